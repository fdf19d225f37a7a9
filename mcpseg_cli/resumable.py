"""Work that survives being cut short: whole files, one process a folder, the same request."""

import json
import os
import re
import shutil
import threading
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from mcpseg_cli.config import option_of
from mcpseg_cli.errors import StateError, StateInUseError

_LONG, _FIRST = 30, 16  # letters of values in messages
_PARTIAL = ".part"
_STEM = 40  # letters of a name that are kept in the hidden one: names may have 255 bytes
_STARTTIME = 19  # in /proc/PID/stat, behind the name: clock ticks since the machine started
_CLOCK_S = 5.0  # seconds that the clocks of files and processes may differ
_LOCK_S = 0.1  # a process that is about to end lets go within this time
_LEFTOVER = re.compile(rf"\.(?:.*\.)?(?P<pid>\d+)-\d+\{_PARTIAL}(?:\.[^.]+)?")


def printable(text: str) -> str:
    r"""Write what is no UTF-8 in paths and arguments as ``\xff``, so that it can be encoded."""
    return text.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


def check_file_name(name: str) -> str:
    """Return a name, see ``is_file_name``.

    Raises:
        ValueError: It is none.
    """
    if not is_file_name(name):
        raise ValueError("a name that leads elsewhere")
    return name


def guarded_cell(text: str) -> str:
    """Write text for a cell of a CSV file that spreadsheets do not take for a formula."""
    return f"'{text}" if text[:1] in ("=", "+", "-", "@", "\t", "\r") else text


def is_file_name(name: str) -> bool:
    """Tell whether a name, joined to a folder, is a file in that folder or below it.

    Folders in it are parted by slashes.
    """
    return "\0" not in name and not set(name.split("/")) & {"", ".", ".."}


def write_whole(path: Path, content: str | bytes, *, is_durable: bool = False) -> None:
    """Write a file; it appears under its name only when complete.

    Args:
        path: The file; its folder must exist; replaced if there.
        content: What to write; text as UTF-8.
        is_durable: Wait until it is on the disk, under its name.

    Raises:
        OSError: The disk is full or the folder not writable; nothing is left behind.
    """
    data = content.encode("utf-8") if isinstance(content, str) else content
    with whole_file(path, is_durable=is_durable) as partial:
        partial.write_bytes(data)


@contextmanager
def whole_file(
    path: Path, *, is_one_of_many: bool = False, is_durable: bool = False
) -> Iterator[Path]:
    """Have a file written under another name; it gets its own when the block ends well.

    Args:
        path: The file; its folder must exist; replaced if there.
        is_one_of_many: Do not search the folder for what killed processes left: in a folder of
            thousands that takes its time, and ``remove_abandoned`` does it once.
        is_durable: Wait until it is on the disk, before it gets its name and after.

    Yields:
        The name to write to: hidden, in the same folder, with the same ending.

    Raises:
        OSError: As the block raises it, but naming ``path``; nothing is left behind.
    """
    if not is_one_of_many:
        remove_abandoned(path.parent)

    # a name of this thread's own: others may write the same file
    writer = f"{os.getpid()}-{threading.get_ident()}"
    partial = path.with_name(f".{path.stem[:_STEM]}.{writer}{_PARTIAL}{path.suffix}")

    try:
        yield partial
        if is_durable:
            flush(partial)
        partial.replace(path)
        if is_durable:
            flush(path.parent)
    except OSError as error:
        if error.errno is None or error.filename not in (None, str(partial)):
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        partial.unlink(missing_ok=True)


def flush(path: Path) -> None:
    """Wait until a file's content, or the names in a folder, are on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Have a folder filled under another name; it gets its own when the block ends well.

    Args:
        path: The folder, not there yet; its parents are made.

    Yields:
        The folder to fill, hidden beside it; what an earlier attempt left there is deleted.
    """
    partial = partial_folder(path)
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir(parents=True)
    try:
        yield partial
        partial.rename(path)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def partial_folder(path: Path) -> Path:
    """Return the name under which ``whole_folder`` has a folder filled."""
    return path.with_name(f".{path.name}{_PARTIAL}")


def is_leftover(name: str) -> bool:
    """Tell whether a file is named as an incomplete one of this program."""
    return _LEFTOVER.fullmatch(name) is not None


def remove_leftovers(folder: Path) -> None:
    """Delete the files that killed processes left incomplete.

    Args:
        folder: Held by the caller, so that no other process is writing there; need not exist.
    """
    for path in folder.glob(f".*{_PARTIAL}*"):
        if _LEFTOVER.fullmatch(path.name):
            path.unlink(missing_ok=True)


