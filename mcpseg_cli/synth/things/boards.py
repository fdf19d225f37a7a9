"""Boards: whiteboards, chalkboards, pin boards, projection screens, flip charts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mcpseg_cli.synth.geometry.shapes import boxes, pipe, rod, solid, stand
from mcpseg_cli.synth.geometry.solids import Item, Part, shifted, tilted
from mcpseg_cli.synth.models.stand_in import stand_in
from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.surfaces.styles import Style, paint, pick_metal, pick_wood


def make_board(kind: str, style: Style, rng: np.random.Generator) -> Item:
    """Make a board that hangs on a wall at y = 0, its lowest edge at z = 0; a flip chart stands.

    Args:
        kind: One of ``BOARD_KINDS``.
        style: Colours and materials of the building.
        rng: Decides sizes and colours.

    Returns:
        An object of class board.

    Raises:
        KeyError: There is no such kind.
    """
    model = stand_in("board", kind, style, rng)
    return model or stand("board", BOARD_KINDS[kind](style, rng))


def _panel(face: Material, rim: Material, size: tuple[float, float], thick: float) -> list[Part]:
    """Make a board in a frame 2 cm wide: size along x and up."""
    (width, height), wide, out = size, 0.02, thick + 0.006
    lows = [(0, 0, 0), (0, 0, height - wide), (0, 0, wide), (width - wide, 0, wide)]
    highs = [(width, out, wide), (width, out, height)]
    highs += [(wide, out, height - wide), (width, out, height - wide)]
    sheet = boxes((0.01, 0, 0.01), (width - 0.01, thick, height - 0.01))
    return [solid(face, sheet), solid(rim, boxes(lows, highs))]


def _whiteboard(style: Style, rng: np.random.Generator) -> list[Part]:
    """Whiteboard with a tray, pens and an eraser."""
    width, height = rng.uniform(1.0, 3.2), rng.uniform(0.85, 1.25)
    rim = pick_metal(style, rng) if rng.random() < 0.7 else pick_wood(style, rng)
    parts = _panel(paint((238, 240, 240), rng, "whiteboard", 0.4), rim, (width, height), 0.018)
    if rng.random() >= 0.8:
        return parts

    # a tray along it or in its middle
    length = width * rng.choice([0.35, 1.0])
    low = (width - length) / 2
    floor, lip = (low, 0, -0.012), (low, 0.07, -0.012)
    tray = boxes([floor, lip], [(low + length, 0.075, 0.0), (low + length, 0.075, 0.008)])

    # what lies on it
    spots = low + rng.uniform(0.02, max(length - 0.2, 0.03), int(rng.integers(1, 5)))
    pens = [shifted(boxes((0, 0.03, 0), (0.13, 0.045, 0.015)), float(x)) for x in spots]
    eraser = boxes((low + 0.02, 0.02, 0), (low + 0.15, 0.065, 0.04))
    colour = ((30, 30, 34), (180, 40, 40), (40, 70, 160))[rng.integers(3)]
    return [*parts, solid(rim, tray), solid(paint(colour, rng), *pens, eraser)]


def _chalkboard(style: Style, rng: np.random.Generator) -> list[Part]:
    """Chalkboard in a wooden frame with a ledge."""
    width, height = rng.uniform(1.5, 3.6), rng.uniform(1.0, 1.3)
    rim = pick_wood(style, rng)
    colour = ((36, 60, 48), (44, 46, 48))[rng.integers(2)]
    parts = _panel(paint(colour, rng, "chalkboard", 0.5), rim, (width, height), 0.02)
    return [*parts, solid(rim, boxes((0, 0, -0.02), (width, 0.08, 0.0)))]


def _pin_board(style: Style, rng: np.random.Generator) -> list[Part]:
    """Cork or felt board with notes pinned to it."""
    width, height = rng.uniform(0.7, 2.0), rng.uniform(0.6, 1.2)
    cork = ((186, 146, 100), (120, 126, 140), (150, 60, 60), (70, 90, 110))[rng.integers(4)]
    parts = _panel(paint(cork, rng, "weave", 0.02), pick_wood(style, rng), (width, height), 0.014)

    # each note a little over the ones before
    count = int(rng.integers(3, 14))
    low = rng.uniform([0.05, 0.05], [width - 0.27, height - 0.35], (count, 2))
    size = rng.uniform([0.1, 0.1], [0.21, 0.297], (count, 2))
    level = 0.014 + 0.001 * np.arange(1, count + 1)
    lows = np.column_stack([low[:, 0], np.full(count, 0.013), low[:, 1]])
    highs = np.column_stack([low[:, 0] + size[:, 0], level, low[:, 1] + size[:, 1]])
    notes = boxes(lows, highs)

    # half of them yellow
    halves = 12 * (count // 2)
    yellow = paint((235, 215, 120), rng, "paper", 0.2)
    white = paint((240, 240, 236), rng, "paper", 0.2)
    return [*parts, solid(white, notes[halves:]), solid(yellow, notes[: max(halves, 12)])]


def _screen(style: Style, rng: np.random.Generator) -> list[Part]:
    """Projection screen let down from its case."""
    width, drop = rng.uniform(1.6, 2.6), rng.uniform(1.1, 1.7)
    case = boxes((0, 0, drop), (width, 0.09, drop + 0.09))
    bar = boxes((0.03, 0.035, -0.03), (width - 0.03, 0.06, 0))
    sheet = boxes((0.05, 0.045, 0), (width - 0.05, 0.048, drop))
    plate, cloth = paint((230, 230, 226), rng), paint((242, 242, 240), rng)
    return [solid(cloth, sheet), solid(plate, case), solid(paint((50, 50, 52), rng), bar)]


def _flip_chart(style: Style, rng: np.random.Generator) -> list[Part]:
    """Flip chart on three legs."""
    metal, lean = pick_metal(style, rng), rng.uniform(0.15, 0.25)
    board = tilted(boxes((-0.35, -0.01, 0.85), (0.35, 0.01, 1.85)), lean)
    sheet = tilted(boxes((-0.32, 0.011, 0.95), (0.32, 0.016, 1.8)), lean)
    ledge = tilted(boxes((-0.35, 0.0, 0.83), (0.35, 0.07, 0.85)), lean)

    legs = [pipe([(x, 0.02, 0), (x * 0.7, -0.27, 1.3)], 0.012) for x in (-0.42, 0.42)]
    rear = pipe([(0, -0.8, 0), (0, -0.32, 1.4)], 0.012)
    white, paper = (
        paint((236, 238, 238), rng, "whiteboard", 0.3),
        paint((244, 243, 238), rng, "paper", 0.4),
    )
    metals = [solid(metal, piece) for piece in (ledge, *legs, rear)]
    return [solid(white, board), solid(paper, sheet), *metals]


def _mobile(style: Style, rng: np.random.Generator) -> list[Part]:
    """Whiteboard on a stand with wheels."""
    width, height = rng.uniform(1.2, 1.8), rng.uniform(0.9, 1.2)
    rim = pick_metal(style, rng)
    face = paint((238, 240, 240), rng, "whiteboard", 0.4)
    panel = _panel(face, rim, (width, height), 0.02)
    parts = [part.moved(x=-width / 2, y=-0.012, z=0.75) for part in panel]

    # a post, a foot and two wheels at each side
    for x in (-width / 2 - 0.03, width / 2 + 0.03):
        parts.append(solid(rim, boxes((x - 0.02, -0.02, 0.05), (x + 0.02, 0.02, 0.8 + height))))
        parts.append(solid(rim, boxes((x - 0.025, -0.28, 0.05), (x + 0.025, 0.28, 0.09))))
        wheel = tilted(rod(0.03, -0.012, 0.012, sides=8), np.pi / 2)
        wheels = [shifted(wheel, x, y, 0.03) for y in (-0.25, 0.25)]
        parts.append(solid(paint((40, 40, 42), rng), *wheels))
    return parts


BOARD_KINDS: dict[str, Callable[[Style, np.random.Generator], list[Part]]] = {
    "whiteboard": _whiteboard,
    "chalkboard": _chalkboard,
    "pin board": _pin_board,
    "projection screen": _screen,
    "flip chart": _flip_chart,
    "mobile": _mobile,
}
"""Boards by kind: what makes their parts."""
STANDING_BOARDS = ("flip chart", "mobile")
"""Those that stand on the floor."""
