"""Damaged files for every reader there is, in a process that may take only so much memory."""

from __future__ import annotations

import gc
import os
import random
import re
import resource
import shutil
import signal
import stat
import time
import warnings
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from mcpseg_cli.errors import McpsegError
from tests.forks import Asked
from tests.soak_report import MOST_MB, MOST_S, Report

if TYPE_CHECKING:
    from tests.soak_sound import Sound

FILES_A_ROUND = 2500
_ENDLESS_S = 60  # to wait for a reader
_ROUND_S = 900.0
_COLLECTED = 50  # files between two searches for circles
_SLOW_EVERY = 10  # turns of all others that a slow kind waits
_PANIC = "panicked at"  # what Rust says of LAZ, see docs/trust.md
LIES = (0, 1, 0x7FFF, 0xFFFF, 1 << 31, (1 << 32) - 1, 1 << 40, (1 << 63) - 1, (1 << 64) - 1)
WORDS = (b"-1", b"0", b"1e999", b"nan", b"9" * 20, b"9" * 400, b"9" * 5000, b"[[[[", b"\xff\xfe")


def play(seed: int, folder: Path, report: Report, share: float = 1.0) -> None:
    """Damage files and read them in a fork, and add what it found to a report."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    count = max(1, int(FILES_A_ROUND * share))
    ended = Asked(lambda: _in_fork(seed, folder, count), folder).ended(_ROUND_S)
    if isinstance(ended.answer, dict):
        report.add(Report(**ended.answer))
    else:
        at = (folder / "at").read_text()
        report.found(f"{at}: the process ended: status {ended.status}: {ended.said[-400:]!r}")


def _in_fork(seed: int, folder: Path, count: int) -> dict[str, object]:
    from tests import soak_files

    files = soak_files.sound_files(folder / "sound")
    most = int(_status_mb("VmData") + MOST_MB) << 20
    resource.setrlimit(resource.RLIMIT_DATA, (most, most))
    report = Report(seed)
    gc.collect()
    gc.freeze()  # what was there before is not searched for circles again and again
    read_damaged(seed, files, folder, report, count)
    return report.as_dict()


def read_damaged(seed: int, files: list[Sound], folder: Path, report: Report, count: int) -> None:
    """Damage files and read them in this process; only errors of one line may come out.

    Args:
        seed: Of the damage.
        files: Sound ones.
        folder: For the damaged ones, and a file ``at`` which says where this is.
        report: What is found is added.
        count: How many to read.
    """
    rng = random.Random(seed)
    turn, num_turns = [], 0
    for number in range(count):
        if not turn:  # each kind in its turn
            takes_all = num_turns % _SLOW_EVERY == 0
            turn = [sound for sound in files if takes_all or not sound.is_slow]
            rng.shuffle(turn)
            num_turns += 1
        sound = turn.pop()
        path = folder / sound.name
        path.write_bytes(damage(sound.data, rng))
        if number % _COLLECTED == 0:  # what reads in circles is no memory of the next one
            gc.collect()
        place = f"seed {seed}, file {number}, {sound.name}"
        (folder / "at").write_text(place)

        # one that never comes back ends this process
        signal.alarm(_ENDLESS_S)
        _forget_peak()
        before, began, said = _status_mb("VmRSS"), time.monotonic(), _num_said()
        _read(path, sound, place, report)
        seconds, memory = time.monotonic() - began, _status_mb("VmHWM") - before
        signal.alarm(0)
        path.unlink()

        if (line := _said_since(said)) and _PANIC not in line:
            report.found(f"{place}: says {line[-300:]!r}")
        if seconds > MOST_S or memory > MOST_MB:
            report.found(f"{place}: {seconds:.0f} s, {memory:,.0f} MB more")
        if seconds > report.slowest_s:
            report.slowest_s, report.slowest = seconds, place
        if memory > report.most_mb:
            report.most_mb, report.most = memory, place


def _read(path: Path, sound: Sound, place: str, report: Report) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # a warning would be a second line on stderr
        try:
            sound.read(path)
            report.read[sound.name] += 1
        except (McpsegError, OSError) as error:
            report.refused[sound.name] += 1
            if isinstance(error.__cause__, MemoryError):
                report.found(f"{place}: asks for {MOST_MB:,.0f} MB: {str(error)[:300]!r}")
            if "\n" in str(error):
                report.found(f"{place}: more than a line: {str(error)[:300]!r}")
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # panics of Rust are no Exception
            report.found(f"{place}: {type(error).__name__}: {str(error)[:300]}")


def _num_said() -> int:
    """Return how many bytes stderr has, where it is a file."""
    status = os.fstat(2)
    return status.st_size if stat.S_ISREG(status.st_mode) else 0


def _said_since(start: int) -> str:
    """Return what libraries wrote to stderr past us; nothing where it is no file."""
    count = _num_said() - start
    with suppress(OSError), open("/proc/self/fd/2", "rb") as file:  # noqa: PTH123
        file.seek(start)
        return file.read(max(0, count)).decode(errors="replace")
    return ""


def _status_mb(name: str) -> float:
    """Read a figure of this process's memory."""
    text = Path("/proc/self/status").read_text()
    return int(text.partition(f"{name}:")[2].split()[0]) / 1024


def _forget_peak() -> None:
    """Have ``VmHWM`` be the most memory from now on."""
    descriptor = os.open("/proc/self/clear_refs", os.O_WRONLY)
    os.write(descriptor, b"5")
    os.close(descriptor)


def damage(data: bytes, rng: random.Random) -> bytes:
    """Flip bits, lie, cut out, insert and cut off, mostly in the first part: there are headers."""
    for _ in range(rng.choice([1, 1, 2, 3, 8])):
        at = rng.randrange(max(1, int(len(data) * rng.choice([0.2, 1.0]))))
        kind = rng.choice(["flip", "flip", "number", "word", "cut out", "insert", "cut off"])
        if kind == "flip" and data:
            data = data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]
        elif kind == "number":  # a number that is a lie
            lie = rng.choice(LIES).to_bytes(8, "little")[: rng.choice([2, 4, 8])]
            data = data[:at] + lie + data[at + len(lie) :]
        elif kind == "word":
            numbers = list(re.finditer(rb"[-+]?\d[\d.]*", data[at : at + 200]))
            if numbers:
                word = rng.choice(numbers)
                data = data[: at + word.start()] + rng.choice(WORDS) + data[at + word.end() :]
        elif kind == "cut out":
            data = data[:at] + data[at + rng.randrange(1, 9) :]
        elif kind == "insert":
            data = data[:at] + rng.randbytes(rng.randrange(1, 9)) + data[at:]
        elif kind == "cut off":
            data = data[: len(data) - rng.randrange(len(data) // 4 + 1)]
    return data
