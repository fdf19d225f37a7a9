"""The legend under a picture of a map."""

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


@dataclass(frozen=True)
class LegendEntry:
    """A name with its colour, which is shown as a square, or as a line."""

    name: str
    colour: tuple[int, int, int]
    is_line: bool = False


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


def with_legend(picture: Image.Image, entries: list[LegendEntry]) -> Image.Image:
    """Return the picture with a legend under it, in as many lines as it takes."""
    # how large letters are, and how wide entries
    text = max(_LEAST_TEXT, int(picture.width * _TEXT_SHARE))
    font = ImageFont.load_default(text)
    widths = [int(2.2 * text + font.getlength(entry.name)) for entry in entries]
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
            place, name = (x + 1.35 * text, y + text // 2), entries[number].name
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
    if entry.is_line:
        canvas.line((x, y + side // 2, x + side, y + side // 2), entry.colour, max(2, side // 6))
    else:
        canvas.rectangle((x, y, x + side, y + side), entry.colour, (90, 90, 90))
