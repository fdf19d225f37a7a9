"""The furniture catalogue: right class, on the floor, sensible sizes, sound triangles."""

import numpy as np
import pytest

from mcpseg_cli.synth.geometry import shapes
from mcpseg_cli.synth.geometry.solids import area_of
from mcpseg_cli.synth.surfaces.catalogue import styles
from mcpseg_cli.synth.things.boards import BOARD_KINDS, make_board
from mcpseg_cli.synth.things.bookcases import BOOKCASE_KINDS, make_bookcase
from mcpseg_cli.synth.things.chairs import CHAIR_DESIGNS, make_chair
from mcpseg_cli.synth.things.clutter import CLUTTER_KINDS, make_clutter
from mcpseg_cli.synth.things.home_sofas import make_home_sofa
from mcpseg_cli.synth.things.sofas import make_sofa
from mcpseg_cli.synth.things.tables import TABLE_DESIGNS, make_table

STYLE = styles()[0].model_copy(
    update={
        "name": "test",
        "wood": ((150, 105, 65), (190, 150, 105)),
        "upholstery": ((60, 80, 120), (120, 50, 50)),
        "metal": ((170, 172, 176), (60, 60, 64)),
        "plastic": ((230, 230, 228), (60, 62, 66)),
        "fabric": ("weave", "plain"),
        "table_tops": ("wood", "plain"),
        "chairs": ("task", "four-leg"),
        "tables": ("desk", "round"),
        "tidiness": 0.4,
    }
)
SIZES = {
    "four-leg": ((0.38, 0.4, 0.7), (0.75, 0.8, 1.05)),
    "stool": ((0.3, 0.3, 0.4), (0.6, 0.6, 0.85)),
    "task": ((0.5, 0.5, 0.8), (0.8, 0.95, 1.5)),
    "executive": ((0.55, 0.6, 1.0), (0.85, 1.1, 1.4)),
    "armchair": ((0.55, 0.55, 0.6), (0.95, 1.0, 1.05)),
    "folding": ((0.38, 0.45, 0.7), (0.55, 0.75, 0.95)),
    "cantilever": ((0.42, 0.5, 0.7), (0.6, 0.8, 1.0)),
    "bench": ((0.9, 0.28, 0.4), (2.3, 0.8, 1.0)),
    "desk": ((1.1, 0.55, 0.68), (2.0, 0.95, 0.8)),
    "round": ((0.65, 0.65, 0.68), (1.35, 1.35, 0.8)),
    "conference": ((2.3, 0.9, 0.68), (5.1, 1.6, 0.8)),
    "trestle": ((1.2, 0.6, 0.68), (2.1, 1.0, 0.8)),
    "coffee": ((0.6, 0.4, 0.3), (1.4, 1.4, 0.55)),
    "corner": ((1.4, 1.2, 0.68), (2.1, 1.9, 0.8)),
    "side": ((0.28, 0.28, 0.4), (0.6, 0.6, 0.65)),
    "standing": ((1.1, 0.6, 0.7), (1.9, 0.85, 1.15)),
    "pedestal": ((0.45, 0.45, 0.68), (0.85, 0.85, 1.1)),
}


def catalogue(seed):
    """Every entry of the catalogue: name, class, objects."""
    rng = np.random.default_rng(seed)
    for design in CHAIR_DESIGNS:
        yield design, "chair", [make_chair(design, STYLE, rng)]
    for design in TABLE_DESIGNS:
        yield design, "table", [make_table(design, STYLE, rng)]

    # seats for several
    for seats in (1, 2, 3):
        yield f"sofa {seats}", "sofa", [make_sofa(seats, STYLE, rng)]
    for corner in (-1.0, 0.0, 1.0):
        yield f"home sofa {corner}", "sofa", [make_home_sofa(2, STYLE, rng, corner).item]

    for kind in BOOKCASE_KINDS:
        yield kind, "bookcase", make_bookcase(kind, STYLE, rng)
    for kind in BOARD_KINDS:
        yield kind, "board", [make_board(kind, STYLE, rng)]
    for kind in CLUTTER_KINDS:
        yield kind, "clutter", [make_clutter(kind, STYLE, rng)]


SEEDS = range(6)


@pytest.mark.parametrize("seed", SEEDS)
def test_every_entry_has_its_class_and_the_rest_is_clutter(seed):
    for name, expected, items in catalogue(seed):
        assert items[0].name == expected, name
        assert {item.name for item in items[1:]} <= {"clutter"}, name


@pytest.mark.parametrize("seed", SEEDS)
def test_every_entry_stands_on_the_floor_with_its_back_at_zero(seed):
    for name, _, items in catalogue(seed):
        low = items[0].bounds()[0]
        assert abs(low[2]) < 1e-3, name
        assert abs(low[1]) < 1e-3, name


@pytest.mark.parametrize("seed", SEEDS)
def test_every_entry_is_centred_between_its_sides(seed):
    for name, _, items in catalogue(seed):
        low, high = items[0].bounds()
        assert abs(low[0] + high[0]) < 0.05, name


