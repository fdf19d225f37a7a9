"""Fetch furniture to train with: the models of Sweet Home 3D, unpacked, with a table of classes.

The meshes are those of Debian's package ``sweethome3d-furniture``: five zip files of OBJ, 820
models, CC0 or CC-BY 3.0. Nothing of them is part of mcpseg. Afterwards ``mcpseg synth --models
FOLDER`` furnishes with them:

  python models/fetch_furniture.py furniture/
  mcpseg synth b/Area_1 --models furniture/

``FOLDER/models.csv`` has a row for each model and is made to be read and edited: a row without a
class is not used, ``home`` is the class that ``mcpseg synth --classes home`` names it by, where it
is a finer one. ``FOLDER/CREDITS.md`` names creators and licences: it goes into the card of
weights that were trained with the models. A table that is there is kept, so that edits last.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import re
import subprocess
import sys
import tempfile
import zipfile
from collections import Counter
from pathlib import Path

from furniture_classes import HOME_RULES, ON_TABLES, RULES, UNUSED

from mcpseg_cli.synth.home_classes import HOME_OF

PACKAGE = "sweethome3d-furniture"
COLUMNS = (
    "model", "name", "class", "placed", "stands_for", "width", "depth", "height", "part", "creator",
    "licence", "rotation", "home",
)  # fmt: skip
KEPT = 5
"""One model in so many, by hash of its name, is kept from training."""
LICENCES = {
    "BlendSwap-CC-0": "CC0 1.0",
    "BlendSwap-CC-BY": "CC-BY 3.0",
    "KatorLegaz": "CC-BY 3.0 US",
    "Reallusion": "CC-BY 3.0 US",
    "Scopia": "CC-BY 3.0",
}


def main() -> int:
    """Fetch, unpack and write the table; say what there is."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where the models go")
    parser.add_argument("--deb", type=Path, help=f"{PACKAGE}_*.deb, where it is there already")
    asked = parser.parse_args()

    # the meshes
    asked.folder.mkdir(parents=True, exist_ok=True)
    archives = unpack_package(asked.deb, asked.folder)
    rows = [row for archive in archives for row in rows_of(archive, asked.folder)]
    if not rows:
        print(f"{asked.folder}: no .sh3f file in the package; expected five", file=sys.stderr)
        return 1

    # what is known of them
    table = asked.folder / "models.csv"
    if table.exists():
        print(f"{table}: kept as it is; remove it for a new one")
    else:
        with table.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            writer.writerows(rows)
    with table.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    (asked.folder / "CREDITS.md").write_text(credits_of(rows), encoding="utf-8")

    used = Counter(row["class"] for row in rows if row["class"])
    print(f"{len(rows)} models, {used.total()} with a class: {dict(used.most_common())}")
    print(
        f"{sum(row['part'] == 'kept' for row in rows if row['class'])} of them kept from training"
    )
    return 0


def unpack_package(deb: Path | None, folder: Path) -> list[Path]:
    """Get Debian's package if it is not there, and return the paths of its zip files."""
    packed = folder / "archives"
    found = sorted(packed.rglob("*.sh3f"))
    if found:
        return found
    with tempfile.TemporaryDirectory() as name:
        if deb is None:
            subprocess.run(["apt-get", "download", PACKAGE], cwd=name, check=True)
            deb = next(Path(name).glob("*.deb"))
        subprocess.run(["dpkg-deb", "-x", str(deb.resolve()), str(packed.resolve())], check=True)
    return sorted(packed.rglob("*.sh3f"))


def rows_of(archive: Path, folder: Path) -> list[dict[str, str]]:
    """Unpack one zip file of models and return a row for each of them."""
    target = folder / archive.stem
    with zipfile.ZipFile(archive) as packed:
        packed.extractall(target)
        text = packed.read("PluginFurnitureCatalog.properties").decode("latin-1")
    entries: dict[int, dict[str, str]] = {}
    for key, number, value in re.findall(r"^(\w+)#(\d+)\s*=(.*)$", text, re.MULTILINE):
        entries.setdefault(int(number), {})[key] = value.strip()
    return [row_of(archive.stem, entry) for entry in entries.values() if "model" in entry]


