"""Names: the order people expect, ``office_2`` before ``office_10``, and their endings."""

import re

NaturalKey = tuple[list[tuple[int, int, str]], str]


def natural_key(name: str) -> NaturalKey:
    """Return what to sort a name by: digits by value, the rest by letters, then the name itself."""
    parts = [part for part in re.split(r"(\d+)", name) if part]
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in parts], name


def split_ending(name: str) -> tuple[str, str]:
    """Split a name or path with slashes before its ending, as ``Path.suffix`` has it."""
    dot, start = name.rfind("."), name.rfind("/") + 1
    if start < dot < len(name) - 1:
        return name[:dot], name[dot:]
    return name, ""
