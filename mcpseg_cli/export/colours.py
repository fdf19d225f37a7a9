"""Colours of classes, objects, confidence and embeddings, as (N, 3) uint8 sRGB."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import ColourBy
from mcpseg_cli.segment.labelled_run import LabelledRun, MapPart

COLOUR_BY: tuple[ColourBy, ...] = ("rgb", "class", "instance", "embedding", "confidence")
UNKNOWN_COLOUR = (112, 112, 144)
# No two of these, nor the colour of no class, are nearer than 12 (CIEDE2000) to a reader with
# normal sight, deuteranopia or protanopia, nor is any to the white that marks what is picked; each
# stands out from a dark panel by 3 to 1 and more. tests/benchmarks/palette.py measures.
_CLASS_COLOURS = {
    "ceiling": "#d0e0ff",
    "floor": "#f0e098",
    "wall": "#889088",
    "beam": "#a09018",
    "column": "#d888b8",
    "window": "#a0d0bc",
    "door": "#985808",
    "table": "#5898ff",
    "chair": "#e01060",
    "sofa": "#a830d0",
    "bookcase": "#d0a080",
    "board": "#087858",
    "clutter": "#70d800",
}
# for classes of other tables, after those colours above that their table leaves free
_MORE_COLOURS = (
    "#58c8ff", "#e0ff18", "#00a0a0", "#ff38d0", "#a04878", "#80ffd0", "#d8b8d0", "#60a858",
    "#a84840", "#ffa0a8", "#3868a0", "#b0c868",
)  # fmt: skip
_CONFIDENCE_RAMP = (
    "#440154",
    "#472d7b",
    "#3b528b",
    "#2c728e",
    "#21918c",
    "#28ae80",
    "#5ec962",
    "#addc30",
    "#fde725",
)
# steps of this share of a circle keep consecutive numbers far apart, however many follow
_GOLDEN = 0.6180339887
_PLASTIC = 0.7548776662  # the same in a second direction, with no common period
_FIT_VOXELS = 100_000  # voxels that decide the axes of the embedding's colours

# from OKLab to the responses of the eye's cones (their cube roots), and from these to linear sRGB
_TO_CONES = np.array(
    [[1, 0.3963378, 0.2158038], [1, -0.1055613, -0.0638542], [1, -0.0894842, -1.2914855]]
)
_TO_LINEAR = np.array(
    [
        [4.0767417, -3.3077116, 0.2309699],
        [-1.2684380, 2.6097574, -0.3413194],
        [-0.0041961, -0.7034186, 1.7076147],
    ]
)


def class_palette(classes: Sequence[str]) -> NDArray[np.uint8]:
    """Choose a colour for every class.

    Args:
        classes: Names that ``semantic`` indexes; those of S3DIS have colours of their own, others
            get those that are left, and after 25 those of objects.

    Returns:
        (256, 3) uint8; ``palette[semantic]`` colours points, a bluish grey where there is no class.
    """
    palette = np.full((256, 3), UNKNOWN_COLOUR, np.uint8)
    free = [colour for name, colour in _CLASS_COLOURS.items() if name not in classes]
    others = [index for index, name in enumerate(classes) if name not in _CLASS_COLOURS]

    # those of S3DIS by name, others in the order of their table
    for index, name in enumerate(classes):
        if name in _CLASS_COLOURS:
            palette[index] = _from_hex(_CLASS_COLOURS[name])
    for index, colour in zip(others, (*free, *_MORE_COLOURS), strict=False):
        palette[index] = _from_hex(colour)

    # a table of more classes than colours
    late = others[len(free) + len(_MORE_COLOURS) :]
    palette[late] = instance_colours(np.arange(1, len(late) + 1, dtype=np.int64))
    return palette


def instance_colours(instance: NDArray[np.integer]) -> NDArray[np.uint8]:
    """Colour objects: consecutive ids lie far apart, and an id has one colour in all pictures.

    Args:
        instance: (N,) object ids; 0, none, is grey.

    Returns:
        (N, 3) uint8.
    """
    ids, place = np.unique(instance, return_inverse=True)
    hue = 2 * np.pi * (ids * _GOLDEN % 1.0)
    lightness = 0.5 + 0.32 * (ids * _PLASTIC % 1.0)
    chroma = 0.17 - 0.05 * np.abs(lightness - 0.66) / 0.16
    colours = _from_oklab(lightness, chroma * np.cos(hue), chroma * np.sin(hue))
    colours[ids == 0] = UNKNOWN_COLOUR
    coloured: NDArray[np.uint8] = colours[place]
    return coloured


def confidence_colours(confidence: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Colour (N,) confidences of 0 to 1 from dark violet to yellow (viridis); (N, 3) uint8."""
    ramp = np.array([_from_hex(colour) for colour in _CONFIDENCE_RAMP], np.float64)
    places = np.linspace(0.0, 1.0, len(ramp))
    channels = [np.interp(confidence, places, ramp[:, channel]) for channel in range(3)]
    return _rounded(np.stack(channels, axis=1))


