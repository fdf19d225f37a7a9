"""Checkpoints of which a bit has changed, and all that a run reads of one."""

from collections.abc import Iterable
from pathlib import Path

from mcpseg_cli.errors import OutputError, StateError
from mcpseg_cli.segment.checkpoint import State


def contents(path: Path) -> list[object]:
    """All that a run reads of its checkpoint."""
    with State(path) as state:
        records = [repr(record) + record.pose.tobytes().hex() for record in state.scans()]
        arrays = [state.merges(), state.first_instance(), *state.first_labels(), *state.evidence()]
        arrays += [getattr(moves, name) for moves in state.moves() for name in ("ids", "instance")]
        arrays += [changes.ids for changes in state.label_changes()]
        rows = [getattr(rows, name) for rows in state.map_rows() for name in ("xyz", "embedding")]
        output = state.written("objects.json")
        return [state.configuration(), records, output, *(a.tobytes() for a in (*arrays, *rows))]


def flipped(data: bytes, bit: int) -> bytes:
    changed = bytearray(data)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


def flips_that_pass(original: Path, copy: Path, bits: Iterable[int]) -> list[int]:
    """Return the bits that change what is read, with no word about it."""
    data, expected, wrong = original.read_bytes(), contents(original), []
    for bit in bits:
        copy.write_bytes(flipped(data, bit))
        try:
            wrong += [bit] if contents(copy) != expected else []
        except (StateError, OutputError) as error:
            wrong += [bit] if "\n" in str(error) else []
        for name in ("-wal", "-shm", "-journal"):
            copy.with_name(copy.name + name).unlink(missing_ok=True)
    return wrong
