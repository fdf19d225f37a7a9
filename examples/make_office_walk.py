"""Make a synthetic recording with ground truth: a robot walks through two furnished rooms made of boxes.

Everything follows from the seed: the sizes, the furniture, the colours, the path and the noise.

    python examples/make_office_walk.py examples/office_walk --seed 1
"""

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.formats import Cloud, Labels, write_cloud
from mcpseg_cli.scan import Scan

Parts = NDArray[np.float64]
"""(P, 2, 3) lowest and highest corner of the boxes an object is made of, metres."""
Group = list[tuple[str, Parts]]
"""Objects that stand together, with their classes; their back is at y = 0 and their front towards +y."""

NUM_SCANS = 24
STEP = 0.3  # metres between scans
SENSOR_HEIGHT = 1.0
SENSOR_RANGE = 5.0
ELEVATION_DEG = (-60.0, 80.0)
NUM_RAYS = 2800
RANGE_NOISE = 0.005  # metres, standard deviation
CLEARANCE = 0.35  # metres between the robot's path and furniture
NEAR = 1.8  # metres from the path to at least one object of every class
CEILING = 2.7
WALL = 0.12  # thickness, metres
DOOR = (0.95, 2.05)  # width and height, metres
BEAM = 0.35  # height, metres

_PALETTE = {
    "ceiling": [(238, 238, 234), (225, 225, 225)],
    "floor": [(150, 118, 85), (105, 112, 118), (165, 158, 145)],
    "wall": [(214, 204, 182), (198, 208, 214), (222, 216, 206)],
    "beam": [(168, 160, 150), (150, 152, 158)],
    "column": [(176, 164, 140), (158, 162, 168)],
    "window": [(140, 190, 220), (115, 160, 195)],
    "door": [(130, 82, 48), (160, 116, 76), (92, 62, 46)],
    "table": [(196, 152, 98), (224, 220, 212), (124, 84, 56)],
    "chair": [(42, 46, 60), (66, 64, 64), (34, 84, 134)],
    "sofa": [(128, 42, 42), (62, 94, 72), (86, 80, 122)],
    "bookcase": [(146, 98, 62), (202, 170, 128), (120, 70, 50)],
    "board": [(246, 249, 247), (38, 82, 60)],
    "clutter": [(190, 150, 100), (200, 60, 50), (50, 110, 170), (70, 70, 75), (230, 190, 60), (80, 150, 90)],
}


