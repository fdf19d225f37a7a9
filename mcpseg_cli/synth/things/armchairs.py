"""Armchairs of homes, class chair: club and wing chairs, easy chairs, rockers, tubs."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import bend, boxes, cushion, pipe, rod, shell, slanted, solid
from mcpseg_cli.synth.geometry.solids import Part, shifted, tilted
from mcpseg_cli.synth.surfaces.styles import Style, pick_fabric, pick_metal, pick_wood


def club_chair(style: Style, rng: np.random.Generator) -> list[Part]:
    """Deep upholstered chair with thick arms that reach down: a sofa for one; at times reclined."""
    fabric, seat = pick_fabric(style, rng), rng.uniform(0.4, 0.48)
    width, depth, arm = rng.uniform(0.78, 1.0), rng.uniform(0.76, 0.95), rng.uniform(0.13, 0.22)
    top, rise, foot = (
        rng.uniform(0.78, 1.05),
        rng.uniform(0.55, 0.68),
        rng.choice([0.03, 0.08, 0.14]),
    )
    half, inner = width / 2, width / 2 - arm
    lean, soft = rng.uniform(0.05, 0.3), rng.uniform(0.15, 0.45)
    spots = [(x, y) for x in (-half + 0.06, half - 0.1) for y in (0.05, depth - 0.1)]
    legs = boxes([(x, y, 0) for x, y in spots], [(x + 0.04, y + 0.04, foot) for x, y in spots])
    parts = [solid(pick_wood(style, rng), legs)]

    # box, seat, back in one or two cushions, arms
    parts.append(solid(fabric, boxes((-inner, 0.1, foot), (inner, depth - 0.02, seat - 0.14))))
    parts.append(
        solid(fabric, cushion((-inner, 0.2, seat - 0.15), (inner, depth, seat), 0.2, soft))
    )
    rear = tilted(cushion((-inner, 0, 0), (inner, 0.22, top - foot - 0.02), 0.2, soft), lean)
    parts.append(solid(fabric, shifted(rear, 0, 0.1 + lean * 0.3, foot)))
    for x in (-half, inner):
        block = cushion((x, 0.06, foot), (x + arm, depth - 0.03, rise), 0.2, soft)
        parts.append(solid(fabric, block))
    if rng.random() < 0.2:
        leg = cushion((-inner, depth, seat - 0.12), (inner, depth + 0.35, seat), 0.3, 0.4)
        parts.append(solid(fabric, leg))
    return parts


def wing_chair(style: Style, rng: np.random.Generator) -> list[Part]:
    """High-backed chair with wings at the head."""
    fabric, seat, foot = pick_fabric(style, rng), rng.uniform(0.4, 0.46), rng.uniform(0.1, 0.2)
    half, depth, top = rng.uniform(0.32, 0.4), rng.uniform(0.7, 0.82), rng.uniform(1.0, 1.18)
    rise, arm = rng.uniform(0.58, 0.66), rng.uniform(0.07, 0.11)
    spots = [(x, y) for x in (-half + 0.03, half - 0.07) for y in (0.04, depth - 0.1)]
    legs = slanted([(x, y, 0) for x, y in spots], [(x, y, foot) for x, y in spots], (0.035, 0.035))
    inner = half - arm
    seat_pad = cushion((-inner, 0.12, foot), (inner, depth, seat), 0.2, 0.3)
    back = tilted(cushion((-half, -0.06, 0), (half, 0.07, top - foot), 0.2, 0.3), 0.16)
    parts = [solid(pick_wood(style, rng), legs), solid(fabric, seat_pad)]
    parts.append(solid(fabric, shifted(back, 0, 0.22, foot)))
    for x in (-half, inner):
        wing = cushion((x, 0.02, seat + 0.2), (x + arm, 0.3, top - 0.03), 0.3, 0.3)
        block = cushion((x, 0.1, foot), (x + arm, depth - 0.05, rise), 0.25, 0.35)
        parts += [solid(fabric, wing), solid(fabric, block)]
    return parts


def easy_chair(style: Style, rng: np.random.Generator) -> list[Part]:
    """Low easy chair: cushions in an open frame of wood or bent steel, at times a rocker."""
    frame = pick_wood(style, rng) if rng.random() < 0.7 else pick_metal(style, rng)
    fabric, seat = pick_fabric(style, rng), rng.uniform(0.34, 0.42)
    half, depth, lean = rng.uniform(0.29, 0.36), rng.uniform(0.66, 0.8), rng.uniform(0.25, 0.5)
    top, rise = rng.uniform(0.5, 0.68), rng.uniform(0.52, 0.62)
    pad = tilted(
        cushion((-half + 0.05, 0, -0.06), (half - 0.05, depth - 0.2, 0.06), 0.2, 0.4), 0.12
    )
    back = tilted(cushion((-half + 0.05, -0.05, 0), (half - 0.05, 0.06, top), 0.2, 0.4), lean)
    parts = [
        solid(fabric, shifted(pad, 0, 0.22, seat - 0.06)),
        solid(fabric, shifted(back, 0, 0.28, seat)),
    ]
    is_rocker = rng.random() < 0.3
    for x in (-half, half):
        line = [(x, 0.08, 0.03), (x, 0.2, rise), (x, depth - 0.05, rise + 0.02), (x, depth, 0.03)]
        parts.append(solid(frame, pipe(bend(line, 0.12), rng.uniform(0.014, 0.024), 6)))
        if is_rocker:
            y = np.linspace(-0.08, depth + 0.12, 9)
            curve = np.column_stack([np.full(9, x), y, 0.015 + 0.35 * (y - depth / 2) ** 2])
            parts.append(solid(frame, pipe(curve, 0.016, 6)))
    bars = boxes(
        [(-half, 0.24, seat - 0.12), (-half, depth - 0.06, seat - 0.08)],
        [(half, 0.27, seat - 0.08), (half, depth - 0.03, seat - 0.04)],
    )
    return [*parts, solid(frame, bars)]


def swivel_tub(style: Style, rng: np.random.Generator) -> list[Part]:
    """Round chair on a disc or a cross."""
    fabric, seat = pick_fabric(style, rng), rng.uniform(0.4, 0.46)
    r, top, rise = rng.uniform(0.32, 0.4), rng.uniform(0.68, 0.85), rng.uniform(0.56, 0.64)
    angle, up = np.meshgrid(np.linspace(-2.2, 2.2, 17), np.linspace(0, 1, 5), indexing="ij")
    crest = rise + (top - rise) * np.clip(np.cos(angle * 0.7), 0, 1)
    lift = seat - 0.16 + (crest - seat + 0.16) * up
    bulge = r * (0.88 + 0.14 * up)
    bowl = np.stack([np.sin(angle) * bulge, r - np.cos(angle) * bulge, lift], axis=-1)
    parts = [solid(fabric, shell(piece, 0.07)) for piece in (bowl[:6], bowl[5:12], bowl[11:])]
    pad = cushion((-r * 0.86, r * 0.2, seat - 0.18), (r * 0.86, r * 2.0, seat), 0.8, 0.35)
    foot = [rod(r * 0.75, 0, 0.02, 0, r, 18), rod(0.03, 0.02, seat - 0.16, 0, r, 10)]
    return [*parts, solid(fabric, pad), solid(pick_metal(style, rng), *foot)]
