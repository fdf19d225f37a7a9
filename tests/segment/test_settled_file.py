"""Files that change while they are read: read again, or refused; never another than was hashed."""

import hashlib
import os

import pytest

from mcpseg_cli.errors import InputError
from mcpseg_cli.segment import settled_file as module
from mcpseg_cli.segment.settled_file import read_settled


@pytest.fixture(autouse=True)
def _no_waiting(monkeypatch):
    monkeypatch.setattr(module, "sleep", lambda seconds: None)


def recorder(path, contents, *, keep_time=False):
    """Make a reader during which a recorder writes: the first contents before, the rest after."""
    waiting = iter(contents)
    path.write_bytes(next(waiting))

    def read():
        found = path.read_bytes()
        if (content := next(waiting, None)) is not None:
            times = path.stat()
            path.write_bytes(content)
            if keep_time:
                os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
        if not found.endswith(b"."):
            raise InputError(path, "cut short", "a whole file", "copy it again")
        return found

    return read


@pytest.mark.parametrize("keep_time", [False, True])
@pytest.mark.parametrize("first", [b"half", b"older."])
def test_a_file_replaced_while_it_is_read_is_read_again(tmp_path, first, keep_time):
    path = tmp_path / "scan"
    file, found = read_settled(path, recorder(path, [first, b"whole."], keep_time=keep_time))
    assert (found, file.size) == (b"whole.", 6)
    assert file.sha256 == hashlib.sha256(b"whole.").hexdigest()
    assert file.matches(path)


def test_a_file_that_is_cut_and_stays_so_is_what_its_reader_says(tmp_path):
    path = tmp_path / "scan"
    with pytest.raises(InputError, match="cut short"):
        read_settled(path, recorder(path, [b"half"]))


def test_a_file_that_never_rests_is_one_line(tmp_path):
    path = tmp_path / "scan"
    with pytest.raises(InputError, match="changes while it is read"):
        read_settled(path, recorder(path, [b"%d." % number for number in range(9)]))


def test_a_scan_replaced_meanwhile_is_labelled_as_it_is_then_and_the_run_goes_on(
    recording, tmp_path, weights_path, monkeypatch
):
    from mcpseg_cli.formats import read_cloud
    from mcpseg_cli.segment.run import SegmentRun
    from tests.commands import segment

    scan = recording[0] / "000002.ply"
    whole, read = scan.read_bytes(), SegmentRun._read_points
    scan.write_bytes((recording[0] / "000001.ply").read_bytes())

    def read_then_replace(self, source):
        found = read(self, source)
        if source.path == scan and scan.read_bytes() != whole:
            scan.write_bytes(whole)
        return found

    monkeypatch.setattr(SegmentRun, "_read_points", read_then_replace)
    assert segment(recording, tmp_path / "out", "-w", weights_path).exit_code == 0
    monkeypatch.undo()
    labelled = read_cloud(tmp_path / "out/scans/000002.ply")
    assert (labelled.xyz == read_cloud(scan).xyz).all()
    again = segment(recording, tmp_path / "out", "-w", weights_path)
    assert (again.exit_code, "nothing new" in again.stderr) == (0, True)
