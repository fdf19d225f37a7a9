"""Rays on triangles: Open3D against a slow twin, labels of what was hit, floors of solid houses."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.building import Building, Mesh
from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.config import SCANNERS, RaytraceSettings
from mcpseg_cli.formats.buildings import read_building
from mcpseg_cli.formats.mesh_building import MeshOptions
from mcpseg_cli.raytrace.floor_plan import build_floor_plan
from mcpseg_cli.raytrace.inside import look_around_inside
from mcpseg_cli.raytrace.occupancy import build_grid
from mcpseg_cli.raytrace.scanner import VirtualScanner
from mcpseg_cli.raytrace.sensors import SensorInBuilding
from mcpseg_cli.raytrace.triangles import TriangleScene
from tests.houses import BOXES, CLASSES, DEPTH, HEIGHT, WIDTH, write_glb

pytest.importorskip("open3d")
EYE = np.array([2.5, 1.0, 1.3])


@pytest.fixture(scope="module")
def house(tmp_path_factory) -> Building:
    path = write_glb(tmp_path_factory.mktemp("house") / "house.glb")
    return read_building(path, mesh=MeshOptions())[0]


def slow_distance(origin, ray, triangles) -> float:
    """Möller and Trumbore, 1997, triangle by triangle, from either side."""
    nearest = np.inf
    for a, b, c in triangles:
        across = np.cross(ray, c - a)
        determinant = (b - a) @ across
        if abs(determinant) < 1e-12:
            continue
        u = (origin - a) @ across / determinant
        along = np.cross(origin - a, b - a)
        v, distance = ray @ along / determinant, (c - a) @ along / determinant
        if u >= 0 and v >= 0 and u + v <= 1 and distance > 1e-9:
            nearest = min(nearest, distance)
    return nearest


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_rays_go_as_far_as_those_of_a_slow_twin(seed):
    rng = np.random.default_rng(seed)
    triangles = rng.uniform(-3, 3, (12, 3, 3)).astype(np.float32)
    xyz = triangles.mean(axis=1)
    labels = np.zeros(12, np.uint8), np.ones(12, np.int32)
    mesh = Mesh(triangles, np.arange(12))
    building = Building(xyz, np.zeros((12, 3), np.uint8), *labels, mesh=mesh)
    scene = TriangleScene(building, build_grid(xyz, 0.5))
    rays = rng.normal(size=(40, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    found = scene.measure(np.zeros((40, 3)), rays)
    expected = [slow_distance(np.zeros(3), ray, triangles.astype(float)) for ray in rays]
    unlike = ~np.isclose(found, expected, rtol=1e-3)
    assert unlike.sum() <= 1  # a ray may just pass an edge


def test_scans_lie_on_the_surfaces_of_what_their_labels_say(house):
    scan = VirtualScanner(house, RaytraceSettings()).scan(0, EYE)
    instance = house.instance[scan.points]
    assert len(scan.xyz) > 5000
    for number in np.unique(instance):
        low, high = (np.array(side) for side in BOXES[house.object_names[number - 1]])
        points = scan.xyz[instance == number]
        inside = np.minimum(points - low, high - points)
        assert (inside >= -1e-3).all()
        assert (inside.min(axis=1) <= 1e-3).all()  # on a side, none within


def test_a_door_a_centimetre_before_its_wall_is_a_door(house):
    scan = VirtualScanner(house, RaytraceSettings()).scan(0, EYE)
    door = house.object_names.index("door") + 1
    before = (scan.xyz[:, 0] > 1.02) & (scan.xyz[:, 0] < 1.88) & (scan.xyz[:, 1] < 0.05)
    before &= (scan.xyz[:, 2] > 0.02) & (scan.xyz[:, 2] < 2.0)
    assert before.sum() > 100
    assert (house.instance[scan.points[before]] == door).all()


def test_nothing_is_seen_through_a_wall(house):
    scan = VirtualScanner(house, RaytraceSettings()).scan(0, EYE)
    assert (scan.xyz >= -1e-3).all()
    assert (scan.xyz <= np.array([WIDTH, DEPTH, HEIGHT]) + 1e-3).all()


@pytest.mark.parametrize("sensor", ["depth-camera", "lidar-16"])
def test_other_sensors_measure_triangles_too(house, sensor):
    settings = RaytraceSettings(**SCANNERS[sensor])
    scanner = VirtualScanner(house, settings)
    pose = np.eye(4)
    pose[:3, 3] = EYE
    scan = SensorInBuilding(scanner).scan(0, pose)
    assert len(scan.xyz) > 300
    overshoot = np.maximum(scan.xyz - [WIDTH, DEPTH, HEIGHT], -scan.xyz).max(axis=1)
    assert np.median(overshoot) < 0.05


def test_feet_of_walls_and_undersides_are_no_floor(house):
    """The walls go a metre below the floor, the floor is 15 cm thick."""
    scene = VirtualScanner(house, RaytraceSettings()).triangles
    plan = build_floor_plan(look_around_inside(scene, house))
    assert np.nanmedian(plan.floor) == pytest.approx(0.0, abs=0.01)
    free = plan.free.sum() * plan.cell_size**2
    assert 0.6 * WIDTH * DEPTH < free < WIDTH * DEPTH


def test_a_mesh_without_ceiling_and_turned_inside_out_still_has_a_floor():
    low, high = (0.0, 0.0), (4.0, 4.0)
    corners = np.array([[*low, 0], [high[0], 0, 0], [*high, 0], [0, high[1], 0]], np.float32)
    triangles = corners[[[0, 2, 1], [0, 3, 2]]]  # facing down
    xyz = np.random.default_rng(0).uniform(0, 4, (4000, 3)).astype(np.float32) * [1, 1, 0]
    rows = np.sort((xyz[:, 1] > xyz[:, 0]).astype(int))
    order = np.argsort(xyz[:, 1] > xyz[:, 0], kind="stable")
    xyz = xyz[order].astype(np.float32)
    building = Building(
        xyz, np.zeros((4000, 3), np.uint8), np.zeros(4000, np.uint8), np.ones(4000, np.int32),
        S3DIS_CLASSES, mesh=Mesh(triangles, np.searchsorted(rows, [0, 1])),
    )  # fmt: skip
    scene = TriangleScene(building, build_grid(xyz, 0.1))
    assert build_floor_plan(look_around_inside(scene, building)).free.any()


def test_all_classes_of_the_house_are_in_a_scan(house):
    scan = VirtualScanner(house, RaytraceSettings()).scan(0, EYE)
    seen = {house.classes[label] for label in house.semantic[scan.points] if label < 255}
    assert seen == {name for name in CLASSES.values() if name}
