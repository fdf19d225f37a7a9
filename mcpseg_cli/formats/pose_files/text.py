"""Text of pose files: any encoding, separator, quotes and decimal sign."""

from __future__ import annotations

import codecs
import csv
import re
from datetime import UTC, datetime
from pathlib import Path

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.magic import recognise

_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_COMMENT = re.compile(r"^\s*(?:#|%|//)\s*")
_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
_CLOCK = re.compile(r"(\d{1,2}):(\d\d):(\d\d(?:\.\d+)?)")
_ZIP = b"PK\x03\x04"


def read_text(path: Path) -> str:
    """Read a text file in whatever encoding editors and spreadsheets leave.

    Args:
        path: UTF-8, UTF-16 or UTF-32, with or without a mark, or Latin-1.

    Raises:
        InputError: Not text.
        OSError: The file cannot be opened.
    """
    data = path.read_bytes()
    text = data.decode(_encoding(data), errors="replace")
    if "\0" in text:
        binary = f"binary data{recognise(path, '; ')}"
        found = "a ZIP or Excel file" if data.startswith(_ZIP) else binary
        expected = "a text table of poses (CSV, TUM or KITTI)"
        raise InputError(path, found, expected, "give the pose file second, exported as text")
    return text


def _encoding(data: bytes) -> str:
    """Tell an encoding by its mark, its zeros, or what cannot be UTF-8."""
    for mark, name in _MARKS:
        if data.startswith(mark):
            return name
    even, odd = data[::2].count(0), data[1::2].count(0)
    if len(data) >= 8 and max(even, odd) > 0.4 * len(data) / 2 and not min(even, odd):
        return "utf-16-le" if odd else "utf-16-be"
    try:
        data.decode()
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"


def split_comments(text: str) -> tuple[list[tuple[int, str]], list[tuple[int, str]]]:
    """Part the lines that say something into data and comments, each with its number from 1."""
    lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), start=1)]
    data = [(number, line) for number, line in lines if line and not _COMMENT.match(line)]
    comments = [(number, _COMMENT.sub("", line)) for number, line in lines if _COMMENT.match(line)]
    return data, comments


def separator_of(line: str) -> str | None:
    """Tell what parts the words of a line: semicolon, tab, comma, or None for spaces."""
    for mark in (";", "\t"):
        if mark in line:
            return mark
    if "," not in line:
        return None
    words = line.split()
    is_decimal = len(words) > 2 and all(
        "," not in word or _DECIMAL_COMMA.fullmatch(word) for word in words
    )
    return None if is_decimal else ","


def split_words(line: str, separator: str | None) -> list[str]:
    """Part a line into words without their quotes."""
    if '"' in line:
        try:
            reader = csv.reader([line], delimiter=separator or " ", skipinitialspace=True)
            words = next(reader, [])
        except csv.Error:
            words = line.split(separator)
    else:
        words = line.split(separator)
    return [word.strip() for word in words]


def to_number(word: str) -> float | None:
    """Read a number, with a decimal comma too; None for anything else."""
    try:
        return float(word)
    except ValueError:
        pass
    if _DECIMAL_COMMA.fullmatch(word):
        return float(word.replace(",", "."))
    return None


def to_moment(word: str) -> float | None:
    """Read a date with time (ISO 8601, UTC where it names no zone) or a time of day, as seconds."""
    found = _CLOCK.fullmatch(word)
    if found:
        return 3600 * int(found[1]) + 60 * int(found[2]) + float(found[3])
    if not re.match(r"\d{4}-?\d\d-?\d\d[T ]", word):
        return None
    try:
        moment = datetime.fromisoformat(word)
    except ValueError:
        return None
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
