"""``mcpseg export``: a labelled map in the formats and viewers of others."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcpseg_cli.cli.options import ColourChoice, Overwrite, Quiet

if TYPE_CHECKING:
    from mcpseg_cli.export.labelled_run import LabelledRun


def export(
    source: Annotated[
        Path, typer.Argument(metavar="OUT", help="Folder of a run of 'mcpseg segment'; it may be in progress.")
    ],
    outputs: Annotated[
        list[Path], typer.Option("-o", "--output", help="File to write, its format told by its ending; repeatable.")
    ],
    color: Annotated[ColourChoice | None, typer.Option(help="What the colours of points say; default: rgb.")] = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Write a labelled map for other programs.

    \b
    Examples:
      mcpseg export out/ -o map.laz -o objects.csv
    """
    from mcpseg_cli.export.labelled_run import LabelledRun
    from mcpseg_cli.export.targets import check_targets

    check_targets(source, outputs, overwrite=overwrite)
    with LabelledRun(source) as run:
        for output in outputs:
            _export_one(run, output)
            typer.echo(output)


def _export_one(run: LabelledRun, output: Path) -> None:
    """Write one file, in the format of its ending."""
    match output.suffix.lower():
        case _:
            raise NotImplementedError(output)
