"""Rows shared among threads: every row is done once, in few heights, however many threads."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.networks.tiles import Scratch, Workers, height_of, tiles_of

MOST_ROWS = 2048
counts = st.integers(0, 50_000)


@given(count=counts)
def test_tiles_cover_all_rows_once_and_in_order(count):
    rows = [row for tile in tiles_of(count) for row in range(tile.start, tile.stop)]
    assert rows == list(range(count))


@given(count=counts)
def test_tiles_are_no_higher_than_their_limit_and_all_but_the_last_alike(count):
    heights = [tile.stop - tile.start for tile in tiles_of(count)]
    assert all(0 < height <= MOST_ROWS for height in heights)
    assert len(set(heights[:-1])) <= 1
    assert all(heights[-1] <= height for height in heights)


@given(count=counts)
def test_tiles_of_many_rows_are_more_than_half_of_the_limit_but_the_last(count):
    tiles = tiles_of(count)
    assert all(tile.stop - tile.start > MOST_ROWS / 2 for tile in tiles[:-1])


def test_products_have_few_heights_whatever_the_number_of_rows():
    heights = {
        height_of(tile.stop - tile.start) for count in range(20_000) for tile in tiles_of(count)
    }
    assert len(heights) <= 24


@given(rows=st.integers(1, MOST_ROWS))
def test_a_height_has_room_for_the_rows_and_little_more(rows):
    assert rows <= height_of(rows) < rows + (128 if rows > 128 else 16)


@settings(deadline=None, max_examples=20)
@given(count=st.integers(0, 20_000), threads=st.integers(1, 3))
def test_workers_do_every_row_once_in_the_same_tiles_on_any_threads(count, threads):
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        workers = Workers()
    finally:
        torch.set_num_threads(before)

    done, tiles = torch.zeros(count, dtype=torch.int64), []

    def work(scratch: Scratch, rows: slice) -> None:
        tiles.append((rows.start, rows.stop))
        done[rows] += 1

    workers.share(count, work)
    assert (done == 1).all()
    assert sorted(tiles) == [(tile.start, tile.stop) for tile in tiles_of(count)]


def test_an_error_in_a_tile_reaches_the_caller():
    def work(scratch: Scratch, rows: slice) -> None:
        raise ValueError(f"row {rows.start}")

    with pytest.raises(ValueError, match="row "):
        Workers().share(10_000, work)


def test_scratch_is_the_same_memory_as_long_as_it_is_large_enough():
    scratch = Scratch()
    first = scratch.matrix("seen", 4, 3)
    first[:] = 7
    assert scratch.matrix("seen", 4, 3).data_ptr() == first.data_ptr()
    assert scratch.matrix("seen", 2, 3).data_ptr() == first.data_ptr()


def test_scratch_that_was_too_small_is_given_up():
    scratch = Scratch()
    small = scratch.matrix("seen", 2, 3)
    large = scratch.matrix("seen", 200, 3)
    assert large.shape == (200, 3)
    assert scratch.matrix("seen", 2, 3).data_ptr() == large.data_ptr() != small.data_ptr()


def test_scratch_of_other_names_and_dtypes_is_other_memory():
    scratch = Scratch()
    matrices = [
        scratch.matrix("seen", 4, 3),
        scratch.matrix("answer", 4, 3),
        scratch.matrix("seen", 4, 3, torch.bfloat16),
    ]
    assert len({matrix.data_ptr() for matrix in matrices}) == 3
    assert all(torch.isfinite(matrix).all() for matrix in matrices)
