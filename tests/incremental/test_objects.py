"""The object inventory: vote, boxes, order."""

import numpy as np
import pytest

from mcpseg_cli.incremental.map_rows import MapRows
from mcpseg_cli.incremental.objects import list_objects
from tests import reference

CLASSES = ("floor", "wall", "chair")


def rows_of(xyz, semantic, instance, confidence=None) -> MapRows:
    count = len(xyz)
    return MapRows(
        xyz=np.asarray(xyz, np.float32).reshape(-1, 3),
        rgb=np.zeros((count, 3), np.uint8),
        semantic=np.asarray(semantic, np.uint8),
        confidence=np.asarray(confidence if confidence is not None else np.ones(count), np.float32),
        instance=np.asarray(instance, np.int32),
        embedding=np.zeros((count, 50), np.int16),
    )


def test_an_empty_map_has_no_objects():
    assert list_objects(rows_of([], [], []), CLASSES) == []


def test_an_object_takes_the_class_most_of_its_points_have():
    found = list_objects(rows_of(np.eye(3), [1, 2, 2], [7, 7, 7], [0.9, 0.5, 0.7]), CLASSES)
    assert [(item.id, item.class_name, item.num_points) for item in found] == [(7, "chair", 3)]
    assert found[0].confidence == pytest.approx(0.6)


def test_a_tied_vote_goes_to_the_first_class_of_the_table():
    assert list_objects(rows_of(np.eye(3)[:2], [2, 1], [1, 1]), CLASSES)[0].class_name == "wall"


def test_objects_come_by_id_whatever_the_order_of_points():
    found = list_objects(rows_of(np.zeros((4, 3)), [0, 1, 2, 0], [9, 2, 5, 9]), CLASSES)
    assert [(item.id, item.class_name) for item in found] == [
        (2, "wall"),
        (5, "chair"),
        (9, "floor"),
    ]


def test_the_axis_aligned_box_and_centroid_are_those_of_the_points():
    xyz = [[0, 0, 0], [2, 4, 1], [1, 2, 2]]
    found = list_objects(rows_of(xyz, [0, 0, 0], [1, 1, 1]), CLASSES)[0]
    assert (found.aabb_min, found.aabb_max, found.centroid) == ((0, 0, 0), (2, 4, 2), (1, 2, 1))


@pytest.mark.parametrize("yaw_deg", [0, 17, 45, 89, 120, 179])
def test_a_turned_rectangle_gets_its_own_oriented_box(yaw_deg):
    u, v = (
        grid.ravel() for grid in np.meshgrid(np.linspace(-1, 1, 40), np.linspace(-0.3, 0.3, 20))
    )
    turn = np.deg2rad(yaw_deg)
    x, y = 5 + u * np.cos(turn) - v * np.sin(turn), -2 + u * np.sin(turn) + v * np.cos(turn)
    xyz = np.column_stack([x, y, np.linspace(0, 0.8, len(u))])
    found = list_objects(rows_of(xyz, np.zeros(len(u)), np.ones(len(u))), CLASSES)[0]
    assert found.obb_yaw_deg == yaw_deg
    assert found.obb_size == pytest.approx((2.0, 0.6, 0.8), abs=1e-3)
    assert found.obb_centre == pytest.approx((5, -2, 0.4), abs=1e-3)


def test_the_oriented_box_is_as_small_as_the_slow_twin_finds():
    rng = np.random.default_rng(0)
    for _ in range(20):
        xy = rng.normal(size=(30, 2)) @ rng.normal(size=(2, 2))
        xyz = np.column_stack([xy, np.zeros(30)]).astype(np.float32)
        found = list_objects(rows_of(xyz, np.zeros(30), np.ones(30)), CLASSES)[0]
        assert found.obb_size[0] * found.obb_size[1] == pytest.approx(
            reference.smallest_rectangle_area(xyz[:, :2].tolist()), rel=1e-3
        )


def test_a_single_point_is_an_object_with_an_empty_box():
    found = list_objects(rows_of([[1, 2, 3]], [1], [4]), CLASSES)[0]
    assert (found.obb_size, found.centroid, found.obb_centre) == ((0, 0, 0), (1, 2, 3), (1, 2, 3))
