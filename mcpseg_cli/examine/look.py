"""A look at some scans of a recording: what their files hold, before anything is decided."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import ColourUnit
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import Cloud
from mcpseg_cli.formats.colours import Colour, decide_unit, find_colour
from mcpseg_cli.formats.recording import ScanSource

FIRST_SCANS = 5
"""Scans that are looked at before a recording is labelled."""
_MOST_POINTS = 200_000  # kept of a scan


@dataclass(frozen=True)
class Glance:
    """What one scan is.

    Attributes:
        name: Its file.
        xyz: (N, 3) measured points, or a part of them, as the file has them.
        pose: (4, 4) float64, sensor to the recording's frame, in the recording's unit.
        num_points: Points in the file.
        num_nan: Those without finite coordinates.
        num_excluded: Those that LAS says are withheld or noise.
        num_zero: Those at 0, 0, 0, as rays have that hit nothing.
        colour: Its colours.
        columns: Names of its attributes.
    """

    name: str
    xyz: NDArray[np.floating]
    pose: NDArray[np.float64]
    num_points: int
    num_nan: int
    num_excluded: int
    num_zero: int
    colour: Colour | None
    columns: tuple[str, ...]


def glance_at(recording: Sequence[ScanSource], which: Iterable[int]) -> list[Glance]:
    """Look at scans, one file in memory at a time; what cannot be read is passed over.

    Args:
        recording: The scans in order, with their poses as the pose file has them.
        which: Numbers of those to look at.
    """
    glances = []
    for number in which:
        source = recording[number]
        try:
            if source.pose is not None:
                glances.append(_glance(source, source.pose, source.read()))
        except (InputError, OSError):
            continue  # the run itself says so when it comes to it
    return glances


def _glance(source: ScanSource, pose: NDArray[np.float64], cloud: Cloud) -> Glance:
    """Take from a cloud what is kept of it."""
    measured = cloud.measured()
    xyz = measured.xyz
    zero = ~xyz.any(axis=1)
    num_zero = int(zero.sum()) if zero.sum() > 1 else 0
    num_excluded = 0 if cloud.excluded is None else int(cloud.excluded.sum())

    # points that are points, not too many of them
    some = np.flatnonzero(~zero) if num_zero and num_zero < len(xyz) else np.arange(len(xyz))
    some = some[:: max(1, len(some) // _MOST_POINTS)]
    return Glance(
        name=source.name,
        xyz=xyz[some],
        pose=pose,
        num_points=len(cloud),
        num_nan=len(cloud) - len(measured) - num_excluded,
        num_excluded=num_excluded,
        num_zero=num_zero,
        colour=find_colour(measured.columns),
        columns=tuple(cloud.columns),
    )


def colour_unit(glances: Sequence[Glance]) -> ColourUnit | None:
    """Decide the unit of a recording's colours; None where it says itself, or nothing does."""
    unclear = [
        glance.colour.values
        for glance in glances
        if glance.colour and glance.colour.unit is None and glance.colour.values.dtype != np.uint8
    ]
    return decide_unit(unclear)


def describe_colour(glances: Sequence[Glance], unit: ColourUnit | None) -> str:
    """Say what the colours of scans are, from which attributes.

    Args:
        glances: At least one scan.
        unit: Their unit, where they do not say it themselves.
    """
    coloured = [glance.colour for glance in glances if glance.colour]
    if not coloured:
        return f"none among {', '.join(glances[0].columns[:12])}; taken as grey"
    names = ", ".join(coloured[0].names)
    if not any(np.nan_to_num(colour.values).any() for colour in coloured):
        return f"none: {names} are 0 everywhere; taken as grey"
    is_bytes = all(colour.values.dtype == np.uint8 for colour in coloured)
    said = coloured[0].unit or ("8-bit" if is_bytes else unit)
    some = "" if len(coloured) == len(glances) else f", in {len(coloured)} of {len(glances)} scans"
    unknown = sum(int(_has_nan(colour.values).sum()) for colour in coloured)
    share = unknown / max(1, sum(len(colour.values) for colour in coloured))
    some += f"; {share:.1%} of the points without, taken as grey" if unknown else ""
    return f"{said or 'of unclear unit'} ({names}){some}"


def _has_nan(values: NDArray[np.generic]) -> NDArray[np.bool_]:
    """Tell which points have a colour that is no number; (N,)."""
    if values.dtype.kind != "f":
        return np.zeros(len(values), bool)
    unknown: NDArray[np.bool_] = np.isnan(values.reshape(len(values), -1)).any(axis=1)
    return unknown


def spread(num_scans: int, num_wanted: int) -> list[int]:
    """Choose scans: the first ones in a row, then others evenly over the recording."""
    first = list(range(min(num_scans, FIRST_SCANS)))
    others = np.linspace(0, num_scans - 1, max(2, num_wanted - len(first))).astype(int).tolist()
    return sorted({*first, *others}) if num_scans else []
