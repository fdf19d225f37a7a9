"""Routes: where the robot goes, in what order, and where it scans."""

import heapq

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.errors import InputError
from mcpseg_cli.raytrace.coverage import choose_waypoints, reached_shares, room_of_cells
from mcpseg_cli.raytrace.floor_plan import build_floor_plan
from mcpseg_cli.raytrace.occupancy import build_grid
from mcpseg_cli.raytrace.rays import ScanPattern, visible_voxels
from mcpseg_cli.raytrace.route import (
    _nearest_neighbours,
    plan_route,
    read_waypoints,
    visiting_order,
)
from tests.worlds import building_of, offices, plan_of, random_plan, three_rooms

SEEDS = st.integers(0, 2**32 - 1)


def random_route(seed, step=0.2, count=12):
    """Plan a route past random cells of the largest region of a random plan."""
    rng = np.random.default_rng(seed)
    plan = random_plan(rng)
    centres = plan.centre_of(np.argwhere(plan.region == 1))
    waypoints = centres[rng.integers(0, len(centres), count)]
    return plan, waypoints, plan_route(plan, waypoints, step)


def slow_distances(free, start):
    """Return the cells of the shortest way from a cell to each other (Dijkstra with a heap)."""
    done, queue = {}, [(0.0, start)]
    moves = [(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if (x, y) != (0, 0)]
    while queue:
        length, (x, y) = heapq.heappop(queue)
        if (x, y) in done:
            continue
        done[x, y] = length
        for dx, dy in moves:
            if free[x + dx, y + dy] and free[x + dx, y] and free[x, y + dy]:
                heapq.heappush(queue, (length + np.hypot(dx, dy), (x + dx, y + dy)))
    return done


def along(path, spacing=0.01):
    """Return places every centimetre along a polyline."""
    arrival = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    at = np.arange(0, arrival[-1], spacing)
    return np.column_stack([np.interp(at, arrival, path[:, axis]) for axis in (0, 1)])


@settings(deadline=None, max_examples=25)
@given(SEEDS)
def test_the_robot_never_leaves_free_cells(seed):
    plan, _, route = random_route(seed)
    assert plan.region_at(route.positions[:, :2]).all()
    places = along(route.path)
    for corner in (
        (1e-6, 1e-6),
        (1e-6, -1e-6),
        (-1e-6, 1e-6),
        (-1e-6, -1e-6),
    ):  # the corner of a cell is in four
        assert plan.region_at(places + corner).all()


@settings(deadline=None, max_examples=25)
@given(SEEDS)
def test_every_waypoint_in_free_space_is_passed(seed):
    _, waypoints, route = random_route(seed)
    apart = np.linalg.norm(
        waypoints[:, None] - np.concatenate([route.path, along(route.path)]), axis=2
    )
    assert apart.min(axis=1).max() < 0.01
    assert len(route.skipped) == 0
    assert {tuple(place) for place in route.waypoints.round(6)} == {
        tuple(place) for place in waypoints.round(6)
    }


@settings(deadline=None, max_examples=25)
@given(SEEDS, st.sampled_from([0.07, 0.2, 0.35]))
def test_scans_are_a_step_apart_along_the_way(seed, step):
    _, _, route = random_route(seed, step)
    assert len(route) == int(route.length / step + 1e-6) + 1
    np.testing.assert_allclose(route.positions[0, :2], route.path[0])
    fine = along(route.path, step / 100)
    np.testing.assert_allclose(route.positions[:, :2], fine[::100][: len(route)], atol=1e-6)


def test_the_way_between_two_waypoints_is_the_shortest():
    for seed in range(6):
        plan, waypoints, route = random_route(seed, count=2)
        cells = plan.cell_of(waypoints)
        expected = slow_distances(plan.region == 1, tuple(cells[0]))[tuple(cells[1])]
        assert route.length == pytest.approx(expected * plan.cell_size)


def test_a_straight_way_has_two_corners_and_evenly_spaced_scans():
    plan = plan_of(np.pad(np.ones((20, 3), bool), 1))
    route = plan_route(
        plan, plan.centre_of(np.array([[1, 2], [11, 2]])), step=0.3, sensor_height=0.8
    )
    assert len(route.path) == 2
    np.testing.assert_allclose(np.diff(route.positions[:, 0]), 0.3)
    assert len(route) == 7
    np.testing.assert_allclose(route.positions[:, 2], 1.3)


def test_poses_face_where_the_robot_is_going():
    _, _, route = random_route(3)
    assert (route.poses[:, :3, 3] == route.positions).all()
    turns = route.poses[:, :3, :3]
    np.testing.assert_allclose(
        turns @ turns.swapaxes(1, 2), np.tile(np.eye(3), (len(route), 1, 1)), atol=1e-12
    )
    ahead = np.diff(route.positions, axis=0)
    straight = np.isclose(np.linalg.norm(ahead, axis=1), 0.2)
    assert straight.sum() > len(route) / 2
    np.testing.assert_allclose(route.poses[:-1, :3, 0][straight], ahead[straight] / 0.2, atol=1e-6)


def test_a_place_passed_twice_is_scanned_twice():
    free = np.zeros((30, 12), bool)
    free[2:28, 2] = True
    free[15, 2:11] = True
    plan = plan_of(free)
    route = plan_route(plan, plan.centre_of(np.array([[2, 2], [15, 10], [27, 2]])))
    assert route.length == pytest.approx((25 + 2 * 8) * 0.2)
    assert len(np.unique(route.positions.round(6), axis=0)) == len(route) - 8


def test_waypoints_of_one_cell_are_one():
    plan = random_plan(np.random.default_rng(0))
    centre = plan.centre_of(np.argwhere(plan.region == 1)[:1])
    route = plan_route(plan, np.concatenate([centre, centre + 0.05, centre]))
    assert (len(route.waypoints), len(route), route.length, len(route.path)) == (1, 1, 0.0, 1)


def test_waypoints_that_are_not_in_free_space_are_skipped_and_kept_apart():
    plan = build_floor_plan(three_rooms())
    inside, in_wall, outside = [6.0, 2.0], [4.0, 0.6], [99.0, 2.0]
    route = plan_route(plan, np.array([in_wall, inside, outside]))
    assert route.skipped.tolist() == [in_wall, outside]
    assert len(route.waypoints) == 1


def test_no_waypoint_gives_an_empty_route():
    plan = build_floor_plan(three_rooms())
    route = plan_route(plan, np.array([[4.0, 0.6]]))
    assert (len(route), route.length, route.poses.shape, route.scan_starts.tolist()) == (
        0,
        0.0,
        (0, 4, 4),
        [0],
    )


def test_regions_that_are_not_connected_are_driven_one_after_the_other():
    plan = build_floor_plan(three_rooms())
    route = plan_route(plan, np.array([[9.0, 1.0], [0.6, 0.6], [11.0, 3.0], [7.0, 3.0]]))
    assert route.regions.tolist() == [1, 2]
    for number, start, end in zip(
        route.regions, route.scan_starts[:-1], route.scan_starts[1:], strict=True
    ):
        assert (plan.region_at(route.positions[start:end, :2]) == number).all()
    apart = np.diff(route.path_starts)
    assert apart.sum() == len(route.path)
    assert route.length < 7 + 4 + 2 * 4


@settings(deadline=None, max_examples=25)
@given(SEEDS)
def test_the_order_is_no_longer_than_nearest_neighbours_and_no_reversal_shortens_it(seed):
    rng = np.random.default_rng(seed)
    places = rng.random((int(rng.integers(2, 15)), 2))
    distance = np.linalg.norm(places[:, None] - places, axis=2)
    order = visiting_order(distance)

    def length(order):
        return distance[order[:-1], order[1:]].sum()

    assert sorted(order) == list(range(len(places)))
    assert length(order) <= length(_nearest_neighbours(distance, 0)) + 1e-9
    for first in range(len(order)):
        for last in range(first + 2, len(order) + 1):
            changed = np.concatenate([order[:first], order[first:last][::-1], order[last:]])
            assert length(order) <= length(changed) + 1e-6


@settings(deadline=None, max_examples=25)
@given(SEEDS)
def test_nearest_neighbours_is_what_the_slow_twin_finds(seed):
    distance = np.random.default_rng(seed).random((9, 9))
    left, expected = set(range(9)) - {4}, [4]
    while left:
        expected.append(min(left, key=lambda there: distance[expected[-1], there]))
        left.remove(expected[-1])
    assert _nearest_neighbours(distance, 4).tolist() == expected


def test_places_on_a_line_are_visited_from_end_to_end():
    places = np.random.default_rng(1).permutation(50).astype(float)
    order = visiting_order(np.abs(places[:, None] - places))
    assert np.abs(np.diff(places[order])).tolist() == [1.0] * 49


def test_no_place_has_an_order():
    assert visiting_order(np.empty((0, 0))).tolist() == []


def test_waypoints_are_read_with_headers_comments_and_any_separator(tmp_path):
    path = tmp_path / "scan_spots.txt"
    path.write_text("x,y\n# the hall\n1.5 -2\n3,\t4.25 # door\n\n 5e0\t6 0.7\n")
    assert read_waypoints(path).tolist() == [[1.5, -2.0], [3.0, 4.25], [5.0, 6.0]]


@pytest.mark.parametrize("line", ["1.0", "1.0 two", "nan 1", "1 inf", "x y"])
def test_a_line_that_is_no_waypoint_is_named(tmp_path, line):
    path = tmp_path / "scan_spots.txt"
    path.write_text(f"1 2\n{line}\n")
    with pytest.raises(InputError, match=r"scan_spots\.txt, line 2: ") as caught:
        read_waypoints(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", ["", "# nothing\n\n", "x y\n"])
def test_a_file_without_waypoints_is_refused(tmp_path, content):
    path = tmp_path / "scan_spots.txt"
    path.write_text(content)
    with pytest.raises(InputError, match="no waypoints"):
        read_waypoints(path)


def seen_from(grid, positions, pattern):
    is_seen = np.zeros(len(grid), bool)
    for position in positions:
        is_seen[visible_voxels(grid, position, pattern.directions(), pattern.reach)] = True
    return is_seen


@pytest.mark.parametrize("seed", range(3))
def test_the_automatic_route_sees_95_percent_of_what_can_be_seen(seed):
    xyz = offices(np.random.default_rng(seed))
    plan, grid, pattern = build_floor_plan(xyz), build_grid(xyz, 0.1), ScanPattern(2.0, 2.0)
    route = plan_route(plan, choose_waypoints(grid, plan, pattern))
    places = plan.centre_of(np.argwhere(plan.region == 1)[::2])
    every = seen_from(grid, np.column_stack([places, plan.floor_at(places) + 1.0]), pattern)
    seen = seen_from(grid, route.positions, pattern)
    assert np.count_nonzero(seen & every) >= 0.95 * np.count_nonzero(every)
    assert len(route.waypoints) < len(places) / 5


def test_automatic_waypoints_are_free_the_same_for_any_number_of_threads_and_reported():
    xyz = three_rooms()
    plan, grid, pattern = build_floor_plan(xyz), build_grid(xyz, 0.1), ScanPattern(5.0, 5.0)
    reports = []
    waypoints = choose_waypoints(
        grid, plan, pattern, progress=lambda *report: reports.append(report)
    )
    assert (plan.region_at(waypoints) == 1).all()
    np.testing.assert_array_equal(choose_waypoints(grid, plan, pattern, num_threads=3), waypoints)
    assert reports == [(done, len(reports)) for done in range(1, len(reports) + 1)]


def test_a_region_without_cells_has_no_waypoints():
    xyz = three_rooms()
    assert choose_waypoints(
        build_grid(xyz, 0.1), build_floor_plan(xyz), ScanPattern(5, 5), region=99
    ).shape == (0, 2)


def test_rooms_the_robot_does_not_get_into_are_named():
    building = building_of(three_rooms(), ("office_1", "office_2", "WC_1"), [4.0, 8.0])
    plan = build_floor_plan(building.xyz)
    assert reached_shares(building, plan, np.array([1], np.int32)) == {
        "office_1": 1.0,
        "office_2": 1.0,
        "WC_1": 0.0,
    }
    assert set(reached_shares(building, plan, np.array([1, 2], np.int32)).values()) == {1.0}
    assert set(reached_shares(building, plan, np.array([0], np.int32)).values()) == {0.0}


def test_a_cell_belongs_to_the_room_with_most_floor_points_in_it():
    building = building_of(three_rooms(), ("a", "b", "c"), [4.03, 8.0])
    plan = build_floor_plan(building.xyz)
    counts = {}
    cells = plan.cell_of(building.xyz[:, :2].astype(float))
    for cell, z, number in zip(
        map(tuple, cells.tolist()), building.xyz[:, 2], building.room_of(), strict=True
    ):
        if z <= plan.floor[cell] + np.float32(0.1):
            counts.setdefault(cell, [0, 0, 0])[number] += 1
    found = room_of_cells(building, plan)
    assert {tuple(cell) for cell in np.argwhere(found >= 0).tolist()} == set(counts)
    assert all(count[found[cell]] == max(count) for cell, count in counts.items())
