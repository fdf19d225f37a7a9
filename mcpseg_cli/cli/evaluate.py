"""``mcpseg eval``: score labelled maps against ground truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcpseg_cli.cli.compiling import told_of_compiling
from mcpseg_cli.cli.options import InstanceField, Json, Quiet, SemanticField

if TYPE_CHECKING:
    from mcpseg_cli.evaluate.class_map import ClassMap
    from mcpseg_cli.evaluate.run import Scores
    from mcpseg_cli.formats.labels import LabelFields

_PARTIAL = 0.5  # share of the truth below which figures say little


def evaluate(
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="OUT GT",
            help="OUT: folder that 'mcpseg segment' wrote, or one labelled cloud. GT: folder of "
            "labelled clouds, one labelled cloud, an HDF5 building, or an area in the S3DIS "
            "layout.",
        ),
    ],
    as_json: Json = False,
    as_csv: Annotated[
        bool, typer.Option("--csv", help="Print CSV: a line for each run and room.")
    ] = False,
    full: Annotated[
        bool, typer.Option("--full", help="Print all figures, not eight lines.")
    ] = False,
    rooms: Annotated[
        bool, typer.Option("--rooms", help="Also print a line for each room that GT names.")
    ] = False,
    fail_under: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE", help="Exit 1 if a figure is below a value; may be repeated."
        ),
    ] = None,
    class_map: Annotated[
        Path | None,
        typer.Option(
            metavar="TABLE",
            help="CSV 'label,class' or JSON: the class of the scores for each class of OUT and GT.",
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Also draw confusion matrix, IoU by class, reliability of confidence and mIoU "
            "over the scans (PNG).",
        ),
    ] = None,
    semantic_field: SemanticField = None,
    instance_field: InstanceField = None,
    allow_partial: Annotated[
        bool,
        typer.Option(
            "--allow-partial", help="Exit 0 also where the map covers under half of what it could."
        ),
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Score labelled maps against ground truth.

    Every point of a map, one a voxel, is compared with the nearest true point within half a voxel;
    of identical clouds, with the same point. What has no true point, or one without class or
    object, is counted and not scored. Accuracy and mIoU are those of the classes in the truth;
    object accuracy counts true objects met with IoU over 0.5 by one of their class.

    A map that covers under half of GT says so first, and the command exits 1 unless
    --allow-partial is given: of the rest the figures say nothing. Where GT is one cloud a scan, and
    the run has fewer scans, it is half of what so many scans are of them.

    Figures of --full are over the whole map. Where GT names rooms (S3DIS, HDF5, raytrace), they are
    given with a room as the unit, too: means over rooms for points and clusters; objects match
    within rooms and count together. Panoptic quality takes every class for things; "with_stuff",
    ceiling, floor and wall for stuff. AP is the ScanNet evaluator's: objects of 100 points and
    more, ranked by mean confidence; "agnostic" ignores classes.

    Of a run's folder, events.jsonl gives the milliseconds per scan, and the labelled scans tell how
    often voxels changed their class or object when seen again, and how good the map was on the way.

    Maps with other classes than the truth are scored by a table of --class-map: a row for each
    class of either side and what it stands for; a class of the scores stands for itself. True
    points of classes without a row, or with "-", are not scored; predicted ones count as wrong.

    Several runs are pooled (confusion matrices summed, objects together) and averaged. --fail-under
    takes the names that --json prints, such as miou, iou.wall, rooms.ari; of several runs it takes
    the pooled figure where there is one, else the mean, unless it begins with "pooled." or "mean.".

    \b
    Examples:
      mcpseg eval out/ gt/
      mcpseg eval out/ s3dis/Area_5 --full --rooms --plot pictures/
      mcpseg eval out_1 gt_1 out_2 gt_2 --csv > scores.csv
      mcpseg eval out/ gt/ --json --fail-under miou=0.35 --fail-under nmi=0.8
      mcpseg eval out/ scannet_gt/ --class-map models/home_to_nyu40.csv
    """
    from mcpseg_cli.cli.display import notice
    from mcpseg_cli.cli.fail_under import check_demands, check_names, parse_demands

    # what cannot be done is said before anything is read
    if len(paths) % 2:
        found = f"{len(paths)} paths; expected pairs of OUT and GT"
        raise typer.BadParameter(found, param_hint="'OUT GT'")
    if as_json and as_csv:
        raise typer.BadParameter("goes to stdout as --json does; choose one", param_hint="'--csv'")
    demands = parse_demands(fail_under or [])
    if plot:
        from mcpseg_cli.evaluate.plots import prepare_plots

        prepare_plots(plot)

    from mcpseg_cli.evaluate.class_map import read_class_map
    from mcpseg_cli.formats.labels import LabelFields

    table = None if class_map is None else read_class_map(class_map)
    fields = LabelFields(semantic_field, instance_field)
    pairs = list(zip(paths[::2], paths[1::2], strict=True))
    with told_of_compiling(quiet=quiet or as_json or as_csv):
        runs = _score_all(pairs, table, fields, quiet=quiet)
    document = _document(runs)

    # the scores are printed and drawn before demands on them fail
    check_names(demands, document)
    if as_json or as_csv:
        _print_for_programs(runs, document, as_json=as_json)
    else:
        _print(runs, document, full=full, rooms=rooms)
        if not full:
            notice("mcpseg: all figures: --full; for programs: --json, --csv", quiet=quiet)
    if plot:
        _draw(plot, runs)
    check_demands(demands, document)
    if not allow_partial:
        _check_coverage(runs)


