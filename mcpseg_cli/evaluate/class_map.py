"""Class maps: tables, written by people, that give the classes of both sides common ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.class_table import check_class_table, read_rows


@dataclass(frozen=True)
class ClassMap:
    """Which class of the scores the classes of a prediction and of its truth stand for.

    Attributes:
        source: The table.
        table: Class of the scores by class of either side.
        dropped: Classes of either side that the table gives none.
    """

    source: Path
    table: dict[str, str]
    dropped: frozenset[str]

    @property
    def classes(self) -> tuple[str, ...]:
        """The classes of the scores, in the order of the table."""
        return tuple(dict.fromkeys(self.table.values()))

    def named(self, labels: Sequence[str]) -> dict[str, str | None]:
        """Return the class of each label: that of its row, its own name if the scores have it."""
        own = set(self.classes) - self.dropped
        return {label: self.table.get(label, label if label in own else None) for label in labels}

    def look_up(self, labels: Sequence[str], source: Path) -> NDArray[np.uint8]:
        """Build the table from labels of a file to classes of the scores.

        Args:
            labels: Class names of the file.
            source: The file, for messages.

        Returns:
            (256,) uint8, 255 for what stands for no class.

        Raises:
            InputError: The file names no classes.
        """
        if not labels:
            expected = f"names, which {self.source} gives classes"
            raise InputError(source, "no class names", expected, "score it without --class-map")
        classes, found = self.classes, np.full(256, UNKNOWN, np.uint8)
        for index, name in enumerate(self.named(labels).values()):
            if name is not None:
                found[index] = classes.index(name)
        return found


@dataclass(frozen=True)
class MappedClasses:
    """What a class map made of the classes of one run and of its truth.

    Attributes:
        source: The table.
        out: Class of the scores by class of the run, None where it has none.
        gt: The same by class of the truth.
    """

    source: Path
    out: dict[str, str | None]
    gt: dict[str, str | None]

    def document(self) -> dict[str, object]:
        """Give it as JSON."""
        return {"table": str(self.source), "out": self.out, "gt": self.gt}


def read_class_map(path: Path) -> ClassMap:
    """Read a class map.

    Args:
        path: CSV or JSON as ``formats.class_table.read_class_table`` takes it: a row for each class
            of either side, and the class of the scores. A class of the scores stands for itself and
            needs no row. What has no row, or none, ``unknown`` or ``-`` for its class, has none.

    Raises:
        InputError: Another layout, or a table that cannot be used.
        OSError: The file cannot be opened.
    """
    rows = read_rows(path)
    table = check_class_table(path, rows)
    return ClassMap(path, table, frozenset(label for label, _ in rows if label not in table))
