"""Work that survives being cut short: whole files, one process at a time, the same request."""

import errno
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from mcpseg_cli import resumable
from mcpseg_cli.errors import StateError, StateInUseError
from mcpseg_cli.resumable import (
    check_same,
    exclusive,
    remove_abandoned,
    remove_leftovers,
    whole_file,
    whole_folder,
    write_whole,
)


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def run_and_die(*lines: str) -> None:
    """Run lines in another process that then ends without any clearing up."""
    script = "\n".join(["import os", "from pathlib import Path", *lines, "    os._exit(1)"])
    result = subprocess.run([sys.executable, "-c", script], check=False, capture_output=True)
    assert (result.returncode, result.stderr) == (1, b"")


# --- whole files ---


@pytest.mark.parametrize("content", ["grün\n", b"\x00\xff", ""])
def test_a_file_is_written_whole_and_replaced(tmp_path, content):
    for before in ("nothing", "something"):
        if before == "something":
            (tmp_path / "a.txt").write_text("something")
        write_whole(tmp_path / "a.txt", content, is_durable=before == "nothing")
        data = content.encode() if isinstance(content, str) else content
        assert (tmp_path / "a.txt").read_bytes() == data
    assert names_in(tmp_path) == ["a.txt"]


def test_until_it_is_complete_a_file_has_a_hidden_name_with_its_ending(tmp_path):
    with whole_file(tmp_path / "map.ply") as partial:
        partial.write_text("half")
        assert (partial.name[0], partial.suffix) == (".", ".ply")
        assert names_in(tmp_path) == [partial.name]
    assert names_in(tmp_path) == ["map.ply"]


def test_a_failure_leaves_the_file_before(tmp_path):
    def write_half() -> None:
        with whole_file(tmp_path / "a.txt") as partial:
            partial.write_text("half")
            raise KeyboardInterrupt

    write_whole(tmp_path / "a.txt", "before")
    with pytest.raises(KeyboardInterrupt):
        write_half()
    assert (tmp_path / "a.txt").read_text() == "before"
    assert names_in(tmp_path) == ["a.txt"]


