"""Floor plans: where the floor is and where a robot can stand on it."""

from itertools import product

import numpy as np
import pytest

from mcpseg_cli.errors import InputError
from mcpseg_cli.raytrace.floor_plan import build_floor_plan
from tests.worlds import HEIGHT, box, rectangle, room, three_rooms, wall


def slow_floor_plan(xyz, cell_size, clearance_low, clearance_high):
    """Follow the paper's program: floors are a dictionary of heights, free cells a set."""
    cells = [
        tuple(cell)
        for cell in np.floor(xyz[:, :2].astype(float) / cell_size + 0.5).astype(int).tolist()
    ]
    lowest = {}
    for cell, z in zip(cells, xyz[:, 2], strict=True):
        lowest[cell] = min(z, lowest.get(cell, z))
    near = list(product(range(-2, 3), repeat=2))
    beside = list(product(range(-1, 2), repeat=2))
    around = {cell: [(cell[0] + x, cell[1] + y) for x, y in near] for cell in lowest}
    around |= {
        cell: [(cell[0] + x, cell[1] + y) for x, y in near]
        for places in around.values()
        for cell in places
    }
    floor = {
        cell: min(lowest[other] for other in places if other in lowest)
        for cell, places in around.items()
        if any(other in lowest for other in places)
    }
    seen = {cell for cell in lowest if lowest[cell] <= floor[cell] + np.float32(clearance_low)}
    grown = {(x + dx, y + dy) for x, y in seen for dx, dy in beside}
    closed = {(x, y) for x, y in grown if all((x + dx, y + dy) in grown for dx, dy in beside)}
    low, high = np.float32(clearance_low), np.float32(clearance_high)
    blocked = {
        cell for cell, z in zip(cells, xyz[:, 2], strict=True) if low < z - floor[cell] < high
    }
    return floor, without_bridges_to_nowhere(closed - blocked, seen)


def without_bridges_to_nowhere(free, seen):
    """Return the cells that are joined to one in which a floor was seen."""
    kept = free & seen
    edge = kept
    while edge:
        edge = {
            (x + dx, y + dy) for x, y in edge for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1))
        } & free - kept
        kept = kept | edge
    return kept


def free_cells(plan):
    return {tuple(cell) for cell in (np.argwhere(plan.free) + plan.low).tolist()}


@pytest.mark.parametrize("seed", range(5))
def test_the_plan_is_what_the_slow_program_finds(seed):
    rng = np.random.default_rng(seed)
    floor = rectangle((-2.0, 1.0, 0.0), (3.0, 5.0, 0.0), spacing=0.1)
    floor[:, 2] = rng.uniform(0, 0.09, len(floor))
    hidden = np.isin(np.floor(floor[:, :2] / 0.2 + 0.5) @ [100, 1], rng.integers(-1500, 1600, 400))
    above = rng.uniform((-2.0, 1.0, 0.0), (3.0, 5.0, 3.0), (250, 3))
    ceiling = rectangle((-2.0, 1.0, 2.6), (3.0, 5.0, 2.6), spacing=0.15)
    xyz = np.concatenate([floor[~hidden], above, ceiling]).astype(np.float32)
    plan = build_floor_plan(xyz)
    heights, free = slow_floor_plan(xyz, 0.2, 0.1, 1.4)
    assert free_cells(plan) == free
    assert 0 < len(free) < 0.9 * plan.free.size
    found = np.argwhere(np.isfinite(plan.floor))
    assert [heights[tuple(cell)] for cell in (found + plan.low).tolist()] == plan.floor[
        tuple(found.T)
    ].tolist()


def test_rooms_joined_by_a_doorway_are_one_region_and_a_closed_room_is_another():
    plan = build_floor_plan(three_rooms())
    first, second, third = plan.region_at(np.array([[0.6, 0.6], [6.0, 2.0], [10.0, 2.0]]))
    assert (first, second, third) == (1, 1, 2)


def test_a_robot_stands_neither_in_walls_nor_under_a_table_nor_outside():
    plan = build_floor_plan(three_rooms())
    places = np.array([[4.0, 0.6], [1.8, 1.9], [-5.0, 2.0], [0.0, 2.0], [1e6, 0.0]])
    assert plan.region_at(places).tolist() == [0, 0, 0, 0, 0]


def test_a_doorway_of_80_centimetres_stays_passable_wherever_it_lies_on_the_cells():
    for start in np.arange(1.0, 1.2, 0.02):
        door = (start, start + 0.8)
        plan = build_floor_plan(np.concatenate([room((0, 0), (4, 3)), wall((2, 0), (2, 3), door)]))
        assert plan.region.max() == 1, start


def test_a_robot_with_a_radius_keeps_away_from_obstacles():
    xyz = np.concatenate([room((0, 0), (4, 4)), box((1.9, 1.9, 0), (2.1, 2.1, 1))])
    plan = build_floor_plan(xyz, robot_radius=0.5)
    centres = plan.centre_of(np.argwhere(plan.free))
    assert len(centres) > 0
    assert np.linalg.norm(centres - 2.0, axis=1).min() >= 0.5
    assert plan.free.sum() < build_floor_plan(xyz).free.sum()


