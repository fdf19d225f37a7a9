"""Add furniture that Infinigen makes to a folder of models, for ``mcpseg synth --models``.

Infinigen (BSD-3) needs Blender as a module and pins old libraries: give it an environment of its
own, and run this script there. Only what furniture needs is installed:

  python3.11 -m venv infinigen/
  infinigen/bin/pip install --no-deps infinigen bpy==4.2.0
  infinigen/bin/pip install -r models/infinigen_requirements.txt
  infinigen/bin/python models/infinigen_furniture.py furniture/ --count 6

Each factory makes ``--count`` pieces, from the seeds 0, 1, ...; a piece that fails is passed over
and counted. Meshes go to ``FOLDER/infinigen``, in metres, y up, the front to +z, every material in
its mean colour: Infinigen's textures are programs, which no mesh file holds. Rows are added to
``FOLDER/models.csv``, which ``models/fetch_furniture.py`` makes; a row that is there is kept.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import importlib
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

KEPT = 5
"""One model in so many, by hash of its name, is kept from training, as of the other source."""
FACTORIES = {
    # factory: class, where it is placed, what it may stand for, class of homes
    "seating.ChairFactory": ("chair", "floor", "four-leg;cantilever;folding", ""),
    "seating.OfficeChairFactory": ("chair", "floor", "task;executive", ""),
    "seating.BarChairFactory": ("chair", "floor", "stool", ""),
    "seating.ArmChairFactory": ("chair", "floor", "armchair", ""),
    "seating.SofaFactory": ("sofa", "floor", "sofa", ""),
    "tables.TableDiningFactory": ("table", "floor", "meeting;trestle;desk", ""),
    "tables.CoffeeTableFactory": ("table", "floor", "coffee", ""),
    "tables.SideTableFactory": ("table", "floor", "side", ""),
    "tables.TableCocktailFactory": ("table", "floor", "pedestal", ""),
    "shelves.SimpleDeskFactory": ("table", "floor", "desk;standing;trestle", ""),
    "shelves.SidetableDeskFactory": ("table", "floor", "side", ""),
    "shelves.SimpleBookcaseFactory": ("bookcase", "floor", "open", ""),
    "shelves.LargeShelfFactory": ("bookcase", "floor", "open;cupboard", ""),
    "shelves.CellShelfFactory": ("bookcase", "floor", "open", ""),
    "shelves.TVStandFactory": ("bookcase", "floor", "tv board", "cabinet"),
    "shelves.SingleCabinetFactory": ("bookcase", "floor", "low", "cabinet"),
    "lamp.FloorLampFactory": ("clutter", "floor", "standard lamp;floor lamp", "lamp"),
    "lamp.DeskLampFactory": ("clutter", "table", "desk lamp", "lamp"),
    "appliances.BeverageFridgeFactory": ("clutter", "floor", "fridge", "appliance"),
    "appliances.DishwasherFactory": ("clutter", "floor", "washing machine", "appliance"),
    "appliances.MicrowaveFactory": ("clutter", "table", "microwave", "appliance"),
    "appliances.MonitorFactory": ("clutter", "table", "monitor", "screen"),
    "appliances.TVFactory": ("clutter", "table", "television", "screen"),
    "bathroom.ToiletFactory": ("clutter", "floor", "toilet", "sanitary"),
    "bathroom.BathtubFactory": ("clutter", "floor", "bath tub", "sanitary"),
}
MOST_FACES = 20_000
SMALLEST, LARGEST = (0.02, 0.02, 0.02), (3.5, 3.5, 2.5)  # metres: width, depth, height
_TO_Y_UP = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]])  # from z up and the front to +x
_GREY = (0.6, 0.6, 0.6)


def main() -> int:
    """Make the pieces and the rows; say what there is."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder of models, with its models.csv")
    parser.add_argument("--count", type=int, default=6, help="pieces of each factory")
    asked = parser.parse_args()
    table = asked.folder / "models.csv"
    with table.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        columns, there = list(reader.fieldnames or ()), {row["model"] for row in reader}

    # piece by piece: what is made stays if the next one crashes
    (asked.folder / "infinigen").mkdir(exist_ok=True)
    made, failed = Counter[str](), Counter[str]()
    for factory, seed in ((name, seed) for name in FACTORIES for seed in range(asked.count)):
        row = row_of(factory, seed)
        if row["model"] in there:
            continue
        try:
            parts = make_piece(factory, seed)
        except Exception as error:
            print(f"{factory} {seed}: {type(error).__name__}: {error}", file=sys.stderr)
            failed[factory] += 1
            continue
        corners = np.concatenate([part.triangles for part in parts]).reshape(-1, 3)
        size = np.ptp(corners, axis=0)[[0, 2, 1]]
        if np.any(size < SMALLEST) or np.any(size > LARGEST):
            failed[factory] += 1
            continue
        write_obj(asked.folder / row["model"], parts)
        row |= dict(
            zip(("width", "depth", "height"), (f"{edge:.4g}" for edge in size), strict=True)
        )
        with table.open("a", newline="", encoding="utf-8") as file:
            csv.DictWriter(file, columns, extrasaction="ignore", restval="").writerow(row)
        made[factory] += 1
    print(f"{made.total()} made, {failed.total()} left out: {dict(failed)}")
    return 0 if made or there else 1


