"""events.jsonl: a line for every scan of a run, in order: what it changed, how long that took."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pydantic import AfterValidator, BaseModel, Field, ValidationError

from mcpseg_cli.errors import InputError, naming
from mcpseg_cli.resumable import check_file_name, write_whole

if TYPE_CHECKING:
    from mcpseg_cli.incremental.segmenter import ScanUpdate


_TIMES = ("ms", "warm_up")  # of a line, beside its event


@dataclass(frozen=True)
class LabelledEvent:
    """A scan was labelled.

    Attributes:
        scan: Its number, from 0.
        name: File name.
        points: Points in it.
        points_in_range: Of these, how many were labelled.
        voxels_new: Voxels it saw first.
        voxels_seen: Voxels it saw that were known.
        voxels: Voxels in the map after it.
        objects: Objects in the map after it.
        merges: Objects it joined: old id, surviving id.
        splits: Objects it found parts of others to be: the other's id, the new id.
        label_changes: Earlier voxels whose labels it changed: class, confidence or object.
        class_changes: Earlier voxels whose class it changed.
        floor: Height of the floor used, metres, map frame; None before any scan came in range.
    """

    scan: int
    name: str
    points: int
    points_in_range: int
    voxels_new: int
    voxels_seen: int
    voxels: int
    objects: int
    merges: list[list[int]]
    splits: list[list[int]]
    label_changes: int
    class_changes: int
    floor: float | None

    @classmethod
    def of(
        cls, number: int, name: str, num_points: int, update: ScanUpdate, num_objects: int
    ) -> LabelledEvent:
        """Describe what a scan did to the map."""
        return cls(
            scan=number,
            name=name,
            points=num_points,
            points_in_range=int((update.point_ids >= 0).sum()),
            voxels_new=update.num_new,
            voxels_seen=update.num_seen,
            voxels=update.first_new + update.num_new,
            objects=num_objects,
            merges=update.merges.tolist(),
            splits=update.splits.tolist(),
            label_changes=len(update.changed),
            class_changes=update.num_reclassified,
            floor=update.floor,
        )


@dataclass(frozen=True)
class SkippedEvent:
    """A scan could not be read.

    Attributes:
        scan: Its number, from 0.
        name: File name.
        skipped: Why.
    """

    scan: int
    name: str
    skipped: str


@dataclass(frozen=True)
class MergedEvent:
    """A scan is in the map because a map that has it was merged into this one.

    Attributes:
        scan: Its number, from 0.
        name: Its name in that map, after the map's.
        points: Points in it.
        merged: Name of the map.
    """

    scan: int
    name: str
    points: int
    merged: str


Event = LabelledEvent | SkippedEvent | MergedEvent


def event_text(
    event: Event, ms: Mapping[str, float] | None = None, *, is_first: bool = False
) -> str:
    """Write an event as JSON, in one line.

    Args:
        event: What happened.
        ms: Milliseconds by stage, where they are known.
        is_first: Whether these are of the first scan of a start, which waits for kernels.
    """
    if not ms:
        return json.dumps(vars(event))
    times = {stage: round(value, 3) for stage, value in ms.items()}
    return json.dumps(vars(event) | {"ms": times} | ({"warm_up": True} if is_first else {}))


def parse_event(text: str) -> Event:
    """Read an event that ``event_text`` wrote without times.

    Raises:
        ValueError: It is none.
    """
    facts = json.loads(text)
    try:
        kinds = {"skipped": SkippedEvent, "merged": MergedEvent}
        found = [kind for key, kind in kinds.items() if key in facts]
        event: Event = (found or [LabelledEvent])[0](**facts)
        return event
    except TypeError as error:
        raise ValueError(f"no event: {text[:80]}") from error


def append_event(
    path: Path,
    event: Event,
    ms: Mapping[str, float] | None,
    *,
    is_first: bool = False,
    is_durable: bool = False,
) -> None:
    """Append an event to events.jsonl, with the times that are known only after the commit.

    Args:
        path: The file.
        event: What happened.
        ms: Milliseconds by stage, where they are known.
        is_first: Whether these are of the first scan of a start, which waits for kernels.
        is_durable: Wait until it is on the disk.

    Raises:
        OSError: The disk is full.
    """
    with naming(path), path.open("a") as file:
        file.write(f"{event_text(event, ms, is_first=is_first)}\n")
        if is_durable:
            file.flush()
            os.fsync(file.fileno())


def reconcile_events(path: Path, events: Sequence[Event]) -> None:
    """Make events.jsonl tell the given events: complete lines stay as long as they are of these.

    Args:
        path: The file; made if not there.
        events: Those of all committed scans; what is added of them has no times.

    Raises:
        OSError: The disk is full.
    """
    *lines, cut = path.read_text(errors="replace").split("\n") if path.exists() else [""]
    kept = 0
    for event, line in zip(events, lines, strict=False):
        if not _is_of(line, event):
            break
        kept += 1
    if cut or kept != len(events) or kept != len(lines):
        lines = lines[:kept] + [event_text(event) for event in events[kept:]]
        write_whole(path, "".join(f"{line}\n" for line in lines))


def _is_of(line: str, event: Event) -> bool:
    """Tell whether a line is an event's, whatever its times."""
    try:
        facts = json.loads(line)
    except (ValueError, RecursionError):
        return False
    if not isinstance(facts, dict):
        return False
    return {name: facts[name] for name in facts if name not in _TIMES} == vars(event)


class _Line(BaseModel):
    """What is read of a line; a name is that of a file in the folder of labelled scans."""

    name: Annotated[str, AfterValidator(check_file_name)]
    skipped: str | None = None
    merged: str | None = None
    warm_up: bool = False
    ms: dict[str, Annotated[float, Field(ge=0.0, le=1e12)]] | None = None


@dataclass(frozen=True)
class ScanEvent:
    """What there is to measure of a line of events.jsonl.

    Attributes:
        name: File name of the scan.
        skipped: Whether it was not read in this run: it could not be, or is of a merged map.
        ms: Milliseconds from reading it to the last output; None where this was not kept.
        is_first: Whether it was the first of a start, which waits for kernels.
    """

    name: str
    skipped: bool
    ms: float | None
    is_first: bool = False


def read_events(path: Path) -> list[ScanEvent]:
    """Read events.jsonl; a last line that is still being written is left out.

    Args:
        path: The file.

    Raises:
        InputError: A line is not one that ``mcpseg segment`` wrote.
        OSError: It cannot be read.
    """
    events = []
    for number, line in enumerate(path.read_text(errors="replace").split("\n")[:-1], start=1):
        try:
            entry = _Line.model_validate_json(line)
            total = None if entry.ms is None else sum(entry.ms.values())
            is_elsewhere = entry.skipped is not None or entry.merged is not None
            events.append(ScanEvent(entry.name, is_elsewhere, total, entry.warm_up))
        except ValidationError as error:
            found = f"line {number:,} that is no event"
            raise InputError(
                path, found, "lines that mcpseg segment wrote", "run it again to mend the file"
            ) from error
    return events