def _check_coverage(runs: list[Scores]) -> None:
    """Fail where the figures say nothing of most of the truth.

    Raises:
        BelowThresholdError: Names the first such run.
    """
    from mcpseg_cli.errors import BelowThresholdError

    for run in runs:
        if run.counts.truth_covered_share < _PARTIAL * run.scans_share:
            raise BelowThresholdError(
                f"{run.output}: covers {_covered(run)}; expected half of it or more; check that "
                "both are of the same place in the same frame, or give --allow-partial"
            )


def _covered(run: Scores) -> str:
    """Say how much of the truth a map covers."""
    points = run.counts.truth_points
    covered = f"{points - run.counts.truth_uncovered:,} of {points:,} points"
    return f"{run.counts.truth_covered_share:.0%} of {run.truth} ({covered})"


def _score_all(
    pairs: list[tuple[Path, Path]],
    class_map: ClassMap | None,
    fields: LabelFields,
    *,
    quiet: bool,
) -> list[Scores]:
    """Score pair after pair, all in the class table of the first; say what the user should know."""
    from mcpseg_cli.cli.display import notice

    runs: list[Scores] = []
    for output, truth in pairs:
        classes = runs[0].classes if runs and class_map is None else ()
        runs.append(_score_one(output, truth, classes, class_map, fields, quiet=quiet))
        if runs[-1].counts.truth_covered_share < _PARTIAL:
            notice(f"mcpseg: {output}: scored on {_covered(runs[-1])} only", quiet=quiet)
        for line in runs[-1].notices:
            notice(f"mcpseg: {line}", quiet=quiet)
    return runs


def _score_one(
    output: Path,
    truth: Path,
    classes: tuple[str, ...],
    class_map: ClassMap | None,
    fields: LabelFields,
    *,
    quiet: bool,
) -> Scores:
    """Score one pair under a progress bar."""
    from mcpseg_cli.cli.display import plain, progress_bar
    from mcpseg_cli.evaluate.run import evaluate_run

    with progress_bar(f"read {output.name}", quiet=quiet) as bar:
        task = bar.add_task("", total=None, state="")

        def told(what: str, done: int, size: int) -> None:
            bar.update(task, completed=done, total=size, state=plain(what))

        return evaluate_run(
            output, truth, classes=classes, class_map=class_map, fields=fields, told=told
        )


def _document(runs: list[Scores]) -> dict[str, object]:
    """Give the scores of one run, or of several with what they come to together."""
    if len(runs) == 1:
        return runs[0].document()
    from mcpseg_cli.evaluate.pooled import average, pool

    documents = [run.document() for run in runs]
    return {"runs": documents, "pooled": pool(runs), "mean": average(documents)}


def _print_for_programs(runs: list[Scores], document: dict[str, object], *, as_json: bool) -> None:
    """Print the scores on stdout, as JSON or CSV."""
    import json

    from mcpseg_cli.cli.score_table import print_csv

    if as_json:
        typer.echo(json.dumps(document))
    else:
        print_csv(runs, document)


def _print(runs: list[Scores], document: dict[str, object], *, full: bool, rooms: bool) -> None:
    """Print the scores on stdout, in eight lines or all of them."""
    from mcpseg_cli.cli.display import print_table
    from mcpseg_cli.cli.headline import headline, headline_of_several
    from mcpseg_cli.cli.score_table import print_blocks, room_blocks, score_blocks

    if full:
        print_blocks(score_blocks(runs, document))
    elif len(runs) == 1:
        print_table(headline(runs[0]))
    else:
        print_blocks([headline_of_several(runs, document)])
    if rooms and (blocks := room_blocks(runs)):
        print_blocks(blocks)


def _draw(folder: Path, runs: list[Scores]) -> None:
    """Draw the pictures: of several runs, their points together and all curves."""
    from mcpseg_cli.evaluate.plots import (
        plot_class_iou,
        plot_confusion,
        plot_over_scans,
        plot_reliability,
    )
    from mcpseg_cli.evaluate.pooled import pool_reliability

    confusion = sum((run.confusion for run in runs[1:]), runs[0].confusion)
    plot_confusion(folder / "confusion_matrix.png", confusion, runs[0].classes, runs[0].unit)
    plot_class_iou(folder / "class_iou.png", confusion, runs[0].classes)
    if reliability := pool_reliability(runs):
        plot_reliability(folder / "reliability.png", reliability, runs[0].unit)
    scanned = {str(run.output): run.scan_by_scan for run in runs}
    curves = {name: scans.curve for name, scans in scanned.items() if scans and scans.curve}
    if curves:
        plot_over_scans(folder / "miou_over_scans.png", curves)
