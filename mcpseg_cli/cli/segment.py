"""``mcpseg segment``: label a recording scan by scan."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcpseg_cli.choices import (
    Clustering,
    Engine,
    Labelling,
    Method,
    OnError,
    Precision,
    ScanFormat,
)
from mcpseg_cli.cli.compiling import told_of_compiling
from mcpseg_cli.cli.following import Arriving
from mcpseg_cli.cli.intake_options import (
    AskedIntake,
    Colour,
    FrameOption,
    MaxTimeGap,
    NoCheck,
    Offset,
    PoseTopic,
    Scale,
    Topic,
    Up,
)
from mcpseg_cli.cli.interrupt import Interrupt
from mcpseg_cli.cli.options import (
    Device,
    Jobs,
    Json,
    Overwrite,
    Quiet,
    Seed,
    Verbose,
    WeightsName,
)
from mcpseg_cli.cli.recordings import segment_recordings, words_of
from mcpseg_cli.cli.segment_summary import Tally, document, num_pending, print_summary
from mcpseg_cli.cli.settings import settings_of

if TYPE_CHECKING:
    from mcpseg_cli.cli.first_look import Taken
    from mcpseg_cli.config import RegionGrowingSettings, SegmentSettings
    from mcpseg_cli.export.live_map import LiveMap
    from mcpseg_cli.formats.recording import Recording
    from mcpseg_cli.incremental.column import Memory
    from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
    from mcpseg_cli.networks.description import DescribedWeights
    from mcpseg_cli.segment.run import ScanReport, SegmentRun

_OF_RECORDINGS = (
    "recordings", "engine", "scheduler", "jobs", "output", "overwrite", "as_json", "quiet", "rerun",
)  # fmt: skip
_FEW_POINTS = 0.05  # share of points in range below which poses and scans hardly belong together


def _needed(context: typer.Context, parameter: typer.CallbackParam, value: Path | None) -> object:
    """Refuse a recording without scans or poses, unless a table has the recordings."""
    has_table = context.params.get("recordings") is not None
    if (value is None) != has_table and not context.resilient_parsing:
        found = "Missing argument" if value is None else "--recordings names all: leave out"
        raise typer.BadParameter(f"{found} {parameter.metavar}")
    return value


def segment(
    context: typer.Context,
    recording: Annotated[
        Path | None,
        typer.Argument(
            metavar="RECORDING",
            callback=_needed,
            help="Folder of scans in natural order (PLY, LAS, LAZ, NPZ, PCD, BIN, XYZ, PTS, TXT), "
            "also in folders in it; folder of RGB-D images; E57 or PTX file; ROS bag or MCAP file.",
        ),
    ] = None,
    poses: Annotated[
        Path | None,
        typer.Argument(
            metavar="[POSES]",
            help="Pose file: CSV with a header, TUM, EuRoC, KITTI, COLMAP or others.  "
            "[default: the recording's own]",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Folder for the results; a run in it is continued.  "
            "[default: RECORDING-labelled, here]",
        ),
    ] = None,
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
            "gets, fused; --offline takes no account of it.  [default: fused for unet, else first]"
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
    frame: FrameOption = "map",
    up: Up = None,
    scale: Scale = None,
    offset: Offset = None,
    colour: Colour = None,
    no_check: NoCheck = False,
    topic: Topic = None,
    pose_topic: PoseTopic = None,
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
        OnError,
        typer.Option(help="What to do about a scan that cannot be read or has no pose."),
    ] = "stop",
    max_time_gap: MaxTimeGap = 0.05,
    follow: Annotated[
        bool,
        typer.Option(
            "--follow",
            help="Wait for scans that are still being written, and label each once it is complete "
            "and its pose is there, until Ctrl-C.",
        ),
    ] = False,
    idle: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS", min=0.0, help="With --follow: end when nothing came for so long."
        ),
    ] = None,
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
    durable: Annotated[
        bool,
        typer.Option(
            "--durable",
            help="Have each scan on the disk before the next: nothing that was told is lost in a "
            "power cut.",
        ),
    ] = False,
    recordings: Annotated[
        Path | None,
        typer.Option(
            metavar="TABLE",
            is_eager=True,
            help="Instead of RECORDING, many recordings: a CSV with a header of scans, poses "
            "and, if wanted, transform, settings, name. Each gets its map in OUT/recordings/, "
            "and OUT their merge.",
        ),
    ] = None,
    engine: Annotated[
        Engine, typer.Option(help="What runs --recordings: this machine, or a Dask cluster.")
    ] = "processes",
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Of --engine dask: tcp://HOST:PORT.")
    ] = None,
    jobs: Jobs = None,
    keep_near: Annotated[
        float | None,
        typer.Option(
            min=1.0,
            metavar="METRES",
            help="For endless runs: keep in memory what is this near the robot, horizontally; the "
            "rest of the map waits in files in OUT, and comes back with the robot.",
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
      mcpseg segment walk.mcap --topic /lidar/points
      mcpseg segment scans/ poses.csv -o out/ --json | jq .objects
      mcpseg segment scans/ poses.csv -o out/ --method sgpn --offline -w sgpn-holdout6.safetensors
      mcpseg segment scans/ poses.csv -o out/ --rerun spawn
      mcpseg segment scans/ poses.tum -o out/ --frame sensor --follow --idle 60
      mcpseg segment --recordings table.csv -o building/ --jobs 4
    """
    if recordings is not None:
        if output is None:
            raise typer.BadParameter("--recordings needs a folder for the results: -o")
        words = words_of(context, _OF_RECORDINGS)
        segment_recordings(
            recordings, output, words, engine, scheduler,
            jobs=jobs, overwrite=overwrite, as_json=as_json, quiet=quiet,
        )  # fmt: skip
        return
    assert recording is not None
    is_auto, local_range = local_range == "auto", None if local_range == "auto" else local_range
    if (offline and follow) or (idle is not None and not follow):
        raise typer.BadParameter("--follow labels scan by scan, and --idle says when it ends")
    from mcpseg_cli.cli.first_look import take_recording
    from mcpseg_cli.config import SegmentSettings
    from mcpseg_cli.formats.recording import TopicChoice, open_recording, place_recording

    # what can be wrong is looked at before torch is imported
    given: dict[str, object] = {
        "voxel_size": voxel_size,
        "local_range": local_range,
        "similarity": similarity,
    }
    given |= {"labelling": labelling, "clustering": clustering}
    given |= {"floor": floor, "seed": seed}
    settings = settings_of(SegmentSettings, given)
    folder = output or default_output(recording)
    kept = None if overwrite else folder
    asked, arriving = AskedIntake.of(frame, up, scale, offset, colour), None
    if follow:
        if poses is None:
            raise typer.BadParameter("--follow needs a pose file after the folder of scans")
        arriving = Arriving.of(recording, poses, frame, max_time_gap, kept)
        found_at = arriving.first(idle, quiet=quiet)
    else:
        found_at = open_recording(
            recording, poses, frame, topics=TopicChoice(topic, pose_topic),
            max_gap=max_time_gap, on_error=on_error, any_distance=True,
        )  # fmt: skip
    asked = asked.in_frame(found_at.frame or frame)
    _tell_what_was_read(found_at, folder, is_default=output is None, quiet=quiet)
    taken = take_recording(found_at, recording, asked, kept, check=not no_check, quiet=quiet)
    opened = place_recording(found_at, taken.intake, poses or recording)

    from mcpseg_cli.incremental.methods import open_method
    from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
    from mcpseg_cli.segment.offline_run import label_offline
    from mcpseg_cli.segment.run import SegmentRun
    from mcpseg_cli.segment.run_record import RunOptions

    chosen = open_method(method, weights)
    found = "as given" if local_range is not None else "the default"
    if is_auto or (local_range is None and _sees_rooms(chosen)):
        with told_of_compiling(quiet=quiet or as_json):
            distance, found = _find_range(opened, taken, settings, quiet=quiet)
        settings = settings.model_copy(update={"local_range": distance})
    memory = _memory(folder, keep_near, offline=offline)
    segmenter = IncrementalSegmenter(
        chosen, settings, precision=precision, device=device, memory=memory
    )
    if kept is None or not (kept / "state.sqlite").exists():
        segmenter.get_ready()  # before anything is written
    options = RunOptions(
        taken.intake.frame, format, on_error, offline, sys.argv, (opened.kind, *opened.notes),
        topic, opened.pairing_as_json(), taken.intake, durable,
    )  # fmt: skip

    with ExitStack() as entered:
        entered.enter_context(told_of_compiling(quiet=quiet or as_json))
        live = entered.enter_context(_live_map(rerun, segmenter)) if rerun else None
        run = entered.enter_context(
            SegmentRun(opened, folder, segmenter, options, overwrite=overwrite)
        )
        interrupt = entered.enter_context(Interrupt())
        if run.pending or arriving:
            segmenter.get_ready()

        _tell_what_is_ahead(run, arriving, quiet=quiet)
        label = run.run if not offline else partial(label_offline, run)
        if arriving:
            label = partial(arriving.label, run, idle, quiet=quiet)
        tally = _label_pending(
            run, label, interrupt, live, quiet=quiet, show_progress=not (quiet or as_json)
        )
        opened = arriving.paired if arriving else opened
        _warn_of_far_points(tally, settings.local_range, quiet=quiet)

        if as_json:
            typer.echo(json.dumps(document(run, opened, tally)))
        elif not quiet:
            print_summary(run, opened, tally, taken, range_from=found, verbose=verbose)

    if interrupt.asked and (pending := num_pending(run)):
        _tell_how_to_continue(len(opened) - pending, len(opened))
        raise typer.Exit(130)
    _check_labelled(run, recording)


