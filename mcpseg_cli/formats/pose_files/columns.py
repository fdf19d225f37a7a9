"""What the columns of a pose table are called, in any usual spelling."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, field

POSITION = ("x", "y", "z")
QUATERNION = ("qx", "qy", "qz", "qw")
ANGLES = ("roll", "pitch", "yaw")
MATRIX = tuple(f"m{row}{column}" for row in range(3) for column in range(4))

_OF_POSITION = {"p", "t", "pos", "position", "positions", "trans", "translation", "tr", "loc"}
_OF_POSITION |= {"location", "xyz", "coord", "coordinate", "point", "origin", "centre", "center"}
_OF_ROTATION = {"q", "quat", "quaternion", "rot", "rotation", "ori", "orient", "orientation", "r"}
_OF_ROTATION |= {"att", "attitude", "euler", "rotvec", "rvec", "o"}
_OF_OTHERS = {"v", "vel", "velocity", "a", "acc", "accel", "acceleration", "lin", "linear", "twist"}
_OF_OTHERS |= {"ang", "angular", "omega", "w", "gyro", "gyr", "b", "ba", "bg", "bw", "bias", "n"}
_OF_OTHERS |= {"cov", "covariance", "std", "sigma", "var", "variance", "normal", "mag", "gravity"}
_OF_OTHERS |= {"rate", "speed", "error", "err", "exposure", "duration", "delta", "dt"}
_NAMES = {"scan", "name", "file", "filename", "image", "img", "cloud", "pointcloud", "pcd", "ply"}
_NAMES |= {"las", "laz", "path", "filepath", "pano", "photo", "picture", "station", "scans"}
_IDS = {"id", "index", "idx", "frame", "number", "num", "no", "nr", "seq", "sequence", "keyframe"}
_IDS |= {"kf", "node", "row", "step", "count"}
_STAMPS = {"stamp": 0, "timestamp": 1, "timestamps": 1, "ts": 2, "time": 3, "times": 3, "utc": 4}
_STAMPS |= {"epoch": 4, "gpstime": 4, "datetime": 4, "secs": 6, "sec": 6, "seconds": 6}
_STAMPS |= {"nsecs": 7, "nsec": 7, "nanosec": 7, "nanosecs": 7, "nanoseconds": 7}
_SECONDS = {"s": 1.0, "sec": 1.0, "secs": 1.0, "second": 1.0, "seconds": 1.0}
_SECONDS |= {"ms": 1e-3, "msec": 1e-3, "msecs": 1e-3, "milliseconds": 1e-3, "millis": 1e-3}
_SECONDS |= {"us": 1e-6, "usec": 1e-6, "usecs": 1e-6, "microseconds": 1e-6, "micros": 1e-6}
_SECONDS |= {"ns": 1e-9, "nsec": 1e-9, "nsecs": 1e-9, "nanosec": 1e-9, "nanosecs": 1e-9}
_SECONDS |= {"nanoseconds": 1e-9, "nanos": 1e-9}
_SURVEY = {"easting": "x", "northing": "y", "elevation": "z", "altitude": "z"}
_FUSED = re.compile(r"(p|t|pos|loc|q|quat|rot|ori|r|v|vel|a|acc|b|w|n)([xyzw])")
_STAMP_AND_UNIT = re.compile(r"(timestamp|time|stamp)(ms|msec|us|usec|ns|nsec)")


@dataclass(frozen=True)
class Columns:
    """Which column of a table holds what.

    Attributes:
        places: Column by meaning: ``x``, ``qw``, ``roll``, ``m03``, ``scan``, ``id``, ``stamp``,
            ``nsec``.
        words: What the columns are called.
        unit: Seconds of one unit of the time stamps, where it is stated.
        is_degrees: Whether angles are in degrees, where it is stated.
        twice: Meanings that more than one column has.
    """

    places: dict[str, int] = field(default_factory=dict)
    words: tuple[str, ...] = ()
    unit: float | None = None
    is_degrees: bool | None = None
    twice: tuple[str, ...] = ()

    def has(self, names: Sequence[str]) -> bool:
        """Tell whether there is a column for every one of some meanings."""
        return all(name in self.places for name in names)

    def of(self, names: Sequence[str]) -> list[int]:
        """Return the columns of some meanings."""
        return [self.places[name] for name in names]

    @property
    def unused(self) -> list[str]:
        """Names of the columns that say nothing about poses."""
        used = set(self.places.values())
        return [word for place, word in enumerate(self.words) if place not in used]


@dataclass(frozen=True)
class _Word:
    """A column's name: its parts in small letters, and the unit in its brackets."""

    parts: tuple[str, ...]
    unit: str


