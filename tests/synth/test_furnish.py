"""Furnished rooms: nothing meets, floats, blocks a door or shuts the robot out."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import ndimage

from mcpseg_cli.synth.geometry.collisions import Collisions, upright
from mcpseg_cli.synth.geometry.solids import area_of
from mcpseg_cli.synth.plan import Opening, Room
from mcpseg_cli.synth.rooms.floor_space import FloorSpace
from mcpseg_cli.synth.rooms.furnish import furnish_room
from mcpseg_cli.synth.surfaces.catalogue import numbered_styles
from tests.synth.test_things import STYLE

SIZES = {
    "hallway": (2.3, 15.0),
    "office": (4.0, 5.0),
    "conferenceRoom": (5.0, 7.0),
    "lounge": (5.5, 6.0),
    "storage": (3.0, 4.0),
    "openspace": (9.0, 11.0),
    "lobby": (6.0, 8.0),
    "pantry": (4.0, 5.0),
    "copyRoom": (3.0, 4.0),
    "WC": (3.4, 4.5),
    "livingRoom": (4.2, 5.2),
    "diningRoom": (3.4, 4.0),
    "kitchen": (3.0, 3.8),
    "bedroom": (3.4, 4.2),
    "study": (2.8, 3.6),
    "bathroom": (2.4, 3.2),
    "classRoom": (6.5, 7.5),
    "cafe": (6.0, 7.0),
    "workshop": (5.5, 6.5),
    "cloakroom": (3.2, 4.2),
}
CASES = [(kind, seed) for kind in SIZES for seed in (0, 1)] + [
    ("office", seed) for seed in range(2, 7)
]


def make_room(kind, seed):
    """A room of a kind with a door, windows opposite and at times a column, its corner anywhere."""
    rng = np.random.default_rng([seed, len(kind)])
    size = np.array(SIZES[kind]) * rng.uniform(0.9, 1.15, 2)
    size = size[::-1] if rng.random() < 0.5 else size
    low = rng.uniform(-20, 20, 2)
    high, ceiling, side = low + size, rng.uniform(2.6, 3.1), int(rng.integers(4))

    # a door and windows opposite
    start = low[side % 2] + rng.uniform(0.2, size[side % 2] - 1.2)
    openings = [Opening("door", side, start, start + 0.9, 0.0, 2.1)]
    sill = rng.choice([0.4, 0.9])
    corners = np.arange(0.4, size[side % 2] - 1.5, 2.0) + low[side % 2]
    openings += [
        Opening("window", (side + 2) % 4, corner, corner + 1.4, sill, 2.2) for corner in corners
    ]

    taken = []
    if rng.random() < 0.4:
        spot = low + size * rng.uniform(0.3, 0.7, 2)
        taken.append(np.array([[*spot, 0.0], [*(spot + 0.3), ceiling]]))
    return Room(f"{kind}_1", kind, low, high, ceiling, tuple(openings), tuple(taken))


@cache
def furnished(kind, seed):
    room = make_room(kind, seed)
    return room, tuple(furnish_room(room, STYLE, np.random.default_rng(seed)))


def points_on(triangles, spacing=0.03):
    """Points all over triangles: one at least in each, a random spread otherwise."""
    rng = np.random.default_rng(0)
    area = area_of(triangles)
    count = 1 + np.floor(area / spacing**2).astype(int)
    rows = np.repeat(np.arange(len(triangles)), count)
    u, v = np.sqrt(rng.random(len(rows))), rng.random(len(rows))
    weights = np.stack([1 - u, u * (1 - v), u * v], axis=1)
    return np.einsum("nk,nkc->nc", weights, triangles[rows])


def in_own_frame(part, xyz):
    cosine, sine = np.cos(part.yaw), np.sin(part.yaw)
    return (xyz - part.origin) @ np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])


@pytest.mark.parametrize(("kind", "seed"), CASES)
def test_no_object_reaches_into_another(kind, seed):
    _, items = furnished(kind, seed)
    clouds = [points_on(np.concatenate([part.triangles for part in item.parts])) for item in items]
    bounds = [item.bounds() for item in items]
    for number, item in enumerate(items):
        for other, cloud in enumerate(clouds):
            if (
                other == number
                or (bounds[other][0] > bounds[number][1]).any()
                or (bounds[other][1] < bounds[number][0]).any()
            ):
                continue

            # no point of the other lies 5 mm inside a part
            for part in item.parts:
                own = in_own_frame(part, cloud)
                inside = ((own > part.low + 0.005) & (own < part.high - 0.005)).all(axis=1)
                assert not inside.any(), (item.name, items[other].name)


@pytest.mark.parametrize(("kind", "seed"), CASES)
def test_everything_stays_inside_the_room(kind, seed):
    room, items = furnished(kind, seed)
    for item in items:
        low, high = item.bounds()
        assert (low > [*(room.low - 1e-3), -1e-3]).all()
        assert (high < [*(room.high + 1e-3), room.ceiling + 1e-3]).all()


@pytest.mark.parametrize(("kind", "seed"), CASES)
def test_nothing_floats(kind, seed):
    room, items = furnished(kind, seed)
    flat = [np.concatenate([part.triangles for part in item.parts]) for item in items]
    tops = [np.unique(np.round(t[np.ptp(t[..., 2], axis=1) < 1e-4][:, 0, 2], 3)) for t in flat]
    for number, item in enumerate(items):
        low, high = item.bounds()

        # on the floor, at a wall or the ceiling, or on top of something
        on_floor = low[2] < 0.002 or item.name == "floor"
        at_wall = (low[:2] - room.low < 0.01).any() or (room.high - high[:2] < 0.01).any()
        at_ceiling = room.ceiling - high[2] < 0.01
        middle = (low + high)[:2] / 2
        held = any(
            other != number
            and len(top)
            and np.abs(top - low[2]).min() < 0.002
            and (items[other].bounds()[0, :2] < middle).all()
            and (items[other].bounds()[1, :2] > middle).all()
            for other, top in enumerate(tops)
        )
        assert on_floor or at_wall or at_ceiling or held, (item.name, low, high)


@pytest.mark.parametrize(("kind", "seed"), CASES)
def test_doors_and_what_is_taken_stay_free(kind, seed):
    room, items = furnished(kind, seed)
    taken = [box + np.array([[0.005], [-0.005]]) for box in room.taken]

    # 0.6 m before each door
    for opening in (opening for opening in room.openings if opening.kind == "door"):
        axis = 1 - opening.side % 2
        near = room.low[axis] if opening.side in (0, 3) else room.high[axis] - 0.6
        box = np.empty((2, 3))
        box[:, 1 - axis] = opening.start + 0.005, opening.end - 0.005
        box[:, axis], box[:, 2] = (near, near + 0.6), (0.0, opening.high)
        taken.append(box)

    for item in items:
        cloud = points_on(np.concatenate([part.triangles for part in item.parts]))
        for low, high in taken:
            assert not ((cloud > low) & (cloud < high)).all(axis=1).any(), item.name


@pytest.mark.parametrize(("kind", "seed"), CASES)
def test_boards_and_bookcases_do_not_cover_windows(kind, seed):
    room, items = furnished(kind, seed)
    for opening in (opening for opening in room.openings if opening.kind == "window"):
        axis = 1 - opening.side % 2
        wall = room.low[axis] if opening.side in (0, 3) else room.high[axis]
        for item in (item for item in items if item.name in ("board", "bookcase")):
            cloud = points_on(np.concatenate([part.triangles for part in item.parts]))

            # points within 9 cm of the pane
            before = np.abs(cloud[:, axis] - wall) < 0.09
            before &= (cloud[:, 1 - axis] > opening.start + 0.01) & (
                cloud[:, 1 - axis] < opening.end - 0.01
            )
            assert not (
                before & (cloud[:, 2] > opening.low + 0.01) & (cloud[:, 2] < opening.high - 0.01)
            ).any()


@pytest.mark.parametrize(("kind", "seed"), CASES)
def test_a_robot_gets_from_the_door_to_nearly_all_free_floor(kind, seed):
    room, items = furnished(kind, seed)
    shape = np.floor((room.high - room.low) / 0.05).astype(int)
    blocked = np.zeros(tuple(shape + 2), bool)
    blocked[[0, -1]] = blocked[:, [0, -1]] = True

    # what stands in the room, and what is taken
    triangles = np.concatenate(
        [part.triangles for item in items for part in item.parts if item.name != "floor"]
    )
    cloud = points_on(triangles)
    boxes = [box for box in room.taken if box[1, 2] > room.ceiling - 0.1]
    cells = ((cloud[cloud[:, 2] < 1.5][:, :2] - room.low) / 0.05).astype(int) + 1
    cells = cells.clip(0, np.array(blocked.shape) - 1)
    blocked[cells[:, 0], cells[:, 1]] = True
    for box in boxes:
        low, high = ((box[:, :2] - room.low) / 0.05).astype(int) + 1
        blocked[low[0] : high[0] + 1, low[1] : high[1] + 1] = True

    # less than the robot's 0.26 m by a cell
    free = ndimage.distance_transform_edt(~blocked) * 0.05 > 0.21
    labels, _ = ndimage.label(free)

    # what it reaches from the door
    door = room.openings[0]
    axis = 1 - door.side % 2
    spot = np.empty(2)
    spot[1 - axis] = (door.start + door.end) / 2
    spot[axis] = room.low[axis] + 0.4 if door.side in (0, 3) else room.high[axis] - 0.4
    cell = ((spot - room.low) / 0.05).astype(int) + 1
    around = labels[cell[0] - 3 : cell[0] + 4, cell[1] - 3 : cell[1] + 4]
    reached = np.isin(labels, around[around > 0])
    assert reached.sum() > 0.85 * free.sum()


def test_an_open_leaf_is_in_the_robots_way():
    low, door = np.zeros(2), Opening("door", 0, 1.0, 1.9, 0.0, 2.1, leaf_deg=90.0)
    ajar, bare = (
        FloorSpace(Room("office_1", "office", low, low + 4.0, 2.6, (opening,), ()))
        for opening in (door, replace(door, leaf_deg=-1.0))
    )
    # beside the leaf, which stands at x = 1.05 and reaches to y = 0.86
    assert not ajar.free[8:12, 6].any()
    assert bare.free[8:12, 6].all()


def test_the_same_seed_furnishes_a_room_the_same():
    room, first = furnished("office", 3)
    second = furnish_room(room, STYLE, np.random.default_rng(3))
    assert [item.name for item in first] == [item.name for item in second]
    for one, other in zip(first, second, strict=True):
        for part, twin in zip(one.parts, other.parts, strict=True):
            np.testing.assert_array_equal(part.triangles, twin.triangles)


def test_rooms_hold_what_their_kind_suggests():
    wanted = {
        "office": {"table", "chair", "bookcase", "clutter"},
        "conferenceRoom": {"table", "chair"},
        "lounge": {"sofa"},
        "livingRoom": {"sofa", "table", "bookcase", "clutter"},
        "diningRoom": {"table", "chair"},
        "bedroom": {"bookcase", "clutter"},
    }
    for kind, classes in wanted.items():
        found = {item.name for seed in (0, 1) for item in furnished(kind, seed)[1]}
        assert classes <= found, kind


def test_a_hallway_keeps_a_way_of_more_than_a_metre():
    for seed in (0, 1):
        room, items = furnished("hallway", seed)
        axis = int(np.argmin(room.high - room.low))
        spans = np.array([item.bounds()[:, axis] for item in items if item.bounds()[0, 2] < 1.5])
        middle = (room.low[axis] + room.high[axis]) / 2
        low = spans[spans[:, 0] + spans[:, 1] < 2 * middle, 1].max(initial=room.low[axis])
        high = spans[spans[:, 0] + spans[:, 1] >= 2 * middle, 0].min(initial=room.high[axis])
        assert high - low > 1.1


def test_a_corridor_of_a_home_has_no_boards_and_keeps_a_way():
    for seed in (0, 1):
        room = make_room("hallway", seed)
        items = furnish_room(room, numbered_styles()[27], np.random.default_rng(seed))
        assert items
        assert "board" not in {item.name for item in items}


def test_a_tiny_room_stays_empty_rather_than_failing():
    low = np.zeros(2)
    door = Opening("door", 0, 0.1, 0.7, 0.0, 2.0)
    room = Room("storage_9", "storage", low, low + 0.8, 2.4, (door,), ())
    assert len(furnish_room(room, STYLE, np.random.default_rng(0))) <= 5


@pytest.mark.parametrize("seed", range(30))
def test_collisions_agree_with_points_in_boxes(seed):
    rng = np.random.default_rng(seed)
    there = upright(np.zeros(3), rng.uniform(0.2, 1, 3))
    new = upright(np.zeros(3), rng.uniform(0.2, 1, 3))
    yaw = rng.uniform(0, 6.28)
    new[:, :2], new[:, 2:4] = rng.uniform(-0.8, 0.8, 2), (np.cos(yaw), np.sin(yaw))

    # points all over the new one
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 60)] * 2), axis=-1).reshape(-1, 2)
    own = grid * new[0, 4:6]
    xy = new[0, :2] + own[:, :1] * new[0, 2:4] + own[:, 1:] * [-new[0, 3], new[0, 2]]
    meets = (np.abs(xy - there[0, :2]) < there[0, 4:6]).all(axis=1).any()

    # they are up to 3 cm apart
    exact, lenient = Collisions(slack=0.0), Collisions(slack=0.03)
    exact.add(there)
    lenient.add(there)
    assert exact.meets(new) >= meets
    assert lenient.meets(new) <= meets


def test_boxes_over_each_other_do_not_collide():
    collisions = Collisions()
    collisions.add(upright(np.zeros(3), np.ones(3)))
    assert not collisions.meets(upright(np.array([0, 0, 1.0]), np.array([1, 1, 2.0])))
    assert collisions.meets(upright(np.array([0, 0, 0.9]), np.array([1, 1, 2.0])))