def default_output(recording: Path) -> Path:
    """Name the folder for the results of a recording: after it, here, never inside it."""
    path = recording.resolve()
    named = path.parent if path.name in ("scans", "velodyne") else path
    name = (named.name if path.is_dir() else path.stem) or "recording"
    here = Path.cwd()
    inside = path.is_dir() and (here == path or path in here.parents)
    folder = path.parent if inside else here
    return (folder if inside else Path()) / f"{name}-labelled"


def _tell_what_was_read(
    recording: Recording, folder: Path, *, is_default: bool, quiet: bool
) -> None:
    """Say how a recording was read where that was a choice, and where the results go."""
    from mcpseg_cli.cli.display import notice

    for note in recording.notes:
        notice(f"mcpseg: {recording.path.name}: {note}", quiet=quiet)
    if is_default:
        notice(f"mcpseg: results go to {folder}; -o changes it", quiet=quiet)


def _memory(output: Path, keep_near: float | None, *, offline: bool) -> Memory:
    """Choose where the map is."""
    from mcpseg_cli.incremental.column import IN_MEMORY
    from mcpseg_cli.segment.paging import PagedMemory

    if keep_near is None:
        return IN_MEMORY
    if offline:
        raise typer.BadParameter("--keep-near: --offline holds the complete cloud; leave one out")
    output.mkdir(parents=True, exist_ok=True)
    return PagedMemory(output, keep_near)


