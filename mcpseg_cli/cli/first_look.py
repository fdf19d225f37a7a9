"""The look that ``mcpseg segment`` takes at a recording before it labels it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from mcpseg_cli.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mcpseg_cli.cli.intake_options import AskedIntake
    from mcpseg_cli.examine.look import Glance
    from mcpseg_cli.formats.intake import Intake
    from mcpseg_cli.formats.recording import Recording


@dataclass(frozen=True)
class Taken:
    """How a recording is taken.

    Attributes:
        intake: Coordinates and colours.
        glances: The first scans; none where a run is continued.
        kept: Configuration of the run that is continued; None for a new one.
    """

    intake: Intake
    glances: tuple[Glance, ...]
    kept: Mapping[str, object] | None

    @property
    def about_colour(self) -> str:
        """What the colours are, in words; empty where nothing was looked at."""
        from mcpseg_cli.examine.look import describe_colour

        return describe_colour(self.glances, self.intake.colour) if self.glances else ""


def take_recording(
    recording: Recording,
    source: Path,
    asked: AskedIntake,
    kept: Path | None,
    *,
    check: bool,
    quiet: bool,
) -> Taken:
    """Decide how to take a recording; what a run was begun with is kept.

    Args:
        recording: The scans with their poses as the pose file has them.
        source: What the user named, for the message.
        asked: What the command line says.
        kept: Folder of a run to continue, if there is one; None starts again.
        check: Whether to refuse what can hardly be meant.
        quiet: No notices.

    Raises:
        InputError: Frame, unit, upwards or place are others than asked for.
        StateError: The checkpoint in ``kept`` is in use or damaged.
    """
    from mcpseg_cli.examine.examination import round_offset
    from mcpseg_cli.examine.look import FIRST_SCANS, colour_unit, glance_at
    from mcpseg_cli.formats.intake import Intake
    from mcpseg_cli.segment.sensor import kept_configuration

    # what was decided before stays
    intake = asked.intake()
    before = kept_configuration(kept) if kept else None
    if before is not None:
        decided = Intake.of(before)
        offset = decided.offset if asked.is_offset_auto else intake.offset
        colour = decided.colour if asked.colour is None else intake.colour
        return Taken(replace(intake, offset=offset, colour=colour), (), before)

    glances = tuple(glance_at(recording, range(min(FIRST_SCANS, len(recording)))))
    if check and glances:
        _check(recording, glances, source, asked, quiet=quiet)
    if asked.is_offset_auto and len(recording.poses):
        intake = replace(intake, offset=round_offset(recording.poses, intake))
    if asked.colour is None:
        intake = replace(intake, colour=colour_unit(glances))
    return Taken(intake, glances, None)


def _check(
    recording: Recording,
    glances: Sequence[Glance],
    source: Path,
    asked: AskedIntake,
    *,
    quiet: bool,
) -> None:
    """Refuse a recording that is not as asked for, in one line."""
    from mcpseg_cli.cli.display import notice
    from mcpseg_cli.examine.examination import examine
    from mcpseg_cli.examine.objections import doubts, objections

    intake = asked.intake()
    found = examine(glances, recording.poses, intake.frame)
    is_own = recording.frame is not None
    against, remedies = objections(found, intake, asked.given, is_frame_own=is_own)
    if against:
        options = " ".join(remedies)
        raise InputError(
            source,
            "; ".join(against),
            f"metres, {intake.up} up, scans in the {intake.frame} frame",
            f"give {options}, or --no-check if it is right as it is",
        )
    if doubt := doubts(found, intake):
        notice(f"mcpseg: {doubt}", quiet=quiet)
