"""Light, views and photos: the fast kernels against slow twins, and what they are for."""

import numpy as np
import pytest

from mcpseg_cli.synth.geometry.solids import Item, box, part_of, quad, tube
from mcpseg_cli.synth.scanning import lighting, photo, scanner, viewing
from mcpseg_cli.synth.scanning.sampling import Samples, mesh_of, sample_mesh
from mcpseg_cli.synth.scanning.visibility import (
    VOXEL,
    build_room_grid,
    facing_of,
    is_clear,
    number_cells,
)
from mcpseg_cli.synth.surfaces.catalogue import styles
from mcpseg_cli.synth.surfaces.materials import Material

GREY = Material("plain", (120, 120, 120), (90, 90, 90))
LAMP = Material("plain", (255, 240, 200), (255, 240, 200), glow=2.0)


@pytest.fixture(scope="module")
def scene():
    """A floor of 4 x 4 m, a table-high box on it and a lamp over one half."""
    floor = Item("floor", (part_of(quad((0, 0, 0), (4, 0, 0), (0, 4, 0)), GREY),))
    block = Item("table", (part_of(box((1.6, 1, 0), (2.0, 3, 1)), GREY),))
    lamp = Item("clutter", (part_of(quad((0.5, 2.2, 2.5), (0.4, 0, 0), (0, -0.4, 0)), LAMP),))
    mesh = mesh_of([floor, block, lamp])
    samples = sample_mesh(mesh, 0.06, np.random.default_rng(0))
    return mesh, build_room_grid(mesh.triangles), samples


def test_cells_are_numbered_as_they_come():
    rng = np.random.default_rng(0)
    cell = rng.integers(0, 4, (300, 3)).astype(np.int32)
    facing = facing_of(rng.normal(size=(300, 3)).astype(np.float32))
    own = np.empty(300, np.int32)
    first = number_cells(cell, facing, np.array([4, 4, 4]), np.zeros(64 * 6, np.int32), own)
    seen = {}
    for row, key in enumerate(zip(map(tuple, cell.tolist()), facing.tolist(), strict=True)):
        seen.setdefault(key, []).append(row)
    assert first.tolist() == [rows[0] for rows in seen.values()]
    assert all(own[row] == number for number, rows in enumerate(seen.values()) for row in rows)


def test_a_normal_faces_the_nearest_axis():
    assert facing_of(
        np.float32([[1, 0.2, 0], [-1, 0, 0], [0, 0.9, 0.1], [0, 0, -0.4]])
    ).tolist() == [1, 0, 3, 4]


def test_lamps_shine_down_and_solids_throw_shadows(scene):
    mesh, grid, samples = scene
    light = lighting.bake(mesh, grid, samples, np.random.default_rng(1))
    on_floor = samples.part == 0
    near = on_floor & (np.hypot(samples.xyz[:, 0] - 0.7, samples.xyz[:, 1] - 2) < 0.4)
    behind = on_floor & (np.hypot(samples.xyz[:, 0] - 2.3, samples.xyz[:, 1] - 2) < 0.2)
    mirrored = on_floor & (np.hypot(samples.xyz[:, 0] - 0.7, samples.xyz[:, 1] - 3.6) < 0.2)
    assert light[near].mean() > 1.5 * light[behind].mean()
    assert light[mirrored].mean() > 1.3 * light[behind].mean()
    assert light.mean() == pytest.approx(1, abs=0.15)
    assert light[near, 0].mean() > light[near, 2].mean()  # the lamp is yellow


def test_shine_is_the_same_as_its_slow_twin(scene):
    mesh, grid, samples = scene
    rng = np.random.default_rng(2)
    rows = rng.choice(len(samples.xyz), 80, replace=False)
    xyz, normals = (samples.xyz[rows] - grid.low) / VOXEL, samples.normals[rows].astype(np.float64)
    lights = lighting._lights(mesh, grid, rng)
    spots, facing, colour, power = lights.spots, lights.facing, lights.colour, lights.power
    draws = rng.integers(lighting.SPOTS, size=(80, 1), dtype=np.uint8)
    fast = np.zeros((80, 3), np.float32)
    lighting._shine(xyz, normals, spots, facing, colour, power, draws, grid.distance, fast)

    # one lamp: three rays each
    slow = np.zeros((80, 3))
    for row in range(80):
        ray = spots[0, draws[row, 0]] - xyz[row]
        length = np.sqrt(ray @ ray + 20)
        leaves = max(-ray @ facing[0, draws[row, 0]] / length, 0) + 0.05
        strength = power[0] * max(ray @ normals[row] / length, 0) * leaves / length**2
        start = xyz[row] + normals[row]
        ends = [
            spots[0, (draws[row, 0] + 5 * k) % 16] + 2 * facing[0, (draws[row, 0] + 5 * k) % 16]
            for k in range(3)
        ]
        slow[row] = (
            400
            * strength
            * np.mean([is_clear(*start, *end, grid.distance) for end in ends])
            * colour[0]
        )
    same = np.isclose(fast, slow, rtol=1e-3, atol=1e-6).all(axis=1)
    assert same.mean() > 0.95  # rays along the edge of a voxel may fall to either side


