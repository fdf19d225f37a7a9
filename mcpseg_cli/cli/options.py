"""Options that mean the same, under the same name and letter, in every command."""

from pathlib import Path
from typing import Annotated

import typer

OutputFolder = Annotated[
    Path, typer.Option("-o", "--output", help="Folder for the results; a run in it is continued.")
]
OutputFile = Annotated[Path, typer.Option("-o", "--output", help="File to write.")]
WeightsName = Annotated[
    str | None,
    typer.Option(
        "-w",
        "--weights",
        help="A .safetensors file, or the name of bundled weights.  [default: the method's]",
    ),
]
SemanticField = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help="Attribute of clouds that is the class.  [default: semantic, label, class, …]",
    ),
]
InstanceField = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help="Attribute of clouds that is the object.  [default: instance, object_id, …]",
    ),
]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of every random choice.")]
Device = Annotated[str, typer.Option("--device", help="Where the network runs: cpu, cuda, …")]
Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON document on stdout and nothing else.")
]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="No progress, no notices, no summary.")]
Verbose = Annotated[
    bool, typer.Option("-v", "--verbose", help="Also print the milliseconds of each stage.")
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace what is there.")]
Jobs = Annotated[
    int | None,
    typer.Option("-j", "--jobs", min=1, help="Threads or processes; default: all cores."),
]


def number_of_jobs(jobs: int | None) -> int:
    """Return the given number, or how many cores this process may use."""
    import os

    if hasattr(os, "sched_getaffinity"):  # Linux; elsewhere all cores may be used
        return jobs or len(os.sched_getaffinity(0))
    return jobs or os.cpu_count() or 1
