"""The order people expect of names: ``office_2`` before ``office_10``."""

import re

NaturalKey = tuple[list[tuple[int, int, str]], str]


def natural_key(name: str) -> NaturalKey:
    """Return what to sort a name by: digits by value, the rest by letters, then the name itself."""
    parts = [part for part in re.split(r"(\d+)", name) if part]
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in parts], name
