"""What pictures of a map can show."""

from __future__ import annotations

from dataclasses import dataclass

from mcpseg_cli.choices import ColourBy, View

PITCH_DEG: dict[View, float] = {"top": 90.0, "cut": 55.0, "perspective": 38.0}
"""How steeply each view looks down."""
YAW_DEG: dict[View, float] = {"top": 0.0, "cut": 30.0, "perspective": 30.0}
"""How far each view is turned about z, to the left of the y axis."""


@dataclass(frozen=True)
class PictureSettings:
    """What a picture shows.

    Attributes:
        view: From above, cut away (parallel rays, aslant; figure 7) or in perspective.
        colour_by: What colours say.
        cut: Voxels higher than this above the floor, as the scan that first saw them knew it, are
            left out, metres.
        yaw_deg: Turn of the view about z; None: the view's own.
    """

    view: View = "cut"
    colour_by: ColourBy = "class"
    cut: float = 2.0
    yaw_deg: float | None = None
