"""``mcpseg view``: the map of a run in the browser, while the run goes on."""

from pathlib import Path
from typing import Annotated

import typer

from mcpseg_cli.choices import ColourBy


def view(
    run: Annotated[
        Path,
        typer.Argument(
            metavar="OUT", help="Folder of a run of 'mcpseg segment', which may be in progress."
        ),
    ],
    color: Annotated[
        ColourBy, typer.Option(help="What the colours of points say at first.")
    ] = "class",
    no_open: Annotated[
        bool, typer.Option("--no-open", help="Only print the address; open no browser.")
    ] = False,
) -> None:
    """Show a labelled map in the browser.

    The page is that of 'mcpseg export OUT -o map.html', and follows a run that is in progress. It
    is served on a free port to this machine alone, and nothing else is; Ctrl-C ends it.

    \b
    Examples:
      mcpseg view out/
      mcpseg view out/ --color instance --no-open
    """
    import webbrowser

    from mcpseg_cli.export.view_server import FollowedMap, serving, url_of

    with serving(FollowedMap(run, color)) as server:
        url = url_of(server)
        typer.echo(url)
        if not no_open and not webbrowser.open(url):
            typer.echo("no browser here; open the address yourself", err=True)
        typer.echo("Ctrl-C ends this", err=True)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            typer.echo("ended", err=True)
