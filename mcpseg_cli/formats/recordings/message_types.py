"""Names in the message types of bags, looked at before rosbags makes Python code of them.

rosbags writes the types that a file describes into a program and runs it. A name with more in it
than letters, figures and ``_`` would be run, too.
"""

from __future__ import annotations

import keyword
import re

from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import TypesysError, store
from rosbags.typesys.codegen import generate_python_code

_NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)
_BASE = re.compile(
    r"u?int(8|16|32|64)|float(32|64|128)|bool|byte|char|octet|wchar|w?string", re.ASCII
)


def guard() -> None:
    """Have rosbags look at types with ``check_types`` before it makes code of them, from now on."""
    setattr(store, "generate_python_code", _checked_code)  # noqa: B010  # not exported


def check_types(types: Typesdict) -> None:
    """See that all that is in the definition of message types is a name, a number or a text.

    Raises:
        TypesysError: Something is not.
    """
    for name, (constants, fields) in types.items():
        _check_type(name)
        for field, description in fields:
            _check_name(field)
            _check_description(description)
        for field, kind, value in constants:
            _check_name(field)
            if not _BASE.fullmatch(kind) or type(value) not in (bool, int, float, str):
                raise TypesysError(f"constant {field!r}")


def _check_name(name: object) -> None:
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise TypesysError(f"name {name!r}")


def _check_type(name: object) -> None:
    """See that a name is of a type, as ``sensor_msgs/msg/PointCloud2``."""
    parts = name.split("/") if isinstance(name, str) else []
    for part in parts or [""]:
        _check_name(part)
    if keyword.iskeyword(str(name)):
        raise TypesysError(f"name {name!r}")


def _check_description(description: object) -> None:
    """See what a field is made of: a kind, and a name, or one of what and how many."""
    kind, about = _pair(description)
    if kind == Nodetype.NAME:
        _check_type(about)
        return
    what, count = _pair(about)
    if not isinstance(count, int):
        raise TypesysError(f"count {count!r}")
    if kind == Nodetype.BASE:
        if not isinstance(what, str) or not _BASE.fullmatch(what):
            raise TypesysError(f"type {what!r}")
    elif kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        _check_description(what)
    else:
        raise TypesysError(f"field {kind!r}")


def _pair(value: object) -> tuple[object, object]:
    if not isinstance(value, tuple) or len(value) != 2:
        raise TypesysError(f"field {value!r}")
    return value


def _checked_code(types: Typesdict) -> str:
    check_types(types)
    return generate_python_code(types)
