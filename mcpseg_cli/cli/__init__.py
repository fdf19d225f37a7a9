"""The ``mcpseg`` command.

Heavy imports happen inside the commands, so that ``--help`` answers at once.
"""

import gc
import sys
from io import TextIOWrapper

import typer

from mcpseg_cli.cli.boundary import OneLineErrors
from mcpseg_cli.cli.evaluate import evaluate
from mcpseg_cli.cli.export import export
from mcpseg_cli.cli.import_weights import import_weights
from mcpseg_cli.cli.info import info
from mcpseg_cli.cli.merge import merge
from mcpseg_cli.cli.raytrace import raytrace
from mcpseg_cli.cli.segment import segment
from mcpseg_cli.cli.synth import synth
from mcpseg_cli.cli.train import train
from mcpseg_cli.cli.view import view

_OBJECTS = 200_000  # between two searches for cycles, which take a second of a start otherwise

app = typer.Typer(
    name="mcpseg",
    cls=OneLineErrors,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(value: bool) -> None:
    if value:
        from mcpseg_cli import __version__

        typer.echo(f"mcpseg {__version__}")
        raise typer.Exit


@app.callback()
def top(
    version: bool = typer.Option(
        False, "-V", "--version", callback=_show_version, is_eager=True, help="Show the version."
    ),
) -> None:
    """Label 3D point clouds while the robot is still scanning.

    Exit status: 0 done, 1 expected failure (one line says which), 2 wrong usage, 130 interrupted.
    """


app.command("synth")(synth)
app.command("raytrace")(raytrace)
app.command("train")(train)
app.command("info")(info)
app.command("segment")(segment)
app.command("merge")(merge)
app.command("eval")(evaluate)
app.command("export")(export)
app.command("view")(view)
app.command("import-weights")(import_weights)


def main() -> None:
    """Run the command line; what a terminal's encoding lacks is printed as an escape."""
    gc.set_threshold(_OBJECTS, 20, 20)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    app()
