"""What speaks against labelling a recording as it was asked for."""

from __future__ import annotations

from collections.abc import Collection

from mcpseg_cli.examine.coincidence import Placement
from mcpseg_cli.examine.examination import Examination
from mcpseg_cli.formats.intake import Intake
from mcpseg_cli.formats.recording import MAX_COORDINATE

_HARDLY = 0.45  # share of points; of the right frame it is 0.5 and more, of any other up to 0.44
_PLACEMENTS: tuple[Placement, Placement] = ("by the poses", "as they are")


def objections(
    found: Examination, asked: Intake, given: Collection[str], *, is_frame_own: bool = False
) -> tuple[list[str], list[str]]:
    """Compare what was found with what was asked for.

    Args:
        found: What the recording is.
        asked: How it is to be taken.
        given: Which of ``up``, ``scale`` and ``offset`` the user named: these are right.
        is_frame_own: Whether the recording itself says the frame, so that no option changes it.

    Returns:
        What is otherwise, and the options or other remedies for it, one each.
    """
    against, remedies = [], []
    shares = {name: f"{share:.0%}" for name, share in found.coincidence.shares.items()}

    # the frame
    if found.frame is not None and found.frame != asked.frame:
        best, other = _PLACEMENTS if found.frame == "sensor" else _PLACEMENTS[::-1]
        coincide = f"{shares[best]} of their points, not {other}, {shares[other]}"
        against.append(f"scans coincide {best} ({coincide})")
        other_poses = "other poses in a file after the recording"
        remedies.append(other_poses if is_frame_own else f"--frame {found.frame}")
    elif found.frame is None and found.coincidence.best == "by the inverse poses":
        coincide = shares["by the inverse poses"]
        against.append(f"scans coincide by the inverse of their poses ({coincide} of their points)")
        remedies.append("poses that lead from the sensor to the map")
    elif found.frame is None and found.coincidence.best == "by camera poses":
        coincide = f"{shares['by camera poses']} of their points"
        against.append(f"scans of a lidar, x forwards, with poses of a camera, z ({coincide})")
        remedies.append("the poses of the lidar (a calib.txt leads from one to the other)")
        return against, remedies  # upwards was told by poses of something else

    # unit, axis and place
    if "scale" not in given and (found.unit.scale != 1.0 or found.pose_scale is not None):
        others = "".join(f" or {name}" for name in found.unit.others)
        poses = "" if found.pose_scale is None else f", poses in units of {found.pose_scale:g} m"
        against.append(f"lengths in {found.unit.name}{others}{poses} ({found.unit.reason})")
        second = "" if found.pose_scale is None else f",{found.pose_scale:g}"
        remedies.append(f"--scale {found.unit.scale:g}{second}")
    if "up" not in given and found.up not in (None, asked.up):
        against.append(f"{found.up} up ({found.up_reason})")
        remedies.append(f"--up {found.up}")
    if "offset" not in given and any(found.offset):
        farthest = max(map(abs, found.offset)) * found.unit.scale
        against.append(f"places {farthest:,.0f} m from the origin, {MAX_COORDINATE:,.0f} m at most")
        remedies.append("--offset auto")
    return against, remedies


def doubts(found: Examination, asked: Intake) -> str | None:
    """Say what speaks against an axis that the user named, or against the poses; else None.

    Args:
        found: What the recording is.
        asked: How it is to be taken; what of it the user named is not refused.
    """
    if found.up not in (None, asked.up):
        return f"{found.up} is up, not {asked.up} as --up says: {found.up_reason}"
    shares, frame = found.coincidence.shares, asked.frame
    share = shares["by the poses" if frame == "sensor" else "as they are"]
    if found.frame is not None or not found.coincidence.num_pairs or share >= _HARDLY:
        return None
    how = "moved by their poses" if frame == "sensor" else "as they are"
    return (
        f"only {share:.0%} of the points of neighbouring scans coincide {how}; "
        "are scans and poses paired right, in one frame and unit? see mcpseg info"
    )
