"""``mcpseg segment``: label a recording scan by scan."""

from __future__ import annotations

import json
import shlex
import signal
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcpseg_cli.cli.options import (
    Device,
    FormatChoice,
    FrameChoice,
    Json,
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
    from types import FrameType

    from mcpseg_cli.config import SegmentSettings
    from mcpseg_cli.segment_run import ScanReport, SegmentRun


def segment(
    scans: Annotated[
        Path, typer.Argument(help="Folder of registered scans (PLY, LAS, LAZ, NPZ, PCD) in natural order.")
    ],
    poses: Annotated[Path, typer.Argument(help="Pose file: CSV with a header, TUM or KITTI.")],
    output: OutputFolder,
    weights: WeightsName = "smoke-test",
    frame: Annotated[FrameChoice, typer.Option(help="Frame of the scans' coordinates.")] = FrameChoice.MAP,
    voxel_size: Annotated[float, typer.Option(help="Edge of a voxel, metres.")] = 0.1,
    local_range: Annotated[
        float, typer.Option("--range", help="Label points up to this far from the robot, horizontally, metres.")
    ] = 2.0,
    similarity: Annotated[float, typer.Option(help="Cosine similarity above which neighbours join one object.")] = 0.9,
    floor: Annotated[str, typer.Option(help="Height of the floor: map, scan-min, or metres.")] = "map",
    format: Annotated[  # noqa: A002
        FormatChoice | None, typer.Option(help="Format of the labelled scans; default: each scan's own.")
    ] = None,
    on_error: Annotated[
        OnErrorChoice, typer.Option(help="What to do about a scan that cannot be read.")
    ] = OnErrorChoice.STOP,
    precision: Annotated[
        PrecisionChoice, typer.Option(help="auto is bf16 where the processor has it.")
    ] = PrecisionChoice.AUTO,
    device: Device = "cpu",
    seed: Seed = 0,
    overwrite: Overwrite = False,
    as_json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Label a recording scan by scan: classes, objects and one growing map.

    OUTPUT gets map.ply (the whole labelled map), scans/ (every input scan with labels), objects.json, events.jsonl,
    run.json and state.sqlite. Run the same command again to continue after an interruption or when scans were added.

    Examples:
      mcpseg segment scans/ poses.csv -o out/

      mcpseg segment scans/ poses_kitti.txt --frame sensor -o out/ --json | jq .objects
    """
    from mcpseg_cli.cli.display import notice, progress_bar
    from mcpseg_cli.recording import open_recording, require_rotations

    settings = _settings(voxel_size, local_range, similarity, floor, seed)
    recording = open_recording(scans, poses)
    require_rotations(poses, frame.value)

    from mcpseg_cli.segment_run import RunOptions, SegmentRun, clear_run
    from mcpseg_cli.segmenter import IncrementalSegmenter
    from mcpseg_cli.weights import find_weights, load_weights

    loaded = load_weights(find_weights(weights))
    if loaded.info.notice:
        notice(f"mcpseg: {loaded.name}: {loaded.info.notice}", quiet=quiet)
    segmenter = IncrementalSegmenter(loaded, settings, precision=precision.value, device=device)
    options = RunOptions(frame.value, format.value if format else None, on_error.value, sys.argv)
    if overwrite:
        clear_run(output)
    with SegmentRun(recording, output, loaded, segmenter, options) as run, _Interrupt(quiet) as interrupt:
        tally = _Tally()
        if run.resumed_from and run.pending:
            notice(f"mcpseg: continuing after {run.resumed_from:,} scans", quiet=quiet)
        elif not run.pending:
            notice(f"mcpseg: nothing new: all {run.resumed_from:,} scans are labelled", quiet=quiet)
        try:
            with progress_bar(quiet=quiet or as_json) as bar:
                task = bar.add_task("", total=len(recording), completed=run.resumed_from, state="")
                for report in run.run(lambda: interrupt.asked):
                    tally.add(report)
                    if report.error:
                        notice(f"mcpseg: skipped: {report.error}", quiet=quiet)
                    objects = segmenter.clusters.num_objects
                    bar.update(
                        task, advance=1, state=f"{report.num_points:,} points  {report.ms:.0f} ms  {objects:,} objects"
                    )
        finally:
            run.write_objects()
        _print_summary(run, tally, as_json=as_json, verbose=verbose)
    if interrupt.asked and len(run.records) < len(recording):
        again = shlex.join(["mcpseg", *sys.argv[1:]])
        notice(f"mcpseg: interrupted after {len(run.records):,} of {len(recording):,} scans; continue with: {again}")
        raise typer.Exit(130)


@dataclass
class _Tally:
    """What this run did."""

    ms: list[float] = field(default_factory=list)
    stages: list[dict[str, float]] = field(default_factory=list)
    points: int = 0

    def add(self, report: ScanReport) -> None:
        self.points += report.num_points
        if report.update is not None:
            self.ms.append(report.ms)
            self.stages.append(report.update.ms)


class _Interrupt:
    """Ctrl-C asks the run to stop after the scan at hand; a second Ctrl-C stops at once."""

    def __init__(self, quiet: bool) -> None:
        self.asked = False
        self._quiet = quiet

    def __enter__(self) -> _Interrupt:
        self._before = signal.signal(signal.SIGINT, self._ask)
        return self

    def __exit__(self, *_: object) -> None:
        signal.signal(signal.SIGINT, self._before)

    def _ask(self, number: int, frame: FrameType | None) -> None:
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True


def _settings(voxel_size: float, local_range: float, similarity: float, floor: str, seed: int) -> SegmentSettings:
    """Check the options that decide the labels."""
    from pydantic import ValidationError

    from mcpseg_cli.config import SegmentSettings

    try:
        height: object = float(floor)
    except ValueError:
        height = floor
    try:
        return SegmentSettings.model_validate(
            {
                "voxel_size": voxel_size,
                "local_range": local_range,
                "similarity": similarity,
                "floor": height,
                "seed": seed,
            }
        )
    except ValidationError as error:
        problem = error.errors()[0]
        raise typer.BadParameter(f"{problem['loc'][0]}: {problem['msg']}") from error


def _print_summary(run: SegmentRun, tally: _Tally, *, as_json: bool, verbose: bool) -> None:
    """Print the result of a run."""
    import resource

    import numpy as np

    from mcpseg_cli.cli.display import print_table

    p50, p95, slowest = np.percentile(tally.ms, (50, 95, 100)) if tally.ms else (0.0, 0.0, 0.0)
    skipped = [record.name for record in run.records if record.error is not None]
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    objects = run.segmenter.clusters.num_objects
    if as_json:
        document = {
            "scans": len(run.records),
            "voxels": len(run.segmenter.map),
            "objects": objects,
            "points": tally.points,
            "skipped": skipped,
            "ms_per_scan": {"p50": p50, "p95": p95, "max": slowest} if tally.ms else None,
            "ms_by_stage": _stage_medians(tally),
            "peak_memory_mb": peak_mb,
            "resumed_from": run.resumed_from,
            "precision": run.segmenter.precision,
            "output": str(run.output),
        }
        typer.echo(json.dumps(document))
        return
    rows = [
        ("scans", f"{len(run.records):,}" + (f" ({run.resumed_from:,} before)" if run.resumed_from else "")),
        ("skipped", ", ".join(skipped) if skipped else "none"),
        ("voxels", f"{len(run.segmenter.map):,}"),
        ("objects", f"{objects:,}"),
        ("ms per scan", f"{p50:.1f} median, {p95:.1f} p95, {slowest:.1f} max" if tally.ms else "-"),
        ("peak memory", f"{peak_mb:,.0f} MB"),
        ("map", str(run.output / "map.ply")),
    ]
    if verbose:
        rows += [(f"ms {stage}", f"{value:.2f}") for stage, value in _stage_medians(tally).items()]
    print_table(rows)


def _stage_medians(tally: _Tally) -> dict[str, float]:
    """Median milliseconds of each stage over the scans of this run."""
    from statistics import median

    stages = tally.stages[0] if tally.stages else {}
    return {stage: median(ms[stage] for ms in tally.stages) for stage in stages}
