"""How much of what a scanner could see the automatic route sees, and what it costs.

    python -m tests.benchmarks.coverage AREA [AREA ...] [--every 1] [--threads 2] [--plot FOLDER]

AREA is a folder in the S3DIS layout or any file that holds a labelled building. What could be seen
is what 1-degree scans from every free cell of the driven region see, of 5 m reach; the automatic
route scans every 0.2 m.
"""

from __future__ import annotations

import argparse
import os
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from mcpseg_cli.building import Building
from mcpseg_cli.formats.buildings import read_building
from mcpseg_cli.raytrace.coverage import choose_waypoints, reached_shares
from mcpseg_cli.raytrace.floor_plan import build_floor_plan
from mcpseg_cli.raytrace.occupancy import OccupancyGrid, build_grid
from mcpseg_cli.raytrace.rays import ScanPattern, cast_rays
from mcpseg_cli.raytrace.route import plan_route
from mcpseg_cli.raytrace.route_plot import plot_route

SENSOR_HEIGHT = 1.0


def seen_from(
    grid: OccupancyGrid, positions: np.ndarray, pattern: ScanPattern, threads: int
) -> np.ndarray:
    """Mark the voxels that scans from any of the positions see."""
    directions = pattern.directions()

    def look(part: np.ndarray) -> np.ndarray:
        is_seen = np.zeros(len(grid), bool)
        for position in part:
            hits = cast_rays(grid, position, directions, pattern.reach)
            is_seen[hits[hits >= 0]] = True
        return is_seen

    with ThreadPoolExecutor(threads) as pool:
        return np.logical_or.reduce(
            list(pool.map(look, [positions[part::threads] for part in range(threads)]))
        )


def measure(
    building: Building, every: int = 1, threads: int = 2, picture: Path | None = None
) -> dict[str, object]:
    """Plan the automatic route of one building and compare what it sees with what could be seen."""
    # each step of planning, timed
    pattern, marks = ScanPattern(), [time.perf_counter()]
    plan = build_floor_plan(building.xyz)
    marks.append(time.perf_counter())
    grid = build_grid(building.xyz, 0.1)
    marks.append(time.perf_counter())
    waypoints = choose_waypoints(grid, plan, pattern, SENSOR_HEIGHT, num_threads=threads)
    marks.append(time.perf_counter())
    route = plan_route(plan, waypoints, sensor_height=SENSOR_HEIGHT)
    marks.append(time.perf_counter())
    steps = ("floor_plan", "grid", "waypoints", "route")
    seconds = dict(zip(steps, np.diff(marks).round(2).tolist(), strict=True))
    if picture is not None:
        plot_route(picture, plan, route, building)

    # what all places see, and what those of the route see
    places = plan.centre_of(np.argwhere(plan.region == 1)[::every])
    origins = np.column_stack([places, plan.floor_at(places) + SENSOR_HEIGHT])
    could = seen_from(grid, origins, pattern, threads)
    does = seen_from(grid, route.positions, pattern, threads)

    shares = reached_shares(building, plan, route.regions)
    return {
        "seen": f"{np.count_nonzero(does & could) / max(1, np.count_nonzero(could)):.2%}",
        "voxels": len(grid),
        "could_be_seen": int(np.count_nonzero(could)),
        "from_places": len(places),
        "waypoints": len(route.waypoints),
        "length_m": round(route.length, 1),
        "scans": len(route),
        "unreachable": [room for room, share in shares.items() if not share],
        "seconds": seconds,
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("areas", nargs="+", type=Path, metavar="AREA")
    parser.add_argument(
        "--every", type=int, default=1, help="compare with one in so many free cells only"
    )
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument(
        "--plot", type=Path, metavar="FOLDER", help="draw each route as FOLDER/NAME.png"
    )
    arguments = parser.parse_args()

    for area in arguments.areas:
        building, _ = read_building(area, use_cache=False)
        picture = arguments.plot / f"{area.stem}.png" if arguments.plot else None
        result = measure(building, arguments.every, arguments.threads, picture)
        print(f"{area.name}: load {os.getloadavg()[0]:.1f}, {len(building):,} points")
        for name, value in result.items():
            print(f"  {name:14} {value}")


if __name__ == "__main__":
    main()
