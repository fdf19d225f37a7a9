"""A house of one room as a mesh: solid floor, walls and ceiling, some things, by name."""

from pathlib import Path

import numpy as np
import trimesh

WIDTH, DEPTH, HEIGHT = 5.0, 4.0, 2.6
THICK = 0.15
FROM_Z_UP = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])
BOXES = {
    "Floor": ((0, 0, -THICK), (WIDTH, DEPTH, 0)),
    "Ceiling": ((0, 0, HEIGHT), (WIDTH, DEPTH, HEIGHT + THICK)),
    "Wall.001": ((-THICK, -THICK, -1), (0, DEPTH + THICK, HEIGHT)),
    "Wall.002": ((WIDTH, -THICK, -1), (WIDTH + THICK, DEPTH + THICK, HEIGHT)),
    "Wall.003": ((0, -THICK, -1), (WIDTH, 0, HEIGHT)),
    "Wall.004": ((0, DEPTH, -1), (WIDTH, DEPTH + THICK, HEIGHT)),
    "door": ((1, -0.1, 0), (1.9, 0.01, 2.05)),  # 1 cm before its wall
    "DiningTable": ((1.5, 1.5, 0.68), (2.9, 2.3, 0.72)),
    "office_chair_7": ((3.6, 2, 0.42), (4.1, 2.5, 0.47)),
    "Thing": ((4.2, 3.2, 0), (4.7, 3.6, 0.4)),
}
FACES = ("0231", "4576", "0154", "2673", "0462", "1375")  # corners of a box, bit by axis
CLASSES = {
    "Floor": "floor", "Ceiling": "ceiling", "Wall.001": "wall", "Wall.002": "wall",
    "Wall.003": "wall", "Wall.004": "wall", "door": "door", "DiningTable": "table",
    "office_chair_7": "chair", "Thing": "",
}  # fmt: skip


def colour_of(name: str) -> list[int]:
    return [40 + 20 * list(BOXES).index(name), 90, 200]


def meshes() -> dict[str, trimesh.Trimesh]:
    made = {}
    for name, bounds in BOXES.items():
        made[name] = trimesh.creation.box(bounds=np.array(bounds, float))
        made[name].visual.face_colors = [*colour_of(name), 255]
    return made


def write_glb(path: Path) -> Path:
    """Write the house, y up, every thing a node of its own."""
    scene = trimesh.Scene()
    for name, mesh in meshes().items():
        scene.add_geometry(mesh, node_name=name, geom_name=f"{name}-mesh", transform=FROM_Z_UP)
    scene.export(path)
    return path


def write_obj(path: Path, keyword: str = "o", scale: float = 1.0) -> Path:
    """Write the house, z up, of faces with four corners, one material for all."""
    lines, first = ["mtllib house.mtl"], 1
    for name, (low, high) in BOXES.items():
        corners = [(low, high)[(n >> axis) & 1][axis] for n in range(8) for axis in range(3)]
        lines.append(f"{keyword} {name}")
        lines += [
            "v " + " ".join(f"{scale * c:g}" for c in corners[i : i + 3]) for i in range(0, 24, 3)
        ]
        lines.append("usemtl paint")
        for face in (
            (0, 2, 3, 1),
            (4, 5, 7, 6),
            (0, 1, 5, 4),
            (2, 6, 7, 3),
            (0, 4, 6, 2),
            (1, 3, 7, 5),
        ):
            lines.append("f " + " ".join(str(first + corner) for corner in face))
        first += 8
    path.write_text("\n".join(lines) + "\n")
    path.with_name("house.mtl").write_text("newmtl paint\nKd 1.0 0.5 0.0\n")
    return path
