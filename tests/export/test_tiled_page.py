"""A page that loads tiles: every voxel is in one of them, evenly, whatever the map's size."""

import json
import re
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from mcpseg_cli.errors import McpsegError
from mcpseg_cli.export import octree
from mcpseg_cli.export.floors import below_ceiling, floor_heights
from mcpseg_cli.export.normals import surface_normals
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.export.tiled_page import PageFolder, write_tiled_page
from mcpseg_cli.grid import voxel_of
from mcpseg_cli.segment.labelled_run import LabelledRun
from tests.commands import invoke
from tests.tiled import MadeUpRun, made_up, read_tiled


@pytest.fixture(scope="module")
def whole(changing_run):
    with LabelledRun(changing_run.out) as run:
        return run.whole()


@pytest.fixture(scope="module")
def site(changing_run, tmp_path_factory):
    folder = tmp_path_factory.mktemp("tiled") / "site"
    result = invoke("export", changing_run.out, "-o", folder, "--split", "html", "-q")
    assert result.exit_code == 0, result.output
    return folder


def matched(tiled, whole):
    """Return the order of a tiled map's points in which they are those of the whole map."""
    order = cKDTree(tiled.xyz).query(whole.xyz)[1]
    assert len(np.unique(order)) == len(tiled.xyz)
    return order


def test_every_voxel_is_in_one_tile_with_its_labels(site, whole):
    tiled = read_tiled(site)
    assert len(tiled.xyz) == len(whole) == tiled.facts["num_points"]
    order = matched(tiled, whole)
    step = max(tiled.facts["tiles"]["steps"])
    np.testing.assert_allclose(tiled.xyz[order], whole.xyz, atol=0.51 * step + 1e-6)
    np.testing.assert_array_equal(tiled.semantic[order], whole.semantic)
    np.testing.assert_array_equal(tiled.instance[order], whole.instance)
    np.testing.assert_array_equal(tiled.rgb[order], whole.rgb)
    np.testing.assert_allclose(tiled.confidence[order] / 255, whole.confidence, atol=0.002)


def test_surfaces_and_heights_are_those_of_the_page_in_one_file(site, whole, changing_run):
    tiled = read_tiled(site)
    order = matched(tiled, whole)
    with LabelledRun(changing_run.out) as run:
        eyes = run.poses[whole.scan, :3, 3]
        height = whole.xyz[:, 2] - floor_heights(run)[whole.scan]
    normal = surface_normals(whole.xyz, eyes, 0.1)
    assert np.abs(tiled.normal[order] - np.rint(127 * normal)).max() <= 1
    np.testing.assert_allclose(tiled.height[order], height, atol=0.008)
    assert tiled.facts["cut"] == below_ceiling(height, normal)
    assert tiled.facts["highest"] == pytest.approx(height.max())


def test_the_objects_are_those_of_the_map(site, changing_run):
    tiled = read_tiled(site)
    with LabelledRun(changing_run.out) as run:
        objects = run.objects()
    places = np.flatnonzero(tiled.columns["object_sizes"])
    assert tiled.columns["object_ids"][places].tolist() == [item.id for item in objects]
    boxes = tiled.columns["object_boxes"].reshape(-1, 7)[places]
    for box, item in zip(boxes, objects, strict=True):
        np.testing.assert_allclose(box[:3] + tiled.facts["origin"], item.obb_centre, atol=1e-3)
        np.testing.assert_allclose(box[3:6], item.obb_size, atol=1e-3)
    assert tiled.facts["num_objects"] == len(objects)


def test_all_that_is_above_a_tile_is_listed_and_only_tiles_with_points_are_files(site):
    tiled = read_tiled(site)
    known = set(tiled.tiles)
    assert (0, 0, 0, 0) in known
    assert all((k - 1, x >> 1, y >> 1, z >> 1) in known for k, x, y, z in known if k)
    files = {
        (int(path.parent.name), *map(int, path.stem.split("_")))
        for path in (site / "tiles").rglob("*.bin")
    }
    counts = tiled.columns["tile_points"]
    assert files == {tile for tile, count in zip(tiled.tiles, counts, strict=True) if count}


some_voxels = st.integers(0, 2**32 - 1).flatmap(
    lambda seed: st.tuples(st.just(seed), st.integers(1, 1500), st.sampled_from([20, 90, 700]))
)


