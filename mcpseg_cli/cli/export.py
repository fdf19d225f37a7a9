"""``mcpseg export``: a labelled map in the formats and viewers of others, and weights as ONNX."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcpseg_cli.choices import ColourBy, SplitFormat, View
from mcpseg_cli.cli.options import Overwrite, Quiet
from mcpseg_cli.errors import OutputError

if TYPE_CHECKING:
    from mcpseg_cli.export.selection import Selection
    from mcpseg_cli.export.views import PictureSettings
    from mcpseg_cli.segment.labelled_run import LabelledRun


def export(
    source: Annotated[
        str,
        typer.Argument(
            metavar="OUT",
            help="Folder of a run of 'mcpseg segment', which may be in progress; for ONNX, a "
            ".safetensors file or the name of bundled weights.",
        ),
    ],
    outputs: Annotated[
        list[Path],
        typer.Option(
            "-o", "--output", help="What to write, told by its ending; may be given several times."
        ),
    ],
    color: Annotated[
        ColourBy | None,
        typer.Option(
            help="What the colours of points say; default: rgb in clouds, class elsewhere."
        ),
    ] = None,
    class_names: Annotated[
        str | None,
        typer.Option(
            "--class", metavar="NAME,NAME", help="Only points (objects) of these classes."
        ),
    ] = None,
    instances: Annotated[
        str | None, typer.Option("--instance", metavar="ID,ID", help="Only these objects.")
    ] = None,
    min_confidence: Annotated[
        float | None,
        typer.Option(min=0.0, max=1.0, help="Only points (objects) of at least this confidence."),
    ] = None,
    min_points: Annotated[
        int | None,
        typer.Option(min=1, help="Only objects (points of objects) of at least so many points."),
    ] = None,
    box: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z,X,Y,Z", help="Only points (centroids) between these two corners, metres."
        ),
    ] = None,
    scans: Annotated[
        Path | None,
        typer.Option(
            help="The recording: write each of its scans with the final map's labels into the "
            "folder -o."
        ),
    ] = None,
    split: Annotated[
        SplitFormat | None,
        typer.Option(
            help="Write a cloud of this format for each object into the folder -o; html: a page, "
            "and the tiles that it loads, for maps of any size."
        ),
    ] = None,
    tiles: Annotated[
        float | None,
        typer.Option(
            min=1.0,
            metavar="METRES",
            help="With --split: a cloud for each square tile of this edge, and tiles.json, which "
            "lists them; no more than a part of the map is in memory.",
        ),
    ] = None,
    view: Annotated[View, typer.Option(help="Where a picture is seen from.")] = "cut",
    cut: Annotated[
        float,
        typer.Option(
            metavar="METRES",
            help="Pictures leave out what is higher above the floor; inf: nothing.",
        ),
    ] = 2.0,
    yaw: Annotated[
        float | None,
        typer.Option(
            metavar="DEGREES", help="Turn of a picture's view; default: 0 for top, else 30."
        ),
    ] = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Write a labelled map for other programs.

    The ending of each -o says what is written. Clouds: .ply .las .laz .pcd .npz .h5 .e57. Objects:
    .json .csv .geojson. Pictures: .png, and .gif turns once around. To walk through: .html, a page
    that needs no network, and .rrd for the Rerun viewer. Weights: .onnx. Nothing is ever written
    into OUT, and a run that is in progress is exported as it is at that moment.

    \b
    Examples:
      mcpseg export out/ -o map.laz -o objects.csv -o map.png
      mcpseg export out/ -o map.html
      mcpseg export out/ -o doors.ply --class door --color instance
      mcpseg export out/ -o relabelled/ --scans scans/
      mcpseg export out/ -o objects/ --split ply --class chair,table
      mcpseg export out/ -o tiles/ --split laz --tiles 20
      mcpseg export out/ -o site/ --split html
      mcpseg export weights.safetensors -o model.onnx
    """
    from mcpseg_cli.export.targets import check_targets
    from mcpseg_cli.export.views import PictureSettings

    if scans is not None and split is not None:
        raise typer.BadParameter("--scans and --split both fill the folder -o; give one of them")
    if tiles is not None and split is None:
        raise typer.BadParameter("--tiles needs --split FORMAT, the format of the tiles")
    if tiles is not None and split == "html":
        raise typer.BadParameter("--tiles is for clouds; a page has tiles of its own")
    request = _Request(
        _selection(class_names, instances, min_confidence, min_points, box),
        color or "rgb",
        PictureSettings(view, color or "class", cut, yaw),
        scans,
        split,
        tiles,
    )
    run_folder = Path(source)
    check_targets(run_folder, outputs, fills_folder=bool(scans or split), overwrite=overwrite)

    # weights have no run, a run has no weights
    if outputs[0].suffix.lower() == ".onnx":
        typer.echo(f"{outputs[0]}: {_export_weights(source, outputs[0])}")
    else:
        _export_run(run_folder, outputs, request, quiet=quiet)


@dataclass(frozen=True)
class _Request:
    """What is asked for, whatever it is written to."""

    selection: Selection
    colour_by: ColourBy
    pictures: PictureSettings
    scans: Path | None
    split: str | None
    tiles: float | None


@dataclass
class _Progress:
    """How far the file at hand has got; whoever writes it tells."""

    show: Callable[[str, int, int], None]
    name: str = ""

    def advance(self, completed: int, total: int) -> None:
        """Show that so much of the file is done."""
        self.show(self.name, completed, total)