def test_errors_name_the_file_not_the_hidden_one(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"missing/a\.txt'$"):
        write_whole(tmp_path / "missing/a.txt", "text")
    (tmp_path / "folder").mkdir()
    with pytest.raises(IsADirectoryError, match=r"folder'$"):
        write_whole(tmp_path / "folder", "text")
    with pytest.raises(OSError, match=r"No space left on device.*a\.txt'$"):  # noqa: SIM117
        with whole_file(tmp_path / "a.txt"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    with pytest.raises(FileNotFoundError, match=r"other\.txt'$"), whole_file(tmp_path / "a.txt"):
        (tmp_path / "other.txt").read_text()


def test_names_of_the_greatest_length_can_be_written(tmp_path):
    name = "é" * 125 + ".ply"
    write_whole(tmp_path / name, "text")
    assert names_in(tmp_path) == [name]


def test_what_a_killed_process_left_of_a_file_goes_with_the_next_write(tmp_path):
    path = f"Path({str(tmp_path)!r}) / 'a.txt'"
    run_and_die(
        "from mcpseg_cli.resumable import whole_file",
        f"with whole_file({path}) as partial:",
        "    partial.write_text('half')",
    )
    (leftover,) = names_in(tmp_path)

    # while this process, too, writes the file
    with whole_file(tmp_path / "a.txt", is_one_of_many=True) as partial:
        partial.write_text("whole")
        assert leftover in names_in(tmp_path)
        write_whole(tmp_path / "b.txt", "another")
        assert leftover not in names_in(tmp_path)
        with ThreadPoolExecutor(1) as thread:  # leaves what a running process writes
            thread.submit(write_whole, tmp_path / "a.txt", "text").result()
        assert names_in(tmp_path) == sorted([partial.name, "a.txt", "b.txt"])


def test_a_process_that_has_the_number_of_a_dead_one_does_not_keep_what_that_left(tmp_path):
    leftover = tmp_path / f".a.{os.getppid()}-1.part.ply"
    for age_s, stays in ((0, True), (400 * 86400, False)):
        leftover.write_text("half")
        os.utime(leftover, (time.time() - age_s, time.time() - age_s))
        remove_abandoned(tmp_path)
        assert leftover.exists() == stays
    remove_abandoned(tmp_path / "missing")


def test_a_file_that_is_to_survive_a_power_cut_is_on_the_disk_before_it_has_its_name(
    tmp_path, monkeypatch
):
    steps = []
    monkeypatch.setattr(resumable, "flush", lambda path: steps.append((path, names_in(tmp_path))))
    write_whole(tmp_path / "a.txt", "text", is_durable=True)
    (content, before), (folder, after) = steps
    assert content.name[0] == "."
    assert (before, folder, after) == ([content.name], tmp_path, ["a.txt"])


def test_a_lock_names_the_process_that_holds_it_and_follows_no_link(tmp_path):
    with (
        exclusive(tmp_path),
        pytest.raises(StateInUseError, match=rf"\(process {os.getpid()}\)"),
        exclusive(tmp_path),
    ):
        pass
    (tmp_path / "users.txt").write_text("keep")
    (tmp_path / ".mcpseg.lock").symlink_to(tmp_path / "users.txt")
    with pytest.raises(OSError, match="symbolic"), exclusive(tmp_path):
        pass
    assert (tmp_path / "users.txt").read_text() == "keep"


def test_leftovers_are_told_from_files_of_the_user(tmp_path):
    users = [".hidden", ".my.part.txt", ".partial", "a.part", "a.1-2.part"]
    for name in [*users, ".map.12-34.part.ply", ".12-34.part.ply", ".a.b.1-2.part"]:
        (tmp_path / name).write_text("")
    remove_leftovers(tmp_path)
    remove_leftovers(tmp_path / "missing")
    assert names_in(tmp_path) == sorted(users)


def test_a_folder_appears_whole_or_not_at_all(tmp_path):
    def fill_half() -> None:
        with whole_folder(tmp_path / "b/room") as partial:
            (partial / "a.txt").write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fill_half()
    assert names_in(tmp_path / "b") == []
    with whole_folder(tmp_path / "b/room") as partial:
        (partial / "a.txt").write_text("whole")
    assert names_in(tmp_path / "b") == ["room"]
    assert names_in(tmp_path / "b/room") == ["a.txt"]


# --- one process at a time ---


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
    run_and_die(
        "from mcpseg_cli.resumable import exclusive", f"with exclusive(Path({str(tmp_path)!r})):"
    )
    assert (tmp_path / ".mcpseg.lock").exists()
    with exclusive(tmp_path), pytest.raises(StateInUseError), exclusive(tmp_path):
        pass
    assert not (tmp_path / ".mcpseg.lock").exists()


# --- the same request ---

KEPT = {"settings": {"seed": 1, "local_range": 2.0}, "classes": ["a"], "weights": "f" * 64}


def refusal(asked: dict, **options) -> str:
    with pytest.raises(StateError) as error:
        check_same(Path("out/run"), KEPT, asked, remedy="start anew", **options)
    return str(error.value)


def test_the_same_request_goes_on_tuples_or_lists():
    check_same(Path("run"), KEPT, KEPT | {"classes": ("a",)}, remedy="start anew")


def test_everything_that_differs_is_told_by_its_option_as_it_was_and_as_it_is():
    asked = KEPT | {"settings": {"seed": 2, "local_range": 1.5}}
    expected = "made with --seed 1, now 2, and --range 2.0, now 1.5; expected the same; start anew"
    assert refusal(asked) == f"out/run: {expected}"


def test_what_is_too_long_to_be_shown_is_only_named():
    assert "made with another class table;" in refusal(
        KEPT | {"classes": ["b"]}, names={"classes": "class table"}
    )
    assert f"made with --weights {'f' * 16}, now {'e' * 16};" in refusal(
        KEPT | {"weights": "e" * 64}
    )
    assert "made with another model;" in refusal(
        KEPT | {"weights": "e" * 64}, names={"weights": "model"}
    )


def test_entries_that_only_one_of_the_two_has_are_told():
    assert "made with --jobs (none), now 3;" in refusal(KEPT | {"jobs": 3})
    assert "made with another classes;" in refusal(
        {name: KEPT[name] for name in ("settings", "weights")}, names={"classes": "classes"}
    )


def test_of_decisive_differences_the_first_is_told_alone():
    asked = KEPT | {"settings": {"seed": 2, "local_range": 1.5}, "offline": True}
    assert "made with --offline (none), now True;" in refusal(
        asked, decisive=("method", "offline", "seed")
    )
