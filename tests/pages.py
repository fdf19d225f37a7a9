"""Pages that ``mcpseg export -o map.html`` wrote: read without a browser, and opened in one."""

import base64
import io
import json
import re
import shutil
import zlib
from pathlib import Path

import numpy as np

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
SOFTWARE_GL = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
LAPTOP = {"viewport": {"width": 1366, "height": 768}}
SMALL = {"viewport": {"width": 800, "height": 480}, "reduced_motion": "reduce"}  # quicker to draw
PHONE = {
    "viewport": {"width": 390, "height": 844}, "device_scale_factor": 2, "has_touch": True,
    "is_mobile": True, "reduced_motion": "reduce",
}  # fmt: skip
MOST_MS = 60_000.0
SET = """([id, value]) => {
    const slider = document.getElementById(id);
    slider.value = value;
    slider.dispatchEvent(new Event("input"));
}"""
FREE = """() => {
    const { width, height, x, y } = freePart(window.innerWidth, window.innerHeight);
    return { width, height, x, y };
}"""


def script(text: str, name: str) -> str:
    """Return the content of the script element of this id."""
    return re.search(rf'<script id="{name}"[^>]*>(.*?)</script>', text, re.DOTALL).group(1)


def read_page(path: Path) -> tuple[dict, dict[str, np.ndarray]]:
    """Return what the page knows, and its columns by name."""
    text = path.read_text(encoding="utf-8")
    facts = json.loads(script(text, "facts"))
    return facts, columns_of(facts, base64.b64decode(script(text, "cloud")))


def columns_of(facts: dict, packed: bytes) -> dict[str, np.ndarray]:
    """Unpack the columns that a page lists."""
    blob = zlib.decompress(packed)
    return {
        entry["name"]: np.frombuffer(blob, f"<{entry['type']}", entry["length"], entry["offset"])
        for entry in facts["columns"]
    }


class Opened:
    """A page in the browser, and what it complained about or asked for."""

    def __init__(self, browser, address, window=SMALL):
        self.complaints, self.requests = [], []
        self.context = browser.new_context(**window)
        self.page = self.context.new_page()
        self.page.on("console", lambda entry: self.complaints.append(entry.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(address if isinstance(address, str) else address.as_uri())
        self.page.wait_for_selector("body[data-state]", state="attached", timeout=MOST_MS)
        self.rest()

    def close(self):
        """Close it."""
        self.context.close()

    def rest(self):
        """Wait until all that was asked for is drawn."""
        resting = 'body[data-rest="yes"]'
        self.page.wait_for_selector(resting, state="attached", timeout=MOST_MS)

    def scene(self):
        """Return the free part of the window, (rows, columns, 3), once it is at rest."""
        from PIL import Image

        self.rest()
        clip = self.page.evaluate(FREE)
        picture = Image.open(io.BytesIO(self.page.screenshot(clip=clip)))
        return np.asarray(picture.convert("RGB")).astype(int)

    def set(self, name, value):
        """Move a slider."""
        self.page.evaluate(SET, [name, value])

    def middle(self):
        """Return x and y of a pixel in the midst of what is drawn."""
        scene = self.scene()
        rows, columns = np.nonzero(is_drawn(scene))
        away = np.abs(rows - np.median(rows)) + np.abs(columns - np.median(columns))
        nearest, free = int(away.argmin()), self.page.evaluate(FREE)
        share = scene.shape[1] / free["width"]
        return free["x"] + columns[nearest] / share, free["y"] + rows[nearest] / share

    def text(self, name):
        """Return the words of an element."""
        return self.page.inner_text(f"#{name}")


def is_drawn(scene):
    """Mark the pixels that are not the dark background."""
    return np.ptp(scene, axis=2) + np.maximum(scene.max(axis=2) - 66, 0) > 24


def differing(first, second):
    """Count the pixels that differ to the eye."""
    return int((np.abs(first - second).max(axis=2) > 8).sum())