class Office:
    """Two rooms side by side along x, joined by a doorway; floor at z = 0, room for one robot path kept free."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.depth = rng.uniform(3.8, 4.2)  # both rooms, along y
        first, second = rng.uniform(5.4, 6.2), rng.uniform(4.4, 5.0)
        self.rooms = ((0.0, first), (first + WALL, first + WALL + second))  # along x
        self.doorway = rng.uniform(0.42, 0.58) * self.depth  # its middle, along y
        self.path = self._plan_path()
        self.parts: list[Parts] = []
        self.rgb: list[NDArray[np.float64]] = []
        self.names: list[str] = []  # class of each object; its instance id is its place, from 1
        self._taken: list[tuple[Parts, float]] = []  # (1, 2, 3) box on the floor plan, height allowed there

    def add(self, name: str, parts: Parts, spread: float = 0.04) -> None:
        """Add one object in a colour of its class; ``spread`` is how much its boxes differ in brightness."""
        palette = _PALETTE[name]
        colour = np.array(palette[self.rng.integers(len(palette))]) + self.rng.normal(0, 8, 3)
        self.rgb.append(colour * (1 + spread * self.rng.uniform(-1, 1, (len(parts), 1))))
        self.parts.append(parts)
        self.names.append(name)

    def reserve(self, parts: Parts, height: float = 0.0) -> None:
        """Keep the floor under ``parts`` free of anything higher than ``height``."""
        self._taken.append((_bounds([parts]), height))

    def from_path(self, parts: Parts) -> float:
        """Return how near the robot's path comes to the box around ``parts``, horizontally, metres."""
        low, high = _bounds([parts])[0, :, :2]
        outside = np.maximum(low - self.path, self.path - high).clip(0)
        return float(np.hypot(outside[:, 0], outside[:, 1]).min())

    def place(self, group: Group, room: int, sides: tuple[int, ...] = (0, 1, 2, 3), *, under: float = 0.0) -> bool:
        """Stand a group with its back to a wall where it is free; False where no place is found.

        Args:
            group: What to place.
            room: 0 or 1.
            sides: Walls to choose from: 0 low y, 1 high x, 2 high y, 3 low x.
            under: Height of what may stand below it later.
        """
        for _ in range(80):
            side = sides[self.rng.integers(len(sides))]
            turned = [(name, _turn(parts, side)) for name, parts in group]
            offset = self._position(_bounds([parts for _, parts in turned]), room, side)
            moved = [(name, parts + offset) for name, parts in turned]
            bounds = _bounds([parts for _, parts in moved])
            if self._is_free(bounds):
                for name, parts in moved:
                    self.add(name, parts, spread=0.35 if name == "bookcase" else 0.04)
                self._taken.append((bounds, under))
                return True
        return False

    def _position(self, bounds: Parts, room: int, side: int) -> NDArray[np.float64]:
        """Choose where along its wall a group stands."""
        low = np.array([self.rooms[room][0], 0.0])
        high = np.array([self.rooms[room][1], self.depth]) - (bounds[0, 1] - bounds[0, 0])[:2]
        position = self.rng.uniform(low + 0.04, np.maximum(high - 0.04, low + 0.05))
        across = 0 if side in (1, 3) else 1
        position[across] = (high if side in (1, 2) else low)[across]
        return np.array([*(position - bounds[0, 0, :2]), 0.0])

    def _is_free(self, bounds: Parts) -> bool:
        """Tell whether a box keeps clear of the robot's path, the walls and everything placed before."""
        low, high = bounds[0, 0], bounds[0, 1]
        if low[1] < -0.01 or high[1] > self.depth + 0.01:
            return False
        if low[2] < SENSOR_HEIGHT + 0.5 and self.from_path(bounds) < CLEARANCE:
            return False
        return not any(
            high[2] > height and (low[:2] < box[0, 1, :2] + 0.03).all() and (high[:2] > box[0, 0, :2] - 0.03).all()
            for box, height in self._taken
        )

    def _plan_path(self) -> NDArray[np.float64]:
        """Lay a smooth path through both rooms and the doorway: (NUM_SCANS, 2) metres, to 0.1 mm as written."""
        (_, first), (second, end) = self.rooms
        middle, sway = self.depth / 2, self.rng.choice([-1, 1]) * self.rng.uniform(0.15, 0.35)
        corners = np.array([
            (first - 4.4, middle + sway), (first - 2.3, middle - sway), (first - 0.8, self.doorway),
            (second + 0.8, self.doorway), (second + 1.8, middle + sway), (end, middle),
        ])  # fmt: skip
        for _ in range(3):  # Chaikin's corner cutting
            cut = np.stack([0.75 * corners[:-1] + 0.25 * corners[1:], 0.25 * corners[:-1] + 0.75 * corners[1:]], axis=1)
            corners = np.concatenate([corners[:1], cut.reshape(-1, 2), corners[-1:]])
        length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
        along = STEP * np.arange(NUM_SCANS)
        return np.stack([np.interp(along, length, corners[:, axis]) for axis in (0, 1)], axis=1).round(4)