def test_blurred_light_is_the_average_around_each_probe():
    rng = np.random.default_rng(3)
    shape = np.array([6, 6, 6])
    table = np.zeros((6, 6, 6, 6), np.int32)
    places = [tuple(place) for place in rng.integers(1, 5, (40, 3)).tolist()]
    places = list(dict.fromkeys(places))
    for number, place in enumerate(places):
        table[(*place, 2)] = number + 1

    # itself counts for three
    light = rng.random((len(places), 3)).astype(np.float32)
    fast = lighting._blur(light, table.ravel(), shape)
    for number, place in enumerate(places):
        near = [k for k, other in enumerate(places) if np.abs(np.subtract(place, other)).max() <= 1]
        weights = [3.0 if k == number else 1.0 for k in near]
        assert np.allclose(
            fast[number], np.average(light[near], axis=0, weights=weights), atol=1e-5
        )


def test_corners_are_less_open_than_plains(scene):
    _, grid, _ = scene
    place = (np.array([[3.2, 2.0, 0.0], [2.05, 2.0, 0.0]]) - grid.low) / VOXEL
    openness = np.empty(2, np.float32)
    lighting._look_around(place, np.array([[0.0, 0, 1]] * 2), grid.distance, openness)
    assert openness[0] == pytest.approx(1.0, abs=0.05)
    assert openness[1] < 0.7


def test_views_are_the_same_as_their_slow_twin(scene):
    mesh, grid, samples = scene
    tripods = np.array([[0.4, 0.4, 1.5], [3.5, 2.0, 1.4], [3.5, 3.5, 1.6]])
    rows = np.random.default_rng(4).choice(len(samples.xyz), 200, replace=False)
    xyz, normals = samples.xyz[rows], samples.normals[rows]
    closed = mesh.is_closed[samples.part[rows]]

    views = np.zeros(200, np.uint16)
    viewing._look_out(xyz, normals, closed, tripods, grid.low, grid.distance, views)
    draws = np.random.default_rng(5).random(200, np.float32)
    chosen = np.full(200, -1, np.int8)
    viewing._choose_viewer(
        xyz, normals, closed, views, np.arange(200, dtype=np.int32), tripods, draws, chosen
    )

    same = 0
    for row in range(200):
        # which tripods see it
        bits = [
            view
            for view in range(3)
            if slow_view(xyz[row], normals[row], closed[row], tripods[view], grid)
        ]
        same += views[row] == sum(1 << view for view in bits)

        # which of them takes it
        bits = [view for view in range(3) if views[row] >> view & 1]
        need, best = draws[row], -1
        for view in sorted(bits, key=lambda view: np.hypot(*(tripods[view] - xyz[row])[:2])):
            ray = tripods[view] - xyz[row]
            facing = ray @ normals[row] / np.linalg.norm(ray)
            if best < 0 and (not closed[row] or facing >= 0.02):
                need -= min(0.4 + 2.2 * abs(facing) / (1 + ray @ ray / 9), 1)
                best = view if need <= 0 else -1
        assert chosen[row] == best
    assert same > 190  # rays along the edge of a voxel may fall to either side


def slow_view(point, normal, closed, tripod, grid):
    facing = (tripod - point) @ normal
    if closed and facing < 0:
        return False
    start = (point - grid.low) / VOXEL + (normal if facing > 0 else -normal)
    return is_clear(*start, *((tripod - grid.low) / VOXEL), grid.distance)


def test_a_wall_behind_a_board_is_covered_and_around_it_is_not():
    rng = np.random.default_rng(6)
    along, up = rng.uniform(0, 3, 500), rng.uniform(0, 3, 500)
    place = np.column_stack([along, np.zeros(500), up]).astype(np.float32)
    place = place[np.argsort(place[:, 0])]
    normals = np.tile(np.float32([0, 1, 0]), (500, 1))

    # the board covers one square metre
    board = part_of(box((1, 0, 1), (2, 0.02, 2)), GREY)
    around = np.array([[board.low, board.high]])
    own = np.array([[board.low, board.high, board.origin]])
    covered = np.zeros(500, bool)
    viewing._mark_under(place, normals, np.arange(500), around, own, np.zeros(1), covered)
    assert np.array_equal(covered, ((place[:, [0, 2]] > 1) & (place[:, [0, 2]] < 2)).all(axis=1))


