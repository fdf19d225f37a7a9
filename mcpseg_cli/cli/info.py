"""``mcpseg info``: say what a recording is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcpseg_cli.cli.options import Json

if TYPE_CHECKING:
    from mcpseg_cli.examine.summary import Summary

_LOOKED_AT = 12  # scans


def info(
    recording: Annotated[
        Path,
        typer.Argument(metavar="RECORDING", help="As of mcpseg segment."),
    ],
    poses: Annotated[
        Path | None,
        typer.Argument(
            metavar="[POSES]",
            help="Pose file, where the recording holds no poses; without any, less can be told.",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Say what a recording is, and how segment would take it.

    Some scans are read, the first ones and others from all over it. Told are their points and
    colours; whether they coincide as they are or when moved by their poses; unit and upward axis,
    by floor, ceiling and the way of the sensor; and the --range, --frame, --scale, --up and
    --offset that fit, with what speaks for them. segment takes the same look at the first scans.

    \b
    Examples:
      mcpseg info scans/ poses.csv
      mcpseg info scans/ poses.csv --json | jq .unit
    """
    import json

    from mcpseg_cli.cli.display import print_table

    summary = _summarise(recording, poses)
    if as_json:
        typer.echo(json.dumps(summary.document()))
    else:
        print_table(summary.rows())


def _summarise(path: Path, poses_path: Path | None) -> Summary:
    """Look at a recording."""
    from dataclasses import replace

    import numpy as np

    from mcpseg_cli.errors import InputError
    from mcpseg_cli.examine.examination import examine
    from mcpseg_cli.examine.look import glance_at, spread
    from mcpseg_cli.examine.summary import Summary
    from mcpseg_cli.formats.intake import Intake
    from mcpseg_cli.formats.recording import list_recording, open_recording
    from mcpseg_cli.scan import Scan
    from mcpseg_cli.segment.sensor import guess_range

    # scans, with poses or without
    try:
        sources = open_recording(path, poses_path, on_error="skip", any_distance=True)
        poses, pairing = sources.poses, f"{sources.columns}; {sources.told}"
        turned = np.ptp(poses[:, :3, :3], axis=0).max() > 0
        pairing += f"; {'with' if turned else 'without'} turns"
    except InputError:
        listed = list_recording(path)
        if poses_path is not None or listed.has_poses:
            raise
        scans = tuple(source.with_pose(np.eye(4)) for source in listed)
        sources = replace(listed, scans=scans)
        poses, pairing = np.empty((0, 4, 4)), "none given"

    glances = glance_at(sources, spread(len(sources), _LOOKED_AT))
    if not glances:
        raise InputError(path, "no scan that can be read", "one at least", "see mcpseg segment")
    found = examine(glances, poses if len(poses) else np.eye(4)[None])

    # as segment would see them
    intake = found.intake(Intake("map"))
    seen = []
    for glance in glances[:5]:
        pose = intake.place_pose(glance.pose)
        seen.append(Scan(intake.place_points(glance.xyz, pose), None, pose))
    distance = guess_range(seen) if len(poses) else (2.0, "no poses to tell the sensor by")
    return Summary(path, poses_path, len(sources), pairing, poses, glances, found, distance)
