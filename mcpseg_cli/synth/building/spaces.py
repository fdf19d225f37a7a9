"""Rooms while a plan is being drawn: boxes on paper, with the openings cut so far."""

from __future__ import annotations

from dataclasses import dataclass, field

from mcpseg_cli.synth.plan import Opening, RoomKind

Rectangle = tuple[float, float, float, float]
"""Lowest x, lowest y, highest x, highest y."""


@dataclass
class Space:
    """A room while the plan is being drawn.

    Attributes:
        kind: What it is used for.
        box: Its inside.
        ceiling: Height, metres.
        openings: What has been cut into its walls so far.
    """

    kind: RoomKind
    box: Rectangle
    ceiling: float
    openings: list[Opening] = field(default_factory=list)

    def reach(self, side: int) -> tuple[float, float]:
        """Return where a wall begins and ends."""
        return (self.box[0], self.box[2]) if side % 2 == 0 else (self.box[1], self.box[3])

    def is_free(self, side: int, start: float, end: float, margin: float = 0.12) -> bool:
        """Return whether a stretch of a wall lies inside it and is clear of other openings."""
        low, high = self.reach(side)
        if start < low + margin or end > high - margin:
            return False
        others = [o for o in self.openings if o.side == side]
        return all(o.end + margin < start or o.start - margin > end for o in others)


def facing(first: Rectangle, second: Rectangle) -> tuple[int, float, float, float]:
    """Return on which side of the first box the second lies, the stretch they share and the gap.

    The side is -1 where they share none.
    """
    gaps = (first[1] - second[3], second[0] - first[2], second[1] - first[3], first[0] - second[2])
    side = max(range(4), key=lambda number: gaps[number])
    axis = side % 2
    low, high = max(first[axis], second[axis]), min(first[axis + 2], second[axis + 2])
    if gaps[side] < 0 or high <= low:
        return -1, 0.0, 0.0, 0.0
    return side, low, high, gaps[side]


def overlaps(box: Rectangle, others: list[Rectangle], margin: float) -> bool:
    """Return whether a box comes closer than ``margin`` to any other."""
    x0, y0, x1, y1 = box
    return any(
        x0 < o[2] + margin and o[0] < x1 + margin and y0 < o[3] + margin and o[1] < y1 + margin
        for o in others
    )


def beyond(box: Rectangle, side: int) -> Rectangle:
    """Return the strip of 2 m outside one side of a box."""
    x0, y0, x1, y1 = box
    strips = (
        (x0, y0 - 2, x1, y0 - 0.02),
        (x1 + 0.02, y0, x1 + 2, y1),
        (x0, y1 + 0.02, x1, y1 + 2),
        (x0 - 2, y0, x0 - 0.02, y1),
    )
    return strips[side]
