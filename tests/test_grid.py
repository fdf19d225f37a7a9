"""Columns of voxels, against what a loop finds."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mcpseg_cli.grid import by_column, rims_of

PLACES = st.lists(st.tuples(st.integers(-9, 9), st.integers(-9, 9)), max_size=40)


@given(PLACES)
def test_rows_are_grouped_by_column_in_order(places):
    columns = np.array(places, np.int32).reshape(-1, 2)
    expected: dict[tuple[int, int], list[int]] = {}
    for row, place in enumerate(places):
        expected.setdefault(place, []).append(row)
    found = [(column, rows.tolist()) for column, rows in by_column(columns)]
    assert found == sorted(expected.items())


@given(PLACES)
def test_a_voxel_is_of_the_rim_of_every_other_column_that_it_touches(places):
    width = 4
    voxel = np.array(places, np.int32).reshape(-1, 2)
    found = [
        (row, *column)
        for rows, columns in rims_of(voxel, width)
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True)
    ]
    expected = {
        (row, (x + a) // width, (y + b) // width)
        for row, (x, y) in enumerate(places)
        for a in (-1, 0, 1)
        for b in (-1, 0, 1)
    } - {(row, x // width, y // width) for row, (x, y) in enumerate(places)}
    assert len(found) == len(expected)
    assert set(found) == expected
