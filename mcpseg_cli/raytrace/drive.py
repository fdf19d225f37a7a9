"""From a building to the poses it is scanned from: floor plan, waypoints, route (paper III-A)."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.raytrace.coverage import choose_waypoints, unreachable_rooms
from mcpseg_cli.raytrace.floor_plan import FloorPlan, build_floor_plan
from mcpseg_cli.raytrace.route import Route, plan_route, read_waypoints
from mcpseg_cli.raytrace.scanner import VirtualScanner

SCAN_SPOTS = "scan_spots.txt"
"""The file of waypoints that the authors' program expects in an area's folder."""


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
        """Tell these waypoints from others: ``automatic``, or the file's name and a hash of the places."""
        if self.source is None or self.places is None:
            return "automatic"
        return f"{self.source.name} {hashlib.blake2b(self.places.tobytes(), digest_size=8).hexdigest()}"


@dataclass(frozen=True)
class Drive:
    """A planned drive: the floor plan, the route, the waypoints' source, and rooms the robot does not get into."""

    plan: FloorPlan
    route: Route
    waypoints: str
    unreachable: tuple[str, ...]

    def record(self) -> dict[str, object]:
        """Return what raytrace.json says about the route."""
        return {
            "waypoints": len(self.route.waypoints),
            "waypoints_skipped": self.route.skipped.tolist(),
            "length_m": round(self.route.length, 3),
            "free_area_m2": round(float(self.plan.free.sum()) * self.plan.cell_size**2, 2),
            "unreachable_rooms": list(self.unreachable),
        }


def find_waypoints(building: Path, given: Path | None) -> Waypoints:
    """Read the waypoints a user names, else the ``scan_spots.txt`` of the area's folder, else choose none yet.

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
    progress: Callable[[int, int], None] | None = None,
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
    plan = build_floor_plan(building.xyz)
    source = waypoints.source or "the building"
    if not plan.free.any():
        raise InputError(source, "no free floor", "floor with 1.4 m of free space over it", "is z up, in metres?")
    places = waypoints.places
    if places is None:
        places = choose_waypoints(
            scanner.grid, plan, scanner.pattern, settings.height, num_threads=threads, progress=progress
        )
    route = plan_route(plan, places, settings.step, settings.height)
    if len(route) == 0:
        raise InputError(source, "no waypoint on free floor", "at least one", "give others, or none for automatic ones")
    return Drive(plan, route, waypoints.identity, tuple(unreachable_rooms(building, plan, route.regions)))
