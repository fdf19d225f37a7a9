"""Which unit lengths are in, by what rooms and sensors are like."""

from __future__ import annotations

from dataclasses import dataclass

from mcpseg_cli.examine.structure import Room

UNITS = {  # metres in each
    "metres": 1.0,
    "millimetres": 0.001,
    "centimetres": 0.01,
    "feet": 0.3048,
    "inches": 0.0254,
    "kilometres": 1000.0,
}
_SENSOR = (0.1, 2.6)  # metres over the floor, of all that is driven, carried or put on a tripod
_ROOM = (1.8, 16.0)  # metres from floor to ceiling, halls among them
_USUAL_ROOM = (1.9, 5.0)
_RANGE = (0.15, 60.0)  # metres to most of what a sensor sees
_USUAL_RANGE = (0.4, 40.0)


@dataclass(frozen=True)
class Unit:
    """What unit lengths are in.

    Attributes:
        name: One of ``UNITS``.
        scale: Metres in it.
        reason: What speaks for it.
        others: Further units that would fit.
    """

    name: str
    scale: float
    reason: str
    others: tuple[str, ...] = ()


def find_unit(room: Room, reach: float) -> Unit:
    """Tell the unit of a recording.

    Args:
        room: Floor and ceiling as seen from the sensor, in the unit.
        reach: How far most points are from it, in the unit.

    Returns:
        Metres wherever they are possible, also where nothing fits.
    """
    if reach <= 0 or _is_possible(room, reach, 1.0, _ROOM, _RANGE):
        return Unit("metres", 1.0, _reason(room, reach))
    fitting = [
        name
        for name, scale in UNITS.items()
        if _is_possible(room, reach, scale, _USUAL_ROOM, _USUAL_RANGE)
    ]
    if not fitting:
        return Unit("metres", 1.0, "nothing fits better")
    return Unit(fitting[0], UNITS[fitting[0]], _reason(room, reach), tuple(fitting[1:]))


def _is_possible(
    room: Room,
    reach: float,
    scale: float,
    heights: tuple[float, float],
    ranges: tuple[float, float],
) -> bool:
    """Tell whether all that is seen has a size that it may have."""
    sizes = ((room.below, _SENSOR), (room.height, heights), (reach, ranges))
    return all(size is None or low <= size * scale <= high for size, (low, high) in sizes)


def _reason(room: Room, reach: float) -> str:
    """Say what is seen."""
    seen = [f"most points within {reach:.3g} of the sensor"]
    if room.below is not None:
        seen.insert(0, f"the floor {room.below:.3g} below it")
    if room.height is not None:
        seen.insert(0, f"rooms {room.height:.3g} high")
    return ", ".join(seen)
