"""Make the weights ``unet`` and ``unet-home`` from nothing: furniture, buildings, scans, trainings.

  python models/make_weights.py work/
  python models/make_weights.py work/ --device cuda --workers 16

Every step is a command of mcpseg; ``--plan`` prints them all and runs none. What is done is not
done again, and what was interrupted goes on: run the same command again. ``work/trained`` holds the
weights with cards and settings at the end, ``work/furniture/CREDITS.md`` the creators to name.

Four trainings follow one another: offices and first homes, furniture and sensors, then buildings
whose objects have finer classes, for ``unet-home`` and, with these joined to 13, for ``unet``.
Buildings are deleted once they are scanned.
"""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

MODELS = Path(__file__).parent
ROOMS, SPACING, STEP = 16, 0.022, 0.4
OF_SENSORS = {
    "sphere": ("--noise", "0.004"),
    "depth-camera": ("--scanner", "depth-camera"),
    "lidar-16": ("--scanner", "lidar-16"),
    "lidar-32": ("--scanner", "lidar-32"),
}


@dataclass(frozen=True)
class Building:
    """A building to scan.

    Attributes:
        seed: Of its making, and of the sensor's way through it.
        number: Its number decides its style: 1 to 6 are offices, 7, 17, 27 homes, 16 joinery.
        sensors: It is recorded once by each.
        models: Furnished with models, too.
        style: Another style than its number's.
        classes: What its objects are named by.
    """

    seed: int
    number: int
    sensors: tuple[str, ...] = ("sphere",)
    models: bool = False
    style: int | None = None
    classes: str = "s3dis"

    @property
    def name(self) -> str:
        """Classes, seed and number, as folders are named."""
        return f"{self.classes}/seed_{self.seed}/Area_{self.number}"

    def recordings(self) -> Iterator[tuple[str, str]]:
        """Yield sensor and name of each recording; its last figure tells what to hold out."""
        for sensor in self.sensors:
            kind = "seed" if sensor == "sphere" else sensor.split("-")[0]
            yield sensor, f"{self.classes}/{kind}_{self.seed}/Area_{self.number}"


BOTH = ("sphere", "depth-camera")
OFFICES = [Building(seed, number) for seed in (1, 2, 3) for number in range(1, 7)]
FIRST = [Building(seed, 7) for seed in (1, 2, 3, 5, 6, 7, 8)]
SECOND = [
    Building(11, 7, models=True),
    Building(11, 17, BOTH, models=True),
    Building(11, 27),
    Building(12, 7, BOTH),
    Building(12, 17),
    Building(12, 27, BOTH, models=True),
    Building(13, 7, models=True),
    Building(13, 17, models=True),
    Building(13, 27),
    Building(11, 16),
    Building(12, 16, BOTH, models=True),
    Building(11, 1, models=True),
    Building(11, 2, ("sphere", "lidar-16"), models=True),
    *(Building(11, number, models=True) for number in (3, 4, 5)),
]
HELD_OUT = [Building(9, 9), Building(14, 9, style=17)]


def finer(seed: int, numbers: Iterable[int], sensor: str, *, models: bool = True) -> list[Building]:
    """Buildings whose objects have the classes of homes, seen by one sensor."""
    return [Building(seed, number, (sensor,), models, classes="home") for number in numbers]


HOMES, CAMERA = (7, 17, 27), "depth-camera"
THIRD = [
    *finer(41, (*HOMES, 37, 1, 4), CAMERA),
    *finer(42, HOMES, CAMERA, models=False),
    *finer(42, (37,), CAMERA),
    *finer(43, (*HOMES, 16), CAMERA),
    *finer(44, HOMES, CAMERA),
    *finer(45, (*HOMES, 16, 1, 2, 3, 4, 5, 6), "sphere"),
    *finer(45, (37,), "sphere", models=False),
    *finer(46, (*HOMES, 16, 37, 4, 5, 6), "sphere"),
    *finer(46, (1, 2, 3), "sphere", models=False),
    *finer(47, HOMES, "sphere"),
    *finer(47, (2,), "lidar-16", models=False),
    *finer(48, (7,), "lidar-16"),
    *finer(48, (5,), "lidar-32"),
    *finer(49, (17, 3), "sphere"),
]
FINER_HELD_OUT = [replace(building, classes="home") for building in HELD_OUT]
TRAININGS = {  # name, areas, settings, what it starts from
    "unet-base": (OFFICES + FIRST + HELD_OUT, "unet-base.toml", None),
    "unet-second": (OFFICES + SECOND + HELD_OUT, "unet-second.toml", "unet-base"),
    "unet-home": (THIRD + FINER_HELD_OUT, "unet-home.toml", "unet-second"),
    "unet": (THIRD + FINER_HELD_OUT, "unet.toml", "unet-home"),
}


