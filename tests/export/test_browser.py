"""The page of a map in headless Chromium: it opens without errors, and every control shows."""

import json

import numpy as np
import pytest

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.export.html import write_html
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.segment.labelled_run import LabelledRun
from tests.pages import LAPTOP, PHONE, Opened, differing, is_drawn

CARD = 260  # pixels at the right that the card of what is picked may cover
RESET = """() => {
    const element = (id) => document.getElementById(id);
    dispatchEvent(new KeyboardEvent("keydown", { key: "Escape" }));
    const states = { boxes: false, path: true, final: false };
    for (const [id, state] of Object.entries(states)) {
        if (element(id).checked !== state) element(id).click();
    }
    for (const [id, value] of [["size", 1], ["scan", element("scan").max]]) {
        element(id).value = value;
        element(id).dispatchEvent(new Event("input"));
    }
    document.querySelector("#tabs button[value=map]").click();
    document.querySelector("#colours button[value=class]").click();
    for (const id of ["all", "below", "aslant"]) element(id).click();
}"""


@pytest.fixture(scope="module")
def written(changing_run, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "map.html"
    with LabelledRun(changing_run.out) as run:
        write_html(run, path, Selection())
    return path


@pytest.fixture(scope="module")
def page_of_all_tests(browser, written):
    opened = Opened(browser, written)
    yield opened
    opened.close()


@pytest.fixture
def opened(page_of_all_tests):
    """The page, as it was when it opened."""
    page_of_all_tests.page.mouse.move(5, 5)
    page_of_all_tests.page.evaluate(RESET)
    page_of_all_tests.rest()
    yield page_of_all_tests
    assert page_of_all_tests.complaints == []


def test_it_asks_for_nothing_and_the_map_fills_the_window(browser, written):
    opened = Opened(browser, written, LAPTOP)
    assert opened.page.get_attribute("body", "data-state") == "ready"
    assert opened.complaints == []
    asked = [url for url in opened.requests if not url.startswith(("file:", "blob:", "data:"))]
    assert asked == []
    assert covered(opened.scene()) >= 0.6
    opened.close()


def covered(scene):
    """The share of the free part that the rectangle around the map takes."""
    rows, columns = np.nonzero(is_drawn(scene))
    return float(np.ptp(rows) * np.ptp(columns) / (scene.shape[0] * scene.shape[1]))


def test_a_class_switched_off_disappears_and_comes_back(opened):
    before = opened.scene()
    counts = [
        int(text.replace(",", ""))
        for text in opened.page.locator("#legend .count").all_inner_texts()
    ]
    commonest = opened.page.locator("#legend input").nth(int(np.argmax(counts)))
    commonest.uncheck()
    assert differing(before, opened.scene()) > 1_000
    commonest.check()
    assert differing(opened.scene(), before) == 0


def test_a_class_can_be_shown_alone(opened):
    before = is_drawn(opened.scene()).sum()
    row = opened.page.locator("#legend li").first
    row.hover()
    row.locator(".only").click()
    assert opened.page.locator("#legend input:checked").count() == 1
    opened.page.uncheck("#path")
    assert 0 < is_drawn(opened.scene()).sum() < before


def test_without_classes_and_path_nothing_is_drawn(opened):
    opened.page.click("#none")
    with_path = is_drawn(opened.scene()).sum()
    opened.page.uncheck("#path")
    assert is_drawn(opened.scene()).sum() == 0 < with_path


def test_the_slider_plays_the_map_growing(opened):
    drawn = []
    for scan in (1, 3, 6):
        opened.set("scan", scan)
        drawn.append(is_drawn(opened.scene()).sum())
        assert opened.text("moment").startswith(f"scan {scan} of 6")
    assert 0 < drawn[0] < drawn[1] < drawn[2]


def test_space_plays_to_the_last_scan(opened):
    opened.set("scan", 4)
    opened.page.keyboard.press("Space")
    opened.page.locator("#play", has_text="▶").wait_for(timeout=60_000)
    assert opened.page.input_value("#scan") == "6"


def test_labels_are_those_of_the_moment_unless_the_final_ones_are_asked_for(opened):
    opened.set("scan", 2)
    then = opened.scene()
    opened.page.check("#final")
    now = opened.scene()
    assert differing(then, now) > 200
    assert (is_drawn(then) == is_drawn(now)).mean() > 0.99

    # to and fro
    opened.page.uncheck("#final")
    opened.set("scan", 6)
    opened.set("scan", 2)
    assert differing(opened.scene(), then) == 0


@pytest.mark.parametrize("key", "1345")
def test_every_colouring_shows_and_has_a_key(opened, key):
    before = opened.scene()
    opened.page.keyboard.press(key)
    button = opened.page.locator("#colours button").nth(int(key) - 1)
    assert button.get_attribute("aria-checked") == "true"
    assert differing(opened.scene(), before) > 1_000


def test_what_is_higher_than_the_slider_is_not_shown(opened):
    before = is_drawn(opened.scene()).sum()
    opened.set("cut", 0.4)
    assert opened.text("height") == "up to 0.40 m"
    low = is_drawn(opened.scene()).sum()
    assert 0 < low < 0.9 * before
    opened.page.click("#below")
    assert is_drawn(opened.scene()).sum() == before


def test_a_click_picks_the_whole_object_and_flies_to_it(opened, changing_run):
    before = opened.scene()
    opened.page.mouse.click(*opened.middle())
    opened.page.locator("#picked").wait_for()
    after = opened.scene()
    assert differing(after, before) > 5_000
    assert (after == 255).all(axis=2).sum() > 100  # the rim

    # the voxel that is there
    words = opened.text("picked").split()
    with LabelledRun(changing_run.out) as run:
        whole, classes = run.whole(), run.classes
    place = [float(word) for word in words[words.index("z") + 1 :][:3]]
    nearest = int(np.linalg.norm(whole.xyz - place, axis=1).argmin())
    np.testing.assert_allclose(whole.xyz[nearest], place, atol=0.01)
    assert words[0] == classes[whole.semantic[nearest]]
    assert int(words[words.index("object") + 1]) == whole.instance[nearest]

    opened.page.keyboard.press("Escape")
    assert opened.page.is_hidden("#picked")


def test_a_double_click_shows_an_object_alone_and_escape_all_again(opened):
    opened.page.uncheck("#path")
    everything = opened.scene()
    opened.page.mouse.dblclick(*opened.middle())
    opened.page.locator("#isolate[aria-pressed=true]").wait_for()
    opened.page.keyboard.press("Escape")
    opened.page.click("#aslant")
    assert differing(opened.scene(), everything) == 0


def test_an_object_of_the_list_can_be_shown_alone(opened):
    opened.page.uncheck("#path")
    opened.page.click("#tabs button[value=objects]")
    opened.page.locator("#objects button").last.click()  # the smallest
    in_company = is_drawn(opened.scene()[:, :-CARD]).sum()
    opened.page.click("#isolate")
    alone = is_drawn(opened.scene()[:, :-CARD]).sum()
    assert 0 < alone < 0.7 * in_company
    opened.page.click("#isolate")
    assert is_drawn(opened.scene()[:, :-CARD]).sum() == in_company


def test_the_list_of_objects_is_searched_and_a_click_picks_one(opened, changing_run):
    opened.page.click("#tabs button[value=objects]")
    with LabelledRun(changing_run.out) as run:
        largest = max(run.objects(), key=lambda item: item.num_points)
    opened.page.fill("#search", f"{largest.class_name} {largest.id}")
    assert opened.page.locator("#objects li").count() == 1
    opened.page.click("#objects button")
    words = opened.text("picked").split()
    assert words[0] == largest.class_name
    assert words[words.index("object") + 1] == str(largest.id)
    opened.page.fill("#search", "no such thing")
    assert opened.page.locator("#objects li").count() == 0
    opened.page.fill("#search", "")


def test_what_is_under_the_pointer_is_named(opened):
    x, y = opened.middle()
    opened.page.mouse.move(x - 1, y)
    opened.page.mouse.move(x, y)
    opened.page.locator("#tip").wait_for(timeout=60_000)
    assert opened.text("tip").split()[0] in S3DIS_CLASSES


def test_boxes_are_drawn_around_objects(opened):
    before = opened.scene()
    opened.page.keyboard.press("b")
    assert opened.page.is_checked("#boxes")
    assert differing(opened.scene(), before) > 500


def test_a_distance_is_measured_between_two_points(opened):
    opened.page.click("#top")
    x, y = opened.middle()
    opened.page.keyboard.press("m")
    for at in (x - 40, x + 40):
        opened.page.mouse.click(at, y)
        opened.rest()
    opened.page.locator("#distance").wait_for()
    metres, across = (float(word.strip("(")) for word in opened.text("distance").split()[0:3:2])
    assert 0.1 < across <= metres < 6.0
    opened.page.keyboard.press("Escape")
    assert opened.page.is_hidden("#distance")


def test_larger_points_cover_more(opened):
    before = is_drawn(opened.scene()).sum()
    opened.set("size", 2)
    assert is_drawn(opened.scene()).sum() > before


def test_a_drag_turns_and_the_wheel_zooms(opened):
    before = opened.scene()
    opened.page.mouse.move(600, 300)
    opened.page.mouse.down()
    opened.page.mouse.move(680, 300)
    opened.page.mouse.up()
    turned = opened.scene()
    assert differing(turned, before) > 5_000
    assert opened.page.is_hidden("#picked")
    opened.page.mouse.wheel(0, 600)
    assert is_drawn(opened.scene()).sum() < 0.9 * is_drawn(turned).sum()


def test_a_screenshot_is_saved(opened, tmp_path):
    from PIL import Image

    with opened.page.expect_download() as download:
        opened.page.click("#shot")
    download.value.save_as(tmp_path / "shot.png")
    with Image.open(tmp_path / "shot.png") as picture:
        assert picture.size == (800, 480)
        assert len(np.unique(np.asarray(picture.convert("RGB")).reshape(-1, 3), axis=0)) > 50


def test_on_a_phone_the_panel_is_folded_and_fingers_turn_and_pick(browser, written):
    opened = Opened(browser, written, PHONE)
    assert opened.page.is_hidden("#legend")
    before = opened.scene()
    assert covered(before) >= 0.6

    # a drag of one finger
    session = opened.context.new_cdp_session(opened.page)
    for kind, points in (
        ("touchStart", [{"x": 200, "y": 400}]),
        ("touchMove", [{"x": 260, "y": 400}]),
        ("touchEnd", []),
    ):
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    turned = opened.scene()
    assert differing(turned, before) > 5_000
    assert opened.page.is_hidden("#picked")

    opened.page.touchscreen.tap(*opened.middle())
    opened.page.locator("#picked").wait_for()
    opened.page.tap("#unpick")
    opened.page.tap("#fold")
    assert opened.page.is_visible("#legend")
    assert opened.complaints == []
    opened.close()


def test_a_name_from_a_file_cannot_act(browser, own_run, tmp_path):
    document = json.loads((own_run / "run.json").read_text())
    evil = "</script><img src=x onerror='window.broken = 1'><script>window.broken = 1</script>"
    document["classes"] = [f"{evil}{name}" for name in document["classes"]]
    (own_run / "run.json").write_text(json.dumps(document))
    with LabelledRun(own_run) as run:
        write_html(run, tmp_path / "map.html", Selection())

    opened = Opened(browser, tmp_path / "map.html")
    opened.page.click("#tabs button[value=objects]")
    opened.page.click("#objects button")
    opened.page.mouse.click(*opened.middle())
    assert opened.page.evaluate("window.broken") is None
    assert opened.text("picked").startswith(evil)
    assert opened.complaints == []
    opened.close()
