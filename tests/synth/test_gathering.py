"""Class rooms, cafés, workshops and halls with coats hold what they are for."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.synth.rooms.furnish import furnish_room
from mcpseg_cli.synth.surfaces.catalogue import numbered_styles
from mcpseg_cli.synth.things.plain_tables import school_desk, work_bench
from tests.synth.test_furnish import make_room

SCHOOL = numbered_styles()[37]


def furnished(kind, seeds=range(4)):
    """All that stands in some rooms of a kind, room by room."""
    return [
        furnish_room(make_room(kind, seed), SCHOOL, np.random.default_rng(seed)) for seed in seeds
    ]


def count(rooms, name):
    return sum(item.name == name for items in rooms for item in items)


def test_pupils_sit_in_rows_behind_desks_that_face_the_board():
    for seed in range(4):
        (items,) = furnished("classRoom", [seed])
        middles = {name: [i.bounds().mean(axis=0) for i in items if i.name == name]
                   for name in ("table", "chair", "board")}  # fmt: skip
        assert middles["board"]
        desks, chairs = np.array(middles["table"]), np.array(middles["chair"])
        assert len(desks) >= 4
        assert len(chairs) >= 3

        # on average chairs are further from the board than their desks
        far = [np.linalg.norm((each - middles["board"][0])[:, :2], axis=1).mean()
               for each in (desks, chairs)]  # fmt: skip
        assert far[0] < far[1] + 0.2


def test_a_cafe_has_a_bar_tables_and_more_chairs_than_tables():
    rooms = furnished("cafe")
    assert sum(item.home == "kitchen" for items in rooms for item in items) >= 3
    assert count(rooms, "chair") > count(rooms, "table") > 8


def test_a_workshop_has_benches_and_racks():
    rooms = furnished("workshop")
    assert count(rooms, "table") >= 8
    assert count(rooms, "bookcase") >= 4


def test_coats_hang_in_a_cloakroom():
    rooms = furnished("cloakroom")
    hung = [i for items in rooms for i in items if i.name == "clutter" and i.bounds()[0, 2] > 0.4]
    assert len(hung) >= 20


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32), st.floats(0.65, 2.6), st.floats(0.5, 0.85), st.floats(0.68, 0.98))
@pytest.mark.parametrize("make", [school_desk, work_bench])
def test_tables_have_the_size_asked_for(make, seed, width, depth, height):
    item = make(width, depth, height, SCHOOL, np.random.default_rng(seed))
    low, high = item.bounds()
    assert item.name == "table"
    np.testing.assert_allclose(high - low, (width, depth, height), atol=0.06)
    assert low[2] == 0
