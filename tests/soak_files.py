"""Sound files for every reader there is, for the long campaign to damage."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import trimesh
from PIL import Image

from mcpseg_cli.building import Building
from mcpseg_cli.config import RaytraceSettings
from mcpseg_cli.evaluate.truth import open_truth
from mcpseg_cli.formats import CLOUD_SUFFIXES, Cloud, read_cloud, write_cloud
from mcpseg_cli.formats.class_table import read_class_table
from mcpseg_cli.formats.hdf5 import read_building_h5, read_tags, write_building_h5
from mcpseg_cli.formats.meshes import read_mesh
from mcpseg_cli.formats.poses import read_poses
from mcpseg_cli.formats.recording import open_recording
from mcpseg_cli.formats.recordings.depth_frames import read_colour, read_depth
from mcpseg_cli.formats.recordings.stations import open_stations
from mcpseg_cli.networks.weights import load_weights
from mcpseg_cli.raytrace.record import (
    FinishedRecord,
    ObjectRecord,
    RouteRecord,
    read_record,
    record_text,
)
from mcpseg_cli.train.settings_file import read_settings
from tests import containers, soak_folders, soak_prepared, soak_runs, soak_tables
from tests.recordings import write_recording, write_weights
from tests.soak_sound import Sound, sound_of

NUM_POINTS = 40  # of a cloud to damage: a header is a good part of its file


def sound_files(folder: Path) -> list[Sound]:
    """Write a file of every format that there is a reader for."""
    folder.mkdir(parents=True, exist_ok=True)
    scans, poses = write_recording(folder / "input", num_scans=9)
    few = _few(read_cloud(scans / "000000.ply"))
    clouds = []
    for suffix in CLOUD_SUFFIXES:
        write_cloud(folder / f"cloud{suffix}", few)
        clouds.append(sound_of(folder / f"cloud{suffix}", read_cloud))
    numbers = np.column_stack([few.xyz, np.ones(NUM_POINTS)]).astype("<f4")
    (folder / "sweep.bin").write_bytes(numbers.tobytes())
    np.savetxt(folder / "cloud.xyz", numbers[:, :3])
    clouds += [sound_of(folder / name, read_cloud) for name in ("sweep.bin", "cloud.xyz")]
    clouds += [*_poses(folder, poses), *_recordings(folder), *_meshes(folder)]
    more = [
        sound_of(path, read) for path, read in soak_tables.tables(folder / "more", (scans, poses))
    ]
    more += soak_folders.recordings(folder / "folders")
    more += [*soak_prepared.prepared(folder / "prepared"), *soak_runs.runs(folder / "runs")]
    return [*clouds, *_others(folder, few), *more]


def _few(cloud: Cloud) -> Cloud:
    return Cloud({name: column[:NUM_POINTS] for name, column in cloud.columns.items()})


def _poses(folder: Path, poses: Path) -> list[Sound]:
    """Write poses as CSV, TUM, an array and JSON."""
    rows = [line.partition(",")[2] for line in poses.read_text().splitlines()[1:]]
    (folder / "poses.tum").write_text("\n".join(rows).replace(",", " ") + "\n")
    matrices = read_poses(poses).poses
    np.save(folder / "poses.npy", matrices)
    frames = [{"file_path": f"{n}", "transform_matrix": m.tolist()} for n, m in enumerate(matrices)]
    (folder / "poses.json").write_text(json.dumps({"frames": frames[:3]}))
    names = ("poses.tum", "poses.npy", "poses.json")
    return [sound_of(poses, read_poses), *(sound_of(folder / name, read_poses) for name in names)]


def _recordings(folder: Path) -> list[Sound]:
    """Write bags and stations."""
    walk = [
        sweep._replace(xyz=sweep.xyz[:NUM_POINTS], rgb=sweep.rgb[:NUM_POINTS])
        for sweep in containers.sweeps_of(
            containers.WALK / "scans", containers.WALK / "poses.csv", 2
        )
    ]
    messages = [containers.cloud(sweep) for sweep in walk]
    messages += [containers.odometry(sweep) for sweep in walk]
    paths = [
        containers.write_ros1_bag(folder / "walk.bag", messages),
        containers.write_mcap(folder / "walk.mcap", messages),
    ]
    database = next(containers.write_ros2_bag(folder / "ros2", messages).glob("*.db3"))
    bags = [sound_of(path, _read_recording) for path in (*paths, database)]
    stations = [
        containers.write_e57(folder / "site.e57", walk),
        containers.write_ptx(folder / "site.ptx", walk),
    ]
    return [*bags, *(sound_of(path, _read_stations) for path in stations)]


def _read_recording(path: Path) -> None:
    for source in open_recording(path):
        source.read()


def _read_stations(path: Path) -> None:
    for station in open_stations(path):
        station.read()


def _others(folder: Path, few: Cloud) -> list[Sound]:
    """Write a building, pictures, tables and records."""
    labels = np.arange(NUM_POINTS) % 2
    rgb = np.zeros((NUM_POINTS, 3), np.uint8)
    building = Building(
        few.xyz.astype(np.float32), rgb, labels.astype(np.uint8), labels.astype(np.int32),
        ("floor", "wall"), (), None, ("a/b",),
    )  # fmt: skip
    write_building_h5(folder / "area.h5", building, {"name": "text"})
    depth = np.full((6, 8), 900, np.uint16)
    Image.fromarray(depth).save(folder / "depth.png")
    Image.fromarray(rgb.reshape(5, 8, 3)).save(folder / "colour.jpg")
    np.save(folder / "depth.npy", depth)
    (folder / "classes.csv").write_text("label,class\na,floor\nb,wall\nc,-\n")
    (folder / "classes.json").write_text('{"a": "floor", "b": "wall"}')
    (folder / "settings.toml").write_text('[train]\nepochs = 3\n[classes]\na = "x"\nb = "y"\n')
    (folder / "raytrace.json").write_text(record_text(_record()))
    with h5py.File(folder / "authors.h5", "w") as file:
        table = np.column_stack([few.xyz, np.zeros((NUM_POINTS, 3)), labels, labels])
        file.create_dataset("points", data=table.astype("f4"), chunks=(16, 8), compression="gzip")
        file["count_room"] = np.array([30, 10])
    readers: dict[str, Callable[[Path], object]] = {
        "area.h5": _read_area, "authors.h5": read_building_h5, "depth.png": read_depth,
        "colour.jpg": read_colour, "depth.npy": read_depth, "classes.csv": read_class_table,
        "classes.json": read_class_table, "settings.toml": read_settings,
        "raytrace.json": _read_record,
    }  # fmt: skip
    return [sound_of(folder / name, read) for name, read in readers.items()]


def _meshes(folder: Path) -> list[Sound]:
    """Write a box in the formats of meshes, and weights."""
    box = trimesh.creation.box()
    paths = [folder / f"box{suffix}" for suffix in (".glb", ".obj", ".stl", ".off", ".ply")]
    for path in paths:
        box.export(path)
    weights = write_weights(folder / "mcpnet.safetensors", "mcpnet")
    return [*(sound_of(path, read_mesh) for path in paths), sound_of(weights, load_weights)]


def _record() -> FinishedRecord:
    """Make the record of a finished run of raytrace."""
    return FinishedRecord(
        mcpseg="0.2.0", source="office", format=1, building="ab", settings=RaytraceSettings(),
        suffix=".ply", waypoints="none", route=RouteRecord(waypoints=2, length_m=3, free_area_m2=9),
        blind_positions=0, poses="cd", classes=["floor"], scans=1, points=9, voxels=5,
        voxels_seen=4,
        voxels_seen_by_class={"floor": 4}, objects_seen=1,
        objects=[ObjectRecord(id=1, name="office_1/chair_1", voxels_seen=4)],
    )  # fmt: skip


def _read_area(path: Path) -> None:
    read_tags(path)
    read_building_h5(path)


def _read_record(path: Path) -> None:
    """Read the record as raytrace does, and as eval does, beside a folder of truth."""
    (path.parent / "gt").mkdir(exist_ok=True)
    write_cloud(path.parent / "gt/000000.ply", Cloud({axis: np.zeros(1) for axis in "xyz"}))
    open_truth(path.parent / "gt")
    read_record(path.parent)