class Maker:
    """Runs what is left of all steps.

    Args:
        asked: Command line.
    """

    def __init__(self, asked: argparse.Namespace) -> None:
        self.asked = asked
        self.work: Path = asked.work
        self.trained = self.work / "trained"

    def make(self) -> None:
        """Run all steps in order; recordings side by side.

        Raises:
            CalledProcessError: A command failed; it has said why.
        """
        buildings = list(dict.fromkeys(each for areas, *_ in TRAININGS.values() for each in areas))
        if not self.asked.without_models:
            self._fetch_furniture()
        if self.asked.plan:
            for building in buildings:
                self._record(building)
        else:
            with ThreadPoolExecutor(self.asked.workers) as pool:
                list(pool.map(self._record, buildings))
        for name, (areas, settings, start) in TRAININGS.items():
            self._train(name, areas, settings, start)

    def _fetch_furniture(self) -> None:
        if not (self.work / "furniture" / "CREDITS.md").exists():
            deb = ("--deb", str(self.asked.deb)) if self.asked.deb else ()
            script = str(MODELS / "fetch_furniture.py")
            self._run([sys.executable, script, str(self.work / "furniture"), *deb])

    def _record(self, building: Building) -> None:
        """Make a building, scan it with each of its sensors, and delete it."""
        left = [
            (sensor, name)
            for sensor, name in building.recordings()
            if not self._recorded(name).exists()
        ]
        if not left:
            return
        area = self.work / "buildings" / building.name
        words = ["--seed", str(building.seed), "--rooms", str(self.asked.rooms)]
        words += ["--spacing", str(SPACING), "--classes", building.classes]
        words += ["--style", str(building.style)] if building.style else []
        if building.models and not self.asked.without_models:
            words += ["--models", str(self.work / "furniture")]
        self._mcpseg("synth", str(area), *words, "-j", "1")

        for sensor, name in left:
            # under its name once it is whole: an interrupted one is continued where it was
            recording, part = self.work / "scans" / name, self.work / "parts" / name
            words = [
                "--step",
                str(self.asked.step),
                "--voxel-size",
                "0.05",
                "--seed",
                str(building.seed),
            ]
            words += ["-j", "1", *OF_SENSORS[sensor]]
            self._mcpseg("raytrace", str(area), "-o", str(part), *words)
            if not self.asked.plan:
                recording.parent.mkdir(parents=True, exist_ok=True)
                part.rename(recording)
        if not self.asked.plan:
            shutil.rmtree(area, ignore_errors=True)

    def _recorded(self, name: str) -> Path:
        return self.work / "scans" / name

    def _train(self, name: str, areas: list[Building], settings: str, start: str | None) -> None:
        """Train on these areas and validate on those held out, of number 9."""
        data = self._gather(name, areas)
        words = ["--holdout", "9", "--name", name, "--config", str(MODELS / settings)]
        words += ["-w", str(self.trained / f"{start}.safetensors")] if start else []
        words += ["--epochs", str(self.asked.epochs)] if self.asked.epochs else []
        words += ["--precision", self.asked.precision] if self.asked.precision else []
        words += ["--device", self.asked.device, "-j", str(self.asked.workers), "--resume"]
        self._mcpseg("train", str(data), *words, "-o", str(self.trained))

    def _gather(self, name: str, areas: list[Building]) -> Path:
        """Link the recordings of a training into a folder of their own."""
        folder = self.work / "data" / name
        for building in areas:
            for _, recording in building.recordings():
                link = folder / recording
                if not self.asked.plan and not link.is_symlink():
                    link.parent.mkdir(parents=True, exist_ok=True)
                    link.symlink_to(os.path.relpath(self._recorded(recording), link.parent))
        return folder

    def _mcpseg(self, command: str, *words: str) -> None:
        self._run([sys.executable, "-m", "mcpseg_cli", command, *words, "-q"])

    def _run(self, words: list[str]) -> None:
        print(shlex.join(words), flush=True)
        if not self.asked.plan:
            subprocess.run(words, check=True, stdout=subprocess.DEVNULL)


def read_command_line(words: list[str] | None = None) -> argparse.Namespace:
    """Read what to do; ``words`` as of the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("work", type=Path, help="folder for everything that is made")
    parser.add_argument("--device", default="cpu", help="where to train: cpu, cuda")
    parser.add_argument("--workers", type=int, default=2, help="buildings made side by side")
    parser.add_argument("--precision", choices=["fp32", "bf16"], help="default: bf16")
    parser.add_argument("--deb", type=Path, help="the furniture's package, where there is one")
    parser.add_argument("--plan", action="store_true", help="print the commands, run none")
    parser.add_argument("--without-models", action="store_true", help="no furniture models")
    parser.add_argument("--rooms", type=int, default=ROOMS, help="of each building")
    parser.add_argument("--step", type=float, default=STEP, help="metres between two scans")
    parser.add_argument("--epochs", type=int, help="of each training; default: its settings'")
    return parser.parse_args(words)


def main(words: list[str] | None = None) -> int:
    """Make the weights; 1 where a command failed."""
    try:
        Maker(read_command_line(words)).make()
    except subprocess.CalledProcessError as error:
        print(f"stopped at: {shlex.join(error.cmd)}; run again to go on", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
