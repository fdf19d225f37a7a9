"""Areas named by classes of homes: the same points as ever under finer names."""

from typing import get_args

import numpy as np
import pytest

from mcpseg_cli.classes import HOME_CLASSES, S3DIS_CLASSES
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.s3dis import read_area
from mcpseg_cli.synth.area import make_building
from mcpseg_cli.synth.home_classes import HOME_OF
from mcpseg_cli.synth.models.library import Model, read_models
from mcpseg_cli.synth.models.stand_in import dressed
from mcpseg_cli.synth.things.bookcases import make_bookcase
from mcpseg_cli.synth.things.clutter import CLUTTER_KINDS, make_clutter
from tests.commands import invoke
from tests.synth.models import row, write_models, write_table
from tests.synth.test_things import STYLE

FINER = HOME_CLASSES[len(S3DIS_CLASSES) :]
SMALL = ("--rooms", "3", "--spacing", "0.08", "--seed", "5", "--style", "7", "-q", "--jobs", "1")


@pytest.fixture(scope="module")
def buildings():
    small = {"num_rooms": 5, "spacing": 0.1, "style": 7}
    return make_building(7, 3, **small), make_building(7, 3, **small, classes="home")


def in_order(building):
    """Points with colours, sorted, and what sorts them."""
    points = np.column_stack([building.xyz, building.rgb.astype(np.float32)])
    order = np.lexsort(points.T)
    return points[order], order


def test_the_points_are_the_same(buildings):
    (plain, _), (home, _) = (in_order(building) for building in buildings)
    np.testing.assert_array_equal(plain, home)


def test_finer_names_come_from_clutter_closed_bookcases_and_rugs(buildings):
    (_, order), (_, home_order) = (in_order(building) for building in buildings)
    plain, home = buildings
    assert (plain.classes, home.classes) == (S3DIS_CLASSES, HOME_CLASSES)
    names = np.array(S3DIS_CLASSES)[plain.semantic[order]]
    finer = np.array(HOME_CLASSES)[home.semantic[home_order]]
    came_from = {(str(a), str(b)) for a, b in zip(names, finer, strict=True) if a != b}
    assert {b for _, b in came_from} >= {"bed", "cabinet", "curtain", "kitchen", "lamp", "rug"}
    assert {b for a, b in came_from if a == "floor"} == {"rug"}
    assert {b for a, b in came_from if a == "bookcase"} <= {"cabinet"}
    assert {a for a, _ in came_from} <= {"floor", "bookcase", "clutter"}


def test_objects_are_the_same_but_for_rugs(buildings):
    sizes = []
    for building in buildings:
        rugs = [n for n, name in enumerate(building.object_names, 1) if "/rug_" in name]
        floors = [n for n, name in enumerate(building.object_names, 1) if "/floor_" in name]
        counts = np.bincount(building.instance)
        sizes.append(sorted(np.delete(counts, [0, *rugs, *floors])))
    assert sizes[0] == sizes[1]


def test_every_finer_name_is_a_class_of_homes_and_of_a_known_thing():
    assert set(HOME_OF.values()) <= set(FINER)
    assert set(HOME_OF) <= set(CLUTTER_KINDS)
    assert set(get_args(Model.model_fields["home"].annotation)) == {"", *FINER}


@pytest.mark.parametrize(
    ("kind", "home"), [("iron bed", "bed"), ("chest", "cabinet"), ("toilet", "sanitary")]
)
def test_things_know_their_finer_class(kind, home):
    item = make_clutter(kind, STYLE, np.random.default_rng(0))
    assert (item.name, item.home) == ("clutter", home)


def test_bookcases_are_cabinets_where_doors_hide_all_of_them():
    homes = {
        (make_bookcase("low", STYLE, np.random.default_rng(seed))[0].home) for seed in range(20)
    }
    assert homes == {"", "cabinet"}
    assert make_bookcase("open", STYLE, np.random.default_rng(0))[0].home == ""


# --- models ---


def test_a_model_is_named_as_its_row_says(tmp_path):
    rows = [row("sub/bin.obj", "clutter", "", (0.3, 0.3, 0.3)) | {"home": "box"}]
    write_table(write_models(tmp_path), rows, extra=("home",))
    models = read_models(tmp_path, classes="home")
    style = STYLE.model_copy(update={"models": models})
    assert dressed(models.models[0], style, np.random.default_rng(0)).home == "box"


def test_a_table_of_models_without_finer_classes_is_refused_for_homes_only(tmp_path):
    write_models(tmp_path)
    assert read_models(tmp_path).models
    with pytest.raises(InputError, match=r"models\.csv: no column home; .*; remove it and run"):
        read_models(tmp_path, classes="home")


def test_a_finer_class_that_there_is_not_is_refused(tmp_path):
    rows = [row("sub/bin.obj", "clutter", "", (0.3, 0.3, 0.3)) | {"home": "bin"}]
    write_table(write_models(tmp_path), rows, extra=("home",))
    with pytest.raises(InputError, match=r"models\.csv, line 2: home 'bin'; expected .*'bed'"):
        read_models(tmp_path)


# --- on disk ---


def test_an_area_carries_its_class_table_until_it_is_replaced(tmp_path):
    area = tmp_path / "Area_7"
    loud = [word for word in SMALL if word != "-q"]
    result = invoke("synth", area, *loud, "--classes", "home")
    assert result.exit_code == 0, result.stderr
    rows = {line.split()[0]: line.split() for line in result.stdout.splitlines()}
    assert rows["bed"][4] == "-"  # S3DIS has none
    home, report = read_area(area, use_cache=False)
    assert (home.classes, report.other_classes) == (HOME_CLASSES, ())
    assert (area / "classes.txt").read_text().split() == list(HOME_CLASSES)

    # asked for again, in other classes, and replaced
    assert invoke("synth", area, *SMALL, "--classes", "home").exit_code == 0
    refused = invoke("synth", area, *SMALL)
    assert refused.exit_code == 1
    assert "made with --classes home" in refused.stderr
    assert invoke("synth", area, *SMALL, "--overwrite").exit_code == 0
    plain, _ = read_area(area, use_cache=False)
    assert (plain.classes, len(plain)) == (S3DIS_CLASSES, len(home))
    assert "classes" not in (area / "synth.json").read_text()
