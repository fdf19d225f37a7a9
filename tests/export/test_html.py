"""The page of a map, read without a browser: self-contained, harmless, and it holds the map."""

import json
import re
import shutil
from importlib.resources import files

import numpy as np
import pytest

from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.export import html as module
from mcpseg_cli.export.colours import instance_colours
from mcpseg_cli.export.html import write_html
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.segment.labelled_run import LabelledRun
from tests.commands import invoke
from tests.pages import read_page

pytest.importorskip("k3d", reason="the page is drawn by K3D, the extra 'html'")
EVIL = '</script><script>window.broken = 1</script><img src=x onerror="window.broken = 1">&amp;'


@pytest.fixture
def run(labelled_run):
    with LabelledRun(labelled_run.out) as run:
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


def test_an_object_has_the_colour_it_has_everywhere(page):
    _, columns = read_page(page)
    np.testing.assert_array_equal(
        columns["object_colours"].reshape(-1, 3), instance_colours(columns["object_ids"])
    )


def test_only_what_is_chosen_is_in_the_page(run, tmp_path):
    whole = run.whole()
    name = run.classes[np.bincount(whole.semantic).argmax()]
    count = write_html(run, tmp_path / "part.html", Selection(classes=(name,)))
    facts, columns = read_page(tmp_path / "part.html")
    assert count == facts["num_points"] == (whole.semantic == run.classes.index(name)).sum()
    assert [entry["name"] for entry in facts["classes"]] == [name]
    assert columns["scan_ends"][-1] == count
    with pytest.raises(InputError, match="nothing in the map"):
        write_html(run, tmp_path / "none.html", Selection(min_confidence=2.0))


def test_the_page_loads_nothing(page):
    text = page.read_text(encoding="utf-8")
    assert "default-src 'none'" in text
    markup = re.sub(r"<script\b([^>]*)>.*?</script>", r"<script\1>", text, flags=re.DOTALL)
    assert not re.search(r"\b(?:src|href|srcset|data|action)\s*=", markup)
    ours = (files("mcpseg_cli.export") / "page").iterdir()
    assert not any(re.search(r"https?://|@import|url\(", entry.read_text()) for entry in ours)


def test_names_from_files_stay_text(labelled_run, tmp_path):
    folder = tmp_path / "<b>run&"
    shutil.copytree(labelled_run.out, folder)
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


def test_without_k3d_one_line_says_what_to_install(run, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "find_spec", lambda name: None)
    with pytest.raises(OutputError, match=r"K3D.*pip install 'mcpseg\[html\]'"):
        write_html(run, tmp_path / "map.html", Selection())
    assert not list(tmp_path.iterdir())


def test_the_command_writes_the_page(labelled_run, tmp_path):
    output = tmp_path / "map.html"
    result = invoke("export", labelled_run.out, "-o", output, "--color", "instance")
    assert result.exit_code == 0
    assert "points" in result.stdout
    assert read_page(output)[0]["colour"] == "instance"
