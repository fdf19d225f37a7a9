"""Poses of pose graphs and of COLMAP: g2o's vertices, ``images.txt``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.pose_files.matrices import Lost, from_quaternions
from mcpseg_cli.formats.pose_files.text import to_number
from mcpseg_cli.formats.poses import Poses

_VERTEX = "VERTEX_SE3:QUAT"
_IMAGE_WORDS = 10
_MOST_ID = 1 << 53  # whole numbers above are not all told apart


def is_g2o(data: Sequence[tuple[int, str]]) -> bool:
    """Tell a pose graph of g2o by its first words."""
    return any(line.startswith(("VERTEX_SE", "EDGE_SE")) for _, line in data[:100])


def read_g2o(path: Path, data: Sequence[tuple[int, str]]) -> Poses:
    """Read the vertices of a pose graph; edges and parameters are passed over.

    Raises:
        InputError: None is a pose in space, or one does not have its nine words.
    """
    vertices = [(number, line.split()) for number, line in data if line.startswith(_VERTEX)]
    if not vertices:
        raise InputError(path, "a pose graph without poses", _VERTEX, "export it in 3D")
    rows = [_floats(path, number, words[1:], 8) for number, words in vertices]
    for (number, words), row in zip(vertices, rows, strict=True):
        if row[0] != np.floor(row[0]) or abs(row[0]) > _MOST_ID:
            found = f"a vertex numbered {words[1][:40]} in line {number}"
            raise InputError(path, found, "whole numbers", "export it again")
    values, lost = np.array(rows), Lost()
    lines = [number for number, _ in vertices]
    poses = from_quaternions(path, lines, values[:, 1:4], values[:, 4:8], lost)
    ids = values[:, 0].astype(np.int64)
    return Poses(poses, ids=ids, lost=lost, columns="g2o: id x y z qx qy qz qw")


def is_colmap(comments: Sequence[tuple[int, str]], data: Sequence[tuple[int, str]]) -> bool:
    """Tell COLMAP's images by its comment, or by ten words that end in a picture's name."""
    if any("IMAGE_ID" in text and "QW" in text for _, text in comments):
        return True
    words = data[0][1].split()
    pictures = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp")
    is_image = len(words) >= _IMAGE_WORDS and words[-1].lower().endswith(pictures)
    return is_image and all(to_number(word) is not None for word in words[:9])


def read_colmap(path: Path, text: str) -> Poses:
    """Read ``images.txt``: two lines an image, the world in the camera's frame, turned around.

    Raises:
        InputError: A line is no image.
    """
    # the second line of an image may be empty
    lines = [line.strip() for line in text.splitlines()]
    numbered = [(n, line) for n, line in enumerate(lines, start=1) if not line.startswith("#")]
    while numbered and not numbered[0][1]:
        numbered.pop(0)
    images = [(n, line.split(maxsplit=9)) for n, line in numbered[::2] if line]
    short = next((n for n, words in images if len(words) != _IMAGE_WORDS), None)
    if short is not None:
        expected = "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME and a line of points"
        raise InputError(path, f"line {short} is no image", expected, "export the model again")

    # world to camera, and back
    values = np.array([_floats(path, n, words[1:8], 7) for n, words in images])
    lost = Lost()
    numbers = [n for n, _ in images]
    inverse = from_quaternions(path, numbers, values[:, 4:7], values[:, [1, 2, 3, 0]], lost)
    rotation = inverse[:, :3, :3].transpose(0, 2, 1)
    poses = inverse.copy()
    poses[:, :3, :3] = rotation
    poses[:, :3, 3] = -(rotation @ inverse[:, :3, 3:])[:, :, 0]
    names = tuple(words[9] for _, words in images)
    told = "COLMAP: QW QX QY QZ TX TY TZ of the world, turned into poses of the camera"
    return Poses(poses, names, lost=lost, columns=told)


def _floats(path: Path, number: int, words: Sequence[str], count: int) -> list[float]:
    """Read so many finite numbers of a line."""
    numbers = [to_number(word) for word in words[:count]]
    wrong = ""
    for word, x in zip(words, numbers, strict=False):
        wrong = word if x is None or not np.isfinite(x) else wrong
    if len(numbers) < count or wrong:
        found = f"{wrong[:40]!r} in line {number}" if wrong else f"line {number} is cut short"
        raise InputError(path, found, f"{count} numbers", "export it again")
    return [x for x in numbers if x is not None]