@settings(max_examples=12, deadline=None)
@given(some_voxels)
def test_tiles_down_to_any_level_have_one_point_in_every_cell_of_it(tmp_path_factory, drawn):
    seed, count, reach = drawn
    rng = np.random.default_rng(seed)
    voxel = np.unique(rng.integers(-reach, reach, (count, 3)) // [1, 1, 8], axis=0)
    folder = tmp_path_factory.mktemp("even") / "site"
    write_tiled_page(MadeUpRun([made_up(voxel, seed)]), folder, Selection())
    tiled = read_tiled(folder)
    assert len(tiled.xyz) == len(voxel)

    known = tiled.facts["tiles"]
    levels = np.array([tile[0] for tile in tiled.tiles])[tiled.tile]
    first = np.round((np.array(known["corner"]) + tiled.facts["origin"]) / 0.1 + 0.5).astype(int)
    at = voxel_of(tiled.xyz.astype(np.float32), 0.1) - first
    assert at.min() >= 0
    for level in range(known["depth"] + 1):
        cells = at >> (known["depth"] - level)
        everywhere = np.unique(cells, axis=0)
        above = cells[levels <= level]
        assert len(np.unique(above, axis=0)) == len(above) == len(everywhere)
    own = np.array([tile[1:] for tile in tiled.tiles])[tiled.tile]
    shift = (known["depth"] - levels + octree.CELL_BITS)[:, None]
    np.testing.assert_array_equal(at >> shift, own)


def slow_nearest(groups, away):
    best = {}
    for row, group in enumerate(groups):
        if group not in best or away[row] < away[best[group]]:
            best[group] = row
    return [row in best.values() for row in range(len(groups))]


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 3)), max_size=40))
def test_the_nearest_of_a_cell_goes_up(rows):
    rows.sort(key=lambda row: row[0])
    groups = np.array([row[0] for row in rows], np.int64)
    away = np.array([row[1] for row in rows], np.float64)
    chosen = octree._nearest_of_runs(groups, away)
    assert chosen.tolist() == slow_nearest(groups.tolist(), away.tolist())


@given(st.lists(st.tuples(*[st.integers(0, 2**21 - 1)] * 3), min_size=1))
def test_places_come_out_of_keys_as_they_went_in(places):
    at = np.array(places, np.int64)
    keys = sum(octree._spread(at[:, axis]) << axis for axis in range(3))
    np.testing.assert_array_equal(octree.places_of(keys), at)


def files_of(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*.*")}


def test_the_same_map_gives_the_same_bytes_however_it_is_cut(tmp_path):
    voxel = np.unique(np.random.default_rng(1).integers(0, 300, (4000, 3)) // [1, 1, 9], axis=0)
    part = made_up(voxel)
    cut = [part.select(slice(start, start + 500)) for start in range(0, len(part), 500)]
    write_tiled_page(MadeUpRun([part]), tmp_path / "one", Selection())
    write_tiled_page(MadeUpRun(cut), tmp_path / "many", Selection())
    assert files_of(tmp_path / "one") == files_of(tmp_path / "many")


def peak_of(tiles_along, folder):
    def piece(number):
        def make():
            voxel = np.argwhere(np.ones((64, 64, 2), bool))
            voxel[:, 0] += 64 * number
            part = made_up(voxel, number)
            return replace(part, instance=part.instance + np.int32(9 * number))

        return make

    run = MadeUpRun([piece(number) for number in range(tiles_along)])
    tracemalloc.start()
    write_tiled_page(run, folder, Selection())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


def test_memory_is_that_of_a_column_whatever_the_size_of_the_map(tmp_path, monkeypatch):
    monkeypatch.setattr("mcpseg_cli.export.tiled_objects._TOGETHER", 10_000)
    write_tiled_page(MadeUpRun([made_up(np.zeros((1, 3), int))]), tmp_path / "warm", Selection())
    small, large = peak_of(3, tmp_path / "small"), peak_of(15, tmp_path / "large")
    assert large < 1.25 * small


def test_a_page_of_before_is_replaced_as_a_whole_and_nothing_else_is(changing_run, tmp_path):
    words = ("export", changing_run.out, "-o", tmp_path / "site", "--split", "html")
    result = invoke(*words)
    assert result.exit_code == 0, result.output
    assert " points in " in result.stdout
    assert result.stdout.rstrip().endswith("tiles")
    before = files_of(tmp_path / "site")
    assert invoke(*words).exit_code == 1
    assert "give --overwrite" in invoke(*words).stderr

    # nothing is chosen: what was there stays
    assert invoke(*words, "--overwrite", "--box=90,90,90,91,91,91").exit_code == 1
    assert files_of(tmp_path / "site") == before

    # fewer tiles than before
    assert invoke(*words, "--overwrite", "--box=-1,-1,-1,0.5,1,1").exit_code == 0
    assert len(read_tiled(tmp_path / "site").xyz) < len(read_tiled_of(before))
    assert invoke(*words, "--overwrite").exit_code == 0
    assert files_of(tmp_path / "site") == before
    assert sorted(path.name for path in (tmp_path / "site").iterdir()) == [
        "index.html", "map.bin", "tiles",
    ]  # fmt: skip

    (tmp_path / "site" / "notes.txt").write_text("mine")
    refused = invoke(*words, "--overwrite")
    assert refused.exit_code == 1
    assert "has notes.txt; expected an empty folder" in refused.stderr
    assert files_of(tmp_path / "site").keys() - before.keys()


def read_tiled_of(files):
    """Count the points that files hold, by their map."""
    body = next(content for path, content in files.items() if path.name == "map.bin")
    facts = json.loads(body[4 : 4 + int.from_bytes(body[:4], "little")])
    return range(facts["num_points"])


def test_a_page_of_somebody_else_is_left_alone(changing_run, tmp_path):
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "index.html").write_text("mine")
    words = ("export", changing_run.out, "-o", tmp_path / "site", "--split", "html", "--overwrite")
    refused = invoke(*words)
    assert (refused.exit_code, len(refused.stderr.splitlines())) == (1, 1)
    assert "has index.html" in refused.stderr
    assert (tmp_path / "site" / "index.html").read_text() == "mine"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--tiles", "5"], "a page has tiles of its own"),
        (["--color", "embedding"], "expected rgb, class, instance, confidence"),
        (["--box=90,90,90,91,91,91"], "nothing in the map that was asked for"),
    ],
)
def test_what_cannot_be_is_one_line(changing_run, tmp_path, options, said):
    words = ("export", changing_run.out, "-o", tmp_path / "site", "--split", "html", *options)
    result = invoke(*words)
    assert result.exit_code != 0
    assert said in " ".join(result.stderr.replace("│", " ").split())
    assert not any((tmp_path / "site").glob("*"))


