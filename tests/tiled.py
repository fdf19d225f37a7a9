"""Pages in tiles, read without a browser, and maps that are made up for them."""

import json
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.segment.labelled_run import MapPart
from tests.pages import columns_of


@dataclass
class TiledMap:
    """What is in the folder of such a page; a row a point, tile after tile."""

    facts: dict
    columns: dict[str, np.ndarray]
    tiles: list[tuple[int, int, int, int]]
    tile: np.ndarray
    xyz: np.ndarray
    normal: np.ndarray
    rgb: np.ndarray
    semantic: np.ndarray
    confidence: np.ndarray
    instance: np.ndarray
    height: np.ndarray


def read_tiled(folder: Path) -> TiledMap:
    """Read it, as its page does."""
    body = (folder / "map.bin").read_bytes()
    end = 4 + int.from_bytes(body[:4], "little")
    facts = json.loads(body[4:end])
    columns = columns_of(facts, body[end:])
    places = columns["tile_places"].reshape(-1, 3)
    tiles = [
        (int(level), *place)
        for level, place in zip(columns["tile_levels"], places.tolist(), strict=True)
    ]
    parts = []
    for number, (tile, count) in enumerate(zip(tiles, columns["tile_points"], strict=True)):
        if count:
            parts.append(_read_tile(folder, facts, columns, number, tile))
            assert len(parts[-1][0]) == count
    return TiledMap(facts, columns, tiles, *map(np.concatenate, zip(*parts, strict=True)))


def _read_tile(folder, facts, columns, number, tile):
    level, x, y, z = tile
    known = facts["tiles"]
    planes = np.frombuffer(
        zlib.decompress((folder / "tiles" / str(level) / f"{x}_{y}_{z}.bin").read_bytes()), np.uint8
    ).reshape(19, -1)
    edge = facts["voxel_size"] * known["cells"] * 2 ** (known["depth"] - level)
    low = np.array(facts["origin"]) + known["corner"] + edge * np.array([x, y, z])
    steps = planes[0:6:2].astype(float) + 256.0 * planes[1:6:2]
    xyz = low + known["steps"][level] * steps.T
    place = planes[14] + 256 * planes[15].astype(np.int64) + 65536 * planes[16].astype(np.int64)
    floor = (planes[17] + 256.0 * planes[18]) * known["floor_step"] + known["lowest_floor"]
    return (
        np.full(planes.shape[1], number), xyz, planes[6:9].view(np.int8).T, planes[9:12].T,
        planes[12], planes[13], columns["object_ids"][place],
        xyz[:, 2] - facts["origin"][2] - floor,
    )  # fmt: skip


@dataclass
class Scan:
    """What a page asks of a scan."""

    floor: float = 0.0
    place: tuple[float, float, float] = (2.0, 2.0, 1.0)


@dataclass
class MadeUpRun:
    """A map that is made as it is read, in place of a checkpoint; see ``LabelledRun``."""

    pieces: list
    voxel_size: float = 0.1
    folder: Path = Path("made_up")
    classes: tuple[str, ...] = S3DIS_CLASSES
    scans: list[Scan] = field(default_factory=lambda: [Scan()])

    @property
    def poses(self) -> np.ndarray:
        """Return (S, 4, 4) poses."""
        poses = np.tile(np.eye(4), (len(self.scans), 1, 1))
        poses[:, :3, 3] = [scan.place for scan in self.scans]
        return poses

    def parts(self) -> Iterator[MapPart]:
        """Make the parts, one after the other; a piece is a part or a function that makes one."""
        for piece in self.pieces:
            yield piece() if callable(piece) else piece


def made_up(voxel: np.ndarray, seed: int = 0, voxel_size: float = 0.1) -> MapPart:
    """Give (V, 3) different voxels points, colours and labels."""
    rng, count = np.random.default_rng(seed), len(voxel)
    xyz = (voxel + rng.uniform(-0.45, 0.45, (count, 3))) * voxel_size
    return MapPart(
        np.arange(count), xyz.astype(np.float32), rng.integers(0, 256, (count, 3)).astype(np.uint8),
        rng.integers(0, 13, count).astype(np.uint8), rng.integers(0, 9, count).astype(np.int32),
        rng.uniform(0.1, 1, count).astype(np.float32), np.zeros((count, 0), np.int16),
        np.zeros(count, np.int32),
    )  # fmt: skip
