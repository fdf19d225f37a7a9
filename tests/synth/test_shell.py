"""The shell: what a room has, where it is, and what can be seen of it."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from mcpseg_cli.synth.building.layout import plan_area
from mcpseg_cli.synth.building.shell import build_shell
from mcpseg_cli.synth.geometry.solids import Item, area_of, box, part_of, quad
from mcpseg_cli.synth.scanning.sampling import mesh_of, sample_mesh
from mcpseg_cli.synth.scanning.visibility import VOXEL, RoomGrid, build_room_grid, sees
from mcpseg_cli.synth.surfaces.catalogue import style_of, styles


def shells():
    for seed, style in enumerate(styles()):
        rng = np.random.default_rng(seed)
        for room in plan_area(style, 8, rng):
            yield room, build_shell(room, style, rng)


SHELLS = list(shells())
IDS = [room.name for room, _ in SHELLS]


@pytest.mark.parametrize(("room", "items"), SHELLS, ids=IDS)
def test_a_room_has_one_floor_one_ceiling_and_four_walls(room, items):
    names = [item.name for item in items]
    shafts = sum(fixture.kind == "shaft" for fixture in room.fixtures)
    assert (names.count("floor"), names.count("ceiling"), names.count("wall")) == (1, 1, 4 + shafts)


@pytest.mark.parametrize(("room", "items"), SHELLS, ids=IDS)
def test_everything_stays_inside_the_room_and_its_openings(room, items):
    deepest = max((opening.depth for opening in room.openings), default=0.0) + 0.02
    for item in items:
        low, high = item.bounds()
        assert (low >= np.array([*(room.low - deepest), -0.001])).all(), item.name
        assert (high <= np.array([*(room.high + deepest), room.ceiling + 0.001])).all(), item.name


@pytest.mark.parametrize(("room", "items"), SHELLS, ids=IDS)
def test_doors_windows_columns_and_beams_are_as_planned(room, items):
    names = [item.name for item in items]
    for name in ("door", "window"):
        assert names.count(name) == sum(opening.kind == name for opening in room.openings)
    assert names.count("column") == sum("column" in fixture.kind for fixture in room.fixtures)
    assert names.count("beam") == sum(fixture.kind == "beam" for fixture in room.fixtures)


@pytest.mark.parametrize(("room", "items"), SHELLS, ids=IDS)
def test_nothing_floats_in_the_air(room, items):
    for item in items:
        low, high = item.bounds()
        touches = low[2] < 0.02 or high[2] > room.ceiling - 0.02
        touches |= bool((low[:2] < room.low + 0.04).any() or (high[:2] > room.high - 0.04).any())
        assert touches, item.name


@pytest.mark.parametrize(("room", "items"), SHELLS, ids=IDS)
def test_walls_face_into_the_room_and_leave_openings_free(room, items):
    mesh = mesh_of([item for item in items if item.name == "wall"][:4])
    middle = np.array([*(room.low + room.high) / 2, room.ceiling / 2])

    # the triangles of the walls' own faces
    on_plane = np.zeros(len(mesh.normals), bool)
    for axis in range(2):
        for bound in (room.low[axis], room.high[axis]):
            on_plane |= (np.abs(mesh.triangles[:, :, axis] - bound) < 1e-9).all(axis=1)
    inside = (
        (mesh.triangles[..., :2] > room.low - 1e-9) & (mesh.triangles[..., :2] < room.high + 1e-9)
    ).all(axis=(1, 2))
    sheet = on_plane & inside & ~mesh.is_closed[mesh.part]

    inwards = ((middle - mesh.triangles.mean(axis=1)) * mesh.normals).sum(axis=1)
    assert (inwards[sheet] > 0).all()
    holes = sum((o.end - o.start) * (o.high - o.low) for o in room.openings)
    if any(o.kind == "passage" for o in room.openings):
        return
    around = 2 * float((room.high - room.low).sum()) * room.ceiling
    assert area_of(mesh.triangles[sheet]).sum() == pytest.approx(around - holes, rel=1e-6)


def test_samples_are_as_dense_as_asked_for():
    mesh = mesh_of([item for item in SHELLS[0][1] if item.name == "floor"])
    samples = sample_mesh(mesh, 0.05, np.random.default_rng(0))
    assert len(samples.xyz) == pytest.approx(area_of(mesh.triangles).sum() / 0.05**2, rel=0.02)
    assert np.abs(samples.xyz[:, 2]).max() < 1e-5


def test_points_lie_more_evenly_than_random_ones_also_after_thinning():
    sheet = part_of(quad((0, 0, 0), (4, 0, 0), (0, 1, 0)), styles()[0].floors[0])
    rng = np.random.default_rng(3)
    samples = sample_mesh(mesh_of([Item("floor", (sheet,))]), 0.03, rng)
    probes = rng.uniform((0.1, 0.1), (3.9, 0.9), (4000, 2))

    # how large holes are, beside those of random points
    for share in (1.0, 0.7, 0.4):
        kept = samples.xyz[samples.rank < share, :2]
        assert len(kept) == pytest.approx(share * len(samples.xyz), rel=0.03)
        holes = [
            np.quantile(cKDTree(cloud).query(probes)[0], 0.995)
            for cloud in (kept, rng.random(kept.shape) * [4, 1])
        ]
        assert holes[0] < 0.9 * holes[1]


def test_corridors_of_a_building_look_the_same():
    style = style_of(4, np.random.default_rng(0))
    halls = [
        room for room in plan_area(style, 24, np.random.default_rng(2)) if room.kind == "hallway"
    ]
    assert len(halls) > 2

    # whatever else is drawn for each
    looks = set()
    for seed, hall in enumerate(halls):
        items = build_shell(hall, style, np.random.default_rng(seed))
        looks.add(
            tuple(
                next(i for i in items if i.name == name).parts[0].material
                for name in ("floor", "ceiling", "wall")
            )
        )
    assert len(looks) == 1


def slow_sees(grid, start, end):
    """Small steps instead of leaps over empty space."""
    ray = (end - start) / VOXEL
    length = np.linalg.norm(ray)
    for gone in np.arange(2.05, length - 0.05, 0.05):
        place = start + (end - start) * gone / length
        if (
            grid.at(place[None])[0] == 0
            and (np.abs((place - grid.low) / VOXEL % 1 - 0.5) < 0.2).all()
        ):
            return False  # only voxels that the ray passes well inside are sure to stop it
    return True


def test_rays_are_stopped_by_what_they_pass_through():
    rng = np.random.default_rng(1)
    grid = build_room_grid(
        np.concatenate([box((1, 1, 0), (1.5, 2, 1)), box((2, 0, 0.5), (2.4, 1, 1.5))])
    )
    points, targets = rng.uniform(0, 3, (2, 400, 3))
    seen = sees(grid, points, targets)
    slow = np.array([slow_sees(grid, a, b) for a, b in zip(points, targets, strict=True)])
    assert not (seen & ~slow).any()  # nothing is seen through a voxel
    assert 0.2 < seen.mean() < 0.95


def test_rays_in_the_open_are_free():
    grid = RoomGrid(np.zeros(3), np.full((20, 20, 20), 20, np.uint8))
    points, targets = np.random.default_rng(2).uniform(0.1, 0.9, (2, 50, 3))
    assert sees(grid, points, targets).all()


def test_the_grid_knows_how_far_the_next_surface_is():
    grid = build_room_grid(part_of(box((0, 0, 0), (1, 1, 0.02)), styles()[0].floors[0]).triangles)
    assert grid.at(np.array([[0.5, 0.5, 0.01]]))[0] == 0
    assert grid.at(np.array([[0.5, 0.5, 0.1]]))[0] == 2
