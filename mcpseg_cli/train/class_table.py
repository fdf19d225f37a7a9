"""The classes a network is trained for, given a class table or not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mcpseg_cli.classes import TABLE_EXPECTED, table_problem
from mcpseg_cli.errors import InputError


def trained_classes(
    tables: Sequence[Sequence[str]], mapping: Mapping[str, str] | None
) -> tuple[str, ...]:
    """List the classes to train.

    Those of the class table, else all that the areas have, in order of appearance.

    Args:
        tables: Class names of each area.
        mapping: From ``formats.class_table.read_class_table``.

    Raises:
        InputError: The areas have too many classes, or one whose name cannot be used.
    """
    if mapping is not None:
        return tuple(dict.fromkeys(mapping.values()))
    classes = tuple(dict.fromkeys(name for table in tables for name in table))
    if problem := table_problem(classes):
        raise InputError(
            "class tables of the data", problem, TABLE_EXPECTED, "choose classes with --classes"
        )
    return classes


def trained_names(labels: Sequence[str], mapping: Mapping[str, str] | None) -> tuple[str, ...]:
    """Name each label by the class it is trained as; those without one get no name.

    Args:
        labels: Class names of an area.
        mapping: From ``formats.class_table.read_class_table``; None: labels are classes.
    """
    return tuple(labels) if mapping is None else tuple(mapping.get(name, "") for name in labels)
