"""ROS 1 bags and ROS 2 bags in SQLite through rosbags."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from functools import cache
from itertools import islice
from pathlib import Path
from struct import error as StructError
from weakref import finalize

import apsw
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag1 import ReaderError as Reader1Error
from rosbags.rosbag1.reader import decompressors
from rosbags.rosbag2 import ReaderError as Reader2Error
from rosbags.typesys import Stores, TypesysError, get_typestore
from rosbags.typesys.store import Typestore

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.claims import BoundedPath
from mcpseg_cli.formats.magic import recognise
from mcpseg_cli.formats.recordings.bag_chunks import unpack_bz2, unpack_lz4
from mcpseg_cli.formats.recordings.bag_files import NOT_DECODED, Place, RawMessage, Topic, undecoded
from mcpseg_cli.formats.recordings.message_types import guard

_UNPACK: dict[Callable[[bytes], bytes], Callable[[bytes], bytes]] = {
    decompressors["bz2"]: unpack_bz2,
    decompressors["lz4"]: unpack_lz4,
}
_DAMAGE = (
    AnyReaderError, Reader1Error, Reader2Error, AssertionError, ValueError, KeyError, apsw.Error,
    OverflowError, MemoryError, RuntimeError, StructError, TypeError, TypesysError,
)  # fmt: skip


class RosBag:
    """ROS 1 bags, one after another, or one ROS 2 bag; open as long as it is used.

    Args:
        path: What the user named, for messages.
        files: The files, or the folder of a ROS 2 bag.

    Attributes:
        topics: What is in them, by name.
        notes: What is to be said of them.

    Raises:
        InputError: One is none, damaged or without its index.
        OSError: One cannot be opened.
    """

    def __init__(self, path: Path, files: Sequence[Path]) -> None:
        self._path = path
        guard()
        try:
            bounded = [BoundedPath(one) if one.suffix == ".bag" else one for one in files]
            self._reader = AnyReader(bounded, default_typestore=_usual_types())
            self._reader.open()
            found = self._reader.topics
        except _DAMAGE as error:
            other = next((kind for one in files if (kind := _other_kind(one))), "")
            if other:
                raise InputError(path, f"no bag{other}", "a ROS bag", "rename it") from error
            raise _refusal(path, error) from error
        finalize(self, self._reader.close)
        for one in self._reader.readers:
            if isinstance(one, Reader1):  # its own way unpacks chunks of any size
                for place, chunk in one.chunks.items():
                    unpack = _UNPACK.get(chunk.decompressor, chunk.decompressor)
                    one.chunks[place] = chunk._replace(decompressor=unpack)

        self._connections = list(self._reader.connections)
        self.notes: tuple[str, ...] = ()
        encoding = "cdr" if self._reader.is2 else "ros1"
        self.topics = {
            name: Topic(name, info.msgtype or "", encoding, info.msgcount)
            for name, info in found.items()
        }

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Iterate over the messages of some topics, in time order."""
        which = [one for one in self._connections if one.topic in topics]
        numbers = {id(one): number for number, one in enumerate(self._connections)}
        if not which:
            return
        before: dict[tuple[int, int], int] = {}  # messages of one connection and moment
        try:
            for connection, time_ns, data in self._reader.messages(which):
                at = (numbers[id(connection)], time_ns)
                nth = before.get(at, 0)
                before[at] = nth + 1
                yield RawMessage(connection.topic, time_ns, _blob(data), (*at, nth))
        except _DAMAGE as error:
            raise _refusal(self._path, error) from error

    def read(self, place: Place) -> RawMessage:
        """Read a message again."""
        number, time_ns, nth = place
        which = [self._connections[number]]
        try:
            found = self._reader.messages(which, start=time_ns, stop=time_ns + 1)
            for connection, at, data in islice(found, nth, nth + 1):
                return RawMessage(connection.topic, at, _blob(data), place)
        except _DAMAGE as error:
            raise _refusal(self._path, error) from error
        remedy = "leave it alone while it is read"
        raise InputError(self._path, "changed meanwhile", "the same bag", remedy)

    def decode(self, raw: RawMessage) -> object:
        """Make a message of its bytes, see ``BagFiles.decode``."""
        topic = self.topics[raw.topic]
        try:
            return self._reader.deserialize(raw.data, topic.type)
        except (*NOT_DECODED, AnyReaderError) as error:
            raise undecoded(self._path, topic, error) from error


def _blob(data: object) -> bytes:
    """Take the bytes of a message; a damaged database may have a number in their place."""
    if not isinstance(data, bytes | bytearray | memoryview):
        raise TypeError(f"a message that is a {type(data).__name__}")
    return bytes(data)


@cache
def _usual_types() -> Typestore:
    """Make the message types of ROS 2, for bags from before these were written into them."""
    return get_typestore(Stores.LATEST)


def _refusal(path: Path, error: BaseException) -> InputError:
    """Say in one line what rosbags found."""
    said = " ".join(str(error).split())[:120] or type(error).__name__
    remedy = "run 'rosbag reindex' on it" if "index" in said.lower() else "copy or record it again"
    return InputError(path, f"rosbags: {said}", "a whole ROS bag", remedy)


def _other_kind(file: Path) -> str:
    """Say what a file is by its first bytes, if that is no bag."""
    kind = recognise(file, "; ")
    return "" if "bag" in kind else kind