@dataclass(frozen=True)
class EmbeddingColours:
    """The three main directions of a map's embeddings as red, green and blue (figure 4).

    Attributes:
        axes: (E, 3) float32 directions, widest spread first.
        low: (3,) float32 coordinate along each that becomes 0.
        high: (3,) float32 coordinate that becomes 255.
    """

    axes: NDArray[np.float32]
    low: NDArray[np.float32]
    high: NDArray[np.float32]

    @classmethod
    def fit(cls, embedding: NDArray[np.float32]) -> EmbeddingColours:
        """Find the directions by principal components.

        Args:
            embedding: (N, E) float32; 98 in 100 of them fit the scale.
        """
        spread = np.cov(embedding.T.astype(np.float64))
        _, vectors = np.linalg.eigh(spread)
        axes = vectors[:, -1:-4:-1]

        # a direction has two signs: choose one
        axes *= np.sign(axes[np.abs(axes).argmax(axis=0), np.arange(3)])
        low, high = np.percentile(embedding @ axes, (1, 99), axis=0)
        return cls(axes.astype(np.float32), low.astype(np.float32), high.astype(np.float32))

    def __call__(self, embedding: NDArray[np.float32]) -> NDArray[np.uint8]:
        """Colour (N, E) float32 embeddings; (N, 3) uint8."""
        share = (embedding @ self.axes - self.low) / np.maximum(self.high - self.low, 1e-6)
        return _rounded(255 * np.clip(share, 0.0, 1.0))


def colouring(run: LabelledRun, by: ColourBy) -> Callable[[MapPart], NDArray[np.uint8]]:
    """Choose what colours say.

    Args:
        run: The map; looked through once for ``embedding``.
        by: What to colour by.

    Returns:
        A function from voxels of the map to (V, 3) uint8.
    """
    if by == "rgb":
        return lambda part: part.rgb
    if by == "instance":
        return lambda part: instance_colours(part.instance)
    if by == "confidence":
        return lambda part: confidence_colours(part.confidence)
    if by == "class":
        palette = class_palette(run.classes)
        return lambda part: palette[part.semantic]

    # the embedding's axes are those of an even sample of the map
    stride = -(-len(run) // _FIT_VOXELS)
    sample = [part.select(part.ids % stride == 0).embedding for part in run.parts()]
    fitted = EmbeddingColours.fit(np.concatenate(sample))
    return lambda part: fitted(part.embedding)


def _from_hex(colour: str) -> tuple[int, int, int]:
    red, green, blue = bytes.fromhex(colour[1:])
    return red, green, blue


def _from_oklab(
    lightness: NDArray[np.float64], a: NDArray[np.float64], b: NDArray[np.float64]
) -> NDArray[np.uint8]:
    """Convert (N,) OKLab coordinates to (N, 3) sRGB (Ottosson 2020).

    In OKLab, colours are as far apart as they look.
    """
    cones = _TO_CONES @ np.stack([lightness, a, b])
    linear = np.clip(_TO_LINEAR @ (cones**3), 0.0, 1.0).T
    gamma = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return _rounded(255 * gamma)


def _rounded(colours: NDArray[np.floating]) -> NDArray[np.uint8]:
    nearest: NDArray[np.floating] = np.rint(colours)
    return nearest.astype(np.uint8)
