"""Models in place of synthetic things: which one, how large, and in what colours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcpseg_cli.synth.geometry.solids import Item, Part, part_of
from mcpseg_cli.synth.models.library import Model
from mcpseg_cli.synth.models.meshes import Piece, read_pieces
from mcpseg_cli.synth.surfaces.materials import Colour, Material
from mcpseg_cli.synth.surfaces.skins import Skin
from mcpseg_cli.synth.surfaces.styles import Style, pick_fabric, pick_table_top, pick_wood

_ABOUT = (0.78, 1.3)  # how much narrower and wider than asked for a model may be
_RECOLOURED, _WORN = 0.5, 0.2  # shares of models
_SEE_THROUGH = 0.6  # what is less opaque is glass
_DEEPEST = 0.72  # metres, of what stands in a row
_COVERED, _WOODEN = ("chair", "sofa"), ("table", "bookcase", "door")
_GLASS = Material("glass", (96, 106, 110), (158, 168, 172), 0.6)


def stand_in(
    class_name: str,
    kind: str,
    style: Style,
    rng: np.random.Generator,
    width: float | None = None,
) -> Item | None:
    """Return a model in place of a synthetic thing, or nothing: then the thing itself is made.

    Args:
        class_name: Class of the thing, one of the 13 of S3DIS.
        kind: Its name among the things of its class.
        style: The building's; without models nothing is drawn from ``rng``.
        rng: Decides whether, which model, its colours and a little of its size.
        width: About how wide it has to be, metres.

    Returns:
        An object that stands on z = 0, its back at y = 0, its middle at x = 0.

    Raises:
        InputError: The mesh cannot be read.
    """
    if style.models is None:
        return None
    found = style.models.standing_for(class_name, kind)
    if width is not None:
        low, high = _ABOUT[0] * width, _ABOUT[1] * width
        found = tuple(model for model in found if low < model.size[0] < high)
    if not found or rng.random() >= style.models.share:
        return None

    # a little larger or smaller than in the catalogue
    model = found[int(rng.integers(len(found)))]
    scale = rng.uniform(0.94, 1.06)
    return dressed(model, style, rng, (scale, scale, scale))


def row_of(
    class_name: str, kind: str, style: Style, rng: np.random.Generator, width: float
) -> list[Part] | None:
    """Return models side by side in place of a long thing, or nothing; see ``stand_in``.

    Args:
        class_name: Class of the thing.
        kind: Its name.
        style: The building's.
        rng: Random numbers.
        width: How wide the row may be, metres.

    Returns:
        Their parts, on z = 0, backs at y = 0, the row's middle at x = 0.
    """
    if style.models is None:
        return None
    found = [m for m in style.models.standing_for(class_name, kind) if m.size[1] < _DEEPEST]
    if not found or rng.random() >= style.models.share:
        return None

    # of one height, from the left, until no more fits
    height = found[int(rng.integers(len(found)))].size[2]
    found = [model for model in found if abs(model.size[2] - height) < 0.12]
    parts: list[Part] = []
    place = 0.0
    while fits := [model for model in found if model.size[0] < width - place]:
        model = fits[int(rng.integers(len(fits)))]
        item = dressed(model, style, rng).moved(x=place + model.size[0] / 2)
        parts += item.parts
        place += model.size[0]
    return [part.moved(x=-place / 2) for part in parts] or None


def fitted(
    class_name: str, kind: str, style: Style, rng: np.random.Generator, size: tuple[float, float]
) -> Item | None:
    """Return a model that fills an opening of a width and height, or nothing; see ``stand_in``."""
    if style.models is None:
        return None
    shape = size[0] / size[1]
    found = [
        model
        for model in style.models.standing_for(class_name, kind)
        if 0.75 < model.size[0] / model.size[2] / shape < 1.33
    ]
    if not found or rng.random() >= style.models.share:
        return None
    model = found[int(rng.integers(len(found)))]
    return dressed(model, style, rng, (size[0] / model.size[0], 1.0, size[1] / model.size[2]))


def dressed(
    model: Model,
    style: Style,
    rng: np.random.Generator,
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> Item:
    """Make an object of a model, recoloured and worn at times.

    Args:
        model: The model.
        style: The building's; has the folder of the models.
        rng: Decides the colours.
        scale: Factors of width, depth and height.

    Returns:
        An object of the model's class.

    Raises:
        InputError: The mesh cannot be read.
    """
    assert style.models is not None
    pieces = read_pieces(style.models.folder / model.model, model.rotation, model.size)
    faces = np.bincount(
        [piece.material for piece in pieces], [len(piece.triangles) for piece in pieces]
    )
    new = _new_surface(model.class_name, style, rng) if rng.random() < _RECOLOURED else None
    largest, is_worn = int(np.argmax(faces)), rng.random() < _WORN

    # all pieces of one material alike
    looks: dict[int, tuple[Material, tuple[float, float, float]]] = {}
    parts = []
    for piece in pieces:
        if piece.material not in looks:
            own = new if piece.material == largest else None
            looks[piece.material] = _look(piece, own, is_worn, rng)
        material, tint = looks[piece.material]
        part = part_of(piece.triangles * np.array(scale), material)
        if piece.image is not None and piece.uv is not None and material.pattern != "glass":
            part = replace(part, skin=Skin(piece.image, piece.uv, tint))
        parts.append(part)
    return Item(model.class_name, tuple(parts), model.home)


def _new_surface(class_name: str, style: Style, rng: np.random.Generator) -> Material | None:
    """Draw what a recoloured model's main material becomes: a cover or wood of the building."""
    if class_name in _COVERED:
        return pick_fabric(style, rng)
    if class_name in _WOODEN:
        return pick_wood(style, rng) if rng.random() < 0.6 else pick_table_top(style, rng)
    return None


def _look(
    piece: Piece, new: Material | None, is_worn: bool, rng: np.random.Generator
) -> tuple[Material, tuple[float, float, float]]:
    """Return a piece's material and the tint of its picture."""
    shade = np.exp(rng.normal(0, 0.1) + rng.normal(0, 0.03, 3))
    seed = int(rng.integers(1 << 30))
    if piece.opacity < _SEE_THROUGH:
        return replace(_GLASS, seed=seed), (1.0, 1.0, 1.0)

    # a new colour: of a picture its tint, of a plain surface all of it
    if new is not None and piece.image is None:
        return new, (1.0, 1.0, 1.0)
    if new is not None:
        shade = np.clip(np.array(new.base) / np.maximum(piece.colour, 12.0), 0.15, 4.0)

    base, tint = _triple(np.clip(piece.colour * shade, 4, 250)), _triple(shade)
    if is_worn:  # stained
        return Material("print", base, _triple(np.array(base) * 0.7), 0.4, seed), tint
    return Material("plain", base, _triple(np.array(base) * 0.75), 0.1, seed), tint


def _triple(values: np.ndarray) -> Colour:
    """Return three numbers of an array."""
    first, second, third = values.tolist()
    return first, second, third
