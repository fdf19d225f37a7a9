"""What a recording is, in words and as a document."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import Frame
from mcpseg_cli.examine.examination import Examination
from mcpseg_cli.examine.look import Glance, describe_colour
from mcpseg_cli.formats.intake import Intake
from mcpseg_cli.formats.scan_source import Recording


@dataclass(frozen=True)
class Summary:
    """A recording and how it would be taken.

    Attributes:
        recording: The scans as they were opened.
        poses_path: The pose file; None without.
        pairing: How scans and poses belong together.
        poses: (P, 4, 4) as the pose file has them; none without a pose file.
        glances: The scans that were looked at.
        found: What they show.
        local_range: Metres that ``--range auto`` would take, and why.
        opened_by: The options that it takes to open it.
    """

    recording: Recording
    poses_path: Path | None
    pairing: str
    poses: NDArray[np.float64]
    glances: Sequence[Glance]
    found: Examination
    local_range: tuple[float, str]
    opened_by: tuple[str, ...] = ()

    @property
    def intake(self) -> Intake:
        """How to take the recording."""
        return self.found.intake(Intake("map"), self.recording.frame)

    @property
    def options(self) -> list[str]:
        """The options that ``mcpseg segment`` needs for it."""
        intake, words = self.intake, [*self.opened_by]
        if intake.frame != "map" and self.recording.frame is None:
            words += ["--frame", intake.frame]
        if intake.scale != 1.0 or intake.pose_scale is not None:
            poses = "" if intake.pose_scale is None else f",{intake.pose_scale:g}"
            words += ["--scale", f"{intake.scale:g}{poses}"]
        if intake.up != "z":
            words += ["--up", intake.up]
        if any(intake.offset):
            words += ["--offset", "auto"]
        return words

    def document(self) -> dict[str, object]:
        """Give everything by name; lengths in metres where nothing else is said."""
        found, counts = self.found, self._counts()
        return {
            "recording": str(self.recording.path),
            "kind": self.recording.kind,
            "notes": list(self.recording.notes),
            "poses": None if self.poses_path is None else str(self.poses_path),
            "scans": len(self.recording),
            "formats": dict(self._endings()),
            "looked_at": len(self.glances),
            "points": counts["points"],
            "points_nan": counts["nan"],
            "points_at_zero": counts["zero"],
            "points_withheld_or_noise": counts["excluded"],
            "attributes": list(self.glances[0].columns),
            "pairing": self.pairing,
            "path_length": self._path() if len(self.poses) else None,
            "coincide": found.coincidence.shares if found.coincidence.num_pairs else None,
            "frame": self.recording.frame or found.frame,
            "unit": found.unit.name,
            "unit_may_be": list(found.unit.others),
            "scale": found.unit.scale,
            "pose_scale": found.pose_scale,
            "up": found.up,
            "up_reason": found.up_reason,
            "offset": list(found.offset),
            "low": self._corner(found.low),
            "high": self._corner(found.high),
            "floor_below_sensor": _rounded(found.room.below),
            "room_height": _rounded(found.room.height),
            "reach": _rounded(found.reach),
            "colour": describe_colour(self.glances, found.colour),
            "range": self.local_range[0],
            "range_reason": self.local_range[1],
            "options": self.options,
        }

    def rows(self) -> list[tuple[str, str]]:
        """Give a name and a line for everything worth knowing."""
        poses = "POSES" if not len(self.poses) else self.poses_path
        named = [str(path) for path in (self.recording.path, poses) if path is not None]
        command = shlex.join(["mcpseg", "segment", *named, *self.options])
        distance, reason = self.local_range
        last = [("range", f"{distance:g} m: {reason}"), ("command", command)]
        return [*self._rows_of_scans(), *self._rows_of_places(), *last]

    def _rows_of_scans(self) -> list[tuple[str, str]]:
        """Say what the scans hold."""
        counts = self._counts()
        about = f"{self.recording.kind}, {len(self.glances):,} looked at"
        rows = [("recording", f"{len(self.recording):,} scans ({about})")]
        rows += [("", note) for note in self.recording.notes]
        rows.append(("points", f"{counts['points'] // len(self.glances):,} a scan"))
        if left_out := self._left_out(counts):
            rows.append(("left out", left_out))
        rows.append(("attributes", ", ".join(self.glances[0].columns)))
        rows.append(("colour", describe_colour(self.glances, self.found.colour)))
        return rows

    def _rows_of_places(self) -> list[tuple[str, str]]:
        """Say where scans and poses are."""
        found = self.found
        rows = [("poses", self.pairing)]
        if len(self.poses):
            rows.append(("path", f"{self._path():.1f} m, {self._step():.2f} m from scan to scan"))
        rows.append(("frame", self._about_frame()))
        others = "".join(f" or {name}" for name in found.unit.others)
        rows.append(("unit", f"{found.unit.name}{others}: {found.unit.reason}"))
        if found.pose_scale is not None:
            rows.append(("poses' unit", f"{found.pose_scale:g} m"))
        rows.append(("up", f"{found.up or 'z, not contradicted'}: {found.up_reason}"))
        rows.append(("span", self._span()))
        if any(found.offset):
            place = ", ".join(f"{value:.15g}" for value in found.offset)
            rows.append(("offset", f"{place}: too far out for float32"))
        if found.room.below is not None:
            rows.append(("floor", f"{found.room.below:.2f} m below the sensor"))
        if found.room.height is not None:
            rows.append(("room height", f"{found.room.height:.2f} m"))
        return rows

    def _counts(self) -> dict[str, int]:
        return {
            "points": sum(glance.num_points for glance in self.glances),
            "nan": sum(glance.num_nan for glance in self.glances),
            "zero": sum(glance.num_zero for glance in self.glances),
            "excluded": sum(glance.num_excluded for glance in self.glances),
        }

    def _left_out(self, counts: dict[str, int]) -> str:
        """Say what share of the points is none."""
        reasons = {"nan": "without coordinates", "zero": "at 0, 0, 0", "excluded": "of noise"}
        named = [
            f"{counts[name] / max(counts['points'], 1):.1%} {reason}"
            for name, reason in reasons.items()
            if counts[name]
        ]
        return ", ".join(named)

    def _endings(self) -> list[tuple[str, int]]:
        """Count formats of the scans looked at."""
        return Counter(
            Path(glance.name).suffix.lstrip(".").upper() for glance in self.glances
        ).most_common()

    def _about_frame(self) -> str:
        """Say which frame scans are in, and by what."""
        coincidence, found = self.found.coincidence, self.recording.frame or self.found.frame
        said = ", as the recording says" if self.recording.frame else ""
        if not coincidence.num_pairs:
            return f"{found or 'cannot be told'}{said}: no two scans to compare"
        shares = ", ".join(f"{share:.0%} {name}" for name, share in coincidence.shares.items())
        named: dict[Frame | None, str] = {None: "cannot be told", "map": "map", "sensor": "sensor"}
        return f"{named[found]}{said}: points of neighbouring scans coincide {shares}"

    def _path(self) -> float:
        """Measure the way of the sensor, metres."""
        steps = np.linalg.norm(np.diff(self.poses[:, :3, 3], axis=0), axis=1)
        return float(steps.sum()) * self._pose_scale

    def _step(self) -> float:
        """Return the median step from scan to scan, metres."""
        steps = np.linalg.norm(np.diff(self.poses[:, :3, 3], axis=0), axis=1)
        return float(np.median(steps)) * self._pose_scale if len(steps) else 0.0

    @property
    def _pose_scale(self) -> float:
        intake = self.intake
        return intake.scale if intake.pose_scale is None else intake.pose_scale

    def _span(self) -> str:
        """Say how far the points looked at extend, in metres."""
        intake = self.intake
        scale = self._pose_scale if intake.frame == "sensor" else intake.scale
        extents = np.abs(intake.turn @ (self.found.high - self.found.low)) * scale
        return " x ".join(f"{extent:.1f}" for extent in extents) + " m"

    @staticmethod
    def _corner(place: NDArray[np.float64]) -> list[float]:
        return [round(float(value), 3) for value in place]


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)
