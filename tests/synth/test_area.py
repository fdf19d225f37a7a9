"""Whole areas: deterministic, labelled, within their rooms and without what nobody can see."""

import subprocess
import sys

import numpy as np
import pytest

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.formats.natural_order import natural_key
from mcpseg_cli.synth import make_area, make_building, style_of, styles
from mcpseg_cli.synth.area import MIN_POINTS
from mcpseg_cli.synth.building.layout import plan_area
from mcpseg_cli.synth.building.shell import build_shell
from mcpseg_cli.synth.geometry.solids import Item, box, part_of
from mcpseg_cli.synth.scanning.photo import take_from_panorama
from mcpseg_cli.synth.scanning.scanner import scan_room
from mcpseg_cli.synth.surfaces.styles import paint


@pytest.fixture(scope="module")
def building():
    return make_building(2, 7, num_rooms=8, spacing=0.06)


def test_rooms_come_in_natural_order_with_objects_numbered_as_their_files(building):
    assert list(building.rooms) == sorted(building.rooms, key=natural_key)
    assert list(building.object_names) == sorted(building.object_names, key=natural_key)
    assert building.instance.min() == 1
    assert building.instance.max() == len(building.object_names)
    names = [
        building.object_names[number - 1].split("/")[1].rsplit("_", 1)[0]
        for number in building.instance[::5000]
    ]
    assert names == [S3DIS_CLASSES[number] for number in building.semantic[::5000]]


def test_no_object_is_tiny(building):
    assert np.bincount(building.instance)[1:].min() >= MIN_POINTS


def test_points_stay_in_their_rooms(building):
    rng = np.random.default_rng([7, 2])
    rooms = {room.name: room for room in plan_area(style_of(2, rng), 8, rng)}
    for number, name in enumerate(building.rooms):
        start, end = building.room_starts[number : number + 2]
        xyz, room = building.xyz[start:end], rooms[name]
        assert (xyz[:, :2] > room.low - 0.5).all()
        assert (xyz[:, :2] < room.high + 0.5).all()
        assert -0.25 < xyz[:, 2].min() < xyz[:, 2].max() < room.ceiling + 0.25


def test_most_classes_occur(building):
    counts = building.class_counts()
    assert all(
        counts[name]
        for name in ("ceiling", "floor", "wall", "window", "door", "table", "chair", "clutter")
    )
    assert counts["wall"] > counts["floor"] > counts["door"]


def test_the_same_seed_makes_the_same_points(building):
    again = make_building(2, 7, num_rooms=8, spacing=0.06)
    assert np.array_equal(building.xyz, again.xyz)
    assert np.array_equal(building.rgb, again.rgb)
    other = make_building(2, 8, num_rooms=2, spacing=0.1)
    assert not np.array_equal(building.xyz[:100], other.xyz[:100])


def test_processes_make_the_same_points():
    alone = list(make_area(1, 3, num_rooms=2, spacing=0.08))
    shared = list(make_area(1, 3, num_rooms=2, spacing=0.08, jobs=2))
    assert [room.object_names for room in alone] == [room.object_names for room in shared]
    for first, second in zip(alone, shared, strict=True):
        assert all(
            np.array_equal(a, b)
            for a, b in zip(first.xyz + first.rgb, second.xyz + second.rgb, strict=True)
        )


def test_half_the_spacing_gives_four_times_the_points():
    coarse, fine = (
        len(make_building(1, 1, num_rooms=2, spacing=spacing, style=styles()[4]))
        for spacing in (0.12, 0.06)
    )
    assert 3.3 < fine / coarse < 4.7


def test_what_is_hidden_is_not_scanned():
    rng = np.random.default_rng(0)
    style = styles()[0]
    room = next(room for room in plan_area(style, 8, rng) if room.kind == "office")

    # a small box in a large one
    x, y = (room.low + room.high) / 2
    small = box((x - 0.1, y - 0.1, 0.3), (x + 0.1, y + 0.1, 0.5))
    large = box((x - 0.4, y - 0.4, 0), (x + 0.4, y + 0.4, 0.9))
    inside = Item("chair", (part_of(small, paint((90, 90, 90), rng)),))
    around = Item("table", (part_of(large, paint((90, 90, 90), rng)),))

    items = [*build_shell(room, style, rng), inside, around]
    scan = scan_room(items, room, style, 0.04, rng)
    assert (scan.item == len(items) - 1).sum() > 300
    assert not (scan.item == len(items) - 2).any()
    under = (np.abs(scan.xyz[:, :2] - [x, y]) < 0.3).all(axis=1) & (scan.xyz[:, 2] < 0.05)
    assert not under.any()


def test_panoramas_that_fit_leave_colours_mostly_alone():
    rng = np.random.default_rng(0)
    xyz = np.column_stack([np.full(4000, 3.0), rng.uniform(-2, 2, (4000, 2))]).astype(np.float32)
    rgb = np.where(xyz[:, 1:2] > 0, 200, 50).astype(np.uint8).repeat(3, axis=1)
    moved, seen = take_from_panorama(xyz, rgb, np.zeros(4000, np.int8), np.zeros((1, 3)), rng)
    assert np.array_equal(moved, xyz)  # one even wall has no edges to fly from
    assert (seen == rgb).all(axis=1).mean() > 0.95


def test_making_areas_does_not_need_torch():
    script = "import sys, mcpseg_cli.synth; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


def test_homes_hold_sofas_on_one_floor_with_its_rugs():
    homes = make_building(7, 2, num_rooms=9, spacing=0.08)
    counts = homes.class_counts()
    assert counts["sofa"] > 0.03 * sum(counts.values())
    assert counts["board"] == 0
    names = [name.split("/")[1] for name in homes.object_names]
    assert names.count("floor_1") == len(homes.rooms)
    assert "floor_2" not in names
