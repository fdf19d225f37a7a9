"""Many robots, one building: is the merged map of four as good as that of one that did it all?

    python -m tests.benchmarks.robots [--seed 101 102 103 104 105] [--rooms 40] [--folder KEPT]

For each seed an office that no weights were trained on (those are of seeds below 50), and a way
through all of it. One robot scans every metre of it. Four robots scan a stretch of it each, and the
beginning of the next one's half a metre off, so that the rooms between them are seen by two. Then
one robot makes all scans of the four in one run, so that merging alone differs. All is what
``mcpseg segment`` with ``unet`` and ``mcpseg merge`` make by default, and ``mcpseg eval`` scores.
With --folder, what is there already is not made again.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import fmean
from unittest.mock import patch

import numpy as np

from mcpseg_cli.config import RaytraceSettings
from mcpseg_cli.incremental import uniting
from mcpseg_cli.merge.run import merge_runs
from mcpseg_cli.raytrace.drive import Waypoints, plan_drive
from mcpseg_cli.raytrace.run import RaytraceRequest, RaytraceRun
from mcpseg_cli.raytrace.scanner import scan_name
from mcpseg_cli.synth import make_building

NUM_STYLES = 6  # of offices
NOISE = 0.004  # metres
FIGURES = {
    "mIoU": "miou", "accuracy": "point_accuracy", "AP50": "ap50", "PQ": "pq",
    "met": "precision_50", "NMI": "nmi", "ARI": "ari",
    "objects": "objects_pred", "true_objects": "objects_true", "scans": "scans",
}  # fmt: skip
Figures = dict[str, float]
PERCENT = ("mIoU", "accuracy", "AP50", "PQ", "met")


@dataclass(frozen=True)
class Robot:
    """Numbers of the scans of a robot, in the order of driving.

    Attributes:
        own: On its stretch of the way.
        beyond: On the beginning of the next one's.
    """

    own: list[int]
    beyond: list[int]

    @property
    def scans(self) -> list[int]:
        """All of them."""
        return self.own + self.beyond


def share_way(num_places: int, num_robots: int, overlap: float) -> list[Robot]:
    """Say where each robot scans.

    Args:
        num_places: Places on the way, half a step apart.
        num_robots: How many share it.
        overlap: How much of the next one's stretch a robot scans too.

    Returns:
        Places of each: even ones of its stretch, odd ones beyond it.
    """
    stretches = np.array_split(np.arange(0, num_places - 1, 2), num_robots)
    more = round(overlap * len(stretches[0]))
    beyond = [*(stretch[:more] + 1 for stretch in stretches[1:]), stretches[0][:0]]
    return [Robot(*(each.tolist() for each in two)) for two in zip(stretches, beyond, strict=True)]


def make_scans(folder: Path, seed: int, options: argparse.Namespace) -> list[Robot]:
    """Write ``scans/``, ``gt/`` and ``poses.csv`` of all scans, robot by robot."""
    kept = folder / "robots.json"
    if kept.is_file():
        return [Robot(**robot) for robot in json.loads(kept.read_text())]
    building = make_building(1 + seed % NUM_STYLES, seed, num_rooms=options.rooms)
    settings = RaytraceSettings(step=options.step / 2, noise=NOISE, seed=seed)
    request = RaytraceRequest(f"office of seed {seed}", settings, ".ply", Waypoints())
    run = RaytraceRun(folder, building, request, overwrite=True)
    drive = plan_drive(run.scanner, request.waypoints)

    # places become scans, numbered in the order of the robots
    places = share_way(len(drive.route), options.robots, options.overlap)
    order = [place for robot in places for place in robot.scans]
    run.start(drive.route.poses[order], drive.record())
    assert run.num_scans == len(order), "a place from which nothing is seen"
    for _ in run.run(1):
        pass
    number = {place: number for number, place in enumerate(order)}
    robots = [
        Robot([number[place] for place in robot.own], [number[place] for place in robot.beyond])
        for robot in places
    ]
    kept.write_text(json.dumps([asdict(robot) for robot in robots]))
    return robots


def segment(folder: Path, name: str, numbers: list[int]) -> Path:
    """Label some of the scans; return the folder of the map."""
    scans, output = folder / "in" / name, folder / "maps" / name
    if (output / "objects.json").is_file():
        return output
    scans.mkdir(parents=True, exist_ok=True)
    header, *rows = (folder / "poses.csv").read_text().splitlines()
    poses = folder / "in" / f"{name}.csv"
    poses.write_text("\n".join([header, *[rows[number] for number in numbers]]) + "\n")
    for number in numbers:
        file = f"{scan_name(number)}.ply"
        if not (scans / file).exists():
            (scans / file).symlink_to(folder.resolve() / "scans" / file)
    mcpseg("segment", scans, poses, "-o", output, "-w", "unet", "-q")
    for labelled in (output / "scans").glob("*.ply"):
        labelled.unlink()
    return output


def merge(folder: Path, name: str, maps: list[Path], *, heard: bool = True) -> Path:
    """Merge maps; return the folder of the result.

    Args:
        folder: Of the building.
        name: What the result is called.
        maps: Which.
        heard: Whether the objects that maps have count, or the sums of evidence alone.
    """
    output = folder / "maps" / name
    if not (output / "objects.json").is_file():
        with patch.object(uniting, "INERTIA", uniting.INERTIA if heard else 0):
            merge_runs(maps, output, {})
    return output


def score(output: Path, truth: Path) -> Figures:
    """Score a map."""
    found = json.loads(mcpseg("eval", output, truth, "--json", "-q"))
    return {
        name: round(found[key] * (100 if name in PERCENT else 1), 4)
        for name, key in FIGURES.items()
    }


def mcpseg(*words: object) -> str:
    """Run a command; return what it printed."""
    command = [sys.executable, "-m", "mcpseg_cli", *map(str, words)]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def measure(folder: Path, seed: int, options: argparse.Namespace) -> dict[str, Figures]:
    """Make the maps of one building; give their figures by what they are of."""
    robots = make_scans(folder, seed, options)
    one = segment(folder, "one", [number for robot in robots for number in robot.own])
    same = segment(folder, "same", [number for robot in robots for number in robot.scans])
    parts = [
        segment(folder, f"robot_{number}", robot.scans)
        for number, robot in enumerate(robots, start=1)
    ]
    maps = {
        "one robot": one,
        "its map, merged alone": merge(folder, "one_alone", [one]),
        "four robots, merged": merge(folder, "merged", parts),
        "four, maps' objects not heard": merge(folder, "unheard", parts, heard=False),
        "one robot, the scans of the four": same,
        "that map, merged alone": merge(folder, "same_alone", [same]),
    }
    return {name: score(output, folder / "gt") for name, output in maps.items()}


def mean_of(buildings: list[dict[str, Figures]]) -> dict[str, Figures]:
    """Average the figures of the buildings."""
    return {
        name: {key: round(fmean(each[name][key] for each in buildings), 4) for key in FIGURES}
        for name in buildings[0]
    }


def main() -> None:
    """Print the figures of each building, then their means."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, nargs="+", default=[101, 102, 103, 104, 105])
    parser.add_argument("--rooms", type=int, default=40)
    parser.add_argument("--step", type=float, default=1.0, help="metres between scans")
    parser.add_argument("--robots", type=int, default=4)
    parser.add_argument("--overlap", type=float, default=0.12, help="of the next one's stretch")
    parser.add_argument("--folder", type=Path, help="to keep everything in")
    options = parser.parse_args()
    buildings = []
    with tempfile.TemporaryDirectory() as name:
        for seed in options.seed:
            folder = (options.folder or Path(name)) / f"seed_{seed}"
            buildings.append(measure(folder, seed, options))
            print(json.dumps({"seed": seed} | buildings[-1]), flush=True)
    print(json.dumps({"mean": mean_of(buildings)}, indent=1))


if __name__ == "__main__":
    main()