def remove_abandoned(folder: Path) -> None:
    """Delete the incomplete files of processes that have ended; others may be writing there now.

    Args:
        folder: Need not exist.
    """
    for leftover in folder.glob(f".*{_PARTIAL}*"):
        found = _LEFTOVER.fullmatch(leftover.name)
        if found and not _may_be_writing(int(found["pid"]), leftover):
            leftover.unlink(missing_ok=True)


def _may_be_writing(pid: int, file: Path) -> bool:
    """Tell whether a process is there, and was when the file was last written."""
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass  # another user's

    # another process may have got the number since
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        uptime = float(Path("/proc/uptime").read_text().split()[0])
        age = uptime - int(fields[_STARTTIME]) / os.sysconf("SC_CLK_TCK")
        return file.stat().st_mtime > time.time() - age - _CLOCK_S
    except OSError:
        return True


@contextmanager
def exclusive(folder: Path, name: str = ".mcpseg.lock") -> Iterator[None]:
    """Hold a folder, or what a name stands for in it, against every other mcpseg process.

    Args:
        folder: Made if not there.
        name: A file that is there as long as it is held, with the number of the process; the lock
            ends with the process, however that ends.

    Raises:
        StateInUseError: Another process holds it.
        OSError: The folder cannot be made or written.
    """
    from filelock import FileLock, Timeout

    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    lock = FileLock(path, timeout=_LOCK_S, poll_interval=_LOCK_S / 4)
    try:
        lock.acquire()
    except Timeout as error:
        raise StateInUseError(
            f"{folder}: another mcpseg is writing there{_holder(path)}; expected to be the only "
            "one; wait for it or name another"
        ) from error
    try:
        path.write_text(f"{os.getpid()}\n")
        yield
    finally:
        path.unlink(missing_ok=True)  # while held: who opened it before sees that it is gone
        lock.release()


def _holder(path: Path) -> str:
    """Name the process that holds a lock, as far as the file says."""
    try:
        text = path.read_text(errors="replace").strip()
    except OSError:
        return ""
    return f" (process {text})" if text.isascii() and text.isdigit() and len(text) < 12 else ""


def check_same(
    path: Path,
    kept: Mapping[str, object],
    asked: Mapping[str, object],
    *,
    remedy: str,
    names: Mapping[str, str] | None = None,
    decisive: Sequence[str] = (),
) -> None:
    """Refuse to go on with what was begun at another request.

    Args:
        path: Where the earlier request is kept.
        kept: The earlier request, as read from JSON; settings may be in groups.
        asked: The present one.
        remedy: What the user can do, beside asking for the same.
        names: What to call an entry that is not named by the option of its setting.
        decisive: Entries from which differences in others follow: only the first of these that
            differs is told.

    Raises:
        StateError: Something differs; says what, as it was and as it is now.
    """
    asked = json.loads(json.dumps(asked))  # tuples as lists, as in the file
    changed = _differences(kept, asked, names or {})
    if not changed:
        return

    first = next(([name] for name in decisive if name in changed), list(changed))
    told = [_tell(name, (names or {}).get(name), *changed[name]) for name in first]
    raise StateError(f"{path}: made with {', and '.join(told)}; expected the same; {remedy}")


def _differences(
    kept: Mapping[str, object], asked: Mapping[str, object], named: Collection[str]
) -> dict[str, tuple[object, object]]:
    """Collect what differs: before and now by name; of groups without a name, one by one."""
    changed: dict[str, tuple[object, object]] = {}
    for name in [*asked, *(name for name in kept if name not in asked)]:
        before, now = kept.get(name), asked.get(name)
        if isinstance(before, dict) and isinstance(now, dict) and name not in named:
            changed |= _differences(before, now, named)
        elif before != now:
            changed[name] = before, now
    return changed


def _tell(name: str, called: str | None, before: object, now: object) -> str:
    """Say how one entry differs, before and now, unless the values are too long to say anything."""
    called = called or option_of(name)
    is_table = isinstance(before, list | dict) or isinstance(now, list | dict)
    is_long = max(len(str(before)), len(str(now))) > _LONG
    if is_table or (is_long and not called.startswith("--")):
        return f"another {called}"

    values = ["(none)" if value is None else str(value) for value in (before, now)]
    if is_long:  # hashes are known by their first letters
        values = [value[:_FIRST] for value in values]
    return f"{called} {values[0]}, now {values[1]}"
