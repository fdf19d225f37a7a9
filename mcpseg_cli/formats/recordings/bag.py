"""A bag as a recording: which topic has the scans, and where the sensor was for each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import cast

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.recordings import ros_messages as ros
from mcpseg_cli.formats.recordings.bag_files import BagFiles, RawMessage, Topic, told_of_fields
from mcpseg_cli.formats.recordings.bag_poses import PoseTopics, Route, is_pose_topic
from mcpseg_cli.formats.recordings.bag_scans import BagScan, Colours, DepthReader
from mcpseg_cli.formats.scan_source import Recording, TopicChoice

_ROS2_FOLDER = "rosbag2_bagfile_information"


def open_bag(path: Path, files: Sequence[Path], topics: TopicChoice) -> Recording:
    """Open a bag; it is gone through once for when its scans were taken and from where.

    Args:
        path: What the user named.
        files: Its files, all of one kind.
        topics: Which topics to take where there are several.

    Raises:
        InputError: It is damaged, has no scans, several topics of them, or no poses for them.
        OSError: A file cannot be opened.
    """
    bag, kind = _open_files(path, files)
    topic = _scan_topic(path, bag, topics.scans)
    is_depth = topic.type == ros.IMAGE
    poses = PoseTopics(path, bag, topics.poses)
    reader = DepthReader(path, bag, topic.name) if is_depth else None
    colours = Colours(path, bag, topic.name) if is_depth else None

    # one look at everything
    stamped: list[tuple[int, str, RawMessage]] = []
    for raw in bag.messages([topic.name, *poses.topics, *_others(reader, colours)]):
        with told_of_fields(path, bag.topics[raw.topic]):
            if raw.topic == topic.name:
                header = cast(ros.PointCloud2, bag.decode(raw)).header
                stamped.append((ros.time_ns(header.stamp) or raw.time_ns, header.frame_id, raw))
            elif raw.topic in poses.topics:
                poses.add(raw)
            for other in (reader, colours):
                if other is not None:
                    other.add(raw)
    stamped.sort(key=lambda one: one[0])

    # who is where
    frames = sorted({frame for _, frame, _ in stamped})
    if len(frames) != 1:
        found = f"{topic.name} in the frames {', '.join(frames)}"
        raise InputError(path, found, "one sensor a topic", "choose another topic (--topic)")
    route, no_poses = _route(poses, frames[0])
    names = _names([stamp for stamp, _, _ in stamped])
    scans = tuple(
        BagScan(
            name, path, route.at(stamp) if route else None, stamp / 1e9,
            route.frame if route else "sensor" if is_depth else None,
            bag, raw.place, reader, colours, stamp,
        )
        for name, (stamp, _, raw) in zip(names, stamped, strict=True)
    )  # fmt: skip
    notes = [*bag.notes, f"scans: {topic.name} ({frames[0]})"]
    notes += [f"poses: {route.told}"] if route else []
    notes += [note for other in (reader, colours) if other for note in other.notes]
    return Recording(path, kind, scans, tuple(notes), no_poses)


def _route(poses: PoseTopics, frame: str) -> tuple[Route | None, InputError | None]:
    """Find where the sensor was; else why that is not known, which a pose file may mend."""
    try:
        return poses.route(frame), None
    except InputError as error:
        return None, error


def _open_files(path: Path, files: Sequence[Path]) -> tuple[BagFiles, str]:
    """Open the files of a bag by their kind."""
    suffixes = {file.suffix.lower() for file in files}
    metadata = path / "metadata.yaml"
    has_metadata = metadata.is_file() and _ROS2_FOLDER in metadata.read_text("utf-8", "replace")
    if len(suffixes) > 1:
        found = f"{' and '.join(sorted(suffixes))} files side by side"
        raise InputError(path, found, "one recording", "name one of them")
    if has_metadata and _is_compressed(metadata):
        from mcpseg_cli.formats.recordings.ros_bag import RosBag

        return RosBag(path, [path]), "ROS 2 bag"
    if suffixes == {".mcap"}:
        from mcpseg_cli.formats.recordings.mcap_bag import McapBag

        return McapBag(files), "ROS 2 bag (MCAP)" if has_metadata else "MCAP file"
    from mcpseg_cli.formats.recordings.ros_bag import RosBag

    if suffixes == {".bag"}:
        return RosBag(path, files), "ROS 1 bag"
    return RosBag(path, [path] if has_metadata else files), "ROS 2 bag (SQLite)"


def _is_compressed(metadata: Path) -> bool:
    """Tell whether messages or files were compressed beyond what their format says."""
    for line in metadata.read_text("utf-8", "replace").splitlines():
        key, _, value = line.strip().partition(":")
        if key == "compression_mode":
            return value.strip(" \"'").lower() not in ("", "none")
    return False


def _scan_topic(path: Path, bag: BagFiles, chosen: str | None) -> Topic:
    """Choose the topic of the scans.

    Raises:
        InputError: There is none, or several and none was chosen.
    """
    known = [topic for topic in bag.topics.values() if topic.encoding in ("ros1", "cdr")]
    known = [topic for topic in known if topic.count]
    clouds = [topic for topic in known if topic.type == ros.CLOUD]
    depths = [topic for topic in known if topic.type == ros.IMAGE and _is_depth(path, bag, topic)]
    if chosen is not None:
        named = [topic for topic in (*clouds, *depths) if topic.name == chosen]
        if named:
            return named[0]
        found, expected = f"no clouds or depth images on {chosen}", _list(clouds + depths)
        raise InputError(path, found, expected or "such a topic", "choose with --topic")

    several = clouds or depths
    if len(several) == 1:
        return several[0]
    what = "point clouds" if clouds else "depth images"
    if several:
        found = f"{what} on {len(several)} topics: {_list(several)}"
        raise InputError(path, found, "one sensor", "choose with --topic")
    found = f"no PointCloud2 or depth images, but {_describe(bag)}"
    raise InputError(path, found, "ROS messages of one of them", "record or convert them")


def _is_depth(path: Path, bag: BagFiles, topic: Topic) -> bool:
    """Tell whether the images of a topic are depth, by the first."""
    first = next(iter(bag.messages([topic.name])), None)
    if first is None:
        return False
    with told_of_fields(path, topic):
        return cast(ros.Image, bag.decode(first)).encoding in ros.DEPTH_ENCODINGS


def _list(topics: Sequence[Topic]) -> str:
    return ", ".join(f"{topic.name} ({topic.count:,})" for topic in topics)


def _describe(bag: BagFiles) -> str:
    """Say what is in a bag instead: topics with type and, where it is not understood, encoding."""
    said = []
    for topic in sorted(bag.topics.values(), key=lambda one: is_pose_topic(one)):
        encoding = "" if topic.encoding in ("ros1", "cdr") else f", encoded {topic.encoding or '?'}"
        said.append(f"{topic.name} ({topic.type or 'no type'}{encoding})")
    return ", ".join(said[:6]) or "nothing"


def _others(reader: DepthReader | None, colours: Colours | None) -> list[str]:
    return [other.topic for other in (reader, colours) if other is not None and other.topic]


def _names(stamps: Sequence[int]) -> list[str]:
    """Name scans by their seconds; those of one moment are counted."""
    names, before = [], dict[int, int]()
    for stamp in stamps:
        nth = before.get(stamp, 0)
        before[stamp] = nth + 1
        seconds, rest = divmod(stamp, 1_000_000_000)
        names.append(f"{seconds}.{rest:09d}{f'_{nth}' if nth else ''}.ply")
    return names
