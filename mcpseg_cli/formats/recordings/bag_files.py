"""What all bags have in common: topics of messages, which can be read again one by one."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from struct import error as StructError
from typing import Protocol

from rosbags.serde import SerdeError
from rosbags.typesys import TypesysError

from mcpseg_cli.errors import InputError

NOT_DECODED = (
    SerdeError, TypesysError, StructError, AssertionError, IndexError, KeyError, TypeError,
    ValueError,
)  # fmt: skip
"""What decoding a message raises that is not what its type says."""

Place = tuple[int, int, int]
"""Where a message lies: file or connection, offset or time, and which of those there."""


@dataclass(frozen=True)
class Topic:
    """One topic of a bag.

    Attributes:
        name: As it was published.
        type: Of its messages, as ROS 2 spells it: ``sensor_msgs/msg/PointCloud2``.
        encoding: ``ros1``, ``cdr``, or what is not understood.
        count: Messages.
    """

    name: str
    type: str
    encoding: str
    count: int


@dataclass(frozen=True)
class RawMessage:
    """A message as it was stored.

    Attributes:
        topic: Its topic.
        time_ns: When it was recorded.
        data: Its bytes.
        place: Where it lies.
    """

    topic: str
    time_ns: int
    data: bytes
    place: Place


class BagFiles(Protocol):
    """The files of a bag."""

    @property
    def topics(self) -> dict[str, Topic]:
        """What is in it, by name."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be said of it."""

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Iterate over the messages of some topics."""

    def read(self, place: Place) -> RawMessage:
        """Read a message again."""

    def decode(self, raw: RawMessage) -> object:
        """Make a message of its bytes: an object whose attributes are the fields of its type."""


def ros_type(name: str) -> str:
    """Spell a type as ROS 2 does: ``nav_msgs/Odometry`` becomes ``nav_msgs/msg/Odometry``."""
    package, _, rest = name.partition("/")
    return name if not rest or rest.startswith("msg/") else f"{package}/msg/{rest}"


def undecoded(path: Path, topic: Topic, error: BaseException) -> InputError:
    """Say in one line that a message cannot be decoded."""
    said = " ".join(str(error).split())[:60] or type(error).__name__
    found = f"a message on {topic.name} that is no {topic.type} ({said})"
    return InputError(path, found, "messages as their types say", "record it again")


@contextmanager
def told_of_fields(path: Path, topic: Topic) -> Iterator[None]:
    """Say in one line that a message lacks a field: a bag may define a usual type in its own way.

    Raises:
        InputError: The block asked for a field that is not there.
    """
    try:
        yield
    except AttributeError as error:
        raise undecoded(path, topic, error) from error
