"""A page that loads tiles, in headless Chromium: what it shows, what it loads, what it lets go."""

import functools
import http.server
import threading

import numpy as np
import pytest

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.export.tiled_page import PageFolder, write_tiled_page
from mcpseg_cli.export.view_server import serving, url_of
from tests.pages import MOST_MS, PHONE, Opened, differing, is_drawn
from tests.tiled import MadeUpRun, Scan, made_up, read_tiled

LOADED = 'body[data-loading="0"][data-rest="yes"]'

SCANS = [Scan(place=(0.5 * number, 0.8, 1.0)) for number in range(501)]


def street(tiles_along: int) -> list:
    """Return a floor with a wall along it, in panels that are objects of classes in turn."""
    pieces = []
    for number in range(tiles_along):
        along, across = np.arange(64 * number, 64 * number + 64), np.arange(16)
        floor = np.stack(np.meshgrid(along, across, [0], indexing="ij"), axis=-1).reshape(-1, 3)
        wall = np.stack(np.meshgrid(along, [16], across, indexing="ij"), axis=-1).reshape(-1, 3)
        part = made_up(np.concatenate([floor, wall]), number)
        owner = np.repeat([1, 2], [len(floor), len(wall)]) + 2 * number
        part.instance[:] = owner
        part.semantic[:] = owner % len(S3DIS_CLASSES)
        pieces.append(part)
    return pieces


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("street") / "site"
    write_tiled_page(MadeUpRun(street(40), scans=SCANS), folder, Selection())
    return folder


@pytest.fixture(scope="module")
def address(site):
    with serving(PageFolder(site)) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield url_of(server)
        server.shutdown()
        thread.join()


@pytest.fixture(scope="module")
def page_of_all_tests(browser, address):
    opened = Opened(browser, address)
    yield opened
    opened.close()


@pytest.fixture
def opened(page_of_all_tests):
    """The page, as it was when it opened."""
    opened = page_of_all_tests
    opened.page.keyboard.press("Escape")
    opened.page.click("#all")
    opened.page.click("#colours button[value=class]")
    opened.page.uncheck("#path")
    opened.set("budget", 2)
    opened.page.click("#fit")
    loaded(opened)
    yield opened
    assert opened.complaints == []


def loaded(opened):
    opened.page.wait_for_selector(LOADED, state="attached", timeout=MOST_MS)
    opened.page.wait_for_timeout(150)  # a flight begins with the next frame
    opened.page.wait_for_selector(LOADED, state="attached", timeout=MOST_MS)


def tiles_asked(opened):
    return [url.split("/tiles/")[1] for url in opened.requests if "/tiles/" in url]


def drawn(opened):
    return int(opened.text("drawn").split()[0].replace(",", ""))


def test_it_opens_with_what_is_large_and_leaves_the_rest_where_it_is(browser, address, site):
    opened = Opened(browser, address)
    loaded(opened)
    tiled, asked = read_tiled(site), tiles_asked(opened)
    assert asked[0] == "0/0_0_0.bin"
    assert len(set(asked)) == len(asked) < len(tiled.tiles)
    assert is_drawn(opened.scene()).sum() > 5_000
    assert f"{tiled.facts['num_points']:,} points" in opened.text("summary")
    assert opened.page.is_hidden("#time")

    # a long path would cover the map
    assert not opened.page.is_checked("#path")
    before = opened.scene()
    opened.page.check("#path")
    assert differing(opened.scene(), before) > 100
    assert opened.complaints == []

    # near the map its finest tiles come
    finest = f"{tiled.facts['tiles']['depth']}/"
    before = sum(name.startswith(finest) for name in asked)
    opened.page.mouse.move(*opened.middle())
    for _ in range(8):
        opened.page.mouse.wheel(0, -300)
    loaded(opened)
    assert sum(name.startswith(finest) for name in tiles_asked(opened)) > before
    assert opened.complaints == []
    opened.close()


def test_no_more_points_are_drawn_than_asked_for_and_what_is_out_of_use_goes(opened):
    budget = 6_000
    opened.page.evaluate("most => { viewer.cloud.budget = most; viewer.redraw(); }", budget)
    loaded(opened)
    few = drawn(opened)
    assert 0 < few <= budget
    assert opened.page.evaluate("viewer.cloud.kept") <= 1.5 * budget + 4_096
    opened.set("budget", 8)
    loaded(opened)
    assert drawn(opened) > few


