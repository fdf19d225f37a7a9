"""A labelled map as one page that opens from disk, without a network, in any browser with WebGL 2.

three.js draws. What the page does with it is in ``page/``: markup, style, and scripts in the order
that ``_SCRIPTS`` lists them.
"""

from __future__ import annotations

import base64
import json
import zlib
from html import escape
from importlib.resources import files
from pathlib import Path

from mcpseg_cli.choices import ColourBy
from mcpseg_cli.export.page_map import PageMap, gather_map
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.resumable import write_whole
from mcpseg_cli.segment.labelled_run import LabelledRun

_SCRIPTS = (
    "data", "shaders", "labels", "cloud", "tile", "tiles", "lines", "camera", "stage", "viewer",
    "picking", "panel", "objects", "timeline", "input", "live", "main",
)  # fmt: skip


def write_html(
    run: LabelledRun, path: Path, selection: Selection, colour_by: ColourBy = "class"
) -> int:
    """Write the chosen voxels as one HTML file.

    Args:
        run: The map, with the labels of all moments.
        path: The page; replaced if there.
        selection: Which voxels.
        colour_by: What colours say when the page opens.

    Returns:
        How many points there are.

    Raises:
        InputError: Nothing is chosen.
        StateError: The checkpoint is damaged.
        OSError: The file cannot be written.
    """
    page_map = gather_map(run, selection, colour_by)
    write_whole(path, page_text(run.folder.resolve().name, page_map))
    return page_map.num_points


def page_text(name: str, page_map: PageMap, moment: str | None = None) -> str:
    """Put a page together.

    Args:
        name: Its title.
        page_map: The map that it holds.
        moment: Of a run that is served, which moment of it this is; the page asks its server for
            later ones. None for a page that never asks for anything.
    """
    cloud = base64.b64encode(page_map.packed).decode("ascii")
    facts = page_map.facts | {"moment": moment}
    return _page_text(name, facts, cloud, "'none'" if moment is None else "'self'")


def tiled_page_text(name: str) -> str:
    """Put a page together that loads its map, ``map.bin``, and then tiles from where it is."""
    return _page_text(name, {"map": "map.bin"}, "", "'self'")


def _page_text(name: str, facts: dict[str, object], cloud: str, connect: str) -> str:
    """Fill the page; ``connect`` says what it may ask for."""
    # names from files must not end up as markup
    page = files("mcpseg_cli.export") / "page"
    scripts = [(page / f"{script}.js").read_text("utf-8") for script in _SCRIPTS]
    library = (page / "three.min.js").read_bytes()
    texts = {
        "title": escape(name or "map"),
        "connect": connect,
        "facts": _as_script_json(facts),
        "cloud": cloud,
        "licence": (page / "three.LICENSE").read_text("utf-8"),
        "library": base64.b64encode(zlib.compress(library, 9)).decode("ascii"),
        "style": (page / "page.css").read_text("utf-8"),
        "script": "\n".join(scripts),
    }
    return _fill((page / "page.html").read_text("utf-8"), texts)


def map_bytes(page_map: PageMap, moment: str | None) -> bytes:
    """Put a map as a page asks for it: length of the facts in four bytes, facts, cloud."""
    facts = json.dumps(page_map.facts | {"moment": moment}).encode("utf-8")
    return len(facts).to_bytes(4, "little") + facts + page_map.packed


def _as_script_json(document: object) -> str:
    """Write JSON that can stand in a script element: none of its characters can end one."""
    text = json.dumps(document)
    for letter in "<>&":
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    return text


def _fill(page: str, texts: dict[str, str]) -> str:
    """Fill the page's places; what is put in is not looked through for places again."""
    pieces = page.split("{{")
    filled = [pieces[0]]
    for piece in pieces[1:]:
        name, rest = piece.split("}}", 1)
        filled += [texts[name], rest]
    return "".join(filled)
