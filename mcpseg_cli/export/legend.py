"""The legend under a picture of a map, with its scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from mcpseg_cli.choices import ColourBy
from mcpseg_cli.export.colours import class_palette, confidence_colours

_CONFIDENCES = (0.0, 0.25, 0.5, 0.75, 1.0)
_TEXT_SHARE = 1 / 66  # height of letters by the picture's width
_LEAST_TEXT = 13  # pixels
_SCALE_SHARE = 0.16  # of the picture's width that a scale takes at most
_SCALE_STEPS = (5.0, 2.0, 1.0)  # times a power of ten: lengths of scales, metres
_SCALE_COLOUR = (30, 30, 30)


@dataclass(frozen=True)
class LegendEntry:
    """A name with its colour, which is shown as a square, or as a line.

    Attributes:
        name: What it means.
        colour: sRGB.
        is_line: Whether it is shown as a line.
        length: Of the line of a scale, pixels, between two ticks; None for other entries.
    """

    name: str
    colour: tuple[int, int, int]
    is_line: bool = False
    length: int | None = None


def legend_entries(
    colour_by: ColourBy, classes: tuple[str, ...], present: NDArray[np.bool_]
) -> list[LegendEntry]:
    """List what colours mean.

    Args:
        colour_by: What they say.
        classes: Class names.
        present: (256,) bool: which classes are in the picture.

    Returns:
        An entry for each colour; none where colours have no names.
    """
    # of classes those that are to be seen
    if colour_by == "class":
        palette = class_palette(classes).tolist()
        return [
            LegendEntry(name, tuple(palette[index]))
            for index, name in enumerate(classes)
            if present[index]
        ]

    if colour_by == "confidence":
        ramp = confidence_colours(np.array(_CONFIDENCES)).tolist()
        return [
            LegendEntry(f"{value:g}", tuple(colour))
            for value, colour in zip(_CONFIDENCES, ramp, strict=True)
        ]

    return []


def scale_entry(width: int, pixels: float) -> LegendEntry:
    """Choose a scale: a round number of metres that takes at most a sixth of a picture's width.

    Args:
        width: Of the picture, pixels.
        pixels: Of a metre.
    """
    most = _SCALE_SHARE * width / pixels
    power = 10.0 ** np.floor(np.log10(most))
    metres = float(power * next(step for step in _SCALE_STEPS if step * power <= most * (1 + 1e-9)))
    return LegendEntry(f"{metres:g} m", _SCALE_COLOUR, is_line=True, length=round(metres * pixels))


def with_legend(picture: Image.Image, entries: list[LegendEntry]) -> Image.Image:
    """Return the picture with a legend under it, in as many lines as it takes."""
    # how large letters are, and how wide entries
    text = max(_LEAST_TEXT, int(picture.width * _TEXT_SHARE))
    font = ImageFont.load_default(text)
    symbols = [text if entry.length is None else entry.length for entry in entries]
    widths = [
        int(1.2 * text + symbol + font.getlength(entry.name))
        for symbol, entry in zip(symbols, entries, strict=True)
    ]
    lines = _break_lines(widths, picture.width - text)

    # room for the lines under the picture
    line_height = int(1.7 * text)
    height = picture.height + line_height * len(lines) + text // 2
    whole = Image.new("RGB", (picture.width, height), (255, 255, 255))
    whole.paste(picture)
    canvas = ImageDraw.Draw(whole)

    # every line in the middle
    for row, line in enumerate(lines):
        x = (picture.width - sum(widths[number] for number in line)) // 2
        y = picture.height + row * line_height + text // 5
        for number in line:
            place = (x + symbols[number] + 0.35 * text, y + text // 2)
            name = entries[number].name
            _draw_symbol(canvas, entries[number], (x, y), text)
            canvas.text(place, name, (30, 30, 30), font, anchor="lm")
            x += widths[number]
    return whole


def _break_lines(widths: list[int], room: int) -> list[list[int]]:
    """Put the numbers of entries into as few lines as the room allows, at least one into each."""
    lines: list[list[int]] = [[]]
    for number, width in enumerate(widths):
        if lines[-1] and sum(widths[other] for other in lines[-1]) + width > room:
            lines.append([])
        lines[-1].append(number)
    return lines


def _draw_symbol(
    canvas: ImageDraw.ImageDraw, entry: LegendEntry, corner: tuple[int, int], side: int
) -> None:
    x, y = corner
    if entry.length is not None:
        ends = (x, x + entry.length)
        canvas.line((x, y + side // 2, ends[1], y + side // 2), entry.colour, max(2, side // 8))
        for end in ends:
            canvas.line((end, y + side // 5, end, y + side - side // 5), entry.colour, 2)
    elif entry.is_line:
        canvas.line((x, y + side // 2, x + side, y + side // 2), entry.colour, max(2, side // 6))
    else:
        canvas.rectangle((x, y, x + side, y + side), entry.colour, (90, 90, 90))