def test_only_boxes_count_as_boxes_not_every_part_of_twelve_triangles():
    assert viewing.is_box(part_of(box((0, 0, 0), (1, 2, 3)), GREY).moved(1.0, 2.0, 0.0, 0.4))
    assert not viewing.is_box(part_of(tube((0, 0, 0), (0, 0, 1), 0.1, sides=6), GREY))


def test_glass_and_dark_things_lose_patches_and_plain_walls_hardly_anything():
    dark = Material("metal", (20, 20, 22), (9, 9, 9), seed=4)
    glass = Material("glass", (90, 100, 110), (150, 160, 170))
    sheets = [
        part_of(quad((3 * k, 0, 0), (2, 0, 0), (0, 0, 2)), m)
        for k, m in enumerate((GREY, dark, glass))
    ]
    mesh = mesh_of([Item("clutter", (sheet,)) for sheet in sheets])
    samples = sample_mesh(mesh, 0.05, np.random.default_rng(0))

    # shares of each that are lost, over 30 seeds
    lost = np.zeros(3)
    for seed in range(30):
        gaps = scanner._gaps(mesh, samples, np.random.default_rng(seed))
        lost += [gaps[samples.part == part].mean() / 30 for part in range(3)]
    assert lost[0] < 0.02
    assert 0.05 < lost[1] < 0.5
    assert 0.1 < lost[2] < 0.6


def test_backs_that_touch_the_wall_are_marked():
    points = np.float32([[0, 0.5, 0.5], [0.3, 0.5, 0.5], [1, 0.5, 0.5]])
    normals = np.float32([[-1, 0, 0], [-1, 0, 0], [-1, 0, 0]])
    marked = np.zeros(3, bool)
    viewing._mark_outward(
        points, normals, np.array([True, True, True]), np.array([[0, 0, 0], [2, 2, 2.0]]), marked
    )
    assert marked.tolist() == [True, False, False]


def test_each_pixel_keeps_its_nearest_point():
    rng = np.random.default_rng(7)
    tripod = rng.integers(0, 2, 300).astype(np.int8)
    row, column = rng.integers(0, 5, (2, 300)).astype(np.int32)
    reach = rng.random(300).astype(np.float32)
    nearest = np.full((2, 5, 5), -1, np.int32)
    photo._nearest(tripod, row, column, reach, nearest)
    for place in np.ndindex(2, 5, 5):
        here = np.flatnonzero((tripod == place[0]) & (row == place[1]) & (column == place[2]))
        assert nearest[place] == (here[np.argmin(reach[here])] if len(here) else -1)


def test_noise_moves_points_along_their_rays_by_millimetres():
    rng = np.random.default_rng(8)
    xyz = np.column_stack([np.full(3000, 3.0), rng.uniform(-1, 1, (3000, 2))]).astype(np.float32)
    moved = scanner._noisy(xyz, np.zeros(3000, np.int8), np.zeros((1, 3)), rng) - xyz
    assert 0.001 < np.abs(moved[:, 0] - np.median(moved[:, 0])).mean() < 0.01
    assert np.abs(moved[:, 1:]).mean() < np.abs(moved[:, 0]).mean()


def test_darker_light_makes_darker_photos(scene):
    mesh, _, samples = scene
    painted = np.full((len(samples.xyz), 3), 120, np.float32)
    light = np.where(samples.xyz[:, :1] > 2, 1.6, 0.4).astype(np.float32).repeat(3, axis=1)
    view, rng = np.zeros(len(painted), np.int8), np.random.default_rng(9)

    # half of the floor is bright, and the lamp itself
    shown = photo.develop(mesh, samples, painted, light, view, styles()[0], rng)
    floor = samples.part == 0
    bright = samples.xyz[:, 0] > 2
    assert shown[floor & bright].mean() > 1.2 * shown[floor & ~bright].mean()
    assert shown[samples.part == 2].mean() > shown[floor].mean()


def test_choosing_samples_keeps_their_order():
    samples = Samples(
        np.arange(9, dtype=np.float32).reshape(3, 3),
        np.zeros((3, 3), np.float32),
        np.arange(3, dtype=np.int32),
        np.zeros(3, np.float32),
        np.arange(3, dtype=np.int32),
    )
    assert samples.chosen(np.array([True, False, True])).part.tolist() == [0, 2]
