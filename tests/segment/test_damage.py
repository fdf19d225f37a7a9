"""A checkpoint of which a bit has changed: what is read is what was written, or it is refused."""

import random
import re
import sqlite3
from collections.abc import Iterator

import numpy as np
import pytest

from mcpseg_cli.errors import StateError
from mcpseg_cli.segment.checkpoint import State
from mcpseg_cli.segment.database import Database, row_checksum
from tests.bit_flips import flips_that_pass

_FLIPS = 300
_SCHEMA = "CREATE TABLE t (key INTEGER PRIMARY KEY, a TEXT, b REAL, checksum INTEGER) STRICT;"


def test_a_flipped_bit_anywhere_is_refused_or_changes_nothing(labelled_run, tmp_path):
    path = labelled_run.out / "state.sqlite"
    rng = random.Random(0)
    bits = (rng.randrange(8 * path.stat().st_size) for _ in range(_FLIPS))
    assert flips_that_pass(path, tmp_path / "state.sqlite", bits) == []


def test_no_flipped_bit_of_the_types_of_a_scan_s_columns_changes_it(labelled_run, tmp_path):
    path = labelled_run.out / "state.sqlite"
    places = [found.start() for found in re.finditer(rb"000001\.ply", path.read_bytes())]
    bits = (bit for place in places for bit in range(8 * (place - 24), 8 * place))
    assert flips_that_pass(path, tmp_path / "state.sqlite", bits) == []


def test_a_flipped_bit_of_a_table_s_statement_is_one_line(labelled_run, tmp_path):
    path = labelled_run.out / "state.sqlite"
    place = path.read_bytes().index(b"CREATE TABLE outputs (\n")
    bits = range(8 * (place + 7), 8 * (place + 23))
    assert flips_that_pass(path, tmp_path / "state.sqlite", bits) == []


def test_no_flipped_bit_of_an_output_s_row_hides_it(labelled_run, tmp_path):
    path = labelled_run.out / "state.sqlite"
    place = path.read_bytes().rindex(b"objects.json")
    bits = range(8 * (place - 8), 8 * (place + 100))
    assert flips_that_pass(path, tmp_path / "state.sqlite", bits) == []


def test_another_type_or_another_place_of_the_same_bytes_is_another_row():
    rows = [
        ("t", (None,)), ("t", (0,)), ("t", (0.0,)), ("t", ("",)), ("t", (b"",)), ("u", (None,)),
        ("t", ("ab", "c")), ("t", ("a", "bc")), ("t", (b"ab", "c")), ("t", ()), ("t", (None, None)),
    ]  # fmt: skip
    assert len({row_checksum(table, values) for table, values in rows}) == len(rows)


def test_arrays_and_bytes_of_a_row_are_one():
    array = np.arange(6, dtype=np.float32).reshape(2, 3)
    assert row_checksum("t", (array.data,)) == row_checksum("t", (array.tobytes(),))


def test_what_no_column_holds_is_a_mistake_of_the_program():
    with pytest.raises(TypeError, match="int64"):
        row_checksum("t", (np.int64(1),))


@pytest.fixture
def database(tmp_path) -> Iterator[Database]:
    found = Database(tmp_path / "d.sqlite", _SCHEMA, 1, tmp_path / "d.sqlite")
    yield found
    found.close()


@pytest.mark.parametrize("value", ["NULL", "'other'", "CAST(x'ff' AS TEXT)", "''"])
def test_a_row_that_was_changed_is_refused(database, value):
    with database.transaction():
        database.insert("t", 1, "one", 1.0)
        database.insert("t", 2, "ünd", None)
    assert list(database.rows("t")) == [(1, "one", 1.0), (2, "ünd", None)]
    database.connection.execute(f"UPDATE t SET a = {value} WHERE key = 2")
    assert list(database.rows("t", "key < ?", (2,))) == [(1, "one", 1.0)]
    with pytest.raises(StateError, match="a row of t"):
        list(database.rows("t"))


@pytest.mark.parametrize(
    "statement",
    ["CREATE TABLE other (a)", "CREATE TRIGGER x AFTER INSERT ON t BEGIN SELECT 1; END",
     "ALTER TABLE t ADD COLUMN c TEXT", "CREATE VIEW v AS SELECT 1"],
)  # fmt: skip
def test_tables_that_are_not_ours_are_refused(database, statement, tmp_path):
    database.close()
    with sqlite3.connect(tmp_path / "d.sqlite") as connection:
        connection.execute(statement)
    connection.close()
    with pytest.raises(StateError, match="tables are not those of this version"):
        Database(tmp_path / "d.sqlite", _SCHEMA, 1, tmp_path / "d.sqlite")


def test_names_that_lead_out_of_the_folder_are_refused(labelled_run, tmp_path):
    copy = tmp_path / "state.sqlite"
    copy.write_bytes((labelled_run.out / "state.sqlite").read_bytes())
    with State(copy) as state, state._database.transaction():
        (row,) = state._database.rows("scans", "number = 1")
        state._database.insert("scans", 1, "../../x.ply", *row[2:], replace=True)
    with State(copy) as state, pytest.raises(StateError, match="damaged"):
        state.scans()
