"""The order people expect of names: ``office_2`` before ``office_10``."""

import re

NaturalKey = tuple[list[tuple[int, int, str]], str]


def natural_key(name: str) -> NaturalKey:
    """Return what to sort a name by: runs of digits by value, the rest by letters; the name itself breaks ties."""
    parts = re.split(r"(\d+)", name)
    return [
        (0, int(part), "") if part.isdecimal() else (1, 0, part) for part in parts if part
    ], name
