"""Rugs: of class floor, which is cut out under them, as they are under later ones."""

import numpy as np
import pytest

from mcpseg_cli.synth.building.rugs import lay_rugs, make_rug
from mcpseg_cli.synth.geometry.shapes import ellipse, rectangle
from mcpseg_cli.synth.geometry.solids import Item, area_of, box, part_of, quad
from tests.synth.test_things import STYLE

FLOOR = Item("floor", (part_of(quad((0, 0, 0), (5, 0, 0), (0, 4, 0)), STYLE.floors[0]),))
CHAIR = Item("chair", (part_of(box((1, 1, 0), (1.4, 1.4, 0.5)), STYLE.floors[0]),))


@pytest.mark.parametrize("seed", range(12))
def test_floor_and_rugs_cover_the_room_once(seed):
    rng = np.random.default_rng(seed)
    outlines = [rectangle(1.4, 0.9), ellipse(1.1, 1.1), rectangle(1.2, 0.8, 0.1)]
    spots = [(1.2, 1.2), (3.6, 1.4), (2.4, 3.0)]
    rugs = [
        make_rug(outline, STYLE, rng).moved(x=x, y=y, yaw=rng.uniform(0, 6))
        for outline, (x, y) in zip(outlines, spots, strict=True)
    ]

    # floors of the room's size that face up, where the floor was
    laid = lay_rugs([FLOOR, CHAIR, *rugs])
    assert [item.name for item in laid] == ["floor", "floor", "floor", "floor", "chair"]
    assert [item.home for item in laid[:4]] == ["", "rug", "rug", "rug"]
    triangles = np.concatenate([part.triangles for item in laid[:4] for part in item.parts])
    assert area_of(triangles).sum() == pytest.approx(20.0, abs=1e-4)
    sides = triangles[:, 1:, :2] - triangles[:, :1, :2]
    assert (sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0] > 0).all()

    # each point lies in one of its triangles
    xy = rng.uniform((0, 0), (5, 4), (400, 2))
    assert (_covers(triangles, xy) == 1).all()


def _covers(triangles, xy):
    """How many of the triangles each point lies in."""
    inside = np.ones((len(xy), len(triangles)), bool)
    for first, last in ((0, 1), (1, 2), (2, 0)):
        start, step = triangles[:, first, :2], triangles[:, last, :2] - triangles[:, first, :2]
        inside &= (
            step[:, 0] * (xy[:, None, 1] - start[:, 1])
            - step[:, 1] * (xy[:, None, 0] - start[:, 0])
            > 0
        )
    return inside.sum(axis=1)


def test_a_rug_that_covers_the_whole_floor_replaces_it():
    rug = make_rug(rectangle(6.0, 5.0), STYLE, np.random.default_rng(0)).moved(x=2.5, y=2.0)
    assert lay_rugs([FLOOR, rug]) == [rug]


def test_rooms_without_rugs_are_left_as_they_are():
    items = [FLOOR, CHAIR]
    assert all(one is other for one, other in zip(lay_rugs(items), items, strict=True))
