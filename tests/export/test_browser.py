"""The page of a map in headless Chromium: it opens without errors, and what one switches shows."""

import io
import json
import shutil
import time

import numpy as np
import pytest

from mcpseg_cli.export.html import write_html
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.segment.labelled_run import LabelledRun

pytest.importorskip("k3d", reason="the page is drawn by K3D, the extra 'html'")
CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
SOFTWARE_GL = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
SCENE = {"x": 260, "y": 20, "width": 500, "height": 480}  # part of the window that nothing covers
MOST_S = 60.0


class Opened:
    """A page in the browser, and what it complained about or asked for."""

    def __init__(self, browser, path):
        self.complaints, self.requests = [], []
        self.page = browser.new_page(viewport={"width": 1000, "height": 600})
        self.page.on("console", self.note)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(path.as_uri())
        self.page.wait_for_selector("body[data-state]", state="attached", timeout=1e3 * MOST_S)

    def note(self, entry):
        """Note what the page complains about, but for screenshots that wait for drawing."""
        if entry.type in ("error", "warning") and "OpenGL, Performance" not in entry.text:
            self.complaints.append(entry.text)

    def scene(self):
        from PIL import Image

        picture = Image.open(io.BytesIO(self.page.screenshot(clip=SCENE)))
        return np.asarray(picture.convert("RGB")).astype(int)

    def settled_scene(self):
        """Return the scene once it has stopped changing."""
        last, end = self.scene(), time.monotonic() + MOST_S
        while time.monotonic() < end:
            self.page.wait_for_timeout(400)
            now = self.scene()
            if np.array_equal(now, last):
                return now
            last = now
        raise AssertionError("the scene does not come to rest")

    def scene_after(self, before):
        """Return the scene once it differs from ``before`` and has come to rest."""
        end = time.monotonic() + MOST_S
        while time.monotonic() < end and np.array_equal(self.scene(), before):
            self.page.wait_for_timeout(100)
        return self.settled_scene()

    def set_slider(self, name, value):
        self.page.evaluate(
            "([id, value]) => { const slider = document.getElementById(id); slider.value = value;"
            " slider.dispatchEvent(new Event('input')); }",
            [name, value],
        )


@pytest.fixture(scope="module")
def browser():
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine (Debian: apt-get install chromium)")
    playwright = pytest.importorskip("playwright.sync_api", reason="Playwright drives the browser")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE_GL)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def opened(browser, labelled_run, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "map.html"
    with LabelledRun(labelled_run.out) as run:
        write_html(run, path, Selection(), "rgb")
    opened = Opened(browser, path)
    yield opened
    opened.page.close()


def differing(first, second):
    return int((np.abs(first - second).max(axis=2) > 8).sum())


def background(opened):
    """Take the scene without points, path and markers."""
    shown = opened.settled_scene()
    opened.page.click("#none")
    opened.page.uncheck("#path")
    empty = opened.scene_after(shown)
    opened.page.click("#all")
    opened.page.check("#path")
    opened.scene_after(empty)
    return empty


def test_it_opens_without_errors_and_asks_for_nothing(opened):
    assert opened.page.get_attribute("body", "data-state") == "ready"
    assert opened.complaints == []
    assert [url for url in opened.requests if not url.startswith(("file:", "blob:", "data:"))] == []


def test_points_are_drawn(opened):
    empty = background(opened)
    assert len(np.unique(empty.reshape(-1, 3), axis=0)) == 1
    assert differing(opened.settled_scene(), empty) > 5_000


def test_a_class_switched_off_disappears_and_comes_back(opened):
    opened.page.click("#all")
    before = opened.settled_scene()
    boxes = opened.page.locator("#legend input")
    counts = [
        int(text.replace(",", ""))
        for text in opened.page.locator("#legend .count").all_inner_texts()
    ]

    commonest = boxes.nth(int(np.argmax(counts)))
    commonest.uncheck()
    without = opened.scene_after(before)
    assert differing(before, without) > 2_000
    commonest.check()
    assert differing(opened.scene_after(without), before) == 0


def test_the_slider_plays_the_map_growing(opened):
    empty = background(opened)
    drawn = []
    for scan in (1, 2, 4):
        opened.set_slider("scan", scan)
        drawn.append(differing(opened.settled_scene(), empty))
        assert opened.page.inner_text("#moment").startswith(f"scan {scan} of 4")
    assert 0 < drawn[0] < drawn[1] < drawn[2]


def test_play_runs_to_the_last_scan(opened):
    opened.set_slider("scan", 3)
    opened.page.click("#play")
    opened.page.locator("#play", has_text="▶").wait_for(timeout=1e3 * MOST_S)
    assert opened.page.input_value("#scan") == "4"


@pytest.mark.parametrize("colour", ["class", "instance", "embedding", "confidence", "rgb"])
def test_every_colouring_shows(opened, colour):
    before = opened.settled_scene()
    opened.page.click(f"#colours button[value={colour}]")
    assert differing(opened.scene_after(before), before) > 2_000


def test_a_click_says_what_a_point_is(opened, labelled_run):
    # a pixel in the middle of what is drawn
    opened.page.click("#top")
    scene = opened.settled_scene()
    away = (np.abs(scene - scene[0, 0]).max(axis=2) > 8).nonzero()
    middle = np.abs(np.stack(away, axis=1) - np.median(away, axis=1)).sum(axis=1).argmin()
    row, column = (float(places[middle]) for places in away)
    opened.page.mouse.click(SCENE["x"] + column, SCENE["y"] + row)
    words = opened.page.inner_text("#picked").split()
    assert {"class", "object", "confidence"} <= set(words)

    # the voxel that is there
    with LabelledRun(labelled_run.out) as run:
        whole = run.whole()
    place = [float(word) for word in words[-4:-1]]
    nearest = int(np.linalg.norm(whole.xyz - place, axis=1).argmin())
    np.testing.assert_allclose(whole.xyz[nearest], place, atol=0.01)
    assert words[words.index("class") + 1] == run.classes[whole.semantic[nearest]]
    assert int(words[words.index("object") + 1]) == whole.instance[nearest]

    opened.page.click("#unpick")
    assert opened.page.is_hidden("#picked")


def test_a_name_from_a_file_cannot_act(browser, labelled_run, tmp_path):
    shutil.copytree(labelled_run.out, tmp_path / "run")
    document = json.loads((tmp_path / "run/run.json").read_text())
    evil = "</script><img src=x onerror='window.broken = 1'><script>window.broken = 1</script>"
    document["classes"] = [f"{evil}{name}" for name in document["classes"]]
    (tmp_path / "run/run.json").write_text(json.dumps(document))
    with LabelledRun(tmp_path / "run") as run:
        write_html(run, tmp_path / "map.html", Selection())

    opened = Opened(browser, tmp_path / "map.html")
    assert opened.page.evaluate("window.broken") is None
    assert opened.page.locator("#legend .name").first.inner_text().startswith(evil)
    assert opened.complaints == []
    opened.page.close()
