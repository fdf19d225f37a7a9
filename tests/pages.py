"""Reads a page that ``mcpseg export -o map.html`` wrote, without a browser."""

import base64
import json
import re
import zlib
from pathlib import Path

import numpy as np


def script(text: str, name: str) -> str:
    """Return the content of the script element of this id."""
    return re.search(rf'<script id="{name}"[^>]*>(.*?)</script>', text, re.DOTALL).group(1)


def read_page(path: Path) -> tuple[dict, dict[str, np.ndarray]]:
    """Return what the page knows, and its columns by name."""
    text = path.read_text(encoding="utf-8")
    facts = json.loads(script(text, "facts"))
    blob = zlib.decompress(base64.b64decode(script(text, "cloud")))
    columns = {
        entry["name"]: np.frombuffer(blob, f"<{entry['type']}", entry["length"], entry["offset"])
        for entry in facts["columns"]
    }
    return facts, columns
