"""The map as scans grow it: what one scan shows of it, and the floor it remembers."""

import numpy as np
import pytest

from mcpseg_cli.config import MapSettings, RegionGrowingSettings, SegmentSettings
from mcpseg_cli.incremental.growing_map import GrowingMap
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.scan import Scan


def make_scan(x: float, num_points: int = 600, low: float = 0.0, seed: int = 0) -> Scan:
    """Points up to four metres around a robot at ``x``, half of them on a floor at ``low``."""
    rng = np.random.default_rng((seed, int(10 * x)))
    pose = np.eye(4)
    pose[:3, 3] = x, 0.0, 1.0
    xyz = rng.uniform([x - 4, -4, low], [x + 4, 4, low + 2], (num_points, 3))
    xyz[::2, 2] = low
    return Scan(xyz.astype(np.float32), None, pose)


def test_points_out_of_range_get_no_voxel():
    growing_map, scan = GrowingMap(MapSettings(local_range=1.5)), make_scan(0.0)
    observed = growing_map.observe(scan)
    distance = np.linalg.norm(scan.xyz[:, :2], axis=1)
    np.testing.assert_array_equal(observed.point_ids >= 0, distance < 1.5)
    assert len(growing_map.voxels) == len(observed.new)


def test_new_voxels_and_those_seen_again_are_all_that_a_scan_sees():
    growing_map = GrowingMap(MapSettings())
    for number in range(4):
        known = len(growing_map.voxels)
        observed = growing_map.observe(make_scan(0.4 * number))
        seen = np.unique(observed.point_ids[observed.point_ids >= 0])

        assert observed.first_new == known
        assert observed.new.tolist() == list(range(known, len(growing_map.voxels)))
        assert np.concatenate([observed.seen_again, observed.new]).tolist() == seen.tolist()
    assert len(observed.seen_again) > 0


def test_a_scan_observed_before_finds_its_voxels_again():
    growing_map = GrowingMap(MapSettings())
    scans = [make_scan(0.4 * number) for number in range(3)]
    observed = [growing_map.observe(scan).point_ids for scan in scans]
    for scan, point_ids in zip(scans, observed, strict=True):
        np.testing.assert_array_equal(growing_map.find_points(scan), point_ids)


def test_a_scan_without_colour_is_grey():
    growing_map = GrowingMap(MapSettings())
    growing_map.observe(make_scan(0.0))
    assert (growing_map.voxels.rgb == 128).all()


@pytest.mark.parametrize(("rule", "expected"), [("scan-min", -0.3), (0.25, 0.25)])
def test_the_floor_is_found_by_the_rule(rule, expected):
    growing_map = GrowingMap(MapSettings(floor=rule))
    assert growing_map.observe(make_scan(0.0, low=-0.3)).floor == pytest.approx(expected)


def test_no_floor_is_known_before_a_scan_comes_in_range_and_the_last_one_holds_after():
    far = make_scan(0.0)
    far = Scan(far.xyz + np.float32(100), None, far.pose)
    growing_map = GrowingMap(MapSettings(floor="scan-min"))
    assert growing_map.observe(far).floor is None

    found = growing_map.observe(make_scan(0.0, low=-0.3)).floor
    again = growing_map.observe(far)
    assert (found, again.floor) == (pytest.approx(-0.3), found)
    assert len(again.new) == len(again.seen_again) == 0


def test_the_segmenter_sees_what_the_map_sees():
    settings = SegmentSettings()
    growing_map = GrowingMap(settings)
    segmenter = IncrementalSegmenter(RegionGrowingSettings(), settings)
    for number in range(3):
        scan = make_scan(0.4 * number)
        observed, update = growing_map.observe(scan), segmenter.register_scan(scan)

        np.testing.assert_array_equal(update.point_ids, observed.point_ids)
        assert (update.num_new, update.num_seen, update.floor) == (
            len(observed.new), len(observed.seen_again), observed.floor,
        )  # fmt: skip
        assert list(update.ms) == ["insert", "floor", "network", "cluster"]
