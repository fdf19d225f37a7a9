"""Where exports go: known endings, nothing replaced unasked, nothing inside the run."""

from collections.abc import Sequence
from pathlib import Path

from mcpseg_cli.errors import OutputError

CLOUDS = (".ply", ".las", ".laz", ".pcd", ".npz", ".h5", ".e57")
OBJECTS = (".json", ".csv", ".geojson")
PICTURES = (".png", ".gif")
PAGES = (".html", ".rrd")
SUFFIXES = (*CLOUDS, *OBJECTS, *PICTURES, *PAGES)


def check_targets(run: Path, outputs: Sequence[Path], *, overwrite: bool) -> None:
    """Refuse files that cannot be written, before any work is done.

    Args:
        run: Folder of the run; exports lie outside it.
        outputs: The files to write.
        overwrite: Whether a file that is there may be replaced.

    Raises:
        OutputError: Says which file and why.
    """
    for path in outputs:
        if path.suffix.lower() not in SUFFIXES:
            known = ", ".join(SUFFIXES)
            raise OutputError(f"{path}: ends in {path.suffix or 'nothing'!r}; expected {known}; rename it")
        check_target(run, path, overwrite=overwrite)
    if len(set(outputs)) != len(outputs):
        raise OutputError(f"{outputs[-1]}: named twice; expected different files; rename one")


def check_target(run: Path, path: Path, *, overwrite: bool) -> None:
    """Refuse one file or folder that lies in the run, is there already, or has no folder to lie in.

    Raises:
        OutputError: Says why.
    """
    if run.resolve() in (path.resolve(), *path.resolve().parents):
        raise OutputError(f"{path}: lies in the run {run}; expected a place outside it; choose another -o")
    if not path.parent.is_dir():
        raise OutputError(f"{path}: {path.parent} is no folder; expected an existing one; make it or choose another -o")
    if path.is_dir():
        raise OutputError(f"{path}: a folder; expected a file; choose another -o")
    if path.exists() and not overwrite:
        raise OutputError(f"{path}: exists; expected a new file; choose another -o or give --overwrite")
