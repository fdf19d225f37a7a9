"""Sound tables, records and folders, for the long campaign to damage a file of each."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from mcpseg_cli.evaluate.class_map import read_class_map
from mcpseg_cli.formats.poses import read_poses
from mcpseg_cli.formats.recordings.rgbd import read_intrinsics, read_pose
from mcpseg_cli.formats.s3dis import read_area
from mcpseg_cli.formats.transform import read_transform
from mcpseg_cli.merge.recordings import read_recordings
from mcpseg_cli.raytrace.route import read_waypoints
from mcpseg_cli.segment.events import read_events
from mcpseg_cli.segment.run_record import RunRecord
from mcpseg_cli.synth.models.library import read_models
from mcpseg_cli.train.checkpoint import read_checkpoint, write_checkpoint
from mcpseg_cli.train.folder import TrainFiles
from mcpseg_cli.train.progress import TrainState
from tests.commands import run_to_its_end
from tests.recordings import write_weights
from tests.train.test_folder import make_record

Read = Callable[[Path], object]
IDENTITY = {"seed": 1}
_ROW = "0 0.1 0.2 0.3 0 0 0 1"


def tables(folder: Path, recording: tuple[Path, Path]) -> list[tuple[Path, Read]]:
    """Write them, and say what reads them.

    Args:
        folder: Where.
        recording: Scans and poses.
    """
    folder.mkdir(parents=True, exist_ok=True)
    texts: dict[str, tuple[str, Read]] = {
        "map.csv": ("label,class\nbed,clutter\nwall,wall\nrug,-\n", read_class_map),
        "way.txt": ("x y\n0.5 1.5\n2 3 # there\n", read_waypoints),
        "motion.txt": ("1 0 0 2\n0 1 0 3\n0 0 1 4\n0 0 0 1\n", read_transform),
        "table.csv": ("scans,poses,settings,name\na/scans,a/p.csv,-q,one\n", read_recordings),
        "graph.g2o": (f"VERTEX_SE3:QUAT {_ROW}\nVERTEX_SE3:QUAT 1{_ROW[1:]}\n", read_poses),
        "images.txt": ("# COLMAP\n1 1 0 0 0 0.1 0.2 0.3 1 a.jpg\n\n", read_poses),
        "kitti.txt": ("1 0 0 1 0 1 0 2 0 0 1 3\n" * 3, read_poses),
        "intrinsics.txt": ("500 500 320 240\n", lambda path: read_intrinsics(path.parent)),
        "pose.txt": ("1 0 0 2\n0 1 0 3\n0 0 1 4\n0 0 0 1\n", read_pose),
        "models.csv": (
            "model,name,class,placed,stands_for,width,depth,height,part,creator,licence,rotation\n"
            "a.obj,Chair,chair,floor,task,0.5,0.5,0.9,train,Me,CC0,\n",
            _read_models,
        ),
    }  # fmt: skip
    found: list[tuple[Path, Read]] = []
    for name, (text, read) in texts.items():
        (folder / name).write_text(text)
        found.append((folder / name, read))
    return [*found, *_of_a_run(folder, recording), *_of_training(folder), _annotation(folder)]


def _read_models(path: Path) -> object:
    """Read a table of models beside the mesh that it names."""
    (path.parent / "a.obj").touch()
    return read_models(path.parent)


def _of_a_run(folder: Path, recording: tuple[Path, Path]) -> list[tuple[Path, Read]]:
    """Label a recording: its record and events."""
    weights = write_weights(folder / "tables.safetensors", "mcpnet")
    run_to_its_end("segment", *recording, "-o", folder / "run", "-w", weights, "-q")
    return [
        (folder / "run/run.json", lambda path: RunRecord.read(path.parent)),
        (folder / "run/events.jsonl", read_events),
    ]


def _of_training(folder: Path) -> list[tuple[Path, Read]]:
    """Write a checkpoint, a record and samples."""
    network = {"layer.weight": torch.ones(3, 2)}
    best = {"layer.weight": torch.zeros(3, 2)}
    state = TrainState(2, (), 0, network, best, {"0.step": torch.ones(1)}, torch.zeros(4))
    write_checkpoint(folder / "train.checkpoint", state, IDENTITY)
    (folder / "record.json").write_text(make_record().model_dump_json())
    return [
        (folder / "train.checkpoint", lambda path: read_checkpoint(path, IDENTITY)),
        (folder / "record.json", lambda path: TrainFiles(path.parent, path.stem).read_record()),
    ]


def _annotation(folder: Path) -> tuple[Path, Read]:
    """Write an object of a room of S3DIS."""
    path = folder / "chair_1.txt"
    np.savetxt(path, np.column_stack([np.random.default_rng(0).random((20, 3)), np.ones((20, 3))]))

    def read(damaged: Path) -> object:
        room = damaged.parent / "room/office_1/Annotations"
        shutil.rmtree(room.parents[1], ignore_errors=True)
        room.mkdir(parents=True)
        shutil.copy(damaged, room / "chair_1.txt")
        np.savetxt(room / "floor_1.txt", np.ones((4, 6)))
        return read_area(room.parents[1], use_cache=False)

    return path, read
