"""Floor plans: rooms apart, all within reach, with doors that fit."""

import itertools

import numpy as np
import pytest

from mcpseg_cli.errors import InputError
from mcpseg_cli.synth.building import layout
from mcpseg_cli.synth.building.corridors import join_corridors
from mcpseg_cli.synth.building.layout import plan_area
from mcpseg_cli.synth.building.spaces import Space
from mcpseg_cli.synth.building.walls import leaf_line, wall_of
from mcpseg_cli.synth.surfaces.catalogue import style_of, styles


def plans():
    counts = [16, 8, 24, 12, 44, 16, 16, 16, 16, 16, 16] * 2
    pairs = enumerate(zip(styles() * 2, counts, strict=True))
    return [
        (style, plan_area(style, count, np.random.default_rng(seed)))
        for seed, (style, count) in pairs
    ]


PLANS = plans()


def neighbours(rooms):
    """Pairs of rooms that one can walk between, found by the places of the openings alone."""
    for i, first in enumerate(rooms):
        for j, second in enumerate(rooms):
            for a, b in itertools.product(first.openings, second.openings):
                walls = abs(wall_of(first, a.side)[2] - wall_of(second, b.side)[2])
                faces = a.kind == b.kind != "window" and (a.side + 2) % 4 == b.side and walls < 0.35
                if faces and np.allclose([a.start, a.end], [b.start, b.end]) and a.leaf_deg != 0:
                    yield i, j


@pytest.mark.parametrize(("style", "rooms"), PLANS)
def test_rooms_do_not_overlap_and_have_walls_between_them(style, rooms):
    for i, first in enumerate(rooms):
        for second in rooms[:i]:
            apart = np.maximum(first.low - second.high, second.low - first.high).max()
            assert apart > 0.09, (first.name, second.name)


@pytest.mark.parametrize("count", [2, 3, 8, 16, 44, 120])
def test_a_plan_has_the_number_of_rooms_asked_for(count):
    assert len(plan_area(styles()[0], count, np.random.default_rng(count))) == count


@pytest.mark.parametrize(("style", "rooms"), PLANS)
def test_every_important_kind_occurs_from_eight_rooms_on(style, rooms):
    assert {room.kind for room in rooms} >= {*style.required, "hallway"}


@pytest.mark.parametrize(("style", "rooms"), PLANS)
def test_corridors_are_connected_and_most_rooms_can_be_entered(style, rooms):
    links = list(neighbours(rooms))
    reached = {next(i for i, room in enumerate(rooms) if room.kind == "hallway")}
    for _ in rooms:
        reached |= {j for i, j in links if i in reached}
    assert all(i in reached for i, room in enumerate(rooms) if room.kind == "hallway")
    assert len(reached) >= 0.84 * len(rooms)


@pytest.mark.parametrize("number", [*range(1, 8), 16, 17, 27])
def test_all_corridors_and_rooms_with_an_open_door_are_connected(number):
    for seed in range(50):
        rng = np.random.default_rng([seed, number])
        rooms = plan_area(style_of(number, rng), 16, rng)
        wanted = {
            i
            for i, room in enumerate(rooms)
            if room.kind == "hallway" or any(map(is_open, room.openings))
        }

        # from one of them through all openings
        links = list(neighbours(rooms))
        reached = {min(wanted)}
        for _ in rooms:
            reached |= {j for i, j in links if i in reached}
        assert wanted <= reached, seed


def is_open(opening):
    return opening.kind == "passage" or (
        opening.kind == "door" and not opening.is_dummy and opening.leaf_deg != 0
    )


def test_corridors_that_do_not_meet_are_told_from_those_that_do():
    # the leg shares 1 m with each
    boxes = [(0.0, 0.0, 4.0, 2.0), (4.1, 0.0, 8.0, 2.0), (3.0, 2.12, 5.0, 6.0)]
    rng = np.random.default_rng(0)
    assert not join_corridors([Space("hallway", box, 0.0) for box in boxes], 2.8, rng)
    assert join_corridors([Space("hallway", box, 0.0) for box in boxes[:2]], 2.8, rng)