def _sees_rooms(method: DescribedWeights | RegionGrowingSettings) -> bool:
    """Tell whether a method is one that learned to see at more than one range."""
    from mcpseg_cli.networks.description import DescribedWeights

    return isinstance(method, DescribedWeights) and method.info.traits.sees_windows


def _check_labelled(run: SegmentRun, source: Path) -> None:
    """Fail where nothing at all was labelled.

    Raises:
        InputError: All scans were skipped, or no point lies in range.
    """
    from mcpseg_cli.errors import InputError

    if len(run.segmenter.map) or not run.records:
        return
    errors = run.records.errors
    if len(errors) == len(run.records):
        found = f"all {len(errors):,} scans were skipped, the first for: {errors[0]}"
        raise InputError(source, found, "scans that can be read", "mend them")
    distance = run.segmenter.settings.local_range
    found = f"nothing was labelled: no point lies within --range {distance:g} of its scan's pose"
    remedy = "check --frame and the poses (mcpseg info), or give a longer --range"
    raise InputError(source, found, "points around the sensor", remedy)


def _find_range(
    recording: Recording, taken: Taken, settings: SegmentSettings, *, quiet: bool
) -> tuple[float, str]:
    """Find the range that serves the sensor, and say so; a run that is continued keeps its own."""
    from mcpseg_cli.cli.display import notice
    from mcpseg_cli.segment.sensor import first_scans, guess_range, range_in

    before = range_in(taken.kept) if taken.kept else None
    if before is not None:
        return before, "as the run was begun"
    distance, found = guess_range(first_scans(recording, taken.intake, settings.voxel_size))
    notice(f"mcpseg: range {distance:g} m: {found}; --range changes it", quiet=quiet)
    return distance, found


