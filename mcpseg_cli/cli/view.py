"""``mcpseg view``: the map of a run in the browser, while the run goes on."""

from pathlib import Path
from typing import Annotated

import typer

from mcpseg_cli.choices import ColourBy


def view(
    run: Annotated[
        Path,
        typer.Argument(
            metavar="OUT",
            help="Folder of a run of 'mcpseg segment', which may be in progress, or of a page that "
            "'mcpseg export --split html' wrote.",
        ),
    ],
    color: Annotated[
        ColourBy | None,
        typer.Option(
            help="What the colours of points say at first; default: class, or what the page says."
        ),
    ] = None,
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
      mcpseg view site/
    """
    import webbrowser

    from mcpseg_cli.export.tiled_page import PageFolder, is_tiled_page
    from mcpseg_cli.export.view_server import FollowedMap, serving, url_of

    is_page = is_tiled_page(run)
    if is_page and color == "embedding":
        raise typer.BadParameter("--color embedding: a page in tiles has no embeddings")
    served = PageFolder(run) if is_page else FollowedMap(run, color or "class")
    with serving(served) as server:
        url = url_of(server) + (f"#{color}" if is_page and color else "")
        typer.echo(url)
        if not no_open and not webbrowser.open(url):
            typer.echo("no browser here; open the address yourself", err=True)
        typer.echo("Ctrl-C ends this", err=True)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            typer.echo("ended", err=True)
