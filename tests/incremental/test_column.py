"""Growing arrays."""

import numpy as np

from mcpseg_cli.incremental import column as columns
from mcpseg_cli.incremental.column import Column


def test_rows_survive_growing(monkeypatch):
    monkeypatch.setattr(columns, "RESERVED_ROWS", 4)
    column = Column(np.int32, 2)
    expected = np.arange(200, dtype=np.int32).reshape(-1, 2)
    for part in np.array_split(expected, [1, 3, 4, 5, 50]):
        column.append(part)
    np.testing.assert_array_equal(column.rows, expected)


def test_truncated_rows_are_forgotten_and_written_over():
    column = Column(np.int32)
    column.append(np.array([1, 2, 3], np.int32))
    column.truncate(1)
    column.append(np.array([9], np.int32))
    assert column.rows.tolist() == [1, 9]