def row_of(factory: str, seed: int) -> dict[str, str]:
    """Return the row of a piece, without its size."""
    name = factory.split(".")[1].removesuffix("Factory")
    model = f"infinigen/{name.lower()}_{seed}.obj"
    class_name, placed, kinds, home = FACTORIES[factory]
    is_kept = int(hashlib.sha256(model.encode()).hexdigest(), 16) % KEPT == 0
    return {
        "model": model,
        "name": name,
        "class": class_name,
        "placed": placed,
        "stands_for": kinds,
        "part": "kept" if is_kept else "train",
        "creator": "Infinigen",
        "licence": "BSD-3",
        "home": home,
    }


@dataclass(frozen=True)
class Part:
    """Triangles of one material.

    Attributes:
        triangles: (F, 3, 3) float64 corners, metres.
        colour: sRGB, 0-1.
    """

    triangles: np.ndarray
    colour: tuple[float, ...]


def make_piece(factory: str, seed: int) -> list[Part]:
    """Have Infinigen make a piece; y up, the front to +z."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    group, name = factory.split(".")
    maker = getattr(importlib.import_module(f"infinigen.assets.objects.{group}"), name)(seed)
    piece = maker.spawn_asset(0)
    maker.finalize_assets([piece])

    parts = []
    for own in [piece, *piece.children_recursive]:
        if own.type == "MESH" and len(own.data.polygons):
            parts += _parts_of(own)
    if not parts:
        raise ValueError("no triangles")
    return parts


def _parts_of(piece: Any) -> Iterator[Part]:
    """Yield the triangles of a mesh by material, far fewer than Blender would draw."""
    if len(piece.data.polygons) > MOST_FACES:
        thin = piece.modifiers.new("thin", "DECIMATE")
        thin.ratio = MOST_FACES / len(piece.data.polygons)
    mesh = piece.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    mesh.calc_loop_triangles()

    corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", corners)
    index = np.empty(len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("material_index", index)
    places = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", places)
    world = np.array(piece.matrix_world)
    places = (places.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]) @ _TO_Y_UP.T

    triangles = places[corners.reshape(-1, 3)]
    for number in np.unique(index):
        yield Part(triangles[index == number], mean_colour(_material_of(piece, number)))


def _material_of(part: Any, index: int) -> Any:
    slots = part.material_slots
    return slots[min(index, len(slots) - 1)].material if len(slots) else None


def mean_colour(material: Any) -> tuple[float, ...]:
    """Return the mean of the colours that a material's program names, sRGB 0-1."""
    if material is None or material.node_tree is None:
        return _GREY
    colours = np.array(list(_colours_in(material.node_tree)))
    if len(colours) == 0:
        return _GREY
    linear = np.clip(colours.mean(axis=0), 0, 1)
    return tuple(np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055))


def _colours_in(tree: Any) -> Iterator[tuple[float, ...]]:
    """Yield the colours of a program: of ramps, of constants, and of surfaces without a program."""
    for node in tree.nodes:
        if node.type == "VALTORGB":
            yield from (tuple(element.color)[:3] for element in node.color_ramp.elements)
        elif node.type == "RGB":
            yield tuple(node.outputs[0].default_value)[:3]
        elif node.type == "GROUP" and node.node_tree:
            yield from _colours_in(node.node_tree)
        elif node.type == "BSDF_PRINCIPLED" and not node.inputs["Base Color"].is_linked:
            yield tuple(node.inputs["Base Color"].default_value)[:3]


def write_obj(path: Path, parts: list[Part]) -> None:
    """Write a mesh and its materials; corners that are one place become one vertex."""
    materials = path.with_suffix(".mtl")
    shades = [" ".join(f"{share:.4f}" for share in part.colour) for part in parts]
    materials.write_text(
        "".join(f"newmtl m{number}\nKd {shade}\nd 1\n" for number, shade in enumerate(shades)),
        encoding="utf-8",
    )
    corners = np.concatenate([part.triangles for part in parts]).reshape(-1, 3).round(4)
    vertices, faces = np.unique(corners, axis=0, return_inverse=True)
    faces = faces.reshape(-1, 3) + 1
    ends = np.cumsum([len(part.triangles) for part in parts])[:-1]
    with path.open("w", encoding="utf-8") as file:
        file.write(f"mtllib {materials.name}\n")
        np.savetxt(file, vertices, "v %.4f %.4f %.4f")
        for number, own in enumerate(np.split(faces, ends)):
            file.write(f"usemtl m{number}\n")
            np.savetxt(file, own, "f %d %d %d")


if __name__ == "__main__":
    sys.exit(main())
