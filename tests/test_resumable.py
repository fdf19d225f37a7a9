"""One process at a time in a folder."""

import subprocess
import sys

import pytest

from mcpseg_cli.errors import StateInUseError
from mcpseg_cli.resumable import exclusive


def test_a_held_folder_is_refused_and_free_again_afterwards(tmp_path):
    with exclusive(tmp_path / "out"), pytest.raises(StateInUseError), exclusive(tmp_path / "out"):
        pass
    with exclusive(tmp_path / "out"):
        assert (tmp_path / "out/.mcpseg.lock").exists()
    assert list((tmp_path / "out").iterdir()) == []


def test_names_in_one_folder_do_not_hinder_each_other(tmp_path):
    with exclusive(tmp_path, "a.lock"), exclusive(tmp_path, "b.lock"):
        assert {path.name for path in tmp_path.iterdir()} == {"a.lock", "b.lock"}


def test_a_file_that_a_killed_process_left_does_not_lock(tmp_path):
    lines = ("import os", "from pathlib import Path", "from mcpseg_cli.lock import exclusive")
    script = "\n".join([*lines, f"with exclusive(Path({str(tmp_path)!r})):", "    os._exit(1)"])
    subprocess.run([sys.executable, "-c", script], check=False)
    assert (tmp_path / ".mcpseg.lock").exists()
    with exclusive(tmp_path), pytest.raises(StateInUseError), exclusive(tmp_path):
        pass
    assert not (tmp_path / ".mcpseg.lock").exists()
