"""Where a sensor was, from what a bag tells: TF, odometry, poses, a path."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import Frame
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.recordings import ros_messages as ros
from mcpseg_cli.formats.recordings.bag_files import BagFiles, RawMessage, Topic
from mcpseg_cli.formats.recordings.transforms import ROBOT_FRAMES, TransformTree
from mcpseg_cli.formats.rigid import Trajectory, from_quaternion, is_lost

_TF = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_ODOMETRY = "nav_msgs/msg/Odometry"
_STAMPED = "geometry_msgs/msg/PoseStamped"
_COVARIANT = "geometry_msgs/msg/PoseWithCovarianceStamped"
_TRANSFORM = "geometry_msgs/msg/TransformStamped"
_PATH = "nav_msgs/msg/Path"
_SINGLE = (_ODOMETRY, _STAMPED, _COVARIANT, _TRANSFORM, _PATH)
_OPTION = "choose with --pose-topic"


class _Vector(Protocol):
    x: float
    y: float
    z: float


class _Quaternion(_Vector, Protocol):
    w: float


class _Pose(Protocol):
    position: _Vector
    orientation: _Quaternion


class _Transform(Protocol):
    translation: _Vector
    rotation: _Quaternion


class _TransformStamped(Protocol):
    header: ros.Header
    child_frame_id: str
    transform: _Transform


class _PoseStamped(Protocol):
    header: ros.Header
    pose: _Pose


class _WithCovariance(Protocol):
    pose: _Pose


class _Odometry(Protocol):
    header: ros.Header
    child_frame_id: str
    pose: _WithCovariance


class _Path(Protocol):
    header: ros.Header
    poses: list[_PoseStamped]


class _TFMessage(Protocol):
    transforms: list[_TransformStamped]


@dataclass
class _Track:
    """The poses of one topic: of ``child`` in ``parent``; which child, some do not say."""

    parent: str
    child: str
    times_ns: list[int]
    poses: list[NDArray[np.float64]]


@dataclass(frozen=True)
class Route:
    """Where a sensor was.

    Attributes:
        frame: Frame of its clouds: ``map`` where they were registered before.
        told: How the poses are found, in words.
    """

    frame: Frame
    told: str
    _tree: TransformTree
    _way: list[str]
    _track: Trajectory | None

    def at(self, time_ns: int) -> NDArray[np.float64] | None:
        """Return the pose (4, 4) of a moment, sensor to map; None at a gap."""
        if self._track is None:
            return self._tree.pose(self._way, time_ns)
        pose = self._track.at(time_ns)
        if pose is None or len(self._way) == 1:
            return pose
        inner = self._tree.pose(self._way, time_ns)
        return None if inner is None else pose @ inner


def is_pose_topic(topic: Topic) -> bool:
    """Tell whether a topic has poses or transforms."""
    return topic.type in (*_TF, *_SINGLE)


class PoseTopics:
    """All that a bag tells of where things were.

    Args:
        path: The bag, for messages.
        bag: Its files.
        chosen: The only topic to believe, beside transforms that never change.

    Attributes:
        topics: The topics that tell of it.

    Raises:
        InputError: The chosen topic has no poses.
    """

    def __init__(self, path: Path, bag: BagFiles, chosen: str | None) -> None:
        self._path, self._bag, self._chosen = path, bag, chosen
        known = [one for one in bag.topics.values() if one.encoding in ("ros1", "cdr")]
        self.topics = {one.name: one for one in known if is_pose_topic(one) and one.count}
        if chosen is not None and chosen not in self.topics:
            found, expected = f"no poses on {chosen}", ", ".join(self.topics) or "such a topic"
            raise InputError(path, found, expected, _OPTION)
        self._tree = TransformTree()
        self._tracks: dict[str, _Track] = {}

    def add(self, raw: RawMessage) -> None:
        """Take note of a message on one of ``topics``."""
        topic, message = self.topics[raw.topic], self._bag.decode(raw)
        is_fixed = raw.topic.strip("/").endswith("tf_static")
        if topic.type in _TF:
            if is_fixed or self._chosen in (None, raw.topic):
                self._add_transforms(cast(_TFMessage, message), raw, is_fixed=is_fixed)
        elif self._chosen in (None, raw.topic):
            self._add_poses(topic, message, raw)

    def _add_transforms(self, message: _TFMessage, raw: RawMessage, *, is_fixed: bool) -> None:
        for one in message.transforms:
            pose = self._pose(one.transform.translation, one.transform.rotation, raw.topic)
            time_ns = ros.time_ns(one.header.stamp) or raw.time_ns
            parent, child = one.header.frame_id, one.child_frame_id
            if pose is not None:
                self._tree.add(parent, child, time_ns, pose, is_fixed=is_fixed)

    def _add_poses(self, topic: Topic, message: object, raw: RawMessage) -> None:
        """Add what one message of poses tells; a path is told anew by each message."""
        header = cast(_PoseStamped, message).header
        child, poses = "", []
        if topic.type == _PATH:
            self._tracks.pop(topic.name, None)
            poses = [(one.header.stamp, one.pose) for one in cast(_Path, message).poses]
        elif topic.type == _TRANSFORM:
            transform = cast(_TransformStamped, message)
            child, moved = transform.child_frame_id, transform.transform
            pose = self._pose(moved.translation, moved.rotation, topic.name)
            self._append(topic, header.frame_id, child, ros.time_ns(header.stamp), pose)
        elif topic.type == _STAMPED:
            poses = [(header.stamp, cast(_PoseStamped, message).pose)]
        else:
            child = cast(_Odometry, message).child_frame_id if topic.type == _ODOMETRY else ""
            poses = [(header.stamp, cast(_Odometry, message).pose.pose)]
        for stamp, place in poses:
            pose = self._pose(place.position, place.orientation, topic.name)
            time_ns = ros.time_ns(stamp) or raw.time_ns
            self._append(topic, header.frame_id, child, time_ns, pose)

    def _append(
        self, topic: Topic, parent: str, child: str, time_ns: int, pose: NDArray[np.float64] | None
    ) -> None:
        """Add a pose to the track of a topic, unless it is that of lost tracking."""
        if pose is None:
            return
        new = _Track(parent.lstrip("/"), child.lstrip("/"), [], [])
        track = self._tracks.setdefault(topic.name, new)
        if (track.parent, track.child) != (new.parent, new.child):
            found = f"poses of {track.child} and of {new.child or 'others'} on {topic.name}"
            raise InputError(self._path, found, "one robot a topic", _OPTION)
        track.times_ns.append(time_ns)
        track.poses.append(pose)

    def _pose(self, place: _Vector, turn: _Quaternion, topic: str) -> NDArray[np.float64] | None:
        """Build a pose; None while tracking was lost."""
        position, quaternion = [place.x, place.y, place.z], [turn.x, turn.y, turn.z, turn.w]
        if is_lost(position, quaternion):
            return None
        return from_quaternion(self._path, position, quaternion, f"a pose of {topic}")

    def route(self, frame: str) -> Route:
        """Find where the sensor of a frame was.

        Raises:
            InputError: Nothing tells it, or several topics do.
        """
        frame, tree = frame.lstrip("/"), self._tree
        way = tree.way_up(frame)
        if two := [one for one in way if one in tree.two_parents]:
            found = f"frame {two[0]} has two parents: {', '.join(tree.two_parents[two[0]])}"
            raise InputError(self._path, found, "one tree of frames", _OPTION)
        if tree.moves(way) and way[-1] not in ROBOT_FRAMES:
            return Route("sensor", f"transforms {' → '.join(way[::-1])}", tree, way, None)

        # a topic of poses goes on where the tree ends, or moves in the frame of the clouds
        inner = {name for name, one in self._tracks.items() if one.child in way}
        unsaid = {name for name, one in self._tracks.items() if not one.child}
        unsaid = {name for name in unsaid if self._tracks[name].parent != frame}
        outer = {name for name, one in self._tracks.items() if one.parent == frame}
        if found_topics := sorted(inner or outer or unsaid):
            name = self._only(found_topics)
            return self._along(name, way, registered=not inner and bool(outer))
        robots = tree.moving_below(frame) if way == [frame] else []
        if len(robots) == 1:
            down = tree.way_up(robots[0])
            return Route("map", f"transforms {' → '.join(down[::-1])}", tree, down, None)
        raise self._no_route(frame, way)

    def _along(self, name: str, way: list[str], *, registered: bool) -> Route:
        """Follow a topic of poses."""
        track = self._tracks[name]
        times, poses = np.array(track.times_ns, np.int64), np.stack(track.poses)
        trajectory = Trajectory.of(times, poses)
        if registered:
            told = f"{name}; the clouds are in its frame {track.parent} already"
            return Route("map", told, self._tree, way[:1], trajectory)
        inner = way[: way.index(track.child) + 1] if track.child in way else way
        told = f"{name}, {track.parent} → {' → '.join(inner[::-1])}"
        if not track.child:
            told += f" (taken as those of {inner[-1]})"
        return Route("sensor", told, self._tree, inner, trajectory)

    def _only(self, names: list[str]) -> str:
        if len(names) > 1:
            found = f"poses on {len(names)} topics: {', '.join(names)}"
            raise InputError(self._path, found, "one of them", _OPTION)
        return names[0]

    def _no_route(self, frame: str, way: list[str]) -> InputError:
        """Say what there is instead of a way from the map to the sensor."""
        frames = {*self._tree.names()}
        frames |= {name for one in self._tracks.values() for name in (one.parent, one.child)}
        known = ", ".join(sorted(frames - {""})[:12]) or "none"
        ends = f", which ends at {way[-1]}" if len(way) > 1 else ""
        found = f"no transform from a map to {frame or 'a frame without name'}{ends}"
        found += f"; frames found: {known}"
        remedy = "record TF or odometry with it, or give a pose file"
        return InputError(self._path, found, "TF, Odometry, PoseStamped or Path", remedy)
