"""The page of a map, read without a browser: self-contained, harmless, and it holds the map."""

import json
import re
from importlib.resources import files

import numpy as np
import pytest

from mcpseg_cli.errors import InputError
from mcpseg_cli.export.colours import instance_colours
from mcpseg_cli.export.html import write_html
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.segment.labelled_run import LabelledRun
from tests.commands import invoke
from tests.pages import read_page

EVIL = '</script><script>window.broken = 1</script><img src=x onerror="window.broken = 1">&amp;'
PAGE = files("mcpseg_cli.export") / "page"


@pytest.fixture
def run(changing_run):
    with LabelledRun(changing_run.out) as run:
        yield run


@pytest.fixture
def page(run, tmp_path):
    write_html(run, tmp_path / "map.html", Selection())
    return tmp_path / "map.html"


def test_labels_come_out_as_they_went_in(run, page):
    whole, (facts, columns) = run.whole(), read_page(page)
    assert facts["num_points"] == len(whole)
    np.testing.assert_array_equal(columns["semantic"], whole.semantic)
    np.testing.assert_array_equal(columns["object_ids"][columns["object"]], whole.instance)
    np.testing.assert_array_equal(columns["rgb"].reshape(-1, 3), whole.rgb)
    np.testing.assert_allclose(columns["confidence"] / 255, whole.confidence, atol=0.5 / 255 + 1e-6)


def test_positions_are_exact_to_a_65535th_of_the_map(run, page):
    whole, (facts, columns) = run.whole(), read_page(page)
    steps = columns["xyz"].reshape(3, -1).T.astype(np.float64)
    found = np.array(facts["origin"]) + facts["low"] + facts["step"] * steps
    np.testing.assert_allclose(found, whole.xyz, atol=0.51 * facts["step"])
    assert facts["step"] == pytest.approx(np.ptp(whole.xyz, axis=0).max() / 65_535, rel=1e-5)


def test_the_map_after_each_scan_is_a_beginning_of_the_points(run, page):
    _, columns = read_page(page)
    assert columns["scan_ends"].tolist() == [record.num_voxels for record in run.scans]


def test_the_path_is_that_of_the_poses(run, page):
    facts, columns = read_page(page)
    path = columns["path"].reshape(-1, 3) + facts["origin"]
    np.testing.assert_allclose(path, run.poses[:, :3, 3], atol=1e-5)


def test_objects_have_the_boxes_classes_and_colours_that_they_have_everywhere(run, page):
    facts, columns = read_page(page)
    boxes = columns["object_boxes"].reshape(-1, 7)
    listed = np.flatnonzero(columns["object_sizes"])
    assert columns["object_ids"][listed].tolist() == [item.id for item in run.objects()]
    for row, item in zip(listed, run.objects(), strict=True):
        assert columns["object_sizes"][row] == item.num_points
        assert run.classes[columns["object_classes"][row]] == item.class_name
        np.testing.assert_allclose(boxes[row, :3] + facts["origin"], item.obb_centre, atol=1e-3)
        np.testing.assert_allclose(boxes[row, 3:6], item.obb_size, atol=1e-3)
    np.testing.assert_array_equal(
        columns["object_colours"].reshape(-1, 3), instance_colours(columns["object_ids"])
    )


def test_only_what_is_chosen_is_in_the_page(run, tmp_path):
    whole = run.whole()
    name = run.classes[np.bincount(whole.semantic).argmax()]
    count = write_html(run, tmp_path / "part.html", Selection(classes=(name,)))
    facts, columns = read_page(tmp_path / "part.html")
    assert count == facts["num_points"] == (whole.semantic == run.classes.index(name)).sum()
    assert facts["classes"][0]["name"] == name
    assert [entry["num_points"] for entry in facts["classes"][1:]].count(0) == len(
        facts["classes"][1:]
    )
    assert columns["scan_ends"][-1] == count
    with pytest.raises(InputError, match="nothing in the map"):
        write_html(run, tmp_path / "none.html", Selection(min_confidence=2.0))


def test_the_page_loads_nothing(page):
    text = page.read_text(encoding="utf-8")
    assert "default-src 'none'" in text
    assert "connect-src 'none'" in text
    markup = re.sub(r"<script\b([^>]*)>.*?</script>", r"<script\1>", text, flags=re.DOTALL)
    assert not re.search(r"\b(?:src|href|srcset|data|action)\s*=", markup)
    ours = [entry for entry in PAGE.iterdir() if not entry.name.startswith("three.")]
    assert len(ours) > 10
    assert not any(re.search(r"https?://|@import|url\(", entry.read_text()) for entry in ours)


def test_three_js_comes_with_its_licence(page):
    licence = (PAGE / "three.LICENSE").read_text()
    assert "MIT License" in licence
    assert "three.js authors" in licence
    assert licence.split("\n\n")[1] in page.read_text(encoding="utf-8")


def test_names_from_files_stay_text(own_run, tmp_path):
    folder = own_run.rename(tmp_path / "<b>run&")
    document = json.loads((folder / "run.json").read_text())
    document["classes"] = [f"{EVIL}{name}" for name in document["classes"]]
    (folder / "run.json").write_text(json.dumps(document))
    with LabelledRun(folder) as run:
        write_html(run, tmp_path / "map.html", Selection())

    # no markup but our own, and the names unchanged
    text = (tmp_path / "map.html").read_text(encoding="utf-8")
    assert 'onerror="' not in text
    assert "<b>" not in text
    assert text.count("<script") == 4
    legend = read_page(tmp_path / "map.html")[0]["classes"]
    assert all(entry["name"].startswith(EVIL) for entry in legend)


def test_the_command_writes_the_page(changing_run, tmp_path):
    output = tmp_path / "map.html"
    result = invoke("export", changing_run.out, "-o", output, "--color", "instance")
    assert result.exit_code == 0
    assert "points" in result.stdout
    assert read_page(output)[0]["colour"] == "instance"
