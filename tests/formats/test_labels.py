"""The one check of labels that truth, maps, buildings and training share."""

from pathlib import Path

import numpy as np
import pytest

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import Cloud
from mcpseg_cli.formats.labels import point_labels

SOURCE = Path("a.ply")
TABLE = ("floor", "wall")


def cloud(semantic, instance, classes=()) -> Cloud:
    columns = {axis: np.zeros(len(semantic), np.float32) for axis in "xyz"}
    return Cloud(
        columns | {"semantic": np.array(semantic), "instance": np.array(instance)}, classes
    )


@pytest.mark.parametrize("dtype", [np.int8, np.int64, np.float16, np.float64])
def test_unknown_is_255_and_no_object_0_in_any_type(dtype):
    labels = np.array([-1, 1, 0], dtype), np.array([-3, 7, 0], dtype)
    semantic, instance = point_labels(cloud(*labels, TABLE), SOURCE)
    assert (semantic.tolist(), semantic.dtype) == ([255, 1, 0], np.uint8)
    assert (instance.tolist(), instance.dtype) == ([0, 7, 0], np.int32)


def test_a_table_given_is_for_clouds_that_name_none():
    seventh = cloud([7], [1])
    assert point_labels(seventh, SOURCE)[0].tolist() == [7]
    with pytest.raises(InputError, match=r"a\.ply: class 7 \(point 0\); expected 0 to 1, or 255"):
        point_labels(seventh, SOURCE, TABLE)
    own = cloud([2], [1], (*TABLE, "door"))
    assert point_labels(own, SOURCE, TABLE)[0].tolist() == [2]


@pytest.mark.parametrize(
    ("semantic", "instance", "says"),
    [
        ([0, 256], [1, 1], r"class 256 \(point 1\); expected 0 to 255"),
        ([0, -2], [1, 1], r"class -2 \(point 1\); expected 0 to 255"),
        ([0, 1.5], [1, 1], r"semantic 1\.5 \(point 1\); expected a whole number"),
        ([0, 1], [np.inf, 1], r"instance inf \(point 0\)"),
        ([0, 1], [1, 2**31], r"object 2147483648 \(point 1\); expected at most 2147483647"),
        (["a", "b"], [1, 1], r"semantic <U1 \(2,\)"),
    ],
)
def test_labels_that_make_no_sense_are_named_with_their_point(semantic, instance, says):
    with pytest.raises(InputError, match=says):
        point_labels(cloud(semantic, instance), SOURCE)


@pytest.mark.parametrize("name", ["semantic", "instance"])
def test_points_without_labels_are_refused(name):
    bare = cloud([0], [0])
    del bare.columns[name]
    with pytest.raises(InputError, match=f"points without {name}"):
        point_labels(bare, SOURCE)