def columns_of(words: Sequence[str]) -> Columns:
    """Find out what columns hold by what they are called.

    Args:
        words: Names of all columns, in order.
    """
    taken = [_taken_apart(word) for word in words]
    meanings = _with_bare_quaternion(taken, _from_zero([_meaning(word) for word in taken]))
    places: dict[str, int] = {}
    twice = []
    for place, meaning in enumerate(meanings):
        if meaning is None or meaning == "stamp":
            continue
        if meaning in places and meaning not in ("scan", "id"):
            twice.append(meaning)
        places.setdefault(meaning, place)

    # names that mean something only where nothing else does
    for place, word in enumerate(taken):
        survey = _SURVEY.get(word.parts[-1] if word.parts else "")
        if survey:
            places.setdefault(survey, place)
        if word.parts == ("w",) and all(name in places for name in QUATERNION[:3]):
            places.setdefault("qw", place)

    # a rotation by its entries and a position by its axes
    if all(name in places for name in (*MATRIX[:3], *MATRIX[4:7], *MATRIX[8:11], *POSITION)):
        for name, axis in zip(MATRIX[3::4], POSITION, strict=True):
            places.setdefault(name, places[axis])

    stamps, unit = _stamps(taken, meanings)
    angles = [taken[places[name]] for name in ANGLES if name in places]
    return Columns(places | stamps, tuple(words), unit, _is_degrees(angles), tuple(twice))


def _taken_apart(word: str) -> _Word:
    text = unicodedata.normalize("NFKC", word)
    brackets = re.search(r"[\[(<]([^\])>]*)[\])>]", text)
    if brackets:
        text = text[: brackets.start()] + text[brackets.end() :]
    text = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", text)
    parts = tuple(re.findall(r"[a-z]+|\d+", text.lower()))
    return _Word(parts, brackets[1].strip().lower() if brackets else "")


def _meaning(word: _Word) -> str | None:
    """Tell what a column holds; None for what has nothing to do with poses."""
    parts = word.parts
    if not parts:
        return None
    return _coordinate(parts) or _entry(parts) or _label(parts)


def _coordinate(parts: tuple[str, ...]) -> str | None:
    """Tell a position, a part of a quaternion, or an angle."""
    *before, last = parts
    fused = _FUSED.fullmatch(last)
    if fused:
        before, last = [*before, fused[1]], fused[2]
    kind = next((part for part in before if part in _OF_POSITION | _OF_ROTATION | _OF_OTHERS), "")
    if kind in _OF_OTHERS or last in _OF_OTHERS - {"w"}:
        return None

    # axes of quaternions may be counted, or called i j k r
    if kind in ("q", "quat", "quaternion") or last in ("qi", "qj", "qk", "qr"):
        place = {"i": "x", "j": "y", "k": "z", "r": "w", "s": "w", "0": "w"}.get(last[-1], last[-1])
        place = {"1": "x", "2": "y", "3": "z"}.get(place, place)
        return f"q{place}" if place in "xyzw" else None
    if last in ("x", "y", "z"):
        return f"q{last}" if kind in _OF_ROTATION else last
    if last == "w" and kind in _OF_ROTATION:
        return "qw"
    return next((name for name in ANGLES if name in parts), None)


