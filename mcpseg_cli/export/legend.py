"""The legend under a picture of a map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from mcpseg_cli.export.colours import ColourBy, class_palette, confidence_colours

_CONFIDENCES = (0.0, 0.25, 0.5, 0.75, 1.0)
_TEXT_SHARE = 1 / 66  # height of letters by the picture's width
_LEAST_TEXT = 13  # pixels


def legend_entries(
    colour_by: ColourBy, classes: tuple[str, ...], present: NDArray[np.bool_]
) -> list[tuple[str, tuple[int, int, int]]]:
    """List what colours mean.

    Args:
        colour_by: What they say.
        classes: Class names.
        present: (256,) bool: which classes are in the picture.

    Returns:
        Names with their colours; none where colours have no names.
    """
    if colour_by == "class":
        palette = class_palette(classes).tolist()
        return [(name, tuple(palette[index])) for index, name in enumerate(classes) if present[index]]
    if colour_by == "confidence":
        ramp = confidence_colours(np.array(_CONFIDENCES)).tolist()
        return [(f"{value:g}", tuple(colour)) for value, colour in zip(_CONFIDENCES, ramp, strict=True)]
    return []


def with_legend(picture: Image.Image, entries: list[tuple[str, tuple[int, int, int]]]) -> Image.Image:
    """Return the picture with a legend under it, in as many lines as it takes; the picture itself without entries."""
    if not entries:
        return picture
    text = max(_LEAST_TEXT, int(picture.width * _TEXT_SHARE))
    font = ImageFont.load_default(text)
    widths = [int(2.2 * text + font.getlength(name)) for name, _ in entries]
    lines: list[list[int]] = [[]]
    for number, width in enumerate(widths):
        if lines[-1] and sum(widths[other] for other in lines[-1]) + width > picture.width - text:
            lines.append([])
        lines[-1].append(number)
    line_height = int(1.7 * text)
    whole = Image.new("RGB", (picture.width, picture.height + line_height * len(lines) + text // 2), (255, 255, 255))
    whole.paste(picture)
    canvas = ImageDraw.Draw(whole)
    for row, line in enumerate(lines):
        x = (picture.width - sum(widths[number] for number in line)) // 2
        y = picture.height + row * line_height
        for number in line:
            name, colour = entries[number]
            canvas.rectangle((x, y + text // 5, x + text, y + text // 5 + text), fill=colour, outline=(90, 90, 90))
            canvas.text((x + 1.35 * text, y + text // 5 + text // 2), name, (30, 30, 30), font, anchor="lm")
            x += widths[number]
    return whole
