"""Text files that are there whole or not at all."""

import os
from pathlib import Path

from mcpseg_cli.errors import naming


def printable(text: str) -> str:
    r"""Write bytes of paths and arguments that are no UTF-8 as ``\xff``, so that the text can be encoded."""
    return text.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


def write_whole(path: Path, text: str) -> None:
    """Write a text file; it appears under its name only when complete.

    Args:
        path: The file; its folder must exist; replaced if there.
        text: What to write.

    Raises:
        OSError: The disk is full or the folder not writable; nothing is left under ``path``'s name.
    """
    partial = path.with_name(f".{os.getpid()}.part.{path.name}")
    try:
        with naming(path):
            partial.write_text(text, encoding="utf-8")
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
    partial.replace(path)
