"""``mcpseg synth``: a procedural building in the S3DIS folder layout."""

from __future__ import annotations

import os
import re
from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

from mcpseg_cli.choices import ModelPart, SynthClasses
from mcpseg_cli.cli.compiling import told_of_compiling
from mcpseg_cli.cli.options import Jobs, Json, Overwrite, Quiet, Seed, number_of_jobs

_S3DIS_POINTS = {
    "ceiling": 3_370_714,
    "floor": 2_856_755,
    "wall": 4_919_229,
    "beam": 318_158,
    "column": 375_640,
    "window": 478_001,
    "door": 974_733,
    "table": 650_464,
    "chair": 791_496,
    "sofa": 88_727,
    "bookcase": 1_284_130,
    "board": 229_758,
    "clutter": 2_272_837,
}
"""Points of S3DIS at 4 cm by class, as the configurations of RandLA-Net and others count them."""


def synth(
    area: Annotated[
        Path,
        typer.Argument(
            metavar="OUT/Area_N", help="Folder of the area to make; its number decides the style."
        ),
    ],
    rooms: Annotated[int, typer.Option(min=2, max=500, help="Rooms, corridors among them.")] = 16,
    spacing: Annotated[
        float,
        typer.Option(
            min=0.008, max=0.2, metavar="METRES", help="One point in each square of this edge."
        ),
    ] = 0.03,
    style: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="The style of Area_N: 1-6, 16 offices, 7, 17, 27 homes, 37 schools; default: N.",
        ),
    ] = None,
    models: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Furnish with meshes, too; models/fetch_furniture.py gets some."
        ),
    ] = None,
    models_part: Annotated[
        ModelPart,
        typer.Option(help="Which of them: those to train on, those kept from training, or all."),
    ] = "train",
    models_share: Annotated[
        float,
        typer.Option(min=0.0, max=1.0, metavar="SHARE", help="How many of the things are meshes."),
    ] = 0.5,
    classes: Annotated[
        SynthClasses,
        typer.Option(help="What names the objects: the 13 classes, or finer ones of homes."),
    ] = "s3dis",
    jobs: Jobs = None,
    seed: Seed = 0,
    overwrite: Overwrite = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Make a procedural office building, or homes.

    A floor of a building as a scanner would have recorded it, in the folder layout of S3DIS: a
    folder for each room, a text file for each object, all 13 classes. The same seed gives the same
    building. Run the same command again to continue after an interruption.

    \b
    Examples:
      mcpseg synth b/Area_1 --seed 1
      mcpseg synth b/Area_2 --seed 1 --rooms 40 --spacing 0.02
      mcpseg synth b/Area_7 --seed 1
      mcpseg synth b/Area_8 --seed 1 --models furniture/
      mcpseg synth b/Area_17 --seed 1 --classes home
      mcpseg raytrace b/Area_1 -o b/scans_1
    """
    import json

    from mcpseg_cli.cli.display import plain, print_table, progress_bar
    from mcpseg_cli.resumable import exclusive
    from mcpseg_cli.synth.area import CLASSES_OF
    from mcpseg_cli.synth.models.library import read_models
    from mcpseg_cli.synth.run import SynthRequest, write_area

    started = perf_counter()
    number = _number_of(area)
    meshes = None if models is None else read_models(models, models_part, models_share, classes)
    request = SynthRequest(
        number=number,
        seed=seed,
        num_rooms=rooms,
        spacing=spacing,
        style=style or number,
        models=None if meshes is None else meshes.digest,
        classes=classes,
    )

    # room by room, counted by class
    points = dict.fromkeys(CLASSES_OF[classes], 0)
    objects = dict.fromkeys(points, 0)
    told = told_of_compiling(quiet=quiet or as_json)
    with exclusive(area), told, progress_bar("build", quiet=quiet or as_json) as bar:
        total, written = write_area(
            area, request, number_of_jobs(jobs), models=meshes, overwrite=overwrite
        )
        task = bar.add_task("", total=total, state="")
        for room in written:
            for name in room.points:
                points[name] += room.points[name]
                objects[name] += room.objects[name]
            bar.update(task, advance=1, state=plain(room.name))

    # what was made
    if as_json:
        document = {"output": str(area), "rooms": total, "points": sum(points.values())}
        document |= {"points_by_class": points, "objects_by_class": objects}
        document |= {"seconds": round(perf_counter() - started, 2)}
        typer.echo(json.dumps(document))
    elif not quiet:
        _print_summary(total, points, objects)
        print_table([("time", f"{perf_counter() - started:,.1f} s"), ("output", str(area))])


def _print_summary(rooms: int, points: dict[str, int], objects: dict[str, int]) -> None:
    """Print points and objects by class, and the shares of points beside those of S3DIS."""
    from mcpseg_cli.cli.display import print_table

    every, known = max(sum(points.values()), 1), sum(_S3DIS_POINTS.values())
    typer.echo(f"{'class':<10} {'objects':>8} {'points':>11} {'share':>7} {'S3DIS':>7}")
    for name in points:
        real = f"{_S3DIS_POINTS[name] / known:7.1%}" if name in _S3DIS_POINTS else f"{'-':>7}"
        shares = f"{points[name] / every:7.1%} {real}"
        typer.echo(f"{name:<10} {objects[name]:>8,} {points[name]:>11,} {shares}")

    counts = {"rooms": rooms, "points": sum(points.values()), "objects": sum(objects.values())}
    print_table((name, f"{count:,}") for name, count in counts.items())


def _number_of(area: Path) -> int:
    """Return the number at the end of a folder's name, 1 where there is none."""
    found = re.search(r"(\d+)$", os.path.abspath(area))  # noqa: PTH100
    return max(1, int(found.group(1))) if found else 1
