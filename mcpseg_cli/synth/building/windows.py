"""Windows as seen from inside a room: frames, panes, sills, blinds and curtains."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from mcpseg_cli.synth.building.walls import on_wall
from mcpseg_cli.synth.geometry.solids import Item, box, part_of, quad, surface
from mcpseg_cli.synth.models.built_in import window_model
from mcpseg_cli.synth.plan import Opening, Room
from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.surfaces.styles import Shade, Style, paint, pick_colour

_INNER_GLASS = Material("glass", (96, 106, 110), (158, 168, 172), 0.6)  # to a corridor


def build_windows(
    room: Room, style: Style, daylight: float, rng: np.random.Generator
) -> list[Item]:
    """Build the windows of a room, with what hangs before them.

    Args:
        room: The room.
        style: The building's.
        daylight: How bright it is outside; 1 is as bright as white paper under the lamps.
        rng: Random numbers.

    Returns:
        A ``window`` for each opening of that kind and ``clutter`` for blinds and curtains, in the
        map frame.
    """
    # all windows of a room are alike
    colour = pick_colour(((228, 226, 220), (70, 72, 74), (150, 152, 154), (110, 84, 60)), rng)
    trim = paint(colour, rng, "plain" if rng.random() < 0.7 else "metal")
    shades, shares = list(style.shades), list(style.shades.values())
    shade = shades[int(rng.choice(len(shades), p=shares))]
    dyed = pick_colour(style.walls + style.accents, rng)
    cloth = paint(dyed, rng, "weave" if shade == "curtain" else "plain")
    glass = _glass(daylight, rng)

    seed = 0 if style.models is None else int(rng.integers(1 << 30))

    items = []
    for opening in room.openings:
        if opening.kind != "window":
            continue
        model = window_model(room, opening, glass, style, seed)
        items.append(model or _window(room, opening, trim, glass, rng))
        if shade != "none" and opening.glazing != "interior":
            items.append(_shade(room, opening, shade, cloth, rng))
    return items


def _glass(daylight: float, rng: np.random.Generator) -> Material:
    """Draw what panes to the street show: in a third of the rooms an outside too bright to see."""
    shift = rng.normal(0, 12) + rng.normal(0, 5, 3)
    if rng.random() < 1 / 3:
        red, green, blue = np.clip(np.array([188, 206, 226]) + shift, 90, 255).tolist()
        return Material("glass", (red, green, blue), (214, 222, 226), 0.6, glow=daylight)

    # a dark bluish one otherwise
    red, green, blue = np.clip(np.array([84, 98, 114]) + shift, 30, 160).tolist()
    light = (red + 60, green + 64, blue + 66)
    return Material("glass", (red, green, blue), light, 0.6, glow=0.35 * daylight)


def _window(
    room: Room, opening: Opening, trim: Material, outside: Material, rng: np.random.Generator
) -> Item:
    """Build frame, mullions, panes and sill of one window."""
    a, b, low, high = opening.start, opening.end, opening.low, opening.high
    is_inside = opening.glazing == "interior"
    back, front = -opening.depth, -opening.depth + (0.03 if is_inside else 0.06)
    rim = rng.uniform(0.035, 0.07)
    bars = [((x0, back, z0), (x1, front, z1)) for x0, z0, x1, z1 in _bars(opening, rim, rng)]
    parts = [part_of(on_wall(box(p, q), room, opening.side), trim) for p, q in bars]

    # one pane through all of them
    glass = replace(_INNER_GLASS if is_inside else outside, seed=int(rng.integers(1 << 30)))
    plane = (back + front) / 2
    pane = quad((b - rim, plane, low + rim), (a - b + 2 * rim, 0, 0), (0, 0, high - low - 2 * rim))
    parts.append(part_of(on_wall(pane, room, opening.side), glass))

    if opening.glazing in ("single", "band"):
        out = rng.uniform(0.01, 0.06)
        sill = box((a, front, low - 0.03), (b, out, low + 0.004))
        parts.append(part_of(on_wall(sill, room, opening.side), replace(trim, seed=trim.seed + 1)))
    return Item("window", tuple(parts))


def _bars(
    opening: Opening, rim: float, rng: np.random.Generator
) -> list[tuple[float, float, float, float]]:
    """Return frame and mullions: lowest x and z, highest x and z of each, in the wall's frame."""
    a, b, low, high = opening.start, opening.end, opening.low, opening.high
    bars = [(a, low, a + rim, high), (b - rim, low, b, high)]
    bars += [(a + rim, low, b - rim, low + rim), (a + rim, high - rim, b - rim, high)]

    # upright ones between panes
    count = max(1, round((b - a) / rng.uniform(0.7, 1.5)))
    edges = np.linspace(a + rim, b - rim, count + 1).tolist()
    bars += [(x - rim / 2, low + rim, x + rim / 2, high - rim) for x in edges[1:-1]]

    # one across
    if high - low > 1.0 and rng.random() < 0.5:
        z, step = low + (high - low) * rng.uniform(0.25, 0.75), rim / 2 + 0.001
        spans = itertools.pairwise(edges)
        bars += [(x0 + step, z - rim / 2, x1 - step, z + rim / 2) for x0, x1 in spans]
    return bars


def _shade(
    room: Room, opening: Opening, shade: Shade, cloth: Material, rng: np.random.Generator
) -> Item:
    """Hang a blind or a curtain before a window."""
    a, b, low, high = opening.start + 0.03, opening.end - 0.03, opening.low, opening.high
    if shade == "curtain":
        out, low = 0.05, max(low - 0.1, 0.03) if opening.glazing != "full" else 0.03
        width = (b - a) * rng.uniform(0.12, 0.4)
        spans = [(a, a + width), (b - width, b)]
    else:
        out = 0.09 - opening.depth if opening.depth > 0.13 else 0.03
        low = high - (high - low) * float(np.clip(rng.beta(0.8, 0.8), 0.1, 0.97))
        spans = [(a, b)]

    # the rail, and the cloth or slats
    rail = box((a, out - 0.02, high - 0.05), (b, out + 0.03, high))
    parts = [part_of(on_wall(rail, room, opening.side), cloth)]
    for first, last in spans:
        folds = max(int((last - first) / 0.03), 2) if shade == "curtain" else 2
        rows = max(int((high - low) / 0.025), 3) if shade == "slats" else 2
        along, up = np.linspace(first, last, folds), np.linspace(low, high - 0.05, rows)
        x, z = np.meshgrid(along, up, indexing="ij")
        y = np.full(x.shape, out)
        if shade == "curtain":
            y = y + 0.03 * np.sin(x * 2 * np.pi / 0.14) + 0.01 * np.sin(7 * x)
        elif shade == "slats":
            y = y + 0.014 * np.where(np.arange(rows) % 2, 1, -1)
        sheet = surface(np.stack([x, y, z], axis=-1))
        parts.append(part_of(on_wall(sheet, room, opening.side), cloth))
    return Item("clutter", tuple(parts), "curtain")
