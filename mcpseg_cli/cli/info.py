"""``mcpseg info``: say what a recording is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcpseg_cli.cli.intake_options import MaxTimeGap, PoseTopic, Topic
from mcpseg_cli.cli.options import Json

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from mcpseg_cli.examine.summary import Summary
    from mcpseg_cli.formats.recording import Recording, TopicChoice

_LOOKED_AT = 12  # scans
_USUAL_GAP_S = 0.05  # from a scan to its pose


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
    topic: Topic = None,
    pose_topic: PoseTopic = None,
    max_time_gap: MaxTimeGap = _USUAL_GAP_S,
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
    from mcpseg_cli.formats.recording import TopicChoice

    summary = _summarise(recording, poses, TopicChoice(topic, pose_topic), max_time_gap)
    if as_json:
        typer.echo(json.dumps(summary.document()))
    else:
        print_table(summary.rows())


def _summarise(path: Path, poses_path: Path | None, topics: TopicChoice, max_gap: float) -> Summary:
    """Look at a recording."""
    import numpy as np

    from mcpseg_cli.errors import InputError
    from mcpseg_cli.examine.examination import examine
    from mcpseg_cli.examine.look import glance_at, spread
    from mcpseg_cli.examine.summary import Summary
    from mcpseg_cli.formats.intake import Intake
    from mcpseg_cli.scan import Scan
    from mcpseg_cli.segment.sensor import guess_range

    sources, poses, pairing = _opened(path, poses_path, topics, max_gap)
    glances = glance_at(sources, spread(len(sources), _LOOKED_AT))
    if not glances:
        raise InputError(path, "no scan that can be read", "one at least", "see mcpseg segment")
    own = sources.frame
    found = examine(glances, poses if len(poses) else np.eye(4)[None], own or "map")

    # as segment would see them
    intake = found.intake(Intake("map"), own)
    seen = []
    for glance in glances[:5]:
        pose = intake.place_pose(glance.pose)
        seen.append(Scan(intake.place_points(glance.xyz, pose), None, pose))
    distance = guess_range(seen) if len(poses) else (2.0, "no poses to tell the sensor by")
    chosen = _asked_again(topics, max_gap, is_whole=not (sources.num_lost or sources.surplus))
    return Summary(
        sources, poses_path, pairing, poses, glances, found, distance, chosen if len(poses) else ()
    )


def _opened(
    path: Path, poses_path: Path | None, topics: TopicChoice, max_gap: float
) -> tuple[Recording, NDArray[np.float64], str]:
    """Open a recording; where it has no poses, as if all scans were taken at the origin."""
    from dataclasses import replace

    import numpy as np

    from mcpseg_cli.errors import InputError
    from mcpseg_cli.formats.recording import list_recording, open_recording

    try:
        sources = open_recording(
            path, poses_path, topics=topics, max_gap=max_gap, on_error="skip", any_distance=True
        )
    except InputError:
        listed = list_recording(path, topics)
        if poses_path is not None or listed.has_poses:
            raise
        scans = tuple(source.with_pose(np.eye(4)) for source in listed)
        return replace(listed, scans=scans), np.empty((0, 4, 4)), "none given"
    poses = sources.poses
    turned = np.ptp(poses[:, :3, :3], axis=0).max() > 0
    how = f"{sources.columns}; {sources.told}; {'with' if turned else 'without'} turns"
    return sources, poses, how


def _asked_again(topics: TopicChoice, max_gap: float, *, is_whole: bool) -> tuple[str, ...]:
    """Spell the options by which the recording was opened, as segment needs them, too."""
    named = {"--topic": topics.scans, "--pose-topic": topics.poses}
    words = [word for name, value in named.items() if value for word in (name, value)]
    words += [] if max_gap == _USUAL_GAP_S else ["--max-time-gap", f"{max_gap:g}"]
    return (*words, *(() if is_whole else ("--on-error", "skip")))
