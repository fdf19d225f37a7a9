"""``mcpseg raytrace``: what a robot with a laser scanner would see of a known building."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from mcpseg_cli.choices import Engine, MeshUpAxis, ScanFormat, Scanner
from mcpseg_cli.cli.compiling import told_of_compiling
from mcpseg_cli.cli.options import (
    InstanceField,
    Jobs,
    Json,
    Overwrite,
    Quiet,
    Seed,
    SemanticField,
    number_of_jobs,
)
from mcpseg_cli.cli.recordings import run_all, words_of
from mcpseg_cli.cli.settings import settings_of

if TYPE_CHECKING:
    from pydantic import JsonValue

    from mcpseg_cli.building import Building
    from mcpseg_cli.config import RaytraceSettings
    from mcpseg_cli.formats.mesh_building import MeshOptions
    from mcpseg_cli.raytrace.record import RaytraceReport
    from mcpseg_cli.raytrace.run import RaytraceRun

_Metres = float | None
_Degrees = float | None


def raytrace(
    context: typer.Context,
    areas: Annotated[
        list[Path],
        typer.Argument(
            metavar="AREA",
            help="Areas or rooms in the S3DIS layout, HDF5 files, labelled clouds (PLY, LAS, NPZ), "
            "or meshes (GLB, OBJ, PLY, IFC).",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Folder for the scans; for several areas, a folder in it each.  "
            "[default: data/AREA]",
        ),
    ] = None,
    step: Annotated[float, typer.Option(metavar="METRES", help="Way between two scans.")] = 0.2,
    waypoints: Annotated[
        Path | None,
        typer.Option(
            help="File of 'x y' lines to drive past; "
            "default: scan_spots.txt of the area, else automatic."
        ),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Also draw floor plan, route and scan positions (PNG).")
    ] = None,
    scanner: Annotated[
        Scanner,
        typer.Option(
            help="paper, or sphere: all directions. authors: -45 to 80 degrees, as in their "
            "program. depth-camera: carried by hand. lidar-16, lidar-32: rings."
        ),
    ] = "paper",
    views: Annotated[
        int | None,
        typer.Option(metavar="N", help="Scans of a depth camera in every --step.  [default: 3]"),
    ] = None,
    v_min: Annotated[
        _Degrees, typer.Option(metavar="DEGREES", help="Elevation of the lowest rays.")
    ] = None,
    v_max: Annotated[
        _Degrees, typer.Option(metavar="DEGREES", help="Elevation that rays stay below.")
    ] = None,
    h_res: Annotated[
        _Degrees,
        typer.Option(
            metavar="DEGREES",
            help="Horizontal angle between rays.  [default: 1, of lidars 0.2]",
        ),
    ] = None,
    v_res: Annotated[
        _Degrees,
        typer.Option(metavar="DEGREES", help="Vertical angle between rays.  [default: 1]"),
    ] = None,
    reach: Annotated[
        _Metres,
        typer.Option(
            "--range",
            metavar="METRES",
            help="Reach of the scanner.  [default: 5, of lidars 30]",
        ),
    ] = None,
    height: Annotated[
        _Metres,
        typer.Option(
            metavar="METRES",
            help="Height over the floor.  [default: 1, of lidars 0.7, of cameras around 1.45]",
        ),
    ] = None,
    voxel_size: Annotated[
        float, typer.Option(metavar="METRES", help="Edge of a voxel: one point a scan each.")
    ] = 0.1,
    noise: Annotated[
        _Metres,
        typer.Option(
            metavar="METRES",
            help="Standard deviation of the measured range; of cameras at 1 m, growing with the "
            "square of the range.  [default: 0, of lidars 0.02, of cameras 0.002]",
        ),
    ] = None,
    dropout: Annotated[
        float, typer.Option(metavar="SHARE", help="Share of the points that are lost, 0 to 0.95.")
    ] = 0.0,
    up: Annotated[
        MeshUpAxis | None,
        typer.Option(help="Axis of a mesh that points up.  [default: y of GLB, z of IFC]"),
    ] = None,
    scale: Annotated[
        float | None,
        typer.Option(
            min=1e-6, max=1e6, help="Metres to one unit of a mesh: 0.001 for mm.  [default: 1]"
        ),
    ] = None,
    classes: Annotated[
        Path | None,
        typer.Option(
            help="Class table of a mesh: CSV 'label,class' or a JSON object; labels are names of "
            "objects, meshes, materials or IFC types, * for any letters.  [default: S3DIS words]"
        ),
    ] = None,
    format: Annotated[ScanFormat, typer.Option(help="Format of the clouds.")] = "ply",  # noqa: A002
    cache: Annotated[
        Path | None,
        typer.Option(help="Folder for parsed S3DIS areas.  [default: a hidden file in the area]"),
    ] = None,
    semantic_field: SemanticField = None,
    instance_field: InstanceField = None,
    engine: Annotated[
        Engine | None,
        typer.Option(
            help="Areas side by side instead of one after another: -j processes of a thread each, "
            "or the workers of a Dask cluster."
        ),
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Of --engine dask: tcp://HOST:PORT.")
    ] = None,
    jobs: Jobs = None,
    seed: Seed = 0,
    overwrite: Overwrite = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Drive a robot through known buildings and scan them.

    A scan every --step metres, 360 x 180 degrees or what the --scanner covers, one point for every
    voxel that a ray ends in. The
    output folder gets scans/ (no labels), gt/ (the same points with semantic and instance),
    poses.csv and raytrace.json: what 'mcpseg segment' and 'mcpseg eval' read. Run the same command
    again to continue after an interruption.

    \b
    Examples:
      mcpseg raytrace s3dis/Area_1 --step 0.2
      mcpseg raytrace s3dis/Area_1 s3dis/Area_2 -o data/ --engine processes
      mcpseg raytrace house.glb --classes names.csv -o house_scans/
      mcpseg raytrace office.ply --scanner authors --plot route.png -o office_scans/
      mcpseg raytrace office.ply --scanner depth-camera --step 0.4 -o office_walk/
    """
    from mcpseg_cli.config import SCANNERS, RaytraceSettings
    from mcpseg_cli.formats.class_table import read_class_table
    from mcpseg_cli.formats.mesh_building import MeshOptions

    settings = settings_of(
        RaytraceSettings,
        {
            "views": views,
            "voxel_size": voxel_size,
            "step": step,
            "height": height,
            "reach": reach,
            "lowest_deg": v_min,
            "highest_deg": v_max,
            "horizontal_deg": h_res,
            "vertical_deg": v_res,
            "noise": noise,
            "dropout": dropout,
            "seed": seed,
        },
        before=SCANNERS[scanner],
    )
    folders = _folders(areas, output)
    if len(areas) > 1 and (waypoints or plot):
        raise typer.BadParameter("--waypoints and --plot are for one area at a time")

    if (engine == "dask") != (scheduler is not None):
        raise typer.BadParameter("--engine dask and --scheduler ADDRESS go together")
    if engine is not None:
        words = words_of(context, ("output", "engine", "scheduler", "jobs", "as_json", "quiet"))
        commands = [
            (
                "raytrace", str(area.resolve()), "-o", str(folder.resolve()), *words,
                "-j", "1", "--json", "--quiet",
            )
            for area, folder in zip(areas, folders, strict=True)
        ]  # fmt: skip
        num_jobs = min(number_of_jobs(jobs), len(commands))
        quiet = quiet or as_json
        done = run_all(commands, "raytrace", engine, scheduler, jobs=num_jobs, quiet=quiet)
        _tell([json.loads(outcome.stdout) for outcome in done], as_json=as_json, quiet=quiet)
        return

    # area after area, each with its own table
    task = _Task(
        settings=settings,
        suffix=f".{format}",
        jobs=number_of_jobs(jobs),
        cache=cache,
        fields=(semantic_field, instance_field),
        mesh=MeshOptions(up, scale, read_class_table(classes) if classes else None, voxel_size),
        overwrite=overwrite,
        quiet=quiet,
        show=not (quiet or as_json),
    )
    documents = []
    for area, folder in zip(areas, folders, strict=True):
        with told_of_compiling(quiet=not task.show):
            report = task.trace(area, folder, waypoints, plot)
        documents.append(report.model_dump(mode="json"))
        if not as_json:
            _tell(documents[-1:], as_json=False, quiet=quiet)
    if as_json:
        _tell(documents, as_json=True)


