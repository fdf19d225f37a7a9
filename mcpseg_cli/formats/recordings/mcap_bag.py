"""MCAP files through the mcap library: any profile, also cut short or still being written."""

from __future__ import annotations

import os
import struct
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, McapRecord, Message, Schema
from mcap.stream_reader import CRCValidationError, breakup_chunk
from mcap.summary import Summary
from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import (
    Stores,
    TypesysError,
    get_types_from_idl,
    get_types_from_msg,
    get_typestore,
)
from rosbags.typesys.store import Typestore
from zstandard import ZstdError

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.magic import recognise
from mcpseg_cli.formats.recordings.bag_chunks import unpack_lz4, unpack_zstd
from mcpseg_cli.formats.recordings.bag_files import (
    NOT_DECODED,
    Place,
    RawMessage,
    Topic,
    ros_type,
    undecoded,
)
from mcpseg_cli.formats.recordings.message_types import guard

_MAGIC = b"\x89MCAP0\r\n"
_DATA = {int(Opcode.SCHEMA), int(Opcode.CHANNEL), int(Opcode.MESSAGE), int(Opcode.CHUNK)}
_DAMAGE = (
    McapError, CRCValidationError, ZstdError, struct.error, RuntimeError, ValueError, OverflowError,
    MemoryError,
)  # fmt: skip
_END = {int(Opcode.DATA_END), int(Opcode.FOOTER)}
_TF = "geometry_msgs/TransformStamped[] transforms\n"  # which ROS 1 has in a package of its own
_STORES = {"ros1": Stores.ROS1_NOETIC, "cdr": Stores.LATEST}


@dataclass
class _Known:
    """Channels and schemas of a file, which its messages refer to."""

    channels: dict[int, Channel]
    schemas: dict[int, Schema]


class McapBag:
    """MCAP files, one after another.

    Args:
        paths: The files.

    Attributes:
        topics: What is in them, by name.
        notes: What is to be said of them.

    Raises:
        InputError: One is none, or damaged.
        OSError: One cannot be opened.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = tuple(paths)
        self._known = [_Known({}, {}) for _ in paths]
        self._chunk: tuple[tuple[int, int], list[McapRecord]] | None = None
        self.topics: dict[str, Topic] = {}
        self.notes: tuple[str, ...] = ()
        counts = self._count()
        for known in self._known:
            for channel in known.channels.values():
                schema = known.schemas.get(channel.schema_id)
                self.topics[channel.topic] = Topic(
                    channel.topic,
                    ros_type(schema.name if schema else ""),
                    channel.message_encoding,
                    counts.get(channel.topic, 0),
                )
        used = {topic.encoding for topic in self.topics.values()} & set(_STORES)
        self._stores = {encoding: self._make_store(encoding) for encoding in sorted(used)}

    def _count(self) -> Counter[str]:
        """Count the messages of all topics: by the summaries of the files, else by a look."""
        summaries = [_summary(path) for path in self._paths]
        if None in summaries:
            return Counter(channel.topic for _, channel, _ in self._all_messages())
        counts: Counter[str] = Counter()
        for known, summary in zip(self._known, summaries, strict=True):
            if summary is not None and summary.statistics is not None:
                known.channels, known.schemas = dict(summary.channels), dict(summary.schemas)
                for number, count in summary.statistics.channel_message_counts.items():
                    counts[known.channels[number].topic] += count
        return counts

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Iterate over the messages of some topics, as they were written."""
        for place, channel, message in self._all_messages():
            if channel.topic in topics:
                yield RawMessage(channel.topic, message.log_time, message.data, place)

    def read(self, place: Place) -> RawMessage:
        """Read a message again."""
        number, offset, nth = place
        if self._chunk is None or self._chunk[0] != (number, offset):
            with self._paths[number].open("rb") as file:
                file.seek(offset)
                record = _next_record(self._paths[number], file)
            self._chunk = ((number, offset), _parts(self._paths[number], record))
        message = self._chunk[1][nth]
        if not isinstance(message, Message):
            remedy = "leave it alone while it is read"
            raise InputError(self._paths[number], "changed meanwhile", "the same file", remedy)
        channel = self._known[number].channels[message.channel_id]
        return RawMessage(channel.topic, message.log_time, message.data, place)

    def decode(self, raw: RawMessage) -> object:
        """Make a message of its bytes, see ``BagFiles.decode``."""
        topic = self.topics[raw.topic]
        if (store := self._stores.get(topic.encoding)) is None:
            found = f"messages on {topic.name} encoded as {topic.encoding!r}"
            expected = " or ".join(_STORES)
            raise InputError(self._paths[raw.place[0]], found, expected, "record it again")
        is_ros1 = topic.encoding == "ros1"
        try:
            deserialize = store.deserialize_ros1 if is_ros1 else store.deserialize_cdr
            return deserialize(raw.data, topic.type)
        except NOT_DECODED as error:
            raise undecoded(self._paths[raw.place[0]], topic, error) from error

    def _all_messages(self) -> Iterator[tuple[Place, Channel, Message]]:
        """Iterate over all messages, taking note of what they refer to."""
        for number, path in enumerate(self._paths):
            known = self._known[number]
            for offset, record in self._records(path):
                for nth, part in enumerate(_parts(path, record)):
                    if isinstance(part, Schema):
                        known.schemas[part.id] = part
                    elif isinstance(part, Channel):
                        known.channels[part.id] = part
                    elif isinstance(part, Message) and part.channel_id in known.channels:
                        yield (number, offset, nth), known.channels[part.channel_id], part

    def _records(self, path: Path) -> Iterator[tuple[int, McapRecord]]:
        """Iterate over the records of a file's data and where they begin, as far as it is whole."""
        with path.open("rb") as file:
            if file.read(len(_MAGIC)) != _MAGIC:
                found = f"no MCAP by its first bytes{recognise(path, '; ')}"
                raise InputError(path, found, "an MCAP file", "copy it again")
            while True:
                offset = file.tell()
                try:
                    record = _next_record(path, file)
                except EOFError:
                    self.notes = (f"{path.name} is cut short or still being written",)
                    return
                if record is None:
                    return
                yield offset, record

    def _make_store(self, encoding: str) -> Typestore:
        """Make a store of the message types that the files describe, else of the usual ones."""
        types: Typesdict = {}
        for path, known in zip(self._paths, self._known, strict=True):
            wanted = {
                channel.schema_id
                for channel in known.channels.values()
                if channel.message_encoding == encoding
            }
            for schema in [known.schemas[one] for one in sorted(wanted) if one in known.schemas]:
                types.update(_types_of(path, schema))
        described = set(types)
        if any(
            one.encoding == encoding and one.type not in described for one in self.topics.values()
        ):
            usual = get_typestore(_STORES[encoding]).fielddefs
            types = {**get_types_from_msg(_TF, "tf2_msgs/msg/TFMessage"), **usual, **types}
        guard()
        store = get_typestore(Stores.EMPTY)
        try:
            store.register(types)
        except TypesysError as error:
            found = f"message types that do not go together ({str(error)[:60]})"
            raise InputError(self._paths[0], found, "ROS messages", "record it again") from error
        return store


