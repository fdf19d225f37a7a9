"""What is fitted to walls, kitchens and homes: in its place, of its class, as the style asks."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.synth.geometry.solids import area_of
from mcpseg_cli.synth.rooms.furnish import furnish_room
from mcpseg_cli.synth.surfaces.catalogue import numbered_styles
from mcpseg_cli.synth.surfaces.styles import paint
from mcpseg_cli.synth.things.cabinet_parts import pick_finish, stack
from mcpseg_cli.synth.things.cabinets import CABINET_KINDS, built_in, make_cabinet, sliding_wardrobe
from mcpseg_cli.synth.things.curtains import curtain, louvres, panel_blind, pick_cloth
from mcpseg_cli.synth.things.kitchen_units import base_run, pick_kitchen, tall_unit, wall_run
from tests.synth import test_furnish as rules

HOME_ROOMS = ("livingRoom", "diningRoom", "kitchen", "bedroom", "study", "bathroom", "hallway")
OFFICE_ROOMS = ("office", "conferenceRoom", "storage", "lounge")
CASES = [(17, kind) for kind in HOME_ROOMS] + [(16, kind) for kind in OFFICE_ROOMS]
FLATS = numbered_styles()[17]


@cache
def furnished(number, kind, seed=0):
    """A room with as many cabinets and curtains as there can be."""
    full = numbered_styles()[number].model_copy(update={"cabinets": 1.0, "curtains": 1.0})
    room, rng = rules.make_room(kind, seed), np.random.default_rng(seed)
    return room, tuple(furnish_room(room, full, rng, paint((230, 228, 224), rng)))


@pytest.mark.parametrize(("number", "kind"), CASES)
@pytest.mark.parametrize(
    "rule",
    [
        rules.test_no_object_reaches_into_another,
        rules.test_everything_stays_inside_the_room,
        rules.test_nothing_floats,
        rules.test_doors_and_what_is_taken_stay_free,
        rules.test_a_robot_gets_from_the_door_to_nearly_all_free_floor,
    ],
)
def test_rooms_full_of_joinery_keep_the_rules_of_all_rooms(number, kind, rule, monkeypatch):
    room, items = furnished(number, kind)
    solid = tuple(item for item in items if item.name != "floor")  # rugs may lie before doors
    monkeypatch.setattr(rules, "furnished", lambda kind, seed: (room, solid))
    rule(kind, 0)


def test_a_style_without_cabinets_and_curtains_has_none_fitted():
    bare = FLATS.model_copy(update={"cabinets": 0.0, "curtains": 0.0})
    full = FLATS.model_copy(update={"cabinets": 1.0, "curtains": 1.0})
    room = rules.make_room("bedroom", 1)

    def highest(style):
        items = [i for s in range(4) for i in furnish_room(room, style, np.random.default_rng(s))]
        return sum(item.bounds()[1, 2] > room.ceiling - 0.02 for item in items)

    assert highest(bare) == 0
    assert highest(full) > 0


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 1 << 20), width=st.floats(0.7, 5.0), height=st.floats(1.9, 3.0))
def test_fitted_runs_are_as_wide_and_high_as_they_are_asked_to_be(seed, width, height):
    rng = np.random.default_rng(seed)
    finish = replace(pick_finish(FLATS, rng), handle="none")
    run = built_in((width, 0.5, height), finish, rng).bounds()
    assert abs(run[1, 2] - height) < 1e-6
    assert np.ptp(run[:, 0]) > width - 1e-6


@settings(max_examples=25, deadline=None)
@given(low=st.floats(0, 1), tall=st.floats(0.1, 2), shares=st.lists(st.floats(0.2, 4), min_size=1))
def test_fronts_over_each_other_fill_their_column(low, tall, shares):
    cells = stack(0.0, 0.5, low, low + tall, tuple(shares))
    assert cells[0][1] == pytest.approx(low)
    assert cells[-1][3] == pytest.approx(low + tall)
    for below, above in pairwise(cells):
        assert below[3] == above[1]


@pytest.mark.parametrize("seed", range(6))
def test_all_that_is_fitted_is_clutter_of_sound_triangles(seed):
    rng = np.random.default_rng(seed)
    look, finish, cloth = pick_kitchen(FLATS, rng), pick_finish(FLATS, rng), pick_cloth(FLATS, rng)
    made = [
        base_run(rng.uniform(1, 4), look, rng, wet=True, hot=True)[0],
        wall_run(rng.uniform(0.4, 3), look, rng),
        tall_unit(0.6, 2.2, look, rng),
        built_in((2.4, 0.6, 2.5), finish, rng),
        sliding_wardrobe((2.0, 0.6, 2.2), finish, rng),
        curtain(2.0, 2.3, cloth, FLATS, rng, drawn=rng.uniform(0.1, 1.0)),
        louvres(2.0, 2.2, cloth, rng),
        panel_blind(1.4, 1.2, cloth, rng, slats=bool(seed % 2)),
        *(make_cabinet(kind, FLATS, rng) for kind in CABINET_KINDS),
    ]
    for item in made:
        triangles = np.concatenate([part.triangles for part in item.parts])
        assert item.name == "clutter"
        assert np.isfinite(triangles).all()
        assert area_of(triangles).min() > 1e-10
        assert abs(item.bounds()[0, 1]) < 1e-6


def test_cabinets_come_in_the_paint_of_the_wall_now_and_then():
    rng = np.random.default_rng(0)
    wall = paint((90, 140, 60), rng)
    fronts = [pick_finish(FLATS, rng, wall).front.base for _ in range(200)]
    alike = sum(np.abs(np.array(front) - wall.base).max() < 25 for front in fronts)
    assert 40 < alike < 110


def test_a_kitchen_with_a_hob_says_where_it_is():
    rng = np.random.default_rng(2)
    look = pick_kitchen(FLATS, rng)
    run, hob = base_run(3.0, look, rng, wet=True, hot=True)
    assert hob is not None
    assert abs(hob) < 1.5
    assert run.bounds()[1, 2] > look.height - 1e-6
    assert base_run(3.0, look, rng, wet=False, hot=False)[1] is None


def test_homes_have_kitchens_beds_and_chairs_but_hardly_a_sofa():
    items = [item.name for kind in HOME_ROOMS for item in furnished(17, kind)[1]]
    assert items.count("chair") > 2 * items.count("sofa")
    assert items.count("clutter") > items.count("bookcase")
