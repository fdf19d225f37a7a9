"""What files claim to hold, compared with their size before room is made for it."""

from __future__ import annotations

from pathlib import Path

from mcpseg_cli.errors import InputError

MOST_TIMES = 64
"""How many times its bytes a file may unpack to, beside ``SPARE``."""
SPARE = 64 << 20
"""Bytes that any file may unpack to."""


def check_claim(path: Path, what: str, num_bytes: int, *, packed: int | None = None) -> None:
    """Refuse what would take far more room than it has bytes; sound scans pack at most tenfold.

    Args:
        path: The file.
        what: What makes the claim, for the message.
        num_bytes: What it would take unpacked.
        packed: Bytes of that part of the file; None: of all of it.

    Raises:
        InputError: More than ``MOST_TIMES`` the bytes and ``SPARE``.
        OSError: The file is gone.
    """
    size = path.stat().st_size if packed is None else packed
    most = MOST_TIMES * size + SPARE
    if num_bytes > most or num_bytes < 0:
        found = f"{what} promises {num_bytes:,} bytes in {size:,}"
        raise InputError(path, found, f"at most {most:,}", "the file is damaged; save it again")
