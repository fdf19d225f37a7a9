"""Which areas are trained on, and class tables."""

import pytest

from mcpseg_cli.errors import InputError
from mcpseg_cli.train.class_table import trained_classes
from mcpseg_cli.train.folds import find_areas, make_folds
from tests.areas import write_area


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("data")
    for name in ("seed_1/Area_1", "seed_1/Area_3", "seed_2/Area_3", "hall"):
        write_area(folder / name, 1, density=0.1)
    return folder


def test_areas_are_found_in_folders_of_folders(data):
    areas = find_areas(data)
    assert [(area.name, area.number) for area in areas] == [
        ("hall", None), ("seed_1/Area_1", 1), ("seed_1/Area_3", 3), ("seed_2/Area_3", 3),
    ]  # fmt: skip


def test_areas_may_be_links_and_are_found_once_where_links_run_in_circles(data, tmp_path):
    (tmp_path / "Area_9").symlink_to(data / "seed_1/Area_1")
    (tmp_path / "round").symlink_to(tmp_path)
    assert [area.number for area in find_areas(tmp_path)] == [9]


def test_one_area_may_be_named_itself(data):
    assert [area.name for area in find_areas(data / "hall")] == ["hall"]


def test_all_areas_of_a_number_are_held_out(data):
    (fold,) = make_folds(find_areas(data), "3", data)
    assert [area.name for area in fold.validation] == ["seed_1/Area_3", "seed_2/Area_3"]
    assert [area.name for area in fold.training] == ["hall", "seed_1/Area_1"]
    assert fold.label == "holdout3"


@pytest.mark.parametrize(
    ("holdout", "numbers"), [("all", [1, 3]), ("3,1", [3, 1]), ("none", [None])]
)
def test_folds_come_one_after_the_other(holdout, numbers, data):
    assert [fold.holdout for fold in make_folds(find_areas(data), holdout, data)] == numbers


def test_an_area_not_traced_to_the_end_is_refused(tmp_path):
    area = write_area(tmp_path / "Area_1", 1, density=0.1)
    (area / "raytrace.json").write_text('{"complete": false}')
    with pytest.raises(
        InputError, match="Area_1: not traced to the end; expected all scans; run its"
    ):
        find_areas(tmp_path)


def test_the_classes_of_a_table_are_trained_in_its_order():
    table = {"armchair": "chair", "sofa": "chair", "laminate": "floor"}
    assert trained_classes([("sofa", "person")], table) == ("chair", "floor")


def test_without_a_table_all_classes_of_the_data_are_trained():
    assert trained_classes([("a", "b"), ("b", "c")], None) == ("a", "b", "c")


@pytest.mark.parametrize(
    "classes", [("a,b", "c"), ("a\x07", "c"), tuple(f"c{n}" for n in range(255))]
)
def test_class_tables_of_the_data_that_labels_cannot_hold_are_refused(classes):
    with pytest.raises(
        InputError, match=r"class tables of the data: .*; expected up to 254 names.*--classes"
    ):
        trained_classes([classes], None)
