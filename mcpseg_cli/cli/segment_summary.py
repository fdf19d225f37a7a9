"""What ``mcpseg segment`` says at its end of what it did."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING

from mcpseg_cli.cli.memory import peak_memory_mb

if TYPE_CHECKING:
    from mcpseg_cli.cli.first_look import Taken
    from mcpseg_cli.evaluate.scan_by_scan import Latency
    from mcpseg_cli.formats.recording import Recording
    from mcpseg_cli.segment.run import ScanReport, SegmentRun

_NAMED = 5  # skipped scans in the summary; events.jsonl and --json name all


@dataclass
class Tally:
    """What this run did.

    Attributes:
        ms: Milliseconds of each scan but the first, which waits for kernels.
        warm_up_ms: Those of the first.
        stages: Milliseconds by stage, of each scan.
        points: Points measured.
        points_labelled: Those within range.
        points_unmeasured: Points left out.
    """

    ms: list[float] = field(default_factory=list)
    warm_up_ms: list[float] = field(default_factory=list)
    stages: list[dict[str, float]] = field(default_factory=list)
    points: int = 0
    points_labelled: int = 0
    points_unmeasured: int = 0

    def add(self, report: ScanReport) -> None:
        """Count a scan."""
        self.points += report.num_points
        self.points_unmeasured += report.num_unmeasured
        if report.update is not None:
            self.points_labelled += int((report.update.point_ids >= 0).sum())
            (self.warm_up_ms if report.is_first else self.ms).append(report.ms)
            self.stages.append(report.update.ms)

    def latency(self) -> Latency | None:
        """Summarise the milliseconds per scan, the first one apart."""
        from mcpseg_cli.evaluate.scan_by_scan import Latency

        return Latency.of(self.ms, self.warm_up_ms)

    def stage_medians(self) -> dict[str, float]:
        """Give the median milliseconds of each stage."""
        from statistics import median

        stages = self.stages[0] if self.stages else {}
        return {stage: median(ms[stage] for ms in self.stages) for stage in stages}


def document(run: SegmentRun, recording: Recording, tally: Tally) -> dict[str, object]:
    """Say what a run did, by name."""
    latency = tally.latency()
    return {
        "scans": len(run.records),
        "pending": num_pending(run),
        "voxels": len(run.segmenter.map),
        "objects": run.segmenter.clusters.num_objects,
        "points": tally.points,
        "points_labelled": tally.points_labelled,
        "points_left_out": tally.points_unmeasured,
        "skipped": _skipped(run),
        "pairing": recording.pairing_as_json(),
        "ms_per_scan": latency and _rounded(asdict(latency)),
        "ms_by_stage": {stage: round(value, 3) for stage, value in tally.stage_medians().items()},
        "peak_memory_mb": round(peak_memory_mb(), 1),
        "resumed_from": run.resumed_from,
        "precision": run.segmenter.precision,
        "output": str(run.output),
    }


def print_summary(
    run: SegmentRun,
    recording: Recording,
    tally: Tally,
    taken: Taken,
    *,
    range_from: str,
    verbose: bool,
) -> None:
    """Print what a run did as a table."""
    from mcpseg_cli.cli.display import print_table

    # scans
    before = f" ({run.resumed_from:,} of them before)" if run.resumed_from else ""
    rows = [("scans", f"{len(run.records):,}{before}")]
    if pending := num_pending(run):
        rows.append(("still to do", f"{pending:,}"))
    if skipped := _skipped(run):
        rows.append(("skipped", _shortened(skipped)))
    rows += [("poses", recording.columns), ("paired", recording.told)]

    # how they were taken
    if tally.points_unmeasured:
        why = "no coordinates, no return, withheld or noise"
        rows.append(("points left out", f"{tally.points_unmeasured:,}: {why}"))
    if not taken.intake.is_plain:
        rows.append(("coordinates", taken.intake.describe()))
    if taken.about_colour:
        rows.append(("colour", taken.about_colour))

    # the map
    rows.append(("range", f"{run.segmenter.settings.local_range:g} m, {range_from}"))
    if tally.points:
        rows.append(("points labelled", f"{tally.points_labelled:,} of {tally.points:,}"))
    rows.append(("voxels", f"{len(run.segmenter.map):,}"))
    rows.append(("objects", f"{run.segmenter.clusters.num_objects:,}"))

    # time and memory
    if latency := tally.latency():
        rows.append(("ms per scan", latency.text()))
    rows.append(("peak memory", f"{peak_memory_mb():,.0f} MB"))
    rows.append(("map", str(run.output / "map.ply")))
    if verbose:
        medians = tally.stage_medians().items()
        rows += [(f"median ms {stage}", f"{value:.2f}") for stage, value in medians]
    print_table(rows)


def num_pending(run: SegmentRun) -> int:
    """Count the scans that are still to be labelled."""
    return len(run.pending) + run.resumed_from - len(run.records)


def _skipped(run: SegmentRun) -> list[str]:
    """Name the scans that could not be read."""
    return list(run.records.skipped.values())


def _shortened(names: list[str]) -> str:
    """List names; count them where there are many."""
    listed = ", ".join(names[:_NAMED])
    return listed if len(names) <= _NAMED else f"{len(names):,} scans: {listed}, …"


def _rounded(values: dict[str, float | None]) -> dict[str, float | None]:
    return {name: value and round(value, 3) for name, value in values.items()}
