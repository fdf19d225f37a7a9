"""``mcpseg merge``: maps of one frame become one."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcpseg_cli.cli.options import Json, OutputFolder, Overwrite, Quiet

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from mcpseg_cli.merge.run import Merged


def merge(
    runs: Annotated[
        list[Path],
        typer.Argument(
            metavar="OUT...",
            help="Folders of runs of 'mcpseg segment' or 'mcpseg merge', in any order.",
        ),
    ],
    output: OutputFolder,
    transform: Annotated[
        list[str] | None,
        typer.Option(
            metavar="OUT=FILE",
            help="A map of another frame, and a text file of 4 x 4 numbers that take its points "
            "into the common one; may be given several times.",
        ),
    ] = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Merge maps of one building into one map.

    What the maps know of each voxel is added, and labels and objects follow from the sums. The
    result is the folder of a run: eval and export read it, and segment continues it. In its
    objects.json, parts are the ids that an object had in each map.

    \b
    Examples:
      mcpseg merge out_1/ out_2/ out_3/ -o building/
      mcpseg merge out_1/ out_2/ -o building/ --transform out_2/=T.txt
    """
    from mcpseg_cli.cli.display import notice, progress_bar
    from mcpseg_cli.merge.run import merge_runs

    transforms = dict(_transform(text) for text in transform or [])
    with progress_bar("merge", quiet=quiet or as_json) as bar:
        task = bar.add_task("", total=None, state="")
        merged = merge_runs(
            runs,
            output,
            transforms,
            overwrite=overwrite,
            command=sys.argv,
            told=lambda what, done, total: bar.update(
                task, completed=done, total=total, state=what
            ),
        )
    for folder in merged.empty:
        notice(f"mcpseg: {folder}: no voxel in it, left out", quiet=quiet)
    if not merged.is_new:
        notice(f"mcpseg: nothing new: {output} is the merge of these maps", quiet=quiet)
    if as_json or not quiet:
        _print(merged, output, as_json=as_json)


def _transform(text: str) -> tuple[Path, NDArray[np.float64]]:
    """Read OUT=FILE."""
    from mcpseg_cli.formats.transform import read_transform

    folder, equals, path = text.rpartition("=")
    if not (folder and equals and path):
        raise typer.BadParameter(f"--transform {text}: expected OUT=FILE")
    return Path(folder), read_transform(Path(path))


def _print(merged: Merged, output: Path, *, as_json: bool) -> None:
    """Say what was made."""
    from mcpseg_cli.cli.display import print_table
    from mcpseg_cli.cli.memory import peak_memory_mb

    if as_json:
        facts = asdict(merged) | {"empty": [str(folder) for folder in merged.empty]}
        facts |= {"peak_memory_mb": round(peak_memory_mb(), 1), "output": str(output)}
        typer.echo(json.dumps(facts))
        return
    print_table(
        [
            ("parts", ", ".join(merged.parts)),
            ("scans", f"{merged.scans:,}"),
            ("voxels", f"{merged.voxels:,}, of {merged.voxels_of_parts:,} in the parts"),
            ("objects", f"{merged.objects:,}"),
            ("peak memory", f"{peak_memory_mb():,.0f} MB"),
            ("map", str(output / "map.ply")),
        ]
    )