def row_of(source: str, entry: dict[str, str]) -> dict[str, str]:
    """Return the row of a model from its entry in a catalogue: centimetres become metres."""
    model = f"{source}{entry['model']}"
    size = [round(float(entry[axis]) / 100, 4) for axis in ("width", "depth", "height")]
    name, kinds = class_of(entry, size)
    is_kept = int(hashlib.sha256(model.encode()).hexdigest(), 16) % KEPT == 0
    return {
        "model": model,
        "name": entry["name"],
        "class": name,
        "placed": place_of(name, kinds, entry, size) if name else "",
        "stands_for": kinds,
        "width": f"{size[0]:g}",
        "depth": f"{size[1]:g}",
        "height": f"{size[2]:g}",
        "part": "kept" if is_kept else "train",
        "creator": entry["creator"],
        "licence": LICENCES.get(source, "see the archive"),
        "rotation": entry.get("modelRotation", ""),
        "home": home_of(name, kinds, entry),
    }


def class_of(entry: dict[str, str], size: list[float]) -> tuple[str, str]:
    """Return the class and what the model may stand for; no class where it is not to be used."""
    own = _said_of(entry)
    width, depth, height = size
    is_too_small = max(size) < 0.1 or min(size) < 0.015
    if is_too_small or max(width, depth) > 3.5 or height > 2.5:
        return "", ""
    if any(re.search(pattern, own) for pattern in UNUSED):
        return "", ""
    for pattern, name, kinds in RULES:
        if re.search(pattern, own):
            return name, _by_size(kinds, width, depth, height)
    return ("", "") if "exterior" in own else ("clutter", "")


def home_of(name: str, kinds: str, entry: dict[str, str]) -> str:
    """Return the finer class, for areas named by classes of homes; empty where it is the same."""
    if name not in ("clutter", "bookcase"):
        return ""
    own = _said_of(entry)
    for pattern, home in HOME_RULES:
        if re.search(pattern, own):
            return home
    homes = {HOME_OF.get(kind, "") for kind in kinds.split(";")}
    return homes.pop() if name == "clutter" and len(homes) == 1 else ""


def _said_of(entry: dict[str, str]) -> str:
    """Return what an entry says of itself, in small letters."""
    stem = entry["model"].rsplit("/", 1)[-1]
    return f"{entry['category']}|{entry['name']}|{stem}".lower()


def _by_size(kinds: str, width: float, depth: float, height: float) -> str:
    """Return what it may stand for, as its size decides."""
    if kinds == "sofa" and depth > 1.2:
        return "corner sofa"
    if kinds == "open":
        return "low" if height < 1.2 else "open;cupboard" if width > 0.7 else "open"
    if kinds == "cupboard" and height < 1.2:
        return "low"
    if kinds.startswith("meeting"):
        if height < 0.56:
            return "coffee" if width > 0.6 else "side"
        if abs(width - depth) < 0.06 * width:
            return "pedestal" if width < 0.85 else "round"
        return "meeting" if width > 2.0 or width < 1.1 else kinds
    if kinds == "table lamp" and height > 0.9:
        return "standard lamp;floor lamp"
    if kinds == "basin" and height > 0.6:
        return "washing machine"
    if kinds == "plant" and height < 0.45:
        return "small plant"
    if kinds in ("carton", "toys") and max(width, height) < 0.25:
        return "small carton" if kinds == "carton" else "figure"
    return kinds


def place_of(name: str, kinds: str, entry: dict[str, str], size: list[float]) -> str:
    """Return how a model is placed: on the floor, on tables, on walls, or in an opening of one."""
    if name in ("door", "window"):
        return "opening"
    hung = {"wall cupboard", "basin", "urinal", "towel box", "radiator", "wall tv", "picture",
            "picture;clock", "wall box", "coat hooks"}  # fmt: skip
    if kinds in hung or (not kinds and float(entry.get("elevation", 0)) > 50):
        return "wall"
    if kinds:
        return "table" if kinds in ON_TABLES else "floor"
    is_small = max(size[:2]) < 0.6 and size[2] < 0.5
    worn = re.search(
        r"shoe|slipper|bootie|sneaker|mocassin|potty|brush|shovel", entry["name"].lower()
    )
    return "table" if is_small and not worn else "floor"


def credits_of(rows: list[dict[str, str]]) -> str:
    """Return whom to name for what is used of the models, as text for a model card."""
    lines = [
        "# Furniture models",
        "",
        "Of Sweet Home 3D (www.sweethome3d.com), converted to OBJ by",
    ]
    lines += ["Emmanuel Puybaret / eTeks; scaled, recoloured and sampled as points by mcpseg.", ""]
    for part in ("train", "kept"):
        used = [row for row in rows if row["class"] and row["part"] == part]
        lines += [f"## {'Trained on' if part == 'train' else 'Kept from training'}", ""]
        for licence in sorted({row["licence"] for row in used}):
            count = Counter(row["creator"] for row in used if row["licence"] == licence)
            named = ", ".join(f"{creator} ({number})" for creator, number in sorted(count.items()))
            lines.append(f"* {licence}: {named}")
        lines.append("")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
