"""Pairing with ground truth against a KD-tree, and what is counted."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree

from mcpseg_cli.building import Building
from mcpseg_cli.errors import InputError
from mcpseg_cli.evaluate.nearest_points import NearestPoints
from mcpseg_cli.evaluate.pairing import pair_with_truth
from mcpseg_cli.evaluate.truth import open_truth
from mcpseg_cli.formats import Cloud, write_cloud
from mcpseg_cli.formats.hdf5 import write_building_h5
from mcpseg_cli.formats.s3dis import write_room

CLASSES = ("floor", "wall", "chair")
REACH = 0.05


def write_truth(path: Path, xyz, semantic, instance, classes=CLASSES) -> Path:
    columns = {axis: np.asarray(xyz, np.float32)[:, number] for number, axis in enumerate("xyz")}
    labels = {
        "semantic": np.asarray(semantic, np.uint8),
        "instance": np.asarray(instance, np.int32),
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    write_cloud(path, Cloud(columns | labels, classes))
    return path


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 4), st.sampled_from([0.0, -300.0, 1e5]))
def test_the_nearest_points_are_those_of_a_kd_tree(seed, num_parts, offset):
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(0, 0.4, (int(rng.integers(1, 60)), 3)) + offset
    offered = rng.uniform(-0.1, 0.5, (int(rng.integers(1, 200)), 3)) + offset

    # offered part by part
    nearest = NearestPoints(xyz, REACH)
    found, num_near = np.full(len(xyz), -1), 0
    for part in np.array_split(np.arange(len(offered)), num_parts):
        ids, rows, near = nearest.offer(offered[part])
        found[ids], num_near = part[rows], num_near + near

    # all at once
    distance, expected = KDTree(offered).query(xyz, distance_upper_bound=REACH + 1e-6)
    np.testing.assert_array_equal(found, np.where(np.isfinite(distance), expected, -1))
    back = KDTree(xyz).query(offered, distance_upper_bound=REACH + 1e-6)[0]
    assert num_near == np.isfinite(back).sum()


def test_points_beyond_half_a_voxel_are_uncovered_on_either_side(tmp_path):
    truth = write_truth(
        tmp_path / "gt.ply", [[0, 0, 0], [1, 0, 0.04], [5, 0, 0]], [0, 1, 2], [1, 2, 3]
    )
    paired = pair_with_truth(
        np.array([[1, 0, 0], [2, 0, 0.0]], np.float32), open_truth(truth), CLASSES, REACH
    )
    assert (paired.covered.tolist(), paired.semantic.tolist()) == ([True, False], [1, 255])
    assert (paired.truth_points, paired.truth_uncovered, paired.by_point) == (3, 2, False)


def test_the_same_cloud_pairs_point_by_point_even_where_points_coincide(tmp_path):
    xyz = np.zeros((3, 3), np.float32)
    truth = write_truth(tmp_path / "gt.ply", xyz, [0, 1, 2], [1, 2, 3])
    paired = pair_with_truth(xyz, open_truth(truth), CLASSES, REACH)
    assert paired.by_point
    assert (paired.semantic.tolist(), paired.instance.tolist()) == ([0, 1, 2], [1, 2, 3])


def test_true_classes_that_the_table_lacks_are_counted_and_unknown(tmp_path):
    truth = write_truth(
        tmp_path / "gt.ply", [[0, 0, 0], [1, 0, 0]], [0, 1], [1, 2], classes=("wall", "stairs")
    )
    paired = pair_with_truth(np.array([[0, 0, 0.01], [1, 0, 0]]), open_truth(truth), CLASSES, REACH)
    assert paired.semantic.tolist() == [1, 255]
    assert paired.other_classes == {"stairs": 1}


def test_class_tables_without_a_common_name_are_refused(tmp_path):
    truth = open_truth(
        write_truth(tmp_path / "gt.ply", [[0, 0, 0]], [0], [1], classes=("Wand", "Boden"))
    )
    with pytest.raises(
        InputError, match=r"gt\.ply: classes Wand, Boden; expected some of floor, wall, chair"
    ):
        pair_with_truth(np.zeros((1, 3)), truth, CLASSES, REACH)


def write_parts(folder: Path, *tables) -> Path:
    """Write a part of truth for each class table, of one point of class 1."""
    for number, classes in enumerate(tables):
        write_truth(folder / f"{number}.ply", [[number, 0, 0]], [1], [1], classes)
    return folder


def test_without_a_table_the_first_that_the_truth_names_is_taken(tmp_path):
    truth = open_truth(write_parts(tmp_path / "gt", ("sofa", "wall"), ("wall", "sofa", "lamp")))
    paired = pair_with_truth(np.array([[0, 0, 0], [1, 0, 0.0]]), truth, (), REACH)
    assert (paired.classes, paired.is_named) == (("sofa", "wall"), True)
    assert (paired.semantic.tolist(), paired.other_classes) == ([1, 0], {"lamp": 0})


def test_without_any_table_the_truth_says_how_many_classes_there_are(tmp_path):
    truth = open_truth(write_parts(tmp_path / "gt", (), ()))
    paired = pair_with_truth(np.array([[0, 0, 0], [5, 0, 0.0]]), truth, (), REACH)
    assert (paired.classes, paired.is_named, paired.highest_class) == ((), False, 1)
    assert paired.semantic.tolist() == [1, 255]


def test_a_table_that_comes_after_classes_beyond_it_is_refused(tmp_path):
    write_truth(tmp_path / "gt/1.ply", [[0, 0, 0]], [0], [1], classes=("wall",))
    truth = open_truth(write_parts(tmp_path / "gt", ()))
    with pytest.raises(InputError, match=r"gt: class 1; expected 0 to 0"):
        pair_with_truth(np.zeros((1, 3)), truth, (), REACH)


def test_classes_beyond_the_table_are_refused_when_the_truth_names_none(tmp_path):
    truth = open_truth(write_truth(tmp_path / "gt.ply", [[0, 0, 0]], [7], [1], classes=()))
    with pytest.raises(InputError, match=r"class 7 \(point 0\); expected 0 to 2"):
        pair_with_truth(np.zeros((1, 3)), truth, CLASSES, REACH)


def test_raytrace_json_tells_the_room_of_every_object(tmp_path):
    write_truth(tmp_path / "gt/0.ply", [[0, 0, 0], [1, 0, 0], [2, 0, 0]], [0, 1, 2], [1, 2, 0])
    objects = [{"id": 1, "name": "office_2/floor_1"}, {"id": 2, "name": "office_1/wall_1"}]
    (tmp_path / "raytrace.json").write_text(json.dumps({"objects": objects}))
    truth = open_truth(tmp_path / "gt")
    assert truth.rooms == ("office_2", "office_1")
    assert [part.room.tolist() for part in truth.parts()] == [[0, 1, -1]]


def test_a_damaged_raytrace_json_is_one_line(tmp_path):
    write_truth(tmp_path / "gt/0.ply", [[0, 0, 0]], [0], [1])
    for text in ("{", "[]", '{"objects": [{"id": "x"}]}', '{"objects": 3}'):
        (tmp_path / "raytrace.json").write_text(text)
        with pytest.raises(InputError, match=r"raytrace\.json: no list of objects"):
            open_truth(tmp_path / "gt")


def test_an_s3dis_area_is_truth_with_rooms(tmp_path):
    rng = np.random.default_rng(0)
    points = [rng.uniform(0, 1, (20, 3)).astype(np.float32) for _ in range(3)]
    rgb = np.zeros((20, 3), np.uint8)
    wall, chair, floor = zip(("wall", "chair", "floor"), points, 3 * [rgb], strict=True)
    write_room(tmp_path / "Area_1", "office_1", [wall, chair])
    write_room(tmp_path / "Area_1", "office_2", [floor])

    truth = open_truth(tmp_path / "Area_1")
    paired = pair_with_truth(np.concatenate(points), truth, ("floor", "wall", "chair"), REACH)
    assert truth.rooms == ("office_1", "office_2")
    assert paired.room.tolist() == [0] * 40 + [1] * 20
    assert paired.instance.tolist() == [2] * 20 + [1] * 20 + [3] * 20  # by name in each room
    assert paired.semantic.tolist() == [1] * 20 + [2] * 20 + [0] * 20


def test_an_hdf5_building_is_truth(tmp_path):
    labels = np.zeros(2, np.uint8), np.ones(2, np.int32)
    xyz = np.array([[0, 0, 0], [1, 0, 0]], np.float32)
    write_building_h5(
        tmp_path / "b.h5", Building(xyz, np.zeros((2, 3), np.uint8), *labels, CLASSES)
    )
    paired = pair_with_truth(xyz, open_truth(tmp_path / "b.h5"), CLASSES, REACH)
    assert paired.covered.all()


def test_the_folder_of_a_recording_is_not_its_truth(tmp_path):
    (tmp_path / "raytrace.json").write_text("{}")
    with pytest.raises(InputError, match=r"a recording; expected its ground truth; name .*gt"):
        open_truth(tmp_path)