def _export_run(folder: Path, outputs: list[Path], request: _Request, *, quiet: bool) -> None:
    """Write everything from one moment of the run, and say what."""
    from mcpseg_cli.cli.display import plain
    from mcpseg_cli.segment.labelled_run import LabelledRun

    with _progress_bar(quiet=quiet) as progress, LabelledRun(folder, progress.advance) as run:
        request = replace(request, selection=request.selection.of(run))
        for output in outputs:
            progress.name = output.name
            if output.suffix:
                done = _export_file(run, output, request)
            else:
                done = _fill_folder(run, output, request, progress)
            if not quiet:
                typer.echo(plain(f"{output}: {done}"))


def _export_file(run: LabelledRun, output: Path, request: _Request) -> str:
    """Write one file of the kind its ending says; return what is in it."""
    from mcpseg_cli.export.targets import CLOUDS, OBJECTS

    suffix = output.suffix.lower()
    if suffix in OBJECTS:
        from mcpseg_cli.export.object_list import write_objects

        return f"{write_objects(run, output, request.selection):,} objects"
    if suffix in CLOUDS:
        from mcpseg_cli.export.map_cloud import write_map

        num_points = write_map(run, output, request.selection, request.colour_by)
    elif suffix == ".html":
        from mcpseg_cli.export.html import write_html

        num_points = write_html(run, output, request.selection, request.pictures.colour_by)
    elif suffix == ".rrd":
        from mcpseg_cli.export.rerun import write_recording

        num_points = write_recording(run, output, request.selection, request.pictures.colour_by)
    else:
        num_points = _draw(run, output, request)
    return f"{num_points:,} points"


def _draw(run: LabelledRun, output: Path, request: _Request) -> int:
    """Write a picture or a turntable; return how many points it shows."""
    try:
        from mcpseg_cli.export.picture import write_picture, write_turntable
    except ModuleNotFoundError as error:
        raise OutputError(
            f"{output}: needs {error.name}; expected it installed; pip install 'mcpseg[plot]'"
        ) from error
    write = write_turntable if output.suffix.lower() == ".gif" else write_picture
    return write(run, output, request.selection, request.pictures)


def _fill_folder(run: LabelledRun, output: Path, request: _Request, progress: _Progress) -> str:
    """Write the relabelled scans, a cloud for each object or tile, or a page and its tiles."""
    if request.split == "html":
        from mcpseg_cli.export.tiled_page import write_tiled_page

        colour_by, told = request.pictures.colour_by, progress.advance
        points, count = write_tiled_page(run, output, request.selection, colour_by, told)
        return f"{points:,} points in {count:,} tiles"
    if request.tiles is not None:
        from mcpseg_cli.export.tiles import write_tiles

        suffix, edge = f".{request.split}", request.tiles
        num_tiles = write_tiles(run, output, suffix, edge, request.selection, request.colour_by)
        return f"{num_tiles:,} tiles"
    if request.scans is None:
        from mcpseg_cli.export.object_list import write_object_clouds

        suffix = f".{request.split}"
        count = write_object_clouds(run, output, suffix, request.selection, request.colour_by)
        return f"{count:,} clouds"

    from mcpseg_cli.export.relabel import relabel_scans

    count = 0
    for count, path in enumerate(relabel_scans(run, request.scans, output), start=1):
        progress.show(path.name, count, len(run.scans))
    return f"{count:,} scans"


def _export_weights(name: str, output: Path) -> str:
    """Write weights as ONNX; say how close they are."""
    from mcpseg_cli.export.onnx import write_onnx
    from mcpseg_cli.networks.description import find_weights
    from mcpseg_cli.networks.weights import load_weights

    weights = load_weights(find_weights(name))
    return f"{weights.info.architecture}, differs from PyTorch by {write_onnx(weights, output):.1g}"


@contextmanager
def _progress_bar(*, quiet: bool) -> Iterator[_Progress]:
    """Put up a bar for the file at hand."""
    from mcpseg_cli.cli.display import plain, progress_bar

    with progress_bar("export", quiet=quiet) as bar:
        task = bar.add_task("", total=None, state="")

        def show(name: str, completed: int, total: int) -> None:
            bar.update(task, completed=completed, total=total, state=plain(name))

        yield _Progress(show)


def _selection(
    classes: str | None,
    instances: str | None,
    min_confidence: float | None,
    min_points: int | None,
    box: str | None,
) -> Selection:
    """Read what is to be exported from the command line."""
    from mcpseg_cli.export.selection import Selection

    # numbers, parted by commas
    try:
        ids = None if instances is None else tuple(int(word) for word in instances.split(","))
        corners = None if box is None else tuple(float(word) for word in box.split(","))
    except ValueError as error:
        raise typer.BadParameter(
            f"--instance takes whole numbers, --box numbers, parted by commas: {error}"
        ) from error

    # two corners, the lowest first; not a number is neither
    if corners is not None and not _is_box(corners):
        raise typer.BadParameter(
            "--box takes x,y,z of the lowest corner, then x,y,z of the highest"
        )

    names = None if classes is None else tuple(name.strip() for name in classes.split(","))
    return Selection(names, ids, min_confidence, corners, min_points)


def _is_box(corners: tuple[float, ...]) -> bool:
    """Tell whether these are x, y, z of a lowest and of a highest corner."""
    pairs = zip(corners[:3], corners[3:], strict=False)
    return len(corners) == 6 and all(low <= high for low, high in pairs)