def _live_map(target: str, segmenter: IncrementalSegmenter) -> LiveMap:
    """Open the viewer or file that shows the map growing."""
    from mcpseg_cli.export.live_map import LiveMap

    return LiveMap(target, segmenter.classes, segmenter.settings.voxel_size)


def _tell_what_is_ahead(run: SegmentRun, arriving: Arriving | None, *, quiet: bool) -> None:
    """Say what the weights warn of, and where the run goes on."""
    from mcpseg_cli.cli.display import notice

    weights = run.segmenter.method.weights
    if weights and weights.info.notice:
        notice(f"mcpseg: {weights.name}: {weights.info.notice}", quiet=quiet)
    if not run.pending and not arriving:
        notice(f"mcpseg: nothing new: all {run.resumed_from:,} scans are labelled", quiet=quiet)
    elif run.resumed_from:
        notice(f"mcpseg: continuing after {run.resumed_from:,} scans", quiet=quiet)


def _label_pending(
    run: SegmentRun,
    label: Callable[[Callable[[], bool]], Iterator[ScanReport]],
    interrupt: Interrupt,
    live: LiveMap | None,
    *,
    quiet: bool,
    show_progress: bool,
) -> Tally:
    """Label the pending scans under a progress bar; the inventory is written whatever ends it."""
    import numpy as np

    from mcpseg_cli.cli.display import notice, progress_bar

    tally = Tally()
    if live:
        live.follow(run.scans_from(0), run.segmenter.rows(), np.empty(0, np.int32))

    try:
        with progress_bar("segment", quiet=not show_progress) as bar:
            total = run.resumed_from + len(run.pending)
            task = bar.add_task("", total=total, completed=run.resumed_from, state="")
            for report in label(lambda: interrupt.asked):
                tally.add(report)
                if live and report.update:
                    told, rows = run.scans_from(live.num_scans), run.segmenter.rows()
                    live.follow(told, rows, report.update.changed)
                if report.error:
                    notice(f"mcpseg: skipped: {report.error}", quiet=quiet, console=bar.console)

                # what there is behind the bar
                objects = f"{run.segmenter.clusters.num_objects:,} objects"
                state = f"{report.num_points:,} points  {report.ms:.0f} ms  {objects}"
                total = run.resumed_from + len(run.pending)  # of a growing recording, so far
                bar.update(task, advance=1, total=total, state=state)
    finally:
        run.write_objects()
    return tally


def _warn_of_far_points(tally: Tally, local_range: float, *, quiet: bool) -> None:
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