def test_a_plan_that_cannot_be_drawn_is_refused_in_one_line(monkeypatch):
    monkeypatch.setattr(layout, "join_corridors", lambda *_: False)
    with pytest.raises(
        InputError, match="expected rooms that fit along corridors; try another"
    ) as caught:
        plan_area(styles()[0], 8, np.random.default_rng(0))
    assert "\n" not in str(caught.value)


def test_corridors_of_a_building_share_one_kind_of_ceiling_and_tiles_hide_ducts():
    for _, rooms in PLANS:
        assert len({room.ceiling_kind for room in rooms if room.kind == "hallway"}) == 1
        for room in rooms:
            assert room.ceiling_kind != "acoustic" or not any(
                f.kind in ("duct", "pipe") for f in room.fixtures
            )


@pytest.mark.parametrize(("style", "rooms"), PLANS)
def test_openings_lie_in_their_walls_and_apart_from_each_other(style, rooms):
    for room in rooms:
        for opening in room.openings:
            start, end, _, _ = wall_of(room, opening.side)
            assert start - 1e-9 <= opening.start < opening.end <= end + 1e-9
            assert 0 <= opening.low < opening.high <= room.ceiling + 1e-9
            for other in room.openings:
                if other is not opening and other.side == opening.side:
                    assert other.end <= opening.start or other.start >= opening.end


@pytest.mark.parametrize(("style", "rooms"), PLANS)
def test_doors_are_wide_enough_to_walk_through(style, rooms):
    for room in rooms:
        for opening in room.openings:
            if opening.kind != "window" and not opening.is_dummy:
                assert opening.end - opening.start >= 0.8
                assert opening.low == 0
                assert opening.high >= 1.9


@pytest.mark.parametrize(("style", "rooms"), PLANS)
def test_open_leaves_stay_inside_their_room(style, rooms):
    for room in rooms:
        for opening in room.openings:
            for ends in leaf_line(room, opening):
                assert (np.array(ends) >= room.low - 0.01).all()
                assert (np.array(ends) <= room.high + 0.01).all()


@pytest.mark.parametrize(("style", "rooms"), PLANS)
def test_columns_and_shafts_keep_off_openings_and_each_other(style, rooms):
    for room in rooms:
        standing = [
            f for f in room.fixtures if f.kind in ("column", "round column", "shaft", "radiator")
        ]
        for i, first in enumerate(standing):
            for second in standing[:i]:
                assert (first.low >= second.high).any() or (first.high <= second.low).any()
        assert len(room.taken) >= len(room.fixtures)


def test_the_same_seed_draws_the_same_plan():
    first, second = (plan_area(styles()[2], 16, np.random.default_rng(5)) for _ in range(2))
    assert [(r.name, r.openings, r.low.tolist()) for r in first] == [
        (r.name, r.openings, r.low.tolist()) for r in second
    ]


def test_styles_come_in_turn_and_differ_from_area_eight_on():
    names = [style_of(number, np.random.default_rng(0)).name for number in range(1, 14)]
    assert names[:7] == [style.name for style in styles()[:7]]
    assert names[7:] == [*names[1:6], names[0]]  # no homes among the crosses
    assert (
        style_of(8, np.random.default_rng(3)).walls != style_of(2, np.random.default_rng(3)).walls
    )


def test_homes_have_the_rooms_of_homes_and_others_have_none_of_them():
    kinds = {style.name: set() for style in styles()}
    for style, rooms in PLANS:
        kinds[style.name] |= {room.kind for room in rooms}
    homes = set().union(*(kinds.pop(name) for name in ("homes", "flats", "houses"))) - {"hallway"}
    assert homes <= {"livingRoom", "diningRoom", "kitchen", "bedroom", "study", "bathroom"}
    assert not any(homes & offices for offices in kinds.values())