@pytest.mark.parametrize("seed", SEEDS)
def test_triangles_are_finite_and_have_an_area(seed):
    for name, _, items in catalogue(seed):
        triangles = np.concatenate([part.triangles for item in items for part in item.parts])
        assert np.isfinite(triangles).all(), name
        assert area_of(triangles).min() > 1e-10, name
        assert 10 < len(triangles) < 6000, name


@pytest.mark.parametrize("seed", SEEDS)
def test_chairs_and_tables_have_sensible_sizes(seed):
    for name, _, items in catalogue(seed):
        if name in SIZES:
            size = np.ptp(items[0].bounds(), axis=0)
            assert (size >= SIZES[name][0]).all(), (name, size)
            assert (size <= SIZES[name][1]).all(), (name, size)


@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_is_smaller_than_a_mug_or_larger_than_a_meeting_table(seed):
    for name, _, items in catalogue(seed):
        size = np.ptp(items[0].bounds(), axis=0)
        assert size.max() > 0.05, name
        assert (size < [5.1, 3.0, 2.6]).all(), (name, size)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_box_of_each_part_holds_its_triangles_tightly(seed):
    for name, _, items in catalogue(seed):
        for part in (part for item in items for part in item.parts):
            cosine, sine = np.cos(part.yaw), np.sin(part.yaw)
            turn = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
            own = (part.triangles.reshape(-1, 3) - part.origin) @ turn
            np.testing.assert_allclose(own.min(axis=0), part.low, atol=1e-6, err_msg=name)
            np.testing.assert_allclose(own.max(axis=0), part.high, atol=1e-6, err_msg=name)


def test_the_same_seed_gives_the_same_furniture():
    for (name, _, first), (_, _, second) in zip(catalogue(3), catalogue(3), strict=True):
        for one, other in zip(first, second, strict=True):
            for part, twin in zip(one.parts, other.parts, strict=True):
                assert part.material == twin.material, name
                np.testing.assert_array_equal(part.triangles, twin.triangles)


def test_two_seeds_give_different_furniture():
    for (name, _, first), (_, _, second) in zip(catalogue(1), catalogue(2), strict=True):
        sizes = [np.ptp(items[0].bounds(), axis=0) for items in (first, second)]
        same_shape = np.allclose(*sizes, atol=1e-4)
        assert not same_shape or first[0].parts[0].material != second[0].parts[0].material, name


@pytest.mark.parametrize("corner", [-1.0, 1.0])
@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_of_a_corner_sofa_stands_where_its_table_goes(corner, seed):
    sofa = make_home_sofa(3, STYLE, np.random.default_rng(seed), corner)
    xyz = np.concatenate([part.triangles.reshape(-1, 3) for part in sofa.item.parts])
    before = (np.abs(xyz[:, 0] - sofa.middle) < 0.3) & (xyz[:, 1] > sofa.depth + 0.08)
    assert xyz[:, 1].max() > sofa.depth + 0.3  # the corner reaches out beside it
    assert not before.any()


def test_there_are_many_kinds_of_clutter():
    assert len(CLUTTER_KINDS) >= 50


def test_an_unknown_design_is_an_error():
    with pytest.raises(KeyError):
        make_chair("throne", STYLE, np.random.default_rng(0))


def test_the_top_is_the_first_part_of_a_table():
    for design in TABLE_DESIGNS:
        table = make_table(design, STYLE, np.random.default_rng(5))
        assert table.parts[0].triangles[..., 2].max() == pytest.approx(
            table.bounds()[1, 2], abs=0.01
        )


def test_things_on_shelves_lie_between_the_sides_of_the_bookcase():
    for seed in SEEDS:
        bookcase, *things = make_bookcase("open", STYLE, np.random.default_rng(seed))
        low, high = bookcase.bounds()
        for thing in things:
            assert (thing.bounds()[0] > low - 1e-3).all()
            assert (thing.bounds()[1] < high + np.array([1e-3, 0.02, 1e-3])).all()


def test_boxes_face_outwards():
    triangles = shapes.boxes([(0, 0, 0)], [(1, 2, 3)])
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    outwards = triangles.mean(axis=1) - [0.5, 1, 1.5]
    assert (np.einsum("fc,fc->f", normal, outwards) > 0).all()


@pytest.mark.parametrize(
    "triangles",
    [
        shapes.cushion((-1, -1, -1), (1, 1, 1)),
        shapes.lathe([(0, -1), (1, -1), (1, 1), (0, 1)]),
        shapes.slab(shapes.ellipse(2, 1), -1, 1),
        shapes.slab(shapes.rectangle(2, 1, 0.2), -1, 1),
        shapes.pipe([(0, 0, -1), (0, 0, 1)], 0.1),
        shapes.slanted((0, 0, -1), (0, 0, 1), (0.1, 0.1)),
    ],
)
def test_closed_shapes_face_outwards(triangles):
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    facing = np.einsum("fc,fc->f", normal, triangles.mean(axis=1))
    assert facing.sum() > 0
    assert (facing > -1e-9).all()


def test_a_shell_is_as_thick_as_asked():
    x, z = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 4), indexing="ij")
    sheet = shapes.shell(np.stack([x, np.zeros_like(x), z], axis=-1), 0.1)
    assert np.ptp(sheet[..., 1]) == pytest.approx(0.1)
