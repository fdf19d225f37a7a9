"""A tiny folder of models of our own: what the tests of models read."""

import csv
from pathlib import Path

import numpy as np
from PIL import Image

COLUMNS = (
    "model", "name", "class", "placed", "stands_for", "width", "depth", "height", "part", "creator",
    "licence", "rotation",
)  # fmt: skip
_QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def block(low, high, first: int) -> list[str]:
    """Lines of OBJ for a box of four-cornered faces, whose corners are numbered from ``first``."""
    corners = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1])
               for z in (low[2], high[2])]  # fmt: skip
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    return lines + ["f " + " ".join(str(first + k) for k in quad) for quad in _QUADS]


def write_obj(path: Path, blocks, opacity: float = 1.0) -> None:
    """Write boxes, y up, each in a colour of its own."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lines, materials = [f"mtllib {path.stem}.mtl"], []
    for number, (low, high, colour) in enumerate(blocks):
        lines += [f"usemtl m{number}", *block(low, high, 1 + 8 * number)]
        shade = " ".join(f"{channel:g}" for channel in colour)
        materials += [f"newmtl m{number}", f"Kd {shade}", f"d {opacity:g}"]
    path.write_text("\n".join(lines) + "\n")
    path.with_suffix(".mtl").write_text("\n".join(materials) + "\n")


def write_textured(path: Path) -> None:
    """Write an upright sheet that faces +z: a picture, red on its left, blue on its right."""
    path.parent.mkdir(parents=True, exist_ok=True)
    image = np.zeros((8, 8, 3), np.uint8)
    image[:, :4, 0] = image[:, 4:, 2] = 200
    Image.fromarray(image).save(path.with_suffix(".png"))
    path.with_suffix(".mtl").write_text(f"newmtl sheet\nKd 1 1 1\nmap_Kd {path.stem}.png\n")
    lines = ["v -1 0 0", "v 1 0 0", "v 1 1 0", "v -1 1 0", "vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"]
    lines = [f"mtllib {path.stem}.mtl", *lines, "usemtl sheet", "f 1/1 2/2 3/3 4/4"]
    path.write_text("\n".join(lines) + "\n")


def row(model: str, class_name: str, kinds: str, size, **changed: str) -> dict[str, str]:
    """A row of the table."""
    width, depth, height = (str(edge) for edge in size)
    values = {"model": model, "name": model, "class": class_name, "placed": "floor"}
    values |= {"stands_for": kinds, "width": width, "depth": depth, "height": height}
    values |= {"part": "train", "creator": "us", "licence": "MIT", "rotation": ""}
    return values | changed


def write_table(folder: Path, rows, extra: tuple[str, ...] = ()) -> None:
    """Write models.csv, with more columns if asked for."""
    with (folder / "models.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, (*COLUMNS, *extra))
        writer.writeheader()
        writer.writerows(rows)


def write_models(folder: Path) -> Path:
    """Make a chair (its back at -z), a table, a bin, a picture and a kept sofa."""
    wood, dark = (0.6, 0.4, 0.2), (0.2, 0.2, 0.2)
    seat, back = ((-1, 0, -1), (1, 1, 1), wood), ((-1, 1, -1), (1, 2, -0.8), dark)
    write_obj(folder / "chair.obj", [seat, back])
    legs = [((x, 0, z), (x + 2, 70, z + 2), dark) for x in (-60, 58) for z in (-40, 38)]
    write_obj(folder / "table.obj", [((-60, 70, -40), (60, 72, 40), wood), *legs])
    write_obj(folder / "sub/bin.obj", [((0, 0, 0), (1, 1, 1), dark)])
    write_obj(folder / "sofa.obj", [((0, 0, 0), (2, 1, 1), wood)])
    write_obj(folder / "pane.obj", [((0, 0, 0), (1, 1, 1), wood)], opacity=0.3)
    write_textured(folder / "picture.obj")
    rows = [
        row("chair.obj", "chair", "", (0.5, 0.5, 0.9)),
        row("table.obj", "table", "meeting;desk;round", (1.4, 0.8, 0.74)),
        row("sub/bin.obj", "clutter", "", (0.3, 0.3, 0.3)),
        row("picture.obj", "clutter", "picture", (1.0, 0.02, 0.6), placed="wall"),
        row("pane.obj", "clutter", "mirror", (0.5, 0.02, 0.6), placed="wall"),
        row("sofa.obj", "sofa", "sofa", (1.8, 0.8, 0.8), part="kept"),
        row("not_used.obj", "", "", (1, 1, 1), placed=""),
    ]
    write_table(folder, rows)
    return folder
