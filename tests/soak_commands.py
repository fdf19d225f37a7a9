"""The commands that the long campaign kills, each with what it must leave."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mcpseg_cli.choices import Architecture, Labelling
from mcpseg_cli.formats import write_cloud
from tests.areas import write_area
from tests.cli.test_raytrace import make_room
from tests.forks import run_to_end
from tests.recordings import write_recording, write_weights

METHODS: dict[str, tuple[Architecture, Labelling]] = {
    "segment mcpnet": ("mcpnet", "first"),
    "segment unet": ("unet", "fused"),
    "segment fused": ("mcpnet", "fused"),
}
NUM_SCANS = 60
_EXPORTS = ["ply", "las", "laz", "npz", "pcd", "h5", "csv", "json", "geojson", "html", "png"]
_TIMED = {"run.json", "events.jsonl", "state.sqlite"}  # say when they were written
_TIMED_ENDS = (".md", "holdout2.json")


@dataclass(frozen=True)
class Killable:
    """A command to kill.

    Attributes:
        name: What the report calls it.
        words: The command for an output folder.
        again: The one that goes on where a killed one ended.
        num_scans: Where it tells of scans, how many there are; 0 otherwise.
        before: What fills the output folder before.
    """

    name: str
    words: Callable[[Path], list[object]]
    again: Callable[[Path], list[object]]
    num_scans: int = 0
    before: Callable[[Path], object] = lambda out: out.mkdir()


def outputs_in(folder: Path) -> dict[str, bytes]:
    """Read all files below a folder; of those that say when they were made, only the names."""
    return {
        path.relative_to(folder).as_posix(): b"" if _is_timed(path.name) else path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def _is_timed(name: str) -> bool:
    return name in _TIMED or name.endswith(_TIMED_ENDS)


def killables(folder: Path) -> tuple[list[Killable], list[Killable]]:
    """Make what the commands need; return those that segment, by method, and all others."""
    folder.mkdir()
    recording = write_recording(folder / "input", num_scans=NUM_SCANS)
    weights = {name: folder / f"{name}.safetensors" for name in ("mcpnet", "unet")}
    for name, _ in METHODS.values():
        write_weights(weights[name], name)
    segments = [
        _same(
            name,
            lambda out, network=network, labelling=labelling: [
                "segment", *recording, "-o", out, "-w", weights[network],
                "--labelling", labelling, "-q",
            ],
            num_scans=NUM_SCANS,
        )
        for name, (network, labelling) in METHODS.items()
    ]  # fmt: skip
    return segments, [*_of_runs(folder, weights["unet"]), *_of_buildings(folder)]


def _same(
    name: str,
    words: Callable[[Path], list[object]],
    num_scans: int = 0,
    before: Callable[[Path], object] = lambda out: out.mkdir(),
) -> Killable:
    """Make one that the same command continues."""
    return Killable(name, words, words, num_scans, before)


def _of_runs(folder: Path, weights: Path) -> list[Killable]:
    """Make those that read or replace the runs of two small recordings."""
    runs = [folder / "run0", folder / "run1"]
    small = [write_recording(folder / f"small{n}", num_scans=8, seed=n) for n in range(2)]
    for run, recording in zip(runs, small, strict=True):
        ended = run_to_end(["segment", *recording, "-o", run, "-w", weights, "-q"], folder)
        assert ended.status == 0, ended.said

    def export(out: Path) -> list[object]:
        targets = [word for end in _EXPORTS for word in ("-o", out / f"map.{end}")]
        return ["export", runs[0], *targets, "-q"]

    return [
        Killable("export", export, lambda out: [*export(out), "--overwrite"]),
        _same("merge", lambda out: ["merge", *runs, "-o", out, "-q"]),
        _same(
            "segment --overwrite",
            lambda out: ["segment", *small[0], "-o", out, "-w", weights, "-q", "--overwrite"],
            before=lambda out: shutil.copytree(runs[1], out),
        ),
    ]


def _of_buildings(folder: Path) -> list[Killable]:
    """Make those that build, scan and learn."""
    write_cloud(folder / "room.ply", make_room())
    for number in (1, 2):
        write_area(folder / f"data/Area_{number}", 4, seed=number)
    coarse = ["--step", "0.1", "--h-res", "3", "--v-res", "3", "--noise", "0.01", "-q"]
    small = ["--holdout", "2", "--batch-size", "64", "--context", "8", "--epochs", "6", "-q"]
    rooms = ["--rooms", "3", "--spacing", "0.08", "--seed", "5", "--jobs", "1", "-q"]

    def train(out: Path) -> list[object]:
        return ["train", folder / "data", *small, "--cache", out / "cache", "-o", out / "trained"]

    return [
        _same("raytrace", lambda out: ["raytrace", folder / "room.ply", "-o", out, *coarse]),
        Killable("train", train, lambda out: [*train(out), "--resume"]),
        _same("synth", lambda out: ["synth", out / "Area_1", *rooms]),
    ]