def make_walk(seed: int) -> list[tuple[Scan, Labels]]:
    """Furnish two rooms and scan them from a robot that walks through both.

    Args:
        seed: Decides everything.

    Returns:
        ``NUM_SCANS`` scans of up to ``NUM_RAYS`` points in the map frame, with colours, and the truth about them:
        S3DIS classes, an id for every object, confidence 1.
    """
    rng = np.random.default_rng(seed)
    office = build_office(rng)
    heading = np.gradient(office.path, axis=0)
    walk = []
    for index, (x, y) in enumerate(office.path):
        yaw = np.arctan2(heading[index, 1], heading[index, 0])
        pose = np.eye(4)
        pose[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
        pose[:3, 3] = x, y, SENSOR_HEIGHT
        walk.append(_scan(office, pose, f"{index:06d}.ply"))
    return walk


def build_office(rng: np.random.Generator) -> Office:
    """Build offices until one has an object of every class near the robot's path."""
    while True:
        office = Office(rng)
        _build_shell(office)
        _furnish(office)
        near = {name for name, parts in zip(office.names, office.parts, strict=True) if office.from_path(parts) < NEAR}
        if near == set(S3DIS_CLASSES):
            return office


def _build_shell(office: Office) -> None:
    """Add floors, ceilings, walls with their openings, windows, doors, beams and columns."""
    rng, (first, second) = office.rng, office.rooms
    for start, end in office.rooms:
        office.add("floor", _box(start - WALL, 0, -0.1, end, office.depth, 0))
        office.add("ceiling", _box(start, 0, CEILING, end, office.depth, CEILING + 0.1))
    for start, end in office.rooms:
        width = rng.uniform(1.3, 2.0)
        left = rng.uniform(0.5, end - start - width - 0.5)
        frame = (left, left + width, rng.uniform(0.8, 1.0), rng.uniform(2.0, 2.2))
        origin = (start, office.depth)
        office.add("wall", _shift(_wall(end - start, frame), *origin))
        office.add("window", _shift(_window(frame), *origin))
        office.add("wall", _shift(_wall(end - start, None), start, -WALL))
        office.reserve(_shift(_box(left, -0.3, 0, left + width, 0, 1), *origin), frame[2])
    left = rng.uniform(0.3, office.depth - DOOR[0] - 0.3)  # the closed door, at the end of one room
    closed = int(rng.integers(2))
    for side, x in enumerate((-WALL, second[1])):
        opening = (left, left + DOOR[0], 0.0, DOOR[1]) if side == closed else None
        office.add("wall", _shift(_along_y(_wall(office.depth, opening)), x))
    x = (0.0, second[1])[closed]
    leaf = _box(x - 0.05, left, 0, x + 0.05, left + DOOR[0], DOOR[1])
    office.add("door", np.concatenate([leaf, _box(x - 0.09, left + 0.06, 1.0, x + 0.09, left + 0.18, 1.04)]))
    office.reserve(_box(x - 0.8, left, 0, x + 0.8, left + DOOR[0], 1))
    _build_doorway(office, first[1])


def _build_doorway(office: Office, x: float) -> None:
    """Add the wall between the rooms, its frame and the door leaf that stands open in one of them."""
    low, high = office.doorway - DOOR[0] / 2, office.doorway + DOOR[0] / 2
    office.add("wall", _shift(_along_y(_wall(office.depth, (low, high, 0.0, DOOR[1]))), x))
    hinge = low - 0.05 if office.rng.random() < 0.5 else high
    leaf = _box(x + WALL, hinge, 0.01, x + WALL + DOOR[0], hinge + 0.05, DOOR[1])
    if office.rng.random() < 0.5:
        leaf[:, :, 0] -= WALL + DOOR[0]
    end = 0.0 if hinge < low else office.depth  # nothing in the corner that the leaf hides
    office.reserve(_box(leaf[0, 0, 0], min(hinge, end), 0, leaf[0, 1, 0], max(hinge, end), 1))
    jambs = [_box(x - 0.02, y, 0, x + WALL + 0.02, y + 0.04, DOOR[1]) for y in (low, high - 0.04)]
    lintel = _box(x - 0.02, low, DOOR[1] - 0.04, x + WALL + 0.02, high, DOOR[1])
    office.add("door", np.concatenate([leaf, *jambs, lintel]))
    office.reserve(_box(x - 1.1, low - 0.1, 0, x + 1.1 + WALL, high + 0.1, 1))


def _furnish(office: Office) -> None:
    """Add beams on columns, boards and furniture, the bulky first."""
    rng = office.rng
    for room in (0, 1):
        width = rng.uniform(0.25, 0.4)
        if office.place([("column", _box(0, 0, 0, width, width, CEILING - BEAM))], room, (0, 2)):
            x = office.parts[-1][0, 0, 0]
            office.add("beam", _box(x, 0, CEILING - BEAM, x + width, office.depth, CEILING))
        board_width = rng.uniform(1.2, 1.9)
        board = np.concatenate([_box(0, 0, 1.0, board_width, 0.05, 1.95), _box(0, 0, 0.95, board_width, 0.1, 1.0)])
        office.place([("board", board)], room, under=0.9)
    sofa_room = int(rng.integers(2))
    office.place([("sofa", _sofa(rng.uniform(1.4, 1.9)))], sofa_room)
    for room in (0, 1):
        office.place([("bookcase", _bookcase(rng, rng.uniform(0.9, 1.4), rng.uniform(1.7, 2.1)))], room)
        for _ in range(2 if room == 1 else 3):
            office.place(_desk(rng), room)
        office.place([("chair", _turn(_chair(), 2) * rng.uniform(0.95, 1.1))], room)  # looks into the room
        for _ in range(4):
            size = rng.uniform(0.22, 0.45, 3)
            office.place([("clutter", _box(0, 0, 0, *size))], room)


def _desk(rng: np.random.Generator) -> Group:
    """Make a table with a chair in front and things on it."""
    width, depth, height = rng.uniform(1.1, 1.6), rng.uniform(0.6, 0.8), rng.uniform(0.7, 0.76)
    legs = [
        _box(x, y, 0, x + 0.06, y + 0.06, height - 0.05) for x in (0.03, width - 0.09) for y in (0.03, depth - 0.09)
    ]
    table = np.concatenate([_box(0, 0, height - 0.05, width, depth, height), *legs])
    group = [
        ("table", table),
        ("chair", _shift(_chair(), rng.uniform(0.15, width - 0.6), depth - rng.uniform(0, 0.15))),
    ]
    x = rng.uniform(0.05, width - 0.65)
    stand = np.concatenate([_box(0.15, 0.08, 0, 0.4, 0.28, 0.02), _box(0.24, 0.16, 0.02, 0.31, 0.2, 0.15)])
    screen = np.concatenate([stand, _box(0, 0.14, 0.1, 0.55, 0.19, 0.45)])
    group.append(("clutter", _shift(screen, x, 0.02, height)))
    size = rng.uniform(0.12, 0.28, 3)
    x = x + 0.6 if x + 0.6 + size[0] < width else x - 0.03 - size[0]
    if x > 0:
        group.append(("clutter", _shift(_box(0, 0, 0, *size), x, 0.08, height)))
    return group


def _chair() -> Parts:
    """Make a chair whose sitter looks to -y."""
    legs = [_box(x, y, 0, x + 0.04, y + 0.04, 0.42) for x in (0, 0.41) for y in (0, 0.41)]
    return np.concatenate([_box(0, 0, 0.42, 0.45, 0.45, 0.48), _box(0, 0.4, 0.48, 0.45, 0.45, 0.95), *legs])


def _sofa(width: float) -> Parts:
    """Make a sofa: base, two cushions, back and arms."""
    inner = (width - 0.4) / 2
    cushions = [_box(0.2 + i * inner, 0.22, 0.32, 0.2 + (i + 1) * inner - 0.02, 0.82, 0.46) for i in (0, 1)]
    arms = [_box(x, 0, 0, x + 0.2, 0.85, 0.62) for x in (0, width - 0.2)]
    return np.concatenate([
        _box(0.2, 0, 0, width - 0.2, 0.8, 0.32), _box(0.2, 0, 0.32, width - 0.2, 0.22, 0.88), *cushions, *arms,
    ])  # fmt: skip


def _bookcase(rng: np.random.Generator, width: float, height: float) -> Parts:
    """Make a bookcase: back, sides, top, and shelves with rows of books."""
    parts = [_box(0, 0, 0, width, 0.02, height), _box(0, 0, height - 0.03, width, 0.32, height)]
    parts += [_box(x, 0, 0, x + 0.03, 0.32, height) for x in (0, width - 0.03)]
    for base in np.linspace(0.05, height - 0.4, 5):
        parts.append(_box(0.03, 0.02, base, width - 0.03, 0.32, base + 0.03))
        x = 0.05
        while (thick := rng.uniform(0.1, 0.3)) + x < width - 0.05:
            if rng.random() < 0.7:
                parts.append(
                    _box(x, 0.04, base + 0.03, x + thick, rng.uniform(0.2, 0.28), base + rng.uniform(0.2, 0.3))
                )
            x += thick + 0.01
    return np.concatenate(parts)


def _wall(length: float, opening: tuple[float, float, float, float] | None) -> Parts:
    """Make a wall along x around an opening: its start, end, bottom and top."""
    if opening is None:
        return _box(0, 0, 0, length, WALL, CEILING)
    start, end, bottom, top = opening
    beside = [_box(0, 0, 0, start, WALL, CEILING), _box(end, 0, 0, length, WALL, CEILING)]
    below = [_box(start, 0, 0, end, WALL, bottom)] * (bottom > 0)
    return np.concatenate([*beside, *below, _box(start, 0, top, end, WALL, CEILING)])


def _window(opening: tuple[float, float, float, float]) -> Parts:
    """Make a pane with its frame and a bar in the middle."""
    start, end, bottom, top = opening
    upright = [_box(x - 0.04, -0.02, bottom, x + 0.04, 0.1, top) for x in (start + 0.04, (start + end) / 2, end - 0.04)]
    level = [_box(start, -0.02, z, end, 0.1, z + 0.06) for z in (bottom, top - 0.06)]
    return np.concatenate([_box(start, 0.04, bottom, end, 0.06, top), *upright, *level])


def _box(*corners: float) -> Parts:
    """Make one box from its lowest and highest corner."""
    return np.array(corners, np.float64).reshape(1, 2, 3)


def _shift(parts: Parts, x: float, y: float = 0.0, z: float = 0.0) -> Parts:
    shifted: Parts = parts + np.array([x, y, z])
    return shifted


def _along_y(parts: Parts) -> Parts:
    return parts[:, :, [1, 0, 2]]


def _turn(parts: Parts, quarters: int) -> Parts:
    """Turn parts about z by quarter turns."""
    for _ in range(quarters):
        corners = np.stack([-parts[:, :, 1], parts[:, :, 0], parts[:, :, 2]], axis=2)
        parts = np.sort(corners, axis=1)
    return parts


def _bounds(groups: list[Parts]) -> Parts:
    parts = np.concatenate(groups)
    return np.stack([parts[:, 0].min(axis=0), parts[:, 1].max(axis=0)])[None]


def _scan(office: Office, pose: NDArray[np.float64], name: str) -> tuple[Scan, Labels]:
    """Cast rays from a pose and colour and label what they hit."""
    rng = office.rng
    position, rays = pose[:3, 3], _rays(rng)
    parts = np.concatenate(office.parts)
    distance, part, axis = _cast(position, rays, parts)
    hit = distance < SENSOR_RANGE
    rays, part, axis = rays[hit], part[hit], axis[hit]
    distance = distance[hit] + rng.normal(0, RANGE_NOISE, len(rays))
    xyz = (position + distance[:, None] * rays).astype(np.float32)
    instance = np.repeat(np.arange(1, len(office.parts) + 1), [len(boxes) for boxes in office.parts])[part]
    semantic = np.array([S3DIS_CLASSES.index(name) for name in office.names])[instance - 1]
    faces = np.where((axis == 2) & (rays[:, 2] < 0), 1.0, np.array([0.9, 0.82, 0.92])[axis])  # level tops are brightest
    light = faces * (0.82 + 0.18 * xyz[:, 1] / office.depth)  # from the windows, at high y
    rgb = np.concatenate(office.rgb)[part] * light[:, None] + rng.normal(0, 4, (len(xyz), 3))
    labels = Labels(semantic.astype(np.uint8), instance.astype(np.int32), np.ones(len(xyz), np.float32), S3DIS_CLASSES)
    return Scan(xyz, rgb.round().clip(0, 255).astype(np.uint8), pose, name), labels


def _rays(rng: np.random.Generator) -> NDArray[np.float64]:
    """Spread unit vectors evenly over all directions between two elevations, on a spiral: (R, 3)."""
    low, high = np.sin(np.deg2rad(ELEVATION_DEG))
    z = low + (high - low) * (np.arange(NUM_RAYS) + rng.random()) / NUM_RAYS
    azimuth = np.pi * (3 - np.sqrt(5)) * np.arange(NUM_RAYS) + rng.uniform(0, 2 * np.pi)
    level = np.sqrt(1 - z**2)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), z], axis=1)


