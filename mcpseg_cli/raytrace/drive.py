"""From a building to the poses it is scanned from: floor plan, waypoints, route (paper III-A)."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.raytrace.coverage import choose_waypoints, reached_shares
from mcpseg_cli.raytrace.floor_plan import FloorPlan, build_floor_plan
from mcpseg_cli.raytrace.inside import look_around_inside
from mcpseg_cli.raytrace.rays import cast_rays
from mcpseg_cli.raytrace.record import RouteRecord
from mcpseg_cli.raytrace.route import Route, plan_route, read_waypoints
from mcpseg_cli.raytrace.scanner import VirtualScanner
from mcpseg_cli.raytrace.sensors import survey_pattern

_HARDLY = 0.5  # of a room's free floor
_ROBOT_HEIGHT = 1.4  # metres; a plan's free floor has nothing lower over it
SCAN_SPOTS = "scan_spots.txt"
"""The file of waypoints that the authors' program expects in an area's folder."""

Progress = Callable[[int, int], None]
"""Called with how many of how many places have been looked from."""


@dataclass(frozen=True)
class Waypoints:
    """Where the robot is to go.

    Attributes:
        source: File they come from; None for automatic ones.
        places: (W, 2) float64, metres, map frame; None for automatic ones.
    """

    source: Path | None = None
    places: NDArray[np.float64] | None = None

    @property
    def identity(self) -> str:
        """Tell these waypoints from others: ``automatic``, or the file's name and a hash."""
        if self.source is None or self.places is None:
            return "automatic"
        digest = hashlib.blake2b(self.places.tobytes(), digest_size=8).hexdigest()
        return f"{self.source.name} {digest}"


@dataclass(frozen=True)
class Drive:
    """A planned drive.

    Attributes:
        plan: Where the robot can stand.
        route: Where it drives and scans.
        reached: Share of its free floor that the robot gets to, by room, in the order of the
            building.
    """

    plan: FloorPlan
    route: Route
    reached: dict[str, float]

    @property
    def unreachable(self) -> list[str]:
        """Rooms the robot does not get into."""
        return [room for room, share in self.reached.items() if share == 0.0]

    @property
    def hardly_reached(self) -> dict[str, float]:
        """Rooms of whose free floor the robot gets to less than half, with the share."""
        return {room: share for room, share in self.reached.items() if 0.0 < share < _HARDLY}

    def notices(self) -> tuple[str, ...]:
        """Give one line for each kind of place the robot does not get to; nothing when it does."""
        lines = []
        if self.unreachable:
            lines.append(f"cannot be reached: {', '.join(self.unreachable)}")
        if self.hardly_reached:
            shares = [f"{room} ({share:.0%})" for room, share in self.hardly_reached.items()]
            lines.append(f"less than half of the free floor can be reached in: {', '.join(shares)}")
        if len(self.route.skipped):
            places = ", ".join(f"({x:.2f}, {y:.2f})" for x, y in self.route.skipped.tolist())
            lines.append(f"waypoints not on free floor, skipped: {places}")
        return tuple(lines)

    def record(self) -> RouteRecord:
        """Return what raytrace.json says about the route."""
        return RouteRecord(
            waypoints=len(self.route.waypoints),
            waypoints_skipped=self.route.skipped.tolist(),
            length_m=round(self.route.length, 3),
            free_area_m2=round(float(self.plan.free.sum()) * self.plan.cell_size**2, 2),
            unreachable_rooms=self.unreachable,
            hardly_reached_rooms={
                room: round(share, 3) for room, share in self.hardly_reached.items()
            },
        )


def find_waypoints(building: Path, given: Path | None) -> Waypoints:
    """Read the waypoints that a user names, else those in the area's folder.

    Args:
        building: Where the building is read from; its folder may hold ``scan_spots.txt``.
        given: File of waypoints; None looks into the folder.

    Returns:
        The waypoints; automatic ones where there is no file.

    Raises:
        InputError: The file is no list of waypoints.
        OSError: It cannot be read.
    """
    source = given or building / SCAN_SPOTS
    if given is None and not source.is_file():
        return Waypoints()
    return Waypoints(source, read_waypoints(source))


def plan_drive(
    scanner: VirtualScanner,
    waypoints: Waypoints,
    *,
    threads: int = 1,
    progress: Progress | None = None,
) -> Drive:
    """Plan where the robot drives and scans.

    Args:
        scanner: Building, grid and settings.
        waypoints: Where to go; automatic ones are chosen so that all that can be seen is seen.
        threads: Threads to look around with.
        progress: Called with how many of how many places have been looked from.

    Raises:
        InputError: No floor to stand on, or no waypoint on it.
    """
    settings, building = scanner.settings, scanner.building
    source = waypoints.source or "the building"

    # where a robot can stand
    points = building.xyz
    if scanner.triangles is not None:
        points = look_around_inside(scanner.triangles, building)
    plan = build_floor_plan(points)
    if not plan.free.any():
        expected = "floor with 1.4 m of free space over it"
        raise InputError(source, "no free floor", expected, "is z up, in metres?")

    # where it is to go
    places = waypoints.places
    if places is None:
        places = _choose_places(scanner, plan, threads, progress)

    # the way past all of it
    route = plan_route(plan, places, settings.step / settings.views, settings.height)
    if len(route) == 0:
        remedy = "give others, or none for automatic ones"
        raise InputError(source, "no waypoint on free floor", "at least one", remedy)
    _check_height(scanner, plan, route)
    return Drive(plan, route, reached_shares(building, plan, route.regions))


def _choose_places(
    scanner: VirtualScanner, plan: FloorPlan, threads: int, progress: Progress | None
) -> NDArray[np.float64]:
    """Choose automatic waypoints, (W, 2); there is at least one."""
    settings, pattern = scanner.settings, scanner.pattern
    if settings.sensor != "sphere":
        pattern = survey_pattern(settings)
    height = settings.height
    places = choose_waypoints(
        scanner.grid, plan, pattern, height, num_threads=threads, progress=progress
    )
    if len(places) == 0:
        raise InputError(
            "the building",
            "nothing can be seen from its floor",
            "surfaces within reach of the rays",
            "another --range, --height, --voxel-size or elevation",
        )
    return places


def _check_height(scanner: VirtualScanner, plan: FloorPlan, route: Route) -> None:
    """Refuse a scanner that is over the ceiling at most places."""
    # what is straight below the scanner
    height, down = scanner.settings.height, np.array([[0.0, 0.0, -1.0]])
    voxels = [cast_rays(scanner.grid, place, down, height + 1.0)[0] for place in route.positions]
    below = np.array(voxels)

    # at most places it is to be the floor, not something far over it
    points = scanner.grid.points[below]
    over_floor = scanner.building.xyz[points, 2] - plan.floor_at(route.positions[:, :2])
    if np.count_nonzero((below >= 0) & (over_floor > _ROBOT_HEIGHT)) > len(route) / 2:
        raise InputError(
            f"--height {height:g}",
            "most places have something between floor and scanner",
            "a scanner below the ceiling",
            "give a lower one",
        )
