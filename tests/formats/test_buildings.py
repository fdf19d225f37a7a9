"""Labelled clouds as buildings: other units and axes are refused, other names are found."""

import numpy as np
import pytest

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import Cloud, write_cloud
from mcpseg_cli.formats.buildings import read_building
from mcpseg_cli.formats.labels import LabelFields


def room(way=lambda xyz: xyz, **columns: np.ndarray) -> Cloud:
    """A floor (class 1) and a ceiling (class 0) of 6 m by 8 m."""
    rng = np.random.default_rng(0)
    xyz = rng.uniform([0, 0, 0], [6, 8, 0.01], (800, 3))
    xyz[400:, 2] += 2.8
    axes = dict(zip("xyz", way(xyz).T, strict=True))
    return Cloud(axes | (columns or {"semantic": np.repeat([1, 0], 400)}))


@pytest.mark.parametrize(
    ("way", "says"),
    [
        (lambda xyz: xyz * 1000, "a building 2,8.. m high; expected metres"),
        (lambda xyz: xyz * 100, "a building 28. m high; expected metres"),
        (lambda xyz: xyz[:, [0, 2, 1]], r"a floor that lies flat in y and .* expected z up"),
        (lambda xyz: xyz + 500_000.0, "coordinates up to 500,008 m"),
    ],
)
def test_buildings_that_are_not_upright_in_metres_are_refused(tmp_path, way, says):
    write_cloud(tmp_path / "a.npz", room(way))
    with pytest.raises(InputError, match=says):
        read_building(tmp_path / "a.npz")


def test_labels_by_other_names_are_found_or_named(tmp_path):
    labels = np.repeat([1, 0], 400)
    write_cloud(tmp_path / "a.npz", room(label=labels, objectId=labels))
    building, notices = read_building(tmp_path / "a.npz")
    assert building.semantic.tolist() == building.instance.tolist() == labels.tolist()
    assert notices == ("no colour; every point is grey",)
    write_cloud(tmp_path / "b.npz", room(mine=labels))
    assert read_building(tmp_path / "b.npz", fields=LabelFields("mine"))[0].semantic[0] == 1


def test_points_without_coordinates_are_left_out_and_counted(tmp_path):
    cloud = room()
    cloud.columns["x"][:5] = np.nan
    write_cloud(tmp_path / "a.npz", cloud)
    building, notices = read_building(tmp_path / "a.npz")
    assert len(building) == 795
    assert notices[0].startswith("5 points without coordinates")