def _entry(parts: tuple[str, ...]) -> str | None:
    """Tell an entry of a matrix: m00, r_11, T[0][3], t_23."""
    digits = "".join(part for part in parts if part.isdecimal())
    letters = [part for part in parts if not part.isdecimal()]
    is_matrix = len(digits) == 2 and letters and letters[-1] in ("m", "r", "t", "mat", "rot")
    return f"m{digits}" if is_matrix and set(digits) <= set("01234") else None


def _from_zero(meanings: list[str | None]) -> list[str | None]:
    """Count the entries of a matrix from 0, as some do from 1."""
    entries = [name for name in meanings if name and re.fullmatch(r"m\d\d", name)]
    if not entries or any("0" in name for name in entries):
        return meanings
    return [
        f"m{int(name[1]) - 1}{int(name[2]) - 1}" if name in entries else name for name in meanings
    ]


def _with_bare_quaternion(taken: list[_Word], meanings: list[str | None]) -> list[str | None]:
    """Take x y z w for a quaternion where the position has names of its own: tx ty tz w x y z."""
    bare = {word.parts[0]: place for place, word in enumerate(taken) if len(word.parts) == 1}
    others = [name for place, name in enumerate(meanings) if place not in bare.values()]
    fused = [meanings[place] for part, place in bare.items() if part not in "xyzw"]
    if not all(axis in bare for axis in "xyzw") or not set(POSITION) <= {*others, *fused}:
        return meanings
    changed = list(meanings)
    for axis in "xyzw":
        changed[bare[axis]] = f"q{axis}"
    return changed


def _label(parts: tuple[str, ...]) -> str | None:
    """Tell a time stamp, a name or a number of scans."""
    if _stamp_rank(parts) is not None:
        return "stamp"
    last = parts[-1]
    if last in ("id", "index", "idx", "number", "num", "no") and len(parts) > 1:
        return "scan" if parts[0] == "scan" else "id"
    if last in _NAMES or parts[0] in ("scan", "file", "filename"):
        return "scan"
    return "id" if last in _IDS else None


def _stamp_rank(parts: tuple[str, ...]) -> int | None:
    """Tell how surely a column is the time stamp, 0 most; None where it is none."""
    if set(parts) & {"id", *_OF_OTHERS}:
        return None
    if parts[0] == "t" and set(parts[1:]) <= _SECONDS.keys():
        return 5
    ranks = [_STAMPS[part] for part in parts if part in _STAMPS]
    ranks += [_STAMPS[found[1]] for part in parts if (found := _STAMP_AND_UNIT.fullmatch(part))]
    return min(ranks) if ranks else None


def _stamps(taken: list[_Word], meanings: list[str | None]) -> tuple[dict[str, int], float | None]:
    """Choose the columns of the time stamps, and their unit where it is stated."""
    places = [place for place, meaning in enumerate(meanings) if meaning == "stamp"]
    if not places:
        return {}, None
    units = {place: _unit(taken[place]) for place in places}
    nanoseconds = [place for place in places if taken[place].parts[-1].startswith(("nsec", "nano"))]
    seconds = [place for place in places if taken[place].parts[-1] in ("sec", "secs", "seconds")]
    if seconds and nanoseconds:
        return {"stamp": seconds[0], "nsec": nanoseconds[0]}, 1.0
    best = min(places, key=lambda place: (_stamp_rank(taken[place].parts) or 0, place))
    return {"stamp": best}, units[best]


def _unit(word: _Word) -> float | None:
    """Tell the seconds of a unit that a column's name states."""
    if word.unit in _SECONDS:
        return _SECONDS[word.unit]
    last = word.parts[-1]
    found = _STAMP_AND_UNIT.fullmatch(last)
    if found:
        return _SECONDS[found[2]]
    return _SECONDS.get(last) if len(word.parts) > 1 or last in _STAMPS else None


def _is_degrees(angles: list[_Word]) -> bool | None:
    """Tell whether angles are stated to be in degrees or in radians."""
    told = " ".join(" ".join([*word.parts, word.unit]) for word in angles)
    if re.search(r"\b(deg|degree|degrees)\b|°", told):
        return True
    return False if re.search(r"\b(rad|radian|radians)\b", told) else None