@pytest.mark.parametrize(
    "strays",
    [
        [[2.0, 2.0, -5.0]],
        [[2.0, 2.0, -0.5], [2.0, 2.0, -0.3], [2.2, 2.0, -0.5]],
        [
            [x, y, z]
            for x in (5.0, 5.2, 5.4)
            for y in (2.0, 2.2, 2.4)
            for z in np.arange(-3, -0.3, 0.1)
        ],
    ],
    ids=["one", "some near the floor", "columns of them"],
)
def test_stray_points_below_the_floor_change_nothing(strays):
    xyz = three_rooms()
    clean = build_floor_plan(xyz)
    plan = build_floor_plan(np.concatenate([xyz, np.array(strays, np.float32)]))
    np.testing.assert_array_equal(plan.region, clean.region)
    np.testing.assert_array_equal(plan.floor, clean.floor)


def test_scattered_stray_points_below_many_cells_change_nothing():
    xyz = three_rooms()
    rng = np.random.default_rng(0)
    strays = rng.uniform((0.5, 0.5, -4.0), (11.5, 3.5, -0.3), (60, 3)).astype(np.float32)
    clean, plan = build_floor_plan(xyz), build_floor_plan(np.concatenate([xyz, strays]))
    np.testing.assert_array_equal(plan.region, clean.region)
    np.testing.assert_array_equal(plan.floor, clean.floor)


def test_a_ceiling_is_no_floor_where_the_floor_is_hidden():
    floor = np.concatenate([rectangle((0, 0, 0), (2, 4, 0)), rectangle((4, 0, 0), (6, 4, 0))])
    plan = build_floor_plan(np.concatenate([floor, rectangle((0, 0, HEIGHT), (6, 4, HEIGHT))]))
    assert np.nanmax(plan.floor) < 0.1
    assert plan.region_at(np.array([[3.0, 2.0]])).tolist() == [0]


@pytest.mark.parametrize(("gap", "num_regions"), [(0.2, 1), (0.35, 1), (1.0, 2)])
def test_only_small_gaps_in_a_floor_are_bridged(gap, num_regions):
    floor = [rectangle((0.1, 0.1, 0), (2.1, 3.9, 0)), rectangle((2.1 + gap, 0.1, 0), (5, 3.9, 0))]
    assert build_floor_plan(np.concatenate(floor)).region.max() == num_regions


def test_the_inside_of_a_thick_wall_is_not_free():
    faces = [wall((x, 0), (x, 4)) for x in (2.0, 2.5)]
    plan = build_floor_plan(np.concatenate([room((0, 0), (2, 4)), room((2.5, 0), (5, 4)), *faces]))
    assert plan.region.max() == 2


def test_a_ramp_is_driven_up_and_its_height_followed():
    xyz = rectangle((0, 0, 0), (8, 2, 0))
    xyz[:, 2] = np.clip(0.08 * (xyz[:, 0] - 1.0), 0.0, 0.48)
    plan = build_floor_plan(xyz)
    assert plan.region.max() == 1
    heights = plan.floor_at(np.array([[0.6, 1.0], [4.0, 1.0], [7.6, 1.0]]))
    np.testing.assert_allclose(heights, [0.0, 0.24, 0.48], atol=0.06)


def test_a_step_of_thirty_centimetres_is_not_climbed_and_both_levels_are_floor():
    lower, upper = rectangle((0, 0, 0), (3, 4, 0)), rectangle((3, 0, 0.3), (7, 4, 0.3))
    plan = build_floor_plan(np.concatenate([lower, upper, rectangle((3, 0, 0), (3, 4, 0.3))]))
    places = np.array([[1.0, 2.0], [5.0, 2.0]])
    assert plan.region_at(places).tolist() == [2, 1]
    np.testing.assert_allclose(plan.floor_at(places), [0.0, 0.3], atol=1e-6)


def test_a_sunken_hall_has_its_own_floor():
    hall, corridor = room((0, 0), (6, 4)) - [0, 0, 2.0], room((8, 0), (16, 4))
    plan = build_floor_plan(np.concatenate([hall, corridor]).astype(np.float32))
    np.testing.assert_allclose(
        plan.floor_at(np.array([[3.0, 2.0], [14.0, 2.0]])), [-2.0, 0.0], atol=1e-6
    )


def test_a_cell_and_its_centre_belong_together():
    plan = build_floor_plan(three_rooms())
    cells = np.argwhere(plan.free)
    np.testing.assert_array_equal(plan.cell_of(plan.centre_of(cells)), cells)


def test_one_point_is_a_building_too():
    plan = build_floor_plan(np.array([[5.0, -3.0, 1.0]], np.float32))
    assert plan.free.sum() == 1
    assert plan.floor_at(np.array([[5.0, -3.0]])).tolist() == [1.0]


def test_a_point_a_thousand_kilometres_away_is_refused_in_one_line():
    with pytest.raises(InputError, match="remove stray points") as caught:
        build_floor_plan(np.array([[0, 0, 0], [1e6, 1e6, 0]], np.float32))
    assert "\n" not in str(caught.value)


def test_the_real_room_has_free_floor_at_its_height(shared_folder):
    folder = shared_folder / "real" / "s3dis_room" / "Area_1" / "conferenceRoom_1" / "Annotations"
    xyz = np.concatenate(
        [np.loadtxt(path, usecols=(0, 1, 2), dtype=np.float32) for path in folder.glob("*.txt")]
    )
    plan = build_floor_plan(xyz)
    assert np.count_nonzero(plan.region == 1) > 200
    assert np.ptp(plan.floor[plan.free]) < 0.15
