"""The one check of labels that truth, maps, buildings and training share."""

from pathlib import Path

import numpy as np
import pytest

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import Cloud, read_cloud, write_cloud
from mcpseg_cli.formats.labels import LabelFields, confidence_column, point_labels

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


@pytest.mark.parametrize(
    ("semantic", "instance"),
    [
        ("label", "object_id"),
        ("scalar_Label", "scalar_Instance"),
        ("class", "inst"),
        ("sem", "objectId"),
        ("Semantic_Label", "instance label"),
        ("classification", "obj"),
    ],
)
def test_labels_are_found_under_usual_names(semantic, instance):
    columns = {axis: np.zeros(2, np.float32) for axis in "xyz"}
    columns |= {semantic: np.array([1.0, 0.0]), instance: np.array([5, 6])}
    found = point_labels(Cloud(columns), SOURCE)
    assert (found[0].tolist(), found[1].tolist()) == ([1, 0], [5, 6])


def test_labels_are_those_of_the_fields_named():
    labelled = cloud([0, 0], [1, 1])
    labelled.columns["mine"] = np.array([3, 4])
    fields = LabelFields("mine", "mine")
    semantic, instance = point_labels(labelled, SOURCE, fields=fields)
    assert (semantic.tolist(), instance.tolist()) == ([3, 4], [3, 4])


def test_fields_that_are_not_there_are_refused_with_those_that_are():
    with pytest.raises(InputError, match="no attribute lable among x, y, z, semantic, instance"):
        point_labels(cloud([0], [1]), SOURCE, fields=LabelFields("lable"))


def test_classifications_of_the_las_standard_are_no_classes(tmp_path):
    columns = {axis: np.zeros(2) for axis in "xyz"} | {"instance": np.ones(2, np.int32)}
    write_cloud(tmp_path / "a.las", Cloud(columns))
    las = read_cloud(tmp_path / "a.las")
    las.columns["classification"] = np.array([2, 6], np.uint8)
    with pytest.raises(InputError, match="classification 6, of the LAS standard"):
        point_labels(las, SOURCE)
    given = point_labels(las, SOURCE, fields=LabelFields("classification"))
    assert given[0].tolist() == [2, 6]
    las.columns["classification"] = np.array([64, 66], np.uint8)
    assert point_labels(las, SOURCE)[0].tolist() == [0, 2]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("bits", [0x7FA00000, 0x7FC00000, 0x7F800000])
def test_confidence_that_is_no_number_of_any_kind_is_refused(bits):
    columns = {axis: np.zeros(3) for axis in "xyz"}
    confidence = np.array([0, bits, 0], np.uint32).view(np.float32)
    with pytest.raises(InputError, match="confidence that is no number"):
        confidence_column(Cloud(columns | {"confidence": confidence}), Path("map.ply"))
