"""``mcpseg eval`` in eight lines, and what it says where there is no class or no object."""

import numpy as np
import pytest

from mcpseg_cli.formats import Cloud, write_cloud
from tests.commands import invoke
from tests.evaluate.test_run import write_pair


@pytest.fixture
def clouds(tmp_path):
    """Write the map and the truth of a cube of points in two objects; give their paths."""

    def write(true_semantic: int, true_instance: int, pred_semantic: int):
        xyz = np.indices((6, 6, 6)).reshape(3, -1).T.astype(np.float32) / 10
        columns = dict(zip("xyz", xyz.T, strict=True))
        paths = tmp_path / "map.ply", tmp_path / "gt.ply"
        for path, semantic, instance in (
            (paths[0], pred_semantic, 1),
            (paths[1], true_semantic, true_instance),
        ):
            labels = {
                "semantic": np.full(len(xyz), semantic, np.uint8),
                "instance": np.full(len(xyz), instance, np.int32),
            }
            write_cloud(path, Cloud(columns | labels, ("wall", "door")))
        return paths

    return write


def rows(text: str) -> dict[str, str]:
    return {line[:17].strip(): line[17:].strip() for line in text.splitlines()}


def test_a_headline_has_at_most_eight_lines_and_full_has_more(labelled_run):
    truth = labelled_run.out / "map.ply"
    short = invoke("eval", labelled_run.out, truth)
    assert len(short.stdout.splitlines()) == 8
    assert "--full" in short.stderr
    found = rows(short.stdout)
    assert list(found) == [
        "compared", "accuracy", "mIoU", "NMI", "objects", "object accuracy", "AP50", "ms per scan",
    ]  # fmt: skip
    assert (found["accuracy"], found["NMI"]) == ("1.000", "1.000")
    assert " median, " in found["ms per scan"]
    full = invoke("eval", labelled_run.out, truth, "--full")
    assert len(full.stdout.splitlines()) > 40
    assert "--full" not in full.stderr


def test_several_runs_fit_into_eight_lines_too(tmp_path):
    pairs = [*write_pair(tmp_path / "a"), *write_pair(tmp_path / "b", 5)]
    lines = invoke("eval", *pairs).stdout.splitlines()
    assert len(lines) == 8
    assert lines[0].split()[-2:] == ["pooled", "mean"]
    assert {len(line.split()) for line in lines[1:4]} == {5}


def test_rooms_follow_the_headline(tmp_path):
    text = invoke("eval", *write_pair(tmp_path / "a"), "--rooms").stdout
    assert "room_1" in text
    assert "panoptic" not in text


def test_a_map_without_classes_says_so_instead_of_0(clouds):
    result = invoke("eval", *clouds(0, 1, 255))
    found = rows(result.stdout)
    for name in ("accuracy", "mIoU", "object accuracy"):
        assert found[name] == "none: the map has no classes"
    assert found["AP50"] == "1.000 whatever the class"
    assert found["NMI"] == "1.000"
    assert "no point has a class, as of region growing" in result.stderr


def test_truth_without_classes_or_objects_says_so(clouds):
    found = rows(invoke("eval", *clouds(255, 1, 0)).stdout)
    assert found["accuracy"] == found["mIoU"] == "unknown: the truth has no classes here"
    found = rows(invoke("eval", *clouds(0, 0, 0)).stdout)
    assert found["NMI"] == found["AP50"] == "unknown: the truth has no objects here"


def test_the_mean_is_over_the_classes_of_the_truth(clouds):
    found = rows(invoke("eval", *clouds(0, 1, 0)).stdout)
    assert found["mIoU"] == "1.000 over 1 of 2 classes, those in the truth"