def test_classes_are_switched_and_colours_chosen(opened):
    before = opened.scene()
    opened.page.click("#none")
    assert is_drawn(opened.scene()).sum() == 0
    opened.page.click("#all")
    assert differing(opened.scene(), before) == 0
    for key in "134":
        opened.page.keyboard.press(key)
        assert differing(opened.scene(), before) > 1_000
    assert opened.page.locator("#colours button").count() == 4


def test_what_is_higher_than_the_slider_is_not_shown(opened):
    before = is_drawn(opened.scene()).sum()
    opened.set("cut", 0.5)
    assert is_drawn(opened.scene()).sum() < before
    opened.page.click("#below")
    assert is_drawn(opened.scene()).sum() == before


def test_a_click_picks_an_object_and_says_what_is_known_of_it(opened, site):
    tiled = read_tiled(site)
    opened.page.mouse.click(*opened.middle())
    opened.page.locator("#picked").wait_for()
    words = opened.text("picked").split()
    place = [float(word) for word in words[words.index("z") + 1 :][:3]]
    nearest = int(np.linalg.norm(tiled.xyz - place, axis=1).argmin())
    np.testing.assert_allclose(tiled.xyz[nearest], place, atol=0.01)
    assert words[0] == S3DIS_CLASSES[tiled.semantic[nearest]]
    assert int(words[words.index("object") + 1]) == tiled.instance[nearest]
    loaded(opened)
    assert (opened.scene() == 255).all(axis=2).sum() > 100  # the rim

    # alone, then with all others
    opened.page.click("#isolate")
    alone = is_drawn(opened.scene()).sum()
    opened.page.click("#isolate")
    assert 0 < alone < is_drawn(opened.scene()).sum()


def test_what_is_under_the_pointer_is_named_and_distances_are_measured(opened):
    x, y = opened.middle()
    opened.page.mouse.move(x - 1, y)
    opened.page.mouse.move(x, y)
    opened.page.locator("#tip").wait_for(timeout=MOST_MS)
    assert opened.text("tip").split()[0] in S3DIS_CLASSES
    opened.page.click("#top")
    x, y = opened.middle()
    opened.page.keyboard.press("m")
    for at in (x - 20, x + 20):
        opened.page.mouse.click(at, y)
        opened.rest()
    opened.page.locator("#distance").wait_for()
    assert float(opened.text("distance").split()[0]) > 0.1


def test_an_object_of_the_list_is_flown_to(opened):
    opened.page.click("#tabs button[value=objects]")
    assert opened.page.locator("#objects button").count() == 80
    asked = len(tiles_asked(opened))
    opened.page.locator("#objects button").first.click()
    loaded(opened)
    assert len(tiles_asked(opened)) >= asked
    assert "points)" in opened.text("picked")
    before = opened.scene()
    opened.page.keyboard.press("b")
    assert differing(opened.scene(), before) > 100
    opened.page.keyboard.press("b")
    opened.page.click("#tabs button[value=map]")


def test_any_web_server_will_do_and_an_address_may_say_the_colours(browser, site):
    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    handler = functools.partial(Quiet, directory=site)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        opened = Opened(browser, f"http://127.0.0.1:{server.server_port}/#instance", PHONE)
        loaded(opened)
        assert is_drawn(opened.scene()).sum() > 5_000
        opened.page.tap("#fold")
        chosen = opened.page.locator("#colours button[aria-checked=true]")
        assert chosen.get_attribute("value") == "instance"
        assert opened.complaints == []
        opened.close()
        server.shutdown()


def test_a_tile_that_is_not_there_is_told_and_the_rest_is_shown(browser, address):
    context = browser.new_context(viewport={"width": 800, "height": 480})
    page = context.new_page()
    page.route("**/tiles/5/**", lambda route: route.fulfill(status=503))
    page.goto(address)
    page.wait_for_selector('body[data-state="ready"]', state="attached", timeout=MOST_MS)
    page.locator("#message", has_text="A tile cannot be loaded").wait_for(timeout=MOST_MS)
    page.unroute("**/tiles/5/**")
    page.wait_for_selector("#message:empty", state="attached", timeout=MOST_MS)
    context.close()


def test_opened_from_a_disk_it_says_in_a_line_what_it_needs(browser, site):
    context = browser.new_context()
    page = context.new_page()
    page.goto((site / "index.html").as_uri())
    page.wait_for_selector('body[data-state="failed"]', state="attached", timeout=MOST_MS)
    said = page.inner_text("#message")
    assert said.splitlines() == [said]
    assert "browsers load no tiles from a disk; run 'mcpseg view FOLDER'" in said
    context.close()