def _tell(documents: list[dict[str, JsonValue]], *, as_json: bool, quiet: bool = False) -> None:
    """Print reports as tables, or as one JSON document."""
    from mcpseg_cli.cli.display import print_table
    from mcpseg_cli.raytrace.record import RaytraceReport

    if as_json:
        typer.echo(json.dumps(documents[0] if len(documents) == 1 else documents))
        return
    for document in documents if not quiet else ():
        print_table(_rows(RaytraceReport.model_validate(document)))


def _folders(areas: list[Path], output: Path | None) -> list[Path]:
    """Choose the folder of each area's scans."""
    names = [_name_of(area) if area.is_dir() else area.stem for area in areas]
    if len(set(names)) < len(names):
        raise typer.BadParameter(
            "two areas have the same name; trace them one at a time, each with its own -o"
        )
    if output is None:
        return [Path("data") / name for name in names]
    return [output] if len(areas) == 1 else [output / name for name in names]


def _name_of(area: Path) -> str:
    """Return what an area is called, also one given as ``.``."""
    return Path(os.path.abspath(area)).name  # noqa: PTH100


@dataclass(frozen=True)
class _Task:
    """What all areas of one command have in common.

    Attributes:
        settings: Scanner and route.
        suffix: Ending of the clouds.
        jobs: Threads.
        cache: Folder for parsed areas.
        fields: Attributes of labelled clouds that are class and object; None: usual names.
        mesh: How to take meshes.
        overwrite: Replace earlier scans.
        quiet: Say nothing of what was noticed.
        show: Show progress.
    """

    settings: RaytraceSettings
    suffix: str
    jobs: int
    cache: Path | None
    fields: tuple[str | None, str | None]
    mesh: MeshOptions
    overwrite: bool
    quiet: bool
    show: bool

    def trace(
        self, area: Path, folder: Path, given: Path | None, picture: Path | None
    ) -> RaytraceReport:
        """Trace one area; return what there is to say about it."""
        from mcpseg_cli.cli.memory import peak_memory_mb
        from mcpseg_cli.raytrace.drive import find_waypoints
        from mcpseg_cli.raytrace.run import RaytraceRequest, RaytraceRun
        from mcpseg_cli.resumable import exclusive

        started = perf_counter()
        waypoints = find_waypoints(area, given)
        building = self._read(area)
        request = RaytraceRequest(_name_of(area), self.settings, self.suffix, waypoints)

        with exclusive(folder):
            run = RaytraceRun(folder, building, request, overwrite=self.overwrite)
            self._plan(run, picture)
            self._scan(run)

        return run.report(perf_counter() - started, peak_memory_mb())

    def _read(self, area: Path) -> Building:
        """Read the building under a progress bar; say what was noticed."""
        from mcpseg_cli.cli.display import notice, plain, progress_bar
        from mcpseg_cli.formats.buildings import read_building
        from mcpseg_cli.formats.labels import LabelFields

        with progress_bar(f"read {area.name}", quiet=not self.show) as bar:
            task = bar.add_task("", total=None, state="")

            def progress(room: str, done: int, total: int) -> None:
                bar.update(
                    task, completed=done >> 20, total=total >> 20, state=plain(f"MB  {room}")
                )

            fields = LabelFields(*self.fields)
            building, notices = read_building(
                area, self.cache, progress, self.jobs, fields=fields, mesh=self.mesh
            )
        for line in notices:
            notice(f"mcpseg: {area}: {line}", quiet=self.quiet)
        return building

    def _plan(self, run: RaytraceRun, picture: Path | None) -> None:
        """Plan the route under a progress bar; say what was noticed."""
        from mcpseg_cli.cli.display import notice, progress_bar

        with progress_bar("plan route", quiet=not self.show) as bar:
            task = bar.add_task("", total=None, state="")

            def progress(done: int, total: int) -> None:
                bar.update(task, completed=done, total=total, state="places looked from")

            def notify(line: str) -> None:
                notice(f"mcpseg: {line}", quiet=self.quiet, console=bar.console)

            run.plan(threads=self.jobs, picture=picture, progress=progress, notify=notify)

    def _scan(self, run: RaytraceRun) -> None:
        """Make the scans that are missing under a progress bar."""
        from mcpseg_cli.cli.display import notice, progress_bar

        if run.is_complete:
            notice(f"mcpseg: {run.folder}: nothing to do: all scans are made", quiet=self.quiet)
            return
        with progress_bar("scan", quiet=not self.show) as bar:
            task = bar.add_task("", total=run.num_scans, state="")
            for scan in run.run(self.jobs):
                bar.update(task, advance=1, state=f"{scan.num_points:,} points")


def _rows(report: RaytraceReport) -> list[tuple[str, str]]:
    """Lay a report out as the rows of a table."""
    route, size = report.route, f"{report.building_points:,} points, {report.objects:,} objects"
    return [
        ("building", f"{report.source}: {size}"),
        ("route", f"{route.length_m:,.1f} m past {route.waypoints:,} waypoints"),
        ("scans", f"{report.scans:,}, {report.points:,} points"),
        ("voxels seen", f"{report.voxels_seen:,} of {report.voxels:,}"),
        ("objects seen", f"{report.objects_seen:,} of {report.objects:,}"),
        ("time", f"{report.seconds:,.1f} s, peak memory {report.peak_memory_mb:,.0f} MB"),
        ("output", report.output),
    ]
