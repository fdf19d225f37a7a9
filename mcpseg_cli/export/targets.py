"""Where exports go: known endings, nothing replaced unasked, nothing inside the run."""

from collections.abc import Sequence
from pathlib import Path

from mcpseg_cli.errors import OutputError

CLOUDS = (".ply", ".las", ".laz", ".pcd", ".npz", ".h5", ".e57")
OBJECTS = (".json", ".csv", ".geojson")
PICTURES = (".png", ".gif")
PAGES = (".html", ".rrd")
MODEL = ".onnx"
SUFFIXES = (*CLOUDS, *OBJECTS, *PICTURES, *PAGES, MODEL)


def check_targets(
    run: Path, outputs: Sequence[Path], *, fills_folder: bool, overwrite: bool
) -> None:
    """Refuse what cannot be written, before any work is done.

    Args:
        run: Folder of the run; exports lie outside it.
        outputs: The files to write, and where ``fills_folder`` one folder, which has no ending.
        fills_folder: Whether a folder is to be filled.
        overwrite: Whether files that are there may be replaced; others in a folder stay.

    Raises:
        OutputError: Says which and why.
    """
    # each its own place
    resolved = [path.resolve() for path in outputs]
    twice = [path for path in outputs if resolved.count(path.resolve()) > 1]
    if twice:
        raise OutputError(f"{twice[0]}: named twice; expected different files; leave one out")

    # a folder only if it is to be filled
    folders = [path for path in outputs if not path.suffix]
    if len(folders) != int(fills_folder):
        named = ", ".join(map(str, folders)) or "no folder"
        expected = "an ending, or --scans or --split to fill a folder"
        expected = "one folder -o to fill" if fills_folder else expected
        raise OutputError(f"{named}: named by -o; expected {expected}; see 'mcpseg export --help'")

    # known endings; weights by themselves
    if any(path.suffix.lower() == MODEL for path in outputs) and len(outputs) > 1:
        raise OutputError(
            f"{outputs[0]}: beside others; expected {MODEL} by itself; "
            "it is made from weights, not a run"
        )
    for path in outputs:
        if path.suffix and path.suffix.lower() not in SUFFIXES:
            raise OutputError(
                f"{path}: ends in {path.suffix!r}; expected {', '.join(SUFFIXES)}; rename it"
            )
        _check_target(run, path, overwrite=overwrite)


def _check_target(run: Path, path: Path, *, overwrite: bool) -> None:
    """Refuse a file or folder that lies in the run, is there already, or has nowhere to lie."""
    # where it lies
    if run.resolve() in (path.resolve(), *path.resolve().parents):
        raise OutputError(
            f"{path}: lies in the run {run}; expected a place outside it; choose another -o"
        )
    if not path.parent.is_dir():
        raise OutputError(
            f"{path}: {path.parent} is no folder; expected an existing one; "
            "make it or choose another -o"
        )

    # what is there already
    is_folder = not path.suffix
    if path.exists() and path.is_dir() != is_folder:
        found, wanted = ("a file", "folder") if is_folder else ("a folder", "file")
        raise OutputError(f"{path}: {found}; expected a {wanted}; choose another -o")
    if path.exists() and not overwrite and (not is_folder or any(path.iterdir())):
        found, wanted = ("not empty", "an empty folder") if is_folder else ("exists", "a new file")
        raise OutputError(
            f"{path}: {found}; expected {wanted}; choose another -o or give --overwrite"
        )
