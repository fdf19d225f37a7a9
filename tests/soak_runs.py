"""Finished runs, for the long campaign to damage a file of each before a command reads them."""

from __future__ import annotations

import shutil
from pathlib import Path

from mcpseg_cli.formats import Cloud, read_cloud, write_cloud
from mcpseg_cli.synth.models.meshes import read_pieces
from tests.cli.test_raytrace import make_room
from tests.recordings import write_recording, write_weights
from tests.soak_sound import Sound, obey, sound_in

_MENDED = ("map.ply", "objects.json")
_COARSE = ("--step", "0.5", "--h-res", "9", "--v-res", "9", "--noise", "0.01", "-q")


def runs(folder: Path) -> list[Sound]:
    """Make a run of segment and one of raytrace, and a model of furniture."""
    folder.mkdir(parents=True, exist_ok=True)
    return [*_of_segment(folder), *_of_raytrace(folder), *_models(folder / "models")]


def _of_segment(folder: Path) -> list[Sound]:
    """Label a recording; its run is continued, scored, merged and exported."""
    recording = write_recording(folder / "input", num_scans=3)
    weights = write_weights(folder / "unet.safetensors", "unet")
    run = folder / "run"
    words = ["segment", *recording, "-o", run, "-w", weights, "-q"]
    obey(*words)
    sound = {name: (run / name).read_bytes() for name in _MENDED}
    cloud = read_cloud(run / "map.ply")
    write_cloud(folder / "truth.ply", Cloud(cloud.columns, cloud.classes))

    def resume(whole: Path) -> None:
        """Go on with a run that is done: what follows from its checkpoint is mended."""
        again = _copied(whole, folder / "again")
        obey(*[again if word is run else word for word in words])
        for name, data in sound.items():
            assert (again / name).read_bytes() == data, f"another {name}, in silence"

    def score(whole: Path) -> None:
        obey("eval", whole, folder / "truth.ply", "--json", "-q")

    def merge(whole: Path) -> None:
        shutil.rmtree(folder / "merged", ignore_errors=True)
        obey("merge", whole, "-o", folder / "merged", "-q")

    def export(whole: Path) -> None:
        outputs = [word for end in ("json", "csv", "npz") for word in ("-o", folder / f"e.{end}")]
        obey("export", whole, *outputs, "-q", "--overwrite")

    damaged = {
        resume: (*_MENDED, "run.json", "events.jsonl"),
        score: ("map.ply", "run.json", "events.jsonl", "scans/000001.ply"),
        merge: ("state.sqlite", "run.json"),
        export: ("state.sqlite", "run.json"),
    }
    return [
        sound_in(_copied(run, folder / f"{does.__name__}-{number}"), inner, does, is_slow=True)
        for does, inners in damaged.items()
        for number, inner in enumerate(inners)
    ]


def _copied(folder: Path, to: Path) -> Path:
    """Copy a folder, in place of an earlier copy."""
    shutil.rmtree(to, ignore_errors=True)
    shutil.copytree(folder, to)
    return to


def _of_raytrace(folder: Path) -> list[Sound]:
    """Scan a room; the run is gone on with."""
    room, traced = folder / "room.ply", folder / "traced"
    write_cloud(room, make_room())
    obey("raytrace", room, "-o", traced, *_COARSE)

    def go_on(whole: Path) -> None:
        obey("raytrace", room, "-o", _copied(whole, folder / "retraced"), *_COARSE)

    return [
        sound_in(traced, inner, go_on, is_slow=True) for inner in ("raytrace.json", "poses.csv")
    ]


def _models(folder: Path) -> list[Sound]:
    """Write a model of furniture."""
    import trimesh

    folder.mkdir(parents=True)
    trimesh.creation.box(extents=(0.5, 0.9, 0.5)).export(folder / "chair.obj")
    trimesh.creation.box(extents=(0.5, 0.9, 0.5)).export(folder / "chair.glb")
    return [
        sound_in(
            folder,
            name,
            lambda whole, name=name: read_pieces.__wrapped__(whole / name, (), (0.5, 0.5, 0.9)),
        )
        for name in ("chair.obj", "chair.glb")
    ]