def _summary(path: Path) -> Summary | None:
    """Read the summary of a file; None where it has none, or none of all channels."""
    with path.open("rb") as file:
        try:
            summary = make_reader(file).get_summary()
        except (*_DAMAGE, KeyError):
            return None  # cut short, or no MCAP, which a look at all of it tells
    if summary is None or summary.statistics is None:
        return None
    counted = summary.statistics.channel_message_counts
    is_whole = set(counted) <= set(summary.channels) and sum(counted.values()) > 0
    return summary if is_whole and summary.schemas else None


def _types_of(path: Path, schema: Schema) -> Typesdict:
    """Read the definition of a message type and of those in it."""
    text = schema.data.decode("utf-8", "replace")
    try:
        if schema.encoding in ("ros1msg", "ros2msg") and text.strip():
            return get_types_from_msg(text, ros_type(schema.name))
        if schema.encoding in ("ros2idl", "omgidl") and text.strip():
            return get_types_from_idl(text)
    except TypesysError as error:
        found = f"a definition of {schema.name} that is none ({str(error)[:60]})"
        raise InputError(path, found, "ROS messages", "record it again") from error
    return {}


def _next_record(path: Path, file: BinaryIO) -> McapRecord | None:
    """Read the next record that holds data; None at the end of these.

    Raises:
        EOFError: The file ends before.
        InputError: The record is damaged.
    """
    size = os.fstat(file.fileno()).st_size
    while True:
        head = file.read(9)
        length = int.from_bytes(head[1:], "little")
        if len(head) < 9 or file.tell() + length > size:
            raise EOFError
        if head[0] in _END:
            return None
        if head[0] not in _DATA:
            file.seek(length, 1)
            continue
        try:
            return _record(head[0], file.read(length))
        except _DAMAGE as error:
            raise _refusal(path, "record", error) from error


def _record(opcode: int, data: bytes) -> McapRecord:
    """Make a record of its bytes."""
    stream = ReadDataStream(BytesIO(data))
    record: McapRecord
    if opcode == Opcode.CHUNK:
        record = Chunk.read(stream)
    elif opcode == Opcode.SCHEMA:
        record = Schema.read(stream)
    elif opcode == Opcode.CHANNEL:
        record = Channel.read(stream)
    else:
        record = Message.read(stream, len(data))
    return record


def _parts(path: Path, record: McapRecord | None) -> list[McapRecord]:
    """Take a chunk apart; any other record is its own only part."""
    if record is None:
        return []
    if not isinstance(record, Chunk):
        return [record]
    try:
        return breakup_chunk(_unpacked(record), validate_crc=True)
    except _DAMAGE as error:
        raise _refusal(path, "chunk", error) from error


def _unpacked(chunk: Chunk) -> Chunk:
    """Unpack a chunk, up to a bound; of another compression it stays as it is."""
    if chunk.compression == "zstd":
        data = unpack_zstd(chunk.data, chunk.uncompressed_size)
    elif chunk.compression == "lz4":
        data = unpack_lz4(chunk.data)
    else:
        return chunk
    return replace(chunk, compression="", data=data)


def _refusal(path: Path, what: str, error: BaseException) -> InputError:
    """Say in one line that a part of a file is damaged."""
    said = " ".join(str(error).split())[:80] or type(error).__name__
    found = f"a damaged {what} ({said})"
    return InputError(path, found, "a whole MCAP file", "copy it again")
