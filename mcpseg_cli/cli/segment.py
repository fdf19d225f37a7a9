"""``mcpseg segment``: label a recording scan by scan."""

from __future__ import annotations

import json
import shlex
import sys
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcpseg_cli.choices import Clustering, Frame, Labelling, Method, OnError, Precision, ScanFormat
from mcpseg_cli.cli.compiling import told_of_compiling
from mcpseg_cli.cli.interrupt import Interrupt
from mcpseg_cli.cli.memory import peak_memory_mb
from mcpseg_cli.cli.options import (
    Device,
    Json,
    OutputFolder,
    Overwrite,
    Quiet,
    Seed,
    Verbose,
    WeightsName,
)
from mcpseg_cli.cli.settings import settings_of

if TYPE_CHECKING:
    from mcpseg_cli.config import RegionGrowingSettings, SegmentSettings
    from mcpseg_cli.evaluate.scan_by_scan import Latency
    from mcpseg_cli.export.live_map import LiveMap
    from mcpseg_cli.formats.recording import ScanFile
    from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
    from mcpseg_cli.networks.weights import Weights
    from mcpseg_cli.segment.run import ScanReport, SegmentRun

_FEW_POINTS = 0.05  # share of points in range below which poses and scans hardly belong together


def segment(
    scans: Annotated[
        Path,
        typer.Argument(
            metavar="SCANS",
            help="Folder of registered scans (PLY, LAS, LAZ, NPZ, PCD) in natural order.",
        ),
    ],
    poses: Annotated[
        Path, typer.Argument(metavar="POSES", help="Pose file: CSV with a header, TUM or KITTI.")
    ],
    output: OutputFolder,
    weights: WeightsName = None,
    method: Annotated[
        Method | None,
        typer.Option(
            help="What labels: a network, or region-growing by normals and colour, which needs no "
            "weights and gives objects without classes (255).  "
            "[default: the network of --weights, else unet]"
        ),
    ] = None,
    labelling: Annotated[
        Labelling | None,
        typer.Option(
            help="Which looks decide a voxel's class: the first, as in the paper, or all that it "
            "gets, fused; --offline has one only.  [default: fused for unet, else first]"
        ),
    ] = None,
    clustering: Annotated[
        Clustering | None,
        typer.Option(
            help="What makes objects: any pair of similar neighbours, as in the paper, or all "
            "evidence along their boundaries, graph.  [default: graph for unet, else paper]"
        ),
    ] = None,
    offline: Annotated[
        bool,
        typer.Option(
            "--offline",
            help="Read all scans first, then label the complete cloud in columns of 1 m; "
            "in one transaction.",
        ),
    ] = False,
    frame: Annotated[Frame, typer.Option(help="Frame of the scans' coordinates.")] = "map",
    voxel_size: Annotated[
        float, typer.Option(metavar="METRES", help="Edge of a voxel, 0.01 to 10.")
    ] = 0.1,
    local_range: Annotated[
        str | None,
        typer.Option(
            "--range",
            metavar="METRES|auto",
            help="Label points up to this far from the robot, horizontally; auto: found from the "
            "first scans, 2 to 5.  [default: 2.0; of the U-Net, auto]",
        ),
    ] = None,
    similarity: Annotated[
        float | None,
        typer.Option(
            help="Cosine similarity, -1 to 1, above which neighbours join one object; default: the "
            "network's own, 0.9 for MCPNet. Networks without embedding join neighbours of one "
            "class instead."
        ),
    ] = None,
    floor: Annotated[
        str,
        typer.Option(
            metavar="map|scan-min|METRES",
            help="Height of the floor: seen in the map, lowest point, or known.",
        ),
    ] = "map",
    format: Annotated[  # noqa: A002
        ScanFormat | None,
        typer.Option(help="Format of the labelled scans; default: each scan's own."),
    ] = None,
    on_error: Annotated[
        OnError, typer.Option(help="What to do about a scan that cannot be read.")
    ] = "stop",
    precision: Annotated[
        Precision, typer.Option(help="auto is bf16 where the processor has it.")
    ] = "auto",
    rerun: Annotated[
        str | None,
        typer.Option(
            metavar="spawn|URL|FILE.rrd",
            help="Show the map growing in the Rerun viewer: start one, connect to one, or write a "
            "file for one.",
        ),
    ] = None,
    device: Device = "cpu",
    seed: Seed = 0,
    overwrite: Overwrite = False,
    as_json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Label a recording scan by scan.

    Every point gets a class and an object id, and one labelled map grows. The output folder gets
    map.ply (the whole labelled map), scans/ (every input scan with labels), objects.json,
    events.jsonl, run.json and state.sqlite. Run the same command again to continue after an
    interruption, or when scans were added.

    \b
    Examples:
      mcpseg segment scans/ poses.csv -o out/
      mcpseg segment scans/ kitti.txt --frame sensor --range 10 -o out/
      mcpseg segment scans/ poses.csv -o out/ --json | jq .objects
      mcpseg segment scans/ poses.csv -o out/ --method sgpn --offline -w sgpn-holdout6.safetensors
      mcpseg segment scans/ poses.csv -o out/ --rerun spawn
    """
    is_auto, local_range = local_range == "auto", None if local_range == "auto" else local_range
    from mcpseg_cli.config import SegmentSettings
    from mcpseg_cli.formats.recording import open_recording

    # what can be wrong is looked at before torch is imported
    given: dict[str, object] = {
        "voxel_size": voxel_size,
        "local_range": local_range,
        "similarity": similarity,
    }
    given |= {"labelling": labelling, "clustering": clustering}
    given |= {"floor": floor, "seed": seed}
    settings = settings_of(SegmentSettings, given)
    recording = open_recording(scans, poses, frame)

    from mcpseg_cli.incremental.methods import open_method
    from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
    from mcpseg_cli.segment.run import SegmentRun
    from mcpseg_cli.segment.run_record import RunOptions

    opened = open_method(method, weights)
    found = "as given" if local_range is not None else "the default"
    if is_auto or (local_range is None and _sees_rooms(opened)):
        kept = None if overwrite else output
        with told_of_compiling(quiet=quiet or as_json):
            distance, found = _find_range(recording, frame, settings, kept, quiet=quiet)
        settings = settings.model_copy(update={"local_range": distance})
    segmenter = IncrementalSegmenter(opened, settings, precision=precision, device=device)
    options = RunOptions(frame, format, on_error, offline, sys.argv)

    with ExitStack() as entered:
        entered.enter_context(told_of_compiling(quiet=quiet or as_json))
        live = entered.enter_context(_live_map(rerun, segmenter)) if rerun else None
        run = entered.enter_context(
            SegmentRun(recording, output, segmenter, options, overwrite=overwrite)
        )
        interrupt = entered.enter_context(Interrupt())

        _tell_what_is_ahead(run, quiet=quiet)
        tally = _label_pending(
            run, interrupt, live, quiet=quiet, show_progress=not (quiet or as_json)
        )
        _warn_of_far_points(tally, settings.local_range, quiet=quiet)

        if as_json:
            typer.echo(json.dumps(_document(run, tally)))
        elif not quiet:
            _print_summary(run, tally, range_from=found, verbose=verbose)

    if interrupt.asked and len(run.records) < len(recording):
        _tell_how_to_continue(len(run.records), len(recording))
        raise typer.Exit(130)


def _sees_rooms(method: Weights | RegionGrowingSettings) -> bool:
    """Tell whether a method is one that learned to see at more than one range."""
    from mcpseg_cli.networks.weights import Weights

    return isinstance(method, Weights) and method.network.sees_windows


def _find_range(
    recording: list[ScanFile],
    frame: Frame,
    settings: SegmentSettings,
    kept: Path | None,
    *,
    quiet: bool,
) -> tuple[float, str]:
    """Find the range that serves the sensor, and say so; a run that is continued keeps its own."""
    from mcpseg_cli.cli.display import notice
    from mcpseg_cli.segment.sensor import first_scans, guess_range, kept_range

    before = kept_range(kept) if kept else None
    if before is not None:
        return before, "as the run was begun"
    distance, found = guess_range(first_scans(recording, frame, settings.voxel_size))
    notice(f"mcpseg: range {distance:g} m: {found}; --range changes it", quiet=quiet)
    return distance, found


def _live_map(target: str, segmenter: IncrementalSegmenter) -> LiveMap:
    """Open the viewer or file that shows the map growing."""
    from mcpseg_cli.export.live_map import LiveMap

    return LiveMap(target, segmenter.classes, segmenter.settings.voxel_size)


def _tell_what_is_ahead(run: SegmentRun, *, quiet: bool) -> None:
    """Say what the weights warn of, and where the run goes on."""
    from mcpseg_cli.cli.display import notice

    weights = run.segmenter.method.weights
    if weights and weights.info.notice:
        notice(f"mcpseg: {weights.name}: {weights.info.notice}", quiet=quiet)
    if not run.pending:
        notice(f"mcpseg: nothing new: all {run.resumed_from:,} scans are labelled", quiet=quiet)
    elif run.resumed_from:
        notice(f"mcpseg: continuing after {run.resumed_from:,} scans", quiet=quiet)


def _label_pending(
    run: SegmentRun, interrupt: Interrupt, live: LiveMap | None, *, quiet: bool, show_progress: bool
) -> _Tally:
    """Label the pending scans under a progress bar; the inventory is written whatever ends it."""
    import numpy as np

    from mcpseg_cli.cli.display import notice, progress_bar
    from mcpseg_cli.segment.offline_run import label_offline

    tally = _Tally()
    if live:
        live.follow(run.records, run.segmenter.rows(), np.empty(0, np.int32))
    label = partial(label_offline, run) if run.options.offline else run.run

    try:
        with progress_bar("segment", quiet=not show_progress) as bar:
            total = run.resumed_from + len(run.pending)
            task = bar.add_task("", total=total, completed=run.resumed_from, state="")
            for report in label(lambda: interrupt.asked):
                tally.add(report)
                if live and report.update:
                    live.follow(run.records, run.segmenter.rows(), report.update.changed)
                if report.error:
                    notice(f"mcpseg: skipped: {report.error}", quiet=quiet, console=bar.console)

                # what there is behind the bar
                objects = f"{run.segmenter.clusters.num_objects:,} objects"
                state = f"{report.num_points:,} points  {report.ms:.0f} ms  {objects}"
                bar.update(task, advance=1, state=state)
    finally:
        run.write_objects()
    return tally


def _warn_of_far_points(tally: _Tally, local_range: float, *, quiet: bool) -> None:
    """Say when the poses hardly belong to the scans."""
    from mcpseg_cli.cli.display import notice

    if tally.points and tally.points_labelled < _FEW_POINTS * tally.points:
        count = f"{tally.points_labelled:,} of {tally.points:,} points"
        advice = "are the scans in the sensor's frame (--frame sensor)?"
        found = f"only {count} lie within --range {local_range:g} of their pose"
        notice(f"mcpseg: {found}: {advice}", quiet=quiet)


def _tell_how_to_continue(done: int, total: int) -> None:
    """Say how an interrupted run goes on: by the same command, which must not start again."""
    from mcpseg_cli.cli.display import notice

    again = shlex.join(["mcpseg", *(word for word in sys.argv[1:] if word != "--overwrite")])
    notice(f"mcpseg: interrupted after {done:,} of {total:,} scans; continue with: {again}")


@dataclass
class _Tally:
    """What this run did."""

    ms: list[float] = field(default_factory=list)
    warm_up_ms: list[float] = field(default_factory=list)
    stages: list[dict[str, float]] = field(default_factory=list)
    points: int = 0
    points_labelled: int = 0

    def add(self, report: ScanReport) -> None:
        self.points += report.num_points
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


def _document(run: SegmentRun, tally: _Tally) -> dict[str, object]:
    """Say what a run did, by name."""
    latency = tally.latency()
    return {
        "scans": len(run.records),
        "pending": _num_pending(run),
        "voxels": len(run.segmenter.map),
        "objects": run.segmenter.clusters.num_objects,
        "points": tally.points,
        "points_labelled": tally.points_labelled,
        "skipped": _skipped(run),
        "ms_per_scan": latency and _rounded(asdict(latency)),
        "ms_by_stage": {stage: round(value, 3) for stage, value in tally.stage_medians().items()},
        "peak_memory_mb": round(peak_memory_mb(), 1),
        "resumed_from": run.resumed_from,
        "precision": run.segmenter.precision,
        "output": str(run.output),
    }


def _print_summary(run: SegmentRun, tally: _Tally, *, range_from: str, verbose: bool) -> None:
    """Print what a run did as a table."""
    from mcpseg_cli.cli.display import print_table

    # scans
    before = f" ({run.resumed_from:,} of them before)" if run.resumed_from else ""
    rows = [("scans", f"{len(run.records):,}{before}")]
    if pending := _num_pending(run):
        rows.append(("still to do", f"{pending:,}"))
    if skipped := _skipped(run):
        rows.append(("skipped", ", ".join(skipped)))

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


def _num_pending(run: SegmentRun) -> int:
    """Count the scans that are still to be labelled."""
    return len(run.pending) + run.resumed_from - len(run.records)


def _skipped(run: SegmentRun) -> list[str]:
    """Name the scans that could not be read."""
    return [record.name for record in run.records if record.error is not None]


def _rounded(values: dict[str, float | None]) -> dict[str, float | None]:
    return {name: value and round(value, 3) for name, value in values.items()}
