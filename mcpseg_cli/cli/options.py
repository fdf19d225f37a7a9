"""Options that mean the same, under the same name and letter, in every command."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class FrameChoice(StrEnum):
    """Frame of the scans' coordinates."""

    MAP = "map"
    SENSOR = "sensor"


class MethodChoice(StrEnum):
    """What tables I and II compare."""

    MCPNET = "mcpnet"
    MCPNET_NOCONTEXT = "mcpnet-nocontext"
    POINTNET = "pointnet"
    POINTNET2 = "pointnet2"
    SGPN = "sgpn"
    VOXNET = "voxnet"
    REGION_GROWING = "region-growing"


class PrecisionChoice(StrEnum):
    """Arithmetic of context pooling."""

    AUTO = "auto"
    FP32 = "fp32"
    BF16 = "bf16"


class FormatChoice(StrEnum):
    """Formats clouds are written in."""

    PLY = "ply"
    LAS = "las"
    LAZ = "laz"
    NPZ = "npz"
    PCD = "pcd"


class CloudFormat(StrEnum):
    """Formats that labelled maps and objects are exported to."""

    PLY = "ply"
    LAS = "las"
    LAZ = "laz"
    PCD = "pcd"
    NPZ = "npz"
    H5 = "h5"
    E57 = "e57"


class ColourChoice(StrEnum):
    """What the colours of points say."""

    RGB = "rgb"
    CLASS = "class"
    INSTANCE = "instance"
    EMBEDDING = "embedding"
    CONFIDENCE = "confidence"


class ViewChoice(StrEnum):
    """Where a picture is seen from."""

    TOP = "top"
    CUT = "cut"
    PERSPECTIVE = "perspective"


class OnErrorChoice(StrEnum):
    """What to do about a scan that cannot be read."""

    STOP = "stop"
    SKIP = "skip"


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
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of every random choice.")]
Device = Annotated[str, typer.Option("--device", help="Where the network runs: cpu, cuda, …")]
Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON document on stdout and nothing else.")
]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="No progress and no notices.")]
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

    return jobs or len(os.sched_getaffinity(0))