def test_a_server_gives_out_the_files_of_the_page_and_no_others(site):
    served = PageFolder(site)
    assert served.answer("/") == ("text/html", (site / "index.html").read_bytes())
    assert served.answer("/map.bin")[1] == (site / "map.bin").read_bytes()
    tile = next((site / "tiles").rglob("*.bin"))
    name = f"/tiles/{tile.parent.name}/{tile.name}"
    assert served.answer(name)[1] == tile.read_bytes()
    for path in (
        "/index.html/", "//map.bin", "/tiles", "/tiles/0/../../map.bin", "/tiles/0/9_9_9.bin",
        "/../site/map.bin", f"{name}?x", f"{name}/", "/%2e%2e/x", "/tiles/0/0_0_0.bin\n", "/moment",
    ):  # fmt: skip
        with pytest.raises(LookupError):
            served.answer(path)


def test_more_objects_than_a_page_can_tell_apart_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("mcpseg_cli.export.tiled_objects.MOST_OBJECTS", 5)
    run = MadeUpRun([made_up(np.argwhere(np.ones((9, 9, 2), bool)))])
    with pytest.raises(McpsegError, match="8 objects; expected at most 4"):
        write_tiled_page(run, tmp_path / "site", Selection())


def test_a_map_too_long_for_keys_is_refused(tmp_path):
    far = MadeUpRun([made_up(np.array([[0, 0, 0], [0, 0, 1 << 21]]))])
    with pytest.raises(McpsegError, match="a map 210 km long; expected at most 210 km"):
        write_tiled_page(far, tmp_path / "site", Selection())
    assert not any((tmp_path / "site").iterdir())


def test_a_map_without_objects_has_none(tmp_path):
    part = made_up(np.argwhere(np.ones((9, 9, 2), bool)))
    part.instance[:] = 0
    write_tiled_page(MadeUpRun([part]), tmp_path / "site", Selection())
    tiled = read_tiled(tmp_path / "site")
    assert tiled.facts["num_objects"] == tiled.instance.max() == 0


def test_view_gives_out_such_a_page_in_the_colours_asked_for(site, monkeypatch):
    def interrupted(_):
        raise KeyboardInterrupt

    monkeypatch.setattr("http.server.ThreadingHTTPServer.serve_forever", interrupted)
    shown = invoke("view", site, "--no-open", "--color", "rgb")
    assert (shown.exit_code, shown.stderr) == (0, "Ctrl-C ends this\nended\n")
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/#rgb\n", shown.stdout)
    assert re.fullmatch(r"http.*:\d+/\n", invoke("view", site, "--no-open").stdout)
    assert "has no embeddings" in invoke("view", site, "--no-open", "--color", "embedding").stderr
