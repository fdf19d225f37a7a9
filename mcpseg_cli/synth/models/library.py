"""A folder of models: its table, read and checked, and which models may stand for a thing."""

from __future__ import annotations

import csv
import hashlib
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from mcpseg_cli.choices import ModelPart, SynthClasses
from mcpseg_cli.errors import InputError

TABLE = "models.csv"
_Placed = Literal["floor", "table", "wall", "opening"]
_Class = Literal["window", "door", "table", "chair", "sofa", "bookcase", "board", "clutter"]
_Home = Literal[
    "", "bed", "cabinet", "curtain", "kitchen", "appliance", "sanitary", "screen", "lamp", "plant",
    "picture", "rug", "box",
]  # fmt: skip
Extent = Annotated[float, Field(gt=0.001, le=10)]
_REMEDY = "mend the row, or make the folder again with models/fetch_furniture.py"

_ANYTHING: dict[tuple[_Placed, bool], tuple[str, ...]] = {
    ("table", False): (
        "mug", "bottle", "vase", "figure", "small carton", "bowl", "candles", "pen pot", "trays",
    ),
    ("floor", False): (
        "carton", "carton pile", "backpack", "bag", "suitcase", "umbrella stand", "bin", "fan",
        "toys", "laundry basket", "cushion", "clothes",
    ),
    ("floor", True): (
        "bicycle", "trolley", "copier", "lockers", "vending machine", "tv stand", "ladder",
    ),
    ("wall", False): ("picture", "clock", "wall box"),
}  # fmt: skip
"""What models that stand for nothing by name may stand for, by place and whether they are large."""


class Model(BaseModel):
    """A row of the table: one mesh and what it is.

    Attributes:
        model: Path of the mesh below the folder; y up, its front to +z.
        class_name: Class, one of those of S3DIS.
        placed: Where it goes: on the floor, on tables, on walls, into an opening of a wall.
        stands_for: Names of the synthetic things it may stand for, those of ``things/``; without,
            it stands for anything of its class and place.
        size: Width, depth and height, metres.
        part: Whether it may be trained on.
        rotation: (3, 3) by rows: how the mesh is turned before its front faces +z; empty for not.
        home: Finer class, one of ``HOME_CLASSES``; empty where it is the same.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    model: str
    class_name: _Class
    placed: _Placed
    stands_for: tuple[str, ...]
    size: tuple[Extent, Extent, Extent]
    part: Literal["train", "kept"]
    rotation: tuple[float, ...]
    home: _Home = ""

    @field_validator("rotation")
    @classmethod
    def _nine_or_none(cls, numbers: tuple[float, ...]) -> tuple[float, ...]:
        """Refuse what is no matrix."""
        if len(numbers) not in (0, 9):
            raise ValueError("nine numbers or none")
        return numbers

    @property
    def kinds(self) -> tuple[str, ...]:
        """Names of the things it may stand for; of clutter without any, those of its place."""
        if self.stands_for or self.class_name != "clutter":
            return self.stands_for
        is_large = self.placed == "floor" and max(self.size) > 0.9
        return _ANYTHING.get((self.placed, is_large), ())


class Models(BaseModel):
    """The models a building is furnished with.

    Attributes:
        folder: Where the meshes are.
        models: Those in use.
        share: How often a thing for which there are models is one of them.
        digest: Hash of the table and of which part of it is in use.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    folder: Path
    models: tuple[Model, ...]
    share: float
    digest: str

    @cached_property
    def _by_kind(self) -> dict[tuple[str, str], tuple[Model, ...]]:
        """The models by class and name of the thing they may stand for."""
        found: dict[tuple[str, str], tuple[Model, ...]] = {}
        for model in self.models:
            for kind in model.kinds or ("",):
                key = (model.class_name, kind)
                found[key] = (*found.get(key, ()), model)
        return found

    def standing_for(self, class_name: str, kind: str) -> tuple[Model, ...]:
        """Return the models that may stand for a thing, by its class and name."""
        found = self._by_kind.get((class_name, kind), ())
        return found if class_name == "clutter" else found + self._by_kind.get((class_name, ""), ())


def read_models(
    folder: Path, part: ModelPart = "train", share: float = 0.5, classes: SynthClasses = "s3dis"
) -> Models:
    """Read the table of a folder of models; rows without a class are passed over.

    Args:
        folder: The folder; has ``models.csv`` and the meshes that it names.
        part: Which of the models to use: those to train on, those kept from it, or all.
        share: How often a thing for which there are models is to be one of them.
        classes: What is to name them; classes of homes need the table's column ``home``.

    Returns:
        The models.

    Raises:
        InputError: The table is missing or damaged, names a mesh that is not there, or has no
            model of the part; or trimesh is not installed.
    """
    path = folder / TABLE
    _check_trimesh(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        remedy = "name a folder made by models/fetch_furniture.py"
        raise InputError(path, "cannot be read", "the table of the models", remedy) from error

    # the rows that are in use
    rows = list(csv.DictReader(text.splitlines()))
    if classes == "home" and not any("home" in row for row in rows):
        remedy = "remove it and run models/fetch_furniture.py again"
        raise InputError(path, "no column home", "the finer class of each model", remedy)
    named = [(line, row) for line, row in enumerate(rows, 2) if row.get("class")]
    models = [_model_of(path, line, row) for line, row in named]
    chosen = tuple(model for model in models if part in ("all", model.part))
    if not chosen:
        found = f"no model of part {part} among {len(models)} with a class"
        raise InputError(path, found, "some", "use another --models-part, or mend the table")
    digest = hashlib.sha256(f"{part} {share} {text}".encode()).hexdigest()[:16]
    return Models(folder=folder, models=chosen, share=share, digest=digest)


def _model_of(path: Path, line: int, row: dict[str, str]) -> Model:
    """Check a row and the file it names."""
    source = f"{path}, line {line}"
    try:
        model = Model.model_validate(
            {
                "model": row["model"],
                "class_name": row["class"],
                "placed": row["placed"],
                "stands_for": tuple(filter(None, row["stands_for"].split(";"))),
                "size": (row["width"], row["depth"], row["height"]),
                "part": row["part"],
                "rotation": tuple(row["rotation"].split()),
                "home": row.get("home") or "",
            }
        )
    except (KeyError, AttributeError) as error:
        columns = "model, class, placed, stands_for, width, depth, height, part, rotation"
        raise InputError(source, "a column is missing", columns, _REMEDY) from error
    except ValidationError as error:
        first = error.errors()[0]
        name = str(first["loc"][0]).replace("class_name", "class")
        if name == "size":
            name = ("width", "depth", "height")[int(first["loc"][1])]
        raise InputError(source, f"{name} {first['input']!r}", first["msg"], _REMEDY) from error
    if not (path.parent / model.model).is_file():
        raise InputError(source, f"{model.model} is not there", "a mesh", _REMEDY)
    return model


def _check_trimesh(path: Path) -> None:
    """Refuse to go on without what reads meshes."""
    try:
        import trimesh  # noqa: F401
    except ImportError as error:
        remedy = "pip install 'mcpseg[models]'"
        raise InputError(path, "trimesh is not installed", "it, to read meshes", remedy) from error
