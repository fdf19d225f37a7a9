"""``mcpseg segment``: label a recording scan by scan."""

from __future__ import annotations

import json
import shlex
import sys
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcpseg_cli.cli.interrupt import Interrupt
from mcpseg_cli.cli.options import (
    Device,
    FormatChoice,
    FrameChoice,
    Json,
    MethodChoice,
    OnErrorChoice,
    OutputFolder,
    Overwrite,
    PrecisionChoice,
    Quiet,
    Seed,
    Verbose,
    WeightsName,
)

if TYPE_CHECKING:
    from mcpseg_cli.config import SegmentSettings
    from mcpseg_cli.export.live_map import LiveMap
    from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
    from mcpseg_cli.segment.run import ScanReport, SegmentRun


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
        MethodChoice | None,
        typer.Option(
            help="What labels: a network, or region-growing by normals and colour, which needs no weights and gives "
            "objects without classes (255).  [default: the network of --weights, else mcpnet]"
        ),
    ] = None,
    offline: Annotated[
        bool,
        typer.Option(
            "--offline",
            help="Read all scans first, then label the complete cloud in columns of 1 m; in one transaction.",
        ),
    ] = False,
    frame: Annotated[
        FrameChoice, typer.Option(help="Frame of the scans' coordinates.")
    ] = FrameChoice.MAP,
    voxel_size: Annotated[
        float, typer.Option(metavar="METRES", help="Edge of a voxel, 0.01 to 10.")
    ] = 0.1,
    local_range: Annotated[
        float,
        typer.Option(
            "--range",
            metavar="METRES",
            help="Label points up to this far from the robot, horizontally.",
        ),
    ] = 2.0,
    similarity: Annotated[
        float | None,
        typer.Option(
            help="Cosine similarity, -1 to 1, above which neighbours join one object; default: the network's own, "
            "0.9 for MCPNet. Networks without embedding join neighbours of one class instead."
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
        FormatChoice | None,
        typer.Option(help="Format of the labelled scans; default: each scan's own."),
    ] = None,
    on_error: Annotated[
        OnErrorChoice, typer.Option(help="What to do about a scan that cannot be read.")
    ] = OnErrorChoice.STOP,
    precision: Annotated[
        PrecisionChoice, typer.Option(help="auto is bf16 where the processor has it.")
    ] = PrecisionChoice.AUTO,
    rerun: Annotated[
        str | None,
        typer.Option(
            metavar="spawn|URL|FILE.rrd",
            help="Show the map growing in the Rerun viewer: start one, connect to one, or write a file for one.",
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
    from mcpseg_cli.cli.display import notice
    from mcpseg_cli.formats.recording import open_recording

    settings = _settings(voxel_size, local_range, similarity, floor, seed)
    recording = open_recording(scans, poses, frame.value)

    import numpy as np

    from mcpseg_cli.incremental.methods import open_method
    from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
    from mcpseg_cli.networks.device import find_device
    from mcpseg_cli.networks.weights import Weights
    from mcpseg_cli.segment.folder import RunOptions, check_folders, clear_run
    from mcpseg_cli.segment.offline_run import OfflineRun
    from mcpseg_cli.segment.run import SegmentRun

    check_folders(recording, output)
    find_device(device)
    opened = open_method(method.value if method else None, weights)
    segmenter = IncrementalSegmenter(opened, settings, precision=precision.value, device=device)
    options = RunOptions(
        frame.value, format.value if format else None, on_error.value, offline, sys.argv
    )
    run_type = OfflineRun if offline else SegmentRun
    with ExitStack() as entered:
        live = entered.enter_context(_live_map(rerun, segmenter)) if rerun else None
        if overwrite:
            clear_run(output, recording)
        run = entered.enter_context(run_type(recording, output, opened, segmenter, options))
        if live is not None:
            live.follow(run.records, segmenter.rows(), np.empty(0, np.int32))
        interrupt = entered.enter_context(Interrupt())
        if isinstance(opened, Weights) and opened.info.notice:
            notice(f"mcpseg: {opened.name}: {opened.info.notice}", quiet=quiet)
        tally = _label_pending(
            run, interrupt, live, quiet=quiet, show_progress=not (quiet or as_json)
        )
        if tally.points and tally.points_labelled < _FEW_POINTS * tally.points:
            share = f"{tally.points_labelled:,} of {tally.points:,} points lie within --range {local_range:g}"
            advice = "are the scans in the sensor's frame (--frame sensor)?"
            notice(f"mcpseg: only {share} of their pose: {advice}", quiet=quiet)
        _print_summary(run, tally, as_json=as_json, verbose=verbose)
    if interrupt.asked and len(run.records) < len(recording):
        again = shlex.join(["mcpseg", *(word for word in sys.argv[1:] if word != "--overwrite")])
        notice(
            f"mcpseg: interrupted after {len(run.records):,} of {len(recording):,} scans; continue with: {again}"
        )
        raise typer.Exit(130)


def _live_map(target: str, segmenter: IncrementalSegmenter) -> LiveMap:
    """Open the viewer or file that shows the map growing."""
    from mcpseg_cli.export.live_map import LiveMap

    return LiveMap(target, segmenter.classes, segmenter.settings.voxel_size)


def _label_pending(
    run: SegmentRun, interrupt: Interrupt, live: LiveMap | None, *, quiet: bool, show_progress: bool
) -> _Tally:
    """Label the pending scans under a progress bar; the inventory is written whatever ends it."""
    from mcpseg_cli.cli.display import notice, progress_bar

    tally = _Tally()
    if run.resumed_from and run.pending:
        notice(f"mcpseg: continuing after {run.resumed_from:,} scans", quiet=quiet)
    elif not run.pending:
        notice(f"mcpseg: nothing new: all {run.resumed_from:,} scans are labelled", quiet=quiet)
    try:
        with progress_bar("segment", quiet=not show_progress) as bar:
            total = run.resumed_from + len(run.pending)
            task = bar.add_task("", total=total, completed=run.resumed_from, state="")
            for report in run.run(lambda: interrupt.asked):
                tally.add(report)
                if live and report.update:
                    live.follow(run.records, run.segmenter.rows(), report.update.changed)
                if report.error:
                    notice(f"mcpseg: skipped: {report.error}", quiet=quiet, console=bar.console)
                objects = f"{run.segmenter.clusters.num_objects:,} objects"
                bar.update(
                    task,
                    advance=1,
                    state=f"{report.num_points:,} points  {report.ms:.0f} ms  {objects}",
                )
    finally:
        run.write_objects()
    return tally


_FEW_POINTS = 0.05  # share of points in range below which poses and scans hardly belong together


@dataclass
class _Tally:
    """What this run did."""

    ms: list[float] = field(default_factory=list)
    stages: list[dict[str, float]] = field(default_factory=list)
    points: int = 0
    points_labelled: int = 0

    def add(self, report: ScanReport) -> None:
        self.points += report.num_points
        if report.update is not None:
            self.points_labelled += int((report.update.point_ids >= 0).sum())
            self.ms.append(report.ms)
            self.stages.append(report.update.ms)


def _settings(
    voxel_size: float, local_range: float, similarity: float | None, floor: str, seed: int
) -> SegmentSettings:
    """Check the options that decide the labels."""
    from pydantic import ValidationError

    from mcpseg_cli.config import SegmentSettings

    try:
        height: object = float(floor)
    except ValueError:
        height = floor
    try:
        given = {
            "voxel_size": voxel_size,
            "local_range": local_range,
            "floor": height,
            "seed": seed,
        }
        return SegmentSettings.model_validate(
            given | ({} if similarity is None else {"similarity": similarity})
        )
    except ValidationError as error:
        problem = error.errors()[0]
        raise typer.BadParameter(f"{problem['loc'][0]}: {problem['msg']}") from error


def _print_summary(run: SegmentRun, tally: _Tally, *, as_json: bool, verbose: bool) -> None:
    """Print the result of a run."""
    import resource

    import numpy as np

    from mcpseg_cli.cli.display import print_table

    p50, p95, slowest = (
        np.percentile(tally.ms, (50, 95, 100)).tolist() if tally.ms else (0.0, 0.0, 0.0)
    )
    skipped = [record.name for record in run.records if record.error is not None]
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    objects = run.segmenter.clusters.num_objects
    pending = len(run.pending) + run.resumed_from - len(run.records)
    if as_json:
        document = {
            "scans": len(run.records),
            "pending": pending,
            "voxels": len(run.segmenter.map),
            "objects": objects,
            "points": tally.points,
            "points_labelled": tally.points_labelled,
            "skipped": skipped,
            "ms_per_scan": {"p50": round(p50, 3), "p95": round(p95, 3), "max": round(slowest, 3)}
            if tally.ms
            else None,
            "ms_by_stage": {
                stage: round(value, 3) for stage, value in _stage_medians(tally).items()
            },
            "peak_memory_mb": round(peak_mb, 1),
            "resumed_from": run.resumed_from,
            "precision": run.segmenter.precision,
            "output": str(run.output),
        }
        typer.echo(json.dumps(document))
        return
    rows = [
        (
            "scans",
            f"{len(run.records):,}"
            + (f" ({run.resumed_from:,} of them before)" if run.resumed_from else ""),
        )
    ]
    rows += [("still to do", f"{pending:,}")] if pending else []
    rows += [("skipped", ", ".join(skipped))] if skipped else []
    if tally.points:
        rows.append(("points labelled", f"{tally.points_labelled:,} of {tally.points:,}"))
    rows += [("voxels", f"{len(run.segmenter.map):,}"), ("objects", f"{objects:,}")]
    if tally.ms:
        rows.append(("ms per scan", f"{p50:.1f} median, {p95:.1f} p95, {slowest:.1f} max"))
    rows += [("peak memory", f"{peak_mb:,.0f} MB"), ("map", str(run.output / "map.ply"))]
    if verbose:
        rows += [
            (f"median ms {stage}", f"{value:.2f}") for stage, value in _stage_medians(tally).items()
        ]
    print_table(rows)


def _stage_medians(tally: _Tally) -> dict[str, float]:
    """Median milliseconds of each stage over the scans of this run."""
    from statistics import median

    stages = tally.stages[0] if tally.stages else {}
    return {stage: median(ms[stage] for ms in tally.stages) for stage in stages}
