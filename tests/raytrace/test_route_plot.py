"""Pictures of routes."""

import sys

import numpy as np
import pytest

from mcpseg_cli.errors import OutputError
from mcpseg_cli.raytrace.floor_plan import build_floor_plan
from mcpseg_cli.raytrace.route import plan_route
from mcpseg_cli.raytrace.route_plot import plot_route
from tests.worlds import building_of, three_rooms


def pixels(path):
    image = pytest.importorskip("matplotlib.image")
    return image.imread(path)[:, :, :3]


def test_a_route_is_drawn_on_its_floor_plan(tmp_path):
    building = building_of(three_rooms(), ("office_1", "office_2", "WC_1"), [4.0, 8.0])
    plan = build_floor_plan(building.xyz)
    waypoints = np.array([[0.6, 0.6], [6.0, 2.0], [10.0, 1.0], [10.0, 3.0], [99.0, 0.0]])
    plot_route(tmp_path / "route.png", plan, plan_route(plan, waypoints), building)
    plot_route(tmp_path / "empty.png", plan, plan_route(plan, waypoints[-1:]))
    picture, empty = pixels(tmp_path / "route.png"), pixels(tmp_path / "empty.png")
    assert min(picture.shape[:2]) > 400
    coloured = [np.mean(np.ptp(image, axis=2) > 0.3) for image in (picture, empty)]
    assert coloured[0] > coloured[1] + 0.002  # the way, the names


def test_without_matplotlib_one_line_says_what_to_install(tmp_path, monkeypatch):
    plan = build_floor_plan(three_rooms())
    route = plan_route(plan, np.array([[0.6, 0.6]]))
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(OutputError, match=r"pip install 'mcpseg\[plot\]'") as caught:
        plot_route(tmp_path / "route.png", plan, route)
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_not_there_is_named(tmp_path):
    plan = build_floor_plan(three_rooms())
    with pytest.raises(OSError, match="nowhere"):
        plot_route(
            tmp_path / "nowhere" / "route.png", plan, plan_route(plan, np.array([[0.6, 0.6]]))
        )
