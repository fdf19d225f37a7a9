"""A labelled map as one page that opens from disk, without a network, in any browser with WebGL.

K3D-jupyter draws; its JavaScript comes with its wheel. What the page does with it is in ``page/``.
"""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import ColourBy
from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.errors import OutputError
from mcpseg_cli.export.colours import (
    COLOUR_BY,
    class_palette,
    colouring,
    confidence_colours,
    instance_colours,
)
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.resumable import write_whole
from mcpseg_cli.segment.labelled_run import LabelledRun, MapPart

_STEPS = 65_535  # positions are kept as 16-bit steps of the longest side: 1.5 mm for 100 m
_HIDDEN_AT_FIRST = ("ceiling",)  # else nothing of an indoor map is seen from above
_BALL = 1.25  # width of a drawn point in voxels: surfaces look closed
_TYPES = {"u1": np.uint8, "u2": np.uint16, "u4": np.uint32, "i4": np.int32, "f4": np.float32}


@dataclass(frozen=True)
class _Points:
    """What the page shows, in the order it was first seen in; columns as those of ``MapPart``."""

    xyz: NDArray[np.float32]
    rgb: NDArray[np.uint8]
    semantic: NDArray[np.uint8]
    instance: NDArray[np.int32]
    confidence: NDArray[np.float32]
    embedding_rgb: NDArray[np.uint8]
    scan: NDArray[np.int32]


def write_html(
    run: LabelledRun, path: Path, selection: Selection, colour_by: ColourBy = "class"
) -> int:
    """Write the chosen voxels as one HTML file.

    Args:
        run: The map; labels are those it has now, whichever scan the page's slider is at.
        path: The page; replaced if there.
        selection: Which voxels.
        colour_by: What colours say when the page opens.

    Returns:
        How many points there are.

    Raises:
        InputError: Nothing is chosen.
        OutputError: K3D is not installed.
        OSError: The file cannot be written.
    """
    # without the library nothing is worth gathering
    library = _library()
    points = _gather(selection.parts(run), colouring(run, "embedding"))

    # names from files must not end up as markup
    cloud, facts = _describe(run, points, colour_by)
    title = escape(run.folder.resolve().name or "map")
    texts = {
        "title": title,
        "facts": _as_script_json(facts),
        "cloud": _packed(cloud),
        "library": _packed(library),
    }
    write_whole(path, _fill(texts))
    return len(points.scan)


def _describe(
    run: LabelledRun, points: _Points, colour_by: ColourBy
) -> tuple[bytes, dict[str, object]]:
    """Give the columns of the page as bytes, and all else that it has to know."""
    # positions as steps from a corner, around an origin in the middle
    origin = (points.xyz.min(axis=0).astype(np.float64) + points.xyz.max(axis=0)) / 2
    local = points.xyz - origin
    step = max(float(np.ptp(local, axis=0).max()), 1e-3) / _STEPS
    path = (run.poses[:, :3, 3] - origin).astype(np.float32)
    cloud, table = _pack(_columns(points, local, step, path, run.classes))

    # where to look, whatever stray points there are
    low, high = np.percentile(local, (1, 99), axis=0)
    return cloud, {
        "num_points": len(local),
        "num_scans": len(path),
        "origin": origin.tolist(),
        "low": local.min(axis=0).tolist(),
        "step": step,
        "middle": ((low + high) / 2).tolist(),
        "radius": max(float(np.linalg.norm(high - low)) / 2, 1.0),
        "point_size": _BALL * run.voxel_size,
        "classes": _legend(points.semantic, run.classes),
        "colours": COLOUR_BY,
        "colour": colour_by,
        "columns": table,
    }


def _library() -> bytes:
    """Read K3D's script from where it is installed, without importing it and its notebook."""
    spec = find_spec("k3d")
    if spec is None or spec.origin is None:
        raise OutputError(
            "-o .html: K3D, which draws the page, is not installed; expected the extra 'html'; "
            "run: pip install 'mcpseg[html]'"
        )
    return (Path(spec.origin).parent / "static" / "standalone.js").read_bytes()


