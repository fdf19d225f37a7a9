"""The scans of a bag: clouds as they are, depth images with the cameras that a bag tells of."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import Frame
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.cloud import Cloud, checked
from mcpseg_cli.formats.fingerprint import Fingerprint
from mcpseg_cli.formats.recordings import ros_messages as ros
from mcpseg_cli.formats.recordings.bag_files import BagFiles, Place, RawMessage, told_of_fields
from mcpseg_cli.formats.rigid import NEAREST_NS
from mcpseg_cli.formats.scan_source import Placeable


class _CameraInfo(Protocol):
    header: ros.Header
    width: int
    height: int


class DepthReader:
    """The camera of the depth images of a topic, as its camera_info tells it.

    Args:
        path: The bag, for messages.
        bag: Its files.
        depth_topic: Topic of the images.

    Attributes:
        topic: Topic of the camera_info.
        notes: What is to be said of the camera.

    Raises:
        InputError: There is no such topic.
    """

    def __init__(self, path: Path, bag: BagFiles, depth_topic: str) -> None:
        self._path, self._bag = path, bag
        infos = [topic.name for topic in bag.topics.values() if topic.type == ros.CAMERA_INFO]
        beside = f"{depth_topic.rpartition('/')[0]}/camera_info"
        if beside not in infos and len(infos) != 1:
            found = f"camera_info on {', '.join(infos) or 'no topic'}"
            raise InputError(path, found, f"it on {beside}", "record it with the images")
        self.topic = beside if beside in infos else infos[0]
        self.matrix: NDArray[np.float64] | None = None
        self.notes: tuple[str, ...] = ()

    def add(self, raw: RawMessage) -> None:
        """Take note of a message, if it is the first camera_info."""
        if raw.topic != self.topic or self.matrix is not None:
            return
        info = self._bag.decode(raw)
        values = getattr(info, "k", None) if hasattr(info, "k") else getattr(info, "K", None)
        lens = getattr(info, "d", None) if hasattr(info, "d") else getattr(info, "D", None)
        self.matrix = np.array(values, np.float64).reshape(3, 3)
        if lens is not None and np.any(np.asarray(lens) != 0):
            self.notes = (f"the lens distortion of {self.topic} is not undone",)

    def cloud(self, raw: RawMessage, colour: NDArray[np.uint8] | None) -> Cloud:
        """Unproject a depth image, see ``depth_frames.unproject``."""
        from mcpseg_cli.formats.recordings.depth_frames import Camera, Layout, unproject

        if self.matrix is None:
            found = f"no message on {self.topic}"
            raise InputError(self._path, found, "the intrinsics", "record it with the images")
        camera = Camera.of(self.matrix)
        depth = ros.depth_of(self._path, cast(ros.Image, self._bag.decode(raw)))
        if colour is not None and colour.shape[:2] != depth.shape:
            colour = None
        return unproject(self._path, depth, Layout(camera, camera, 1.0), colour)


class Colours:
    """Colour images registered to the depth images: of the same frame, on the only such topic.

    Args:
        path: The bag, for messages.
        bag: Its files.
        depth_topic: Topic of the depth images.

    Attributes:
        topic: Topic of the images; empty where there is none, or several.
        notes: What is to be said of them.
    """

    def __init__(self, path: Path, bag: BagFiles, depth_topic: str) -> None:
        self._path, self._bag = path, bag
        depth = self._first(depth_topic)
        images = {
            topic.name: self._first(topic.name)
            for topic in bag.topics.values()
            if topic.type == ros.IMAGE and topic.name != depth_topic and topic.count
        }
        colours = {name: one for name, one in images.items() if one[0] in ros.COLOUR_ENCODINGS}
        same = [name for name, one in colours.items() if one[1:] == depth[1:]]
        self.topic = same[0] if len(same) == 1 else ""
        self.notes: tuple[str, ...] = (f"colours: {self.topic}",) if self.topic else ()
        if colours and not self.topic:
            names = ", ".join(colours)
            why = "several of its camera" if same else "none of the frame and size of the depth"
            self.notes = (f"no colours: {names}: {why}",)
        self._places: list[tuple[int, Place]] = []

    def _first(self, name: str) -> tuple[str, str, int, int]:
        """Return encoding, frame, height and width of the first image of a topic.

        Images of one camera, or registered to it, have all but the first in common.
        """
        raw = next(iter(self._bag.messages([name])), None)
        if raw is None:
            found = f"no message on {name}"
            raise InputError(self._path, found, "those it promises", "record it again")
        image = cast(ros.Image, self._bag.decode(raw))
        with told_of_fields(self._path, self._bag.topics[name]):
            frame = image.header.frame_id.lstrip("/")
            return image.encoding, frame, image.height, image.width

    def add(self, raw: RawMessage) -> None:
        """Take note of a message, if it is a colour image."""
        if raw.topic == self.topic:
            header = cast(ros.Image, self._bag.decode(raw)).header
            self._places.append((ros.time_ns(header.stamp) or raw.time_ns, raw.place))

    def nearest(self, time_ns: int) -> RawMessage | None:
        """Return the image of a moment, if there is one near it."""
        near = min(self._places, key=lambda one: abs(one[0] - time_ns), default=None)
        if near is None or abs(near[0] - time_ns) > NEAREST_NS:
            return None
        return self._bag.read(near[1])

    def image(self, raw: RawMessage | None) -> NDArray[np.uint8] | None:
        """Return the colours (H, W, 3) of a message."""
        if raw is None:
            return None
        return ros.colour_of(self._path, cast(ros.Image, self._bag.decode(raw)))


@dataclass(frozen=True, eq=False)
class BagScan(Placeable):
    """One message of a bag.

    Attributes:
        name: Seconds of its stamp, with .ply.
        path: The bag.
        pose: (4, 4) float64, sensor to map; None where the poses have a gap.
        stamp: Seconds.
        frame: ``sensor``, or ``map`` for clouds that were registered before they were recorded.
        lost: Why it has no pose, where it is known.
    """

    name: str
    path: Path
    pose: NDArray[np.float64] | None
    stamp: float
    frame: Frame | None
    _bag: BagFiles = field(repr=False)
    _place: Place
    _reader: DepthReader | None = field(repr=False)
    _colours: Colours | None = field(repr=False)
    _stamp_ns: int
    lost: str = ""

    def read(self) -> Cloud:
        """Read its points; those without coordinates or depth are dropped."""
        depth, colour = self._messages()
        with told_of_fields(self.path, self._bag.topics[depth.topic]):
            if self._reader is not None and self._colours is not None:
                cloud = self._reader.cloud(depth, self._colours.image(colour))
            else:
                message = cast(ros.PointCloud2, self._bag.decode(depth))
                cloud = ros.points_of(self.path, message, drops_zeros=self.frame == "sensor")
        return checked(self.path, cloud)

    def fingerprint(self) -> Fingerprint:
        """Take the fingerprint of its messages."""
        depth, colour = self._messages()
        content = [depth.data, colour.data if colour else b""]
        if self._reader is not None and self._reader.matrix is not None:
            content.append(self._reader.matrix.tobytes())
        return Fingerprint.of_part(self.path, content)

    def is_still(self, kept: Fingerprint) -> bool:
        """Tell whether its messages are still what they were."""
        return kept.is_untouched(self.path) or self.fingerprint().sha256 == kept.sha256

    def _messages(self) -> tuple[RawMessage, RawMessage | None]:
        colour = self._colours.nearest(self._stamp_ns) if self._colours else None
        return self._bag.read(self._place), colour
