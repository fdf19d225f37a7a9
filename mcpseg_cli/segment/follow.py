"""``mcpseg segment --follow``: scans are labelled as they come."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from time import monotonic, perf_counter, sleep

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.growing_folder import GrowingFolder
from mcpseg_cli.formats.recording import place_scan
from mcpseg_cli.formats.scan_source import ScanSource
from mcpseg_cli.segment.folder import kept_state
from mcpseg_cli.segment.run import ScanReport, SegmentRun

_PAUSE_S = 0.05  # from look to look; longer where looking takes long

_QUIET_S = 2.0  # after which the first scans are all there are for now


def consumed_scans(output: Path) -> list[str]:
    """Return the file names of the scans that a run has consumed; none where there is no run.

    Args:
        output: Folder of the run.

    Raises:
        StateError: The checkpoint there is in use or damaged.
    """
    with kept_state(output) as state:
        return [] if state is None else [record.name for record in state.scans()]


def wait_for_scans(
    folder: GrowingFolder, count: int, idle_s: float | None, told: Callable[[str], None]
) -> list[ScanSource]:
    """Wait until there is enough to begin with.

    Args:
        folder: The recording.
        count: So many scans are enough; fewer where no more come for some seconds.
        idle_s: Seconds without a change after which what is there is enough; None for ever.
        told: Called with what it waits for.

    Returns:
        The scans that are complete, at least one.

    Raises:
        InputError: Nothing came, or it does not fit together.
    """
    for scans in _looks(folder, lambda: False, idle_s, told):
        is_quiet = monotonic() - folder.changed > _QUIET_S
        if len(scans) >= count or (scans and is_quiet):
            return scans
    return folder.look(is_over=True)


def label_arriving(
    run: SegmentRun,
    folder: GrowingFolder,
    should_stop: Callable[[], bool],
    idle_s: float | None,
    told: Callable[[str], None],
) -> Iterator[ScanReport]:
    """Label scans as they come, until asked to stop or until nothing changes any more.

    Args:
        run: A run of the first scans of the recording.
        folder: The recording.
        should_stop: Asked before every scan and between looks.
        idle_s: Seconds without a change after which nothing more is expected; None for ever.
        told: Called with what it waits for.

    Raises:
        InputError: As ``SegmentRun.run``; or what was labelled has changed.
        OutputError: As ``SegmentRun.run``.
    """
    for source in folder.look()[: len(run.records)]:
        folder.take(source)
    for scans in _looks(folder, should_stop, idle_s, told):
        yield from _label(run, folder, scans, should_stop)
    if not should_stop():
        scans = folder.look(is_over=True)
        yield from _label(run, folder, scans, should_stop, is_over=True)


def _looks(
    folder: GrowingFolder,
    should_stop: Callable[[], bool],
    idle_s: float | None,
    told: Callable[[str], None],
) -> Iterator[list[ScanSource]]:
    """Look again and again, with pauses, and give the scans whose turn it is."""
    problem = ""
    while not should_stop():
        started = monotonic()
        yield folder.look()
        if folder.problem is not None and str(folder.problem) != problem:
            problem = str(folder.problem)
            told(problem)
        if idle_s is not None and monotonic() - folder.changed >= idle_s:
            return
        sleep(max(_PAUSE_S, min(monotonic() - started, 1.0)))


def _label(
    run: SegmentRun,
    folder: GrowingFolder,
    scans: list[ScanSource],
    should_stop: Callable[[], bool],
    *,
    is_over: bool = False,
) -> Iterator[ScanReport]:
    """Label scans; the first that turns out to be incomplete, and those after it, have to wait."""
    for source in scans:
        if should_stop():
            return
        started, placed = perf_counter(), place_scan(source, run.options.taken)
        try:
            read = run.read(placed)
        except (InputError, OSError) as error:
            if not is_over and source.pose is not None and folder.may_change(source):
                return
            report = run.refuse(placed, error, started)
        else:
            if not is_over and folder.is_other_now(source):
                return
            report = run.label(read, started)
        folder.take(source)
        if len(run.records) > run.resumed_from + len(run.pending):
            run.pending.append(placed)
        yield report