def _cast(
    position: NDArray[np.float64], rays: NDArray[np.float64], parts: Parts
) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.intp]]:
    """Find the first box on each ray by the slab test: distance (inf for none), box, axis its face looks along."""
    entry = np.full((len(rays), len(parts)), -np.inf)  # (R, P)
    leave = np.full_like(entry, np.inf)
    face = np.zeros(entry.shape, np.intp)
    for axis in range(3):
        ahead = (rays[:, axis] < 0).astype(np.intp)  # the corner that a ray meets first
        scale = 1 / rays[:, axis, None]
        corners = parts[:, :, axis].T - position[axis]  # (2, P)
        near, far = corners[ahead] * scale, corners[1 - ahead] * scale  # (R, P)
        face[near > entry] = axis
        entry, leave = np.maximum(entry, near), np.minimum(leave, far)
    entry[(entry > leave) | (entry <= 0)] = np.inf
    first = entry.argmin(axis=1)
    rows = np.arange(len(rays))
    return entry[rows, first], first, face[rows, first]


def write_walk(walk: list[tuple[Scan, Labels]], folder: Path) -> None:
    """Write ``scans/``, ``poses.csv`` and the same scans with their labels as ``gt/``.

    Args:
        walk: Scans and their truth, as ``make_walk`` gives them.
        folder: Where; made if it is not there. Files of the same names are replaced.
    """
    for name in ("scans", "gt"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    rows = ["scan,timestamp,x,y,z,qx,qy,qz,qw"]
    for index, (scan, labels) in enumerate(walk):
        assert scan.rgb is not None  # the scanner sees colours
        columns: dict[str, NDArray[np.generic]] = {name: scan.xyz[:, axis] for axis, name in enumerate("xyz")}
        columns |= {name: scan.rgb[:, axis] for axis, name in enumerate(("red", "green", "blue"))}
        write_cloud(folder / "scans" / scan.name, Cloud(columns))
        columns |= {"semantic": labels.semantic, "instance": labels.instance}
        write_cloud(folder / "gt" / scan.name, Cloud(columns, labels.classes))
        x, y, z = scan.position
        yaw = np.arctan2(scan.pose[1, 0], scan.pose[0, 0])
        rows.append(
            f"{scan.name},{0.5 * index:.1f},{x:.4f},{y:.4f},{z:.4f},0,0,{np.sin(yaw / 2):.6f},{np.cos(yaw / 2):.6f}"
        )
    (folder / "poses.csv").write_text("\n".join(rows) + "\n")


def main() -> None:
    """Write the walk of one seed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="where to write scans/, gt/ and poses.csv")
    parser.add_argument("--seed", type=int, default=1, help="which rooms")
    arguments = parser.parse_args()
    write_walk(make_walk(arguments.seed), arguments.folder)


if __name__ == "__main__":
    main()