def _gather(parts: Iterable[MapPart], colour: Callable[[MapPart], NDArray[np.uint8]]) -> _Points:
    """Join the parts without their embeddings, of which only the colours are shown."""
    rows = [
        (part.xyz, part.rgb, part.semantic, part.instance, part.confidence, colour(part), part.scan)
        for part in parts
    ]
    return _Points(*(np.concatenate(column) for column in zip(*rows, strict=True)))


def _columns(
    points: _Points,
    local: NDArray[np.float64],
    step: float,
    path: NDArray[np.float32],
    classes: tuple[str, ...],
) -> dict[str, NDArray[np.generic]]:
    """Give the arrays of the page; positions axis by axis, which packs better."""
    ids, place, sizes = np.unique(points.instance, return_inverse=True, return_counts=True)

    return {
        "xyz": np.rint((local - local.min(axis=0)) / step).astype(np.uint16).T,
        "rgb": points.rgb,
        "embedding": points.embedding_rgb,
        "semantic": points.semantic,
        "object": place.astype(np.uint32),
        "confidence": np.rint(255 * points.confidence).astype(np.uint8),
        "object_ids": ids.astype(np.int32),
        "object_sizes": sizes.astype(np.uint32),
        "object_colours": instance_colours(ids),
        "class_colours": class_palette(classes),
        "confidence_colours": confidence_colours(np.linspace(0.0, 1.0, 256)),
        "scan_ends": np.cumsum(np.bincount(points.scan, minlength=len(path))).astype(np.uint32),
        "path": path,
    }


def _pack(columns: dict[str, NDArray[np.generic]]) -> tuple[bytes, list[dict[str, str | int]]]:
    """Put arrays one after another, each at a multiple of four bytes, and list where they are."""
    names = {np.dtype(dtype): name for name, dtype in _TYPES.items()}
    blob, table = bytearray(), []
    for name, column in columns.items():
        entry: dict[str, str | int] = {"name": name, "type": names[column.dtype]}
        table.append(entry | {"offset": len(blob), "length": column.size})
        blob += np.ascontiguousarray(column).astype(column.dtype.newbyteorder("<")).tobytes()
        blob += bytes(-len(blob) % 4)
    return bytes(blob), table


def _legend(
    semantic: NDArray[np.uint8], classes: tuple[str, ...]
) -> list[dict[str, str | int | bool]]:
    """List the classes that occur."""
    counts = np.bincount(semantic, minlength=256).tolist()
    names = {**dict(enumerate(classes)), UNKNOWN: "unknown"}
    legend: list[dict[str, str | int | bool]] = []
    for index in (index for index, count in enumerate(counts) if count):
        # a map of nothing else than ceilings shows them
        is_shown = names.get(index) not in _HIDDEN_AT_FIRST or counts[index] == len(semantic)
        name = names.get(index, f"class {index}")
        legend.append(
            {"semantic": index, "name": name, "num_points": counts[index], "shown": is_shown}
        )
    return legend


def _as_script_json(document: object) -> str:
    """Write JSON that can stand in a script element: none of its characters can end one."""
    text = json.dumps(document)
    for letter in "<>&":
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    return text


def _packed(data: bytes) -> str:
    return base64.b64encode(zlib.compress(data, 9)).decode("ascii")


def _fill(texts: dict[str, str]) -> str:
    """Fill the page's places; what is put in is not looked through for places again."""
    page = files("mcpseg_cli.export") / "page"
    texts = texts | {
        name: (page / f"page.{kind}").read_text("utf-8")
        for name, kind in (("style", "css"), ("script", "js"))
    }
    pieces = (page / "page.html").read_text("utf-8").split("{{")
    filled = [pieces[0]]
    for piece in pieces[1:]:
        name, rest = piece.split("}}", 1)
        filled += [texts[name], rest]
    return "".join(filled)
