"""Options that say how the coordinates and colours of a recording are taken."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

import typer

from mcpseg_cli.choices import ColourUnit, Frame, UpAxis

if TYPE_CHECKING:
    from mcpseg_cli.formats.intake import Intake

FrameOption = Annotated[
    Frame,
    typer.Option(
        "--frame",
        help="Frame of the scans' coordinates, where the recording does not say: RGB-D images, "
        "stations and bags do.",
    ),
]
Up = Annotated[
    UpAxis | None,
    typer.Option("--up", help="Axis of the recording that points up.  [default: z]"),
]
Scale = Annotated[
    str | None,
    typer.Option(
        "--scale",
        metavar="METRES[,METRES]",
        help="Metres in a unit of scans and poses, 0.001 for millimetres; a second number is for "
        "poses in another unit.  [default: 1]",
    ),
]
Offset = Annotated[
    str | None,
    typer.Option(
        "--offset",
        metavar="X,Y,Z|auto",
        help="Subtract this from all coordinates, as of georeferenced recordings, in their own "
        "axes and unit; exported clouds have it again. auto: a round place near the first pose.",
    ),
]
Colour = Annotated[
    ColourUnit | None,
    typer.Option("--colour", help="Unit of the colours.  [default: told from the first scans]"),
]
Topic = Annotated[
    str | None,
    typer.Option(
        "--topic", help="Topic of a bag's point clouds or depth images, if there are several."
    ),
]
PoseTopic = Annotated[
    str | None,
    typer.Option("--pose-topic", help="Topic of a bag's poses, if there are several."),
]
MaxTimeGap = Annotated[
    float,
    typer.Option(
        "--max-time-gap",
        metavar="SECONDS",
        min=0.0,
        help="How far a pose may be in time, where scans pair by their time stamps.",
    ),
]
NoCheck = Annotated[
    bool,
    typer.Option(
        "--no-check",
        help="Label without a look at whether frame, unit, upwards and place can be right.",
    ),
]


@dataclass(frozen=True)
class AskedIntake:
    """What the command line says of how to take a recording; None: nothing.

    Attributes:
        frame: Frame of the scans' coordinates.
        up: Axis that points up.
        scale: Metres in a unit of the scans, and of the poses if that is another.
        offset: What to subtract; ``auto``: to be found.
        colour: Unit of the colours.
    """

    frame: Frame
    up: UpAxis | None
    scale: tuple[float, ...]
    offset: tuple[float, ...] | None
    is_offset_auto: bool
    colour: ColourUnit | None

    @classmethod
    def of(
        cls,
        frame: Frame,
        up: UpAxis | None,
        scale: str | None,
        offset: str | None,
        colour: ColourUnit | None,
    ) -> AskedIntake:
        """Read the options.

        Raises:
            typer.BadParameter: One has a value that it cannot have.
        """
        scales = _numbers("--scale", scale, (1, 2)) if scale is not None else ()
        if any(not 0 < number < float("inf") for number in scales):
            raise typer.BadParameter(f"{scale}: expected metres above 0", param_hint="--scale")
        is_auto = offset == "auto"
        place = _numbers("--offset", offset, (3,)) if offset and not is_auto else None
        return cls(frame, up, scales, place, is_auto, colour)

    def in_frame(self, frame: Frame) -> AskedIntake:
        """Return the same of a recording that says its frame itself."""
        return replace(self, frame=frame)

    @property
    def given(self) -> set[str]:
        """Names of what was said."""
        said = {"up": self.up, "scale": self.scale, "offset": self.offset or self.is_offset_auto}
        return {name for name, value in said.items() if value}

    def intake(self) -> Intake:
        """Return how to take a recording, as far as that was said."""
        from mcpseg_cli.formats.intake import Intake

        scale, pose_scale = (*self.scale, 1.0)[0], self.scale[1] if self.scale[1:] else None
        x, y, z = self.offset or (0.0, 0.0, 0.0)
        return Intake(self.frame, self.up or "z", scale, pose_scale, (x, y, z), self.colour)


def _numbers(option: str, text: str, counts: Sequence[int]) -> tuple[float, ...]:
    """Read finite numbers parted by commas."""
    try:
        numbers = tuple(float(word) for word in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) not in counts or not all(abs(number) < float("inf") for number in numbers):
        expected = " or ".join(map(str, counts))
        raise typer.BadParameter(f"{text}: expected {expected} numbers", param_hint=option)
    return numbers
