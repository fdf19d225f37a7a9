"""Meshes and IFC that are damaged, or lie: a line, in bounded memory."""

import struct
import zlib
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import mesh_building
from mcpseg_cli.formats.buildings import read_building
from mcpseg_cli.formats.ifc import read_ifc
from mcpseg_cli.formats.mesh_building import MeshOptions
from mcpseg_cli.formats.meshes import read_mesh
from tests.formats.test_meshes import write_ifc
from tests.houses import write_glb

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")
OPTIONS = MeshOptions(up="z", scale=1.0, voxel_size=0.4)
BOX = trimesh.creation.box(extents=(4.0, 3.0, 2.5))


def textured(path: Path, picture: Image.Image) -> Path:
    mesh = BOX.copy()
    mesh.visual = trimesh.visual.TextureVisuals(uv=mesh.vertices[:, :2] % 1.0, image=picture)
    mesh.export(path)
    return path


def png_of(width: int, height: int) -> bytes:
    """A PNG of a few bytes that claims to be so large."""
    head = struct.pack(">II5B", width, height, 8, 2, 0, 0, 0)
    chunks = [(b"IHDR", head), (b"IDAT", zlib.compress(bytes(99))), (b"IEND", b"")]
    data = b"\x89PNG\r\n\x1a\n"
    for name, content in chunks:
        crc = struct.pack(">I", zlib.crc32(name + content))
        data += struct.pack(">I", len(content)) + name + content + crc
    return data


@pytest.mark.parametrize("word", ["1e999", "nan", "-1e300"])
def test_corners_that_are_no_numbers_are_refused(word, tmp_path):
    path = tmp_path / "house.obj"
    path.write_text(f"v 0 0 0\nv 4 0 0\nv 0 {word} 0\nv 0 0 2.5\nf 1 2 3\nf 1 2 4\n")
    with pytest.raises(InputError, match=r"house\.obj: .*; expected"):
        read_building(path, mesh=OPTIONS)


@pytest.mark.parametrize("bits", [0x7FA00000, 0x7FC00000, 0x7F800000, 0xFF800000, 0x7F7FFFFF])
def test_corners_of_glb_that_are_no_numbers_of_any_kind_are_refused(bits, tmp_path):
    path = tmp_path / "house.glb"
    path.write_bytes(BOX.export(file_type="glb"))
    data = path.read_bytes()
    path.write_bytes(data.replace(struct.pack("<f", 1.25), struct.pack("<I", bits), 1))
    assert path.read_bytes() != data
    with pytest.raises(InputError, match=r"house\.glb: .*; expected"):
        read_building(path, mesh=OPTIONS)


def test_corners_of_two_numbers_are_refused(tmp_path):
    path = tmp_path / "house.obj"
    path.write_text("v 0 0\nv 4 0\nv 0 3\nf 1 2 3\n")
    with pytest.raises(InputError, match=r"house\.obj: .*; expected"):
        read_building(path, mesh=OPTIONS)


@pytest.mark.parametrize("kept", [0.1, 0.5, 0.9])
def test_a_picture_that_is_cut_short_is_refused(kept, tmp_path):
    rng = np.random.default_rng(0)
    path = textured(
        tmp_path / "house.gltf", Image.fromarray(rng.integers(0, 256, (64, 64, 3)).astype(np.uint8))
    )
    (largest,) = sorted(tmp_path.glob("*.bin"), key=lambda one: one.stat().st_size)[-1:]
    data = bytearray(largest.read_bytes())
    assert data[1:4] == b"PNG"
    start = int(kept * len(data))
    data[start : start + 40] = bytes(40)
    largest.write_bytes(data)
    with pytest.raises(InputError, match=r"house\.gltf: no mesh: .*; expected GLB"):
        read_mesh(path)


@pytest.mark.parametrize("side", [10_000, 30_000, 60_000])
def test_a_picture_that_claims_to_be_huge_is_left_out(side, tmp_path):
    path = textured(tmp_path / "house.obj", Image.new("RGB", (4, 4)))
    (picture,) = tmp_path.glob("*.png")
    picture.write_bytes(png_of(side, side))
    assert read_mesh(path)[0].picture is None


def test_points_are_the_same_whatever_is_placed_at_once(tmp_path, monkeypatch):
    path = textured(
        tmp_path / "house.glb", Image.fromarray(np.arange(48, dtype="u1").reshape(4, 4, 3))
    )
    whole, _ = read_building(path, mesh=OPTIONS)
    monkeypatch.setattr(mesh_building, "_BLOCK", 7)
    again, _ = read_building(path, mesh=OPTIONS)
    for name in ("xyz", "rgb", "semantic", "instance"):
        np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))


def test_more_points_than_memory_holds_are_refused(tmp_path):
    path = write_glb(tmp_path / "house.glb")
    finest = MeshOptions(voxel_size=0.0005)
    with pytest.raises(InputError, match=r"square metres of surface; expected at most"):
        read_building(path, mesh=finest)


# --- IFC ---


@pytest.mark.parametrize(
    ("does", "found"),
    [
        ("import os; os.abort()", r"ifcopenshell ends at it \(status -6\)"),
        ("import ctypes; ctypes.string_at(0)", r"ifcopenshell ends at it \(status -11\)"),
        ("raise RuntimeError('two\\nlines')", "no IFC: two lines"),
        ("raise NotImplementedError", "no IFC: NotImplementedError"),
        ("bytearray(1 << 44)", "no IFC: MemoryError"),
        ("print('chatter'); raise ValueError('odd')", "no IFC: odd"),
        ("import os; os._exit(0)", "no IFC: "),
    ],
)
def test_an_ifc_that_ends_its_reader_is_refused_in_one_line(does, found, tmp_path, monkeypatch):
    pytest.importorskip("ifcopenshell")
    fake = tmp_path / "library/ifcopenshell"
    fake.mkdir(parents=True)
    (fake / "__init__.py").write_text("def open(path):\n    from . import geom\n    " + does + "\n")
    (fake / "geom.py").touch()
    path = tmp_path / "house.ifc"
    path.write_text("ISO-10303-21;\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "library"))
    with pytest.raises(InputError, match=found):
        read_ifc(path)


@pytest.mark.parametrize("old", ["IFC4", "IFCSLAB(", "#1=", "0."])
def test_a_damaged_ifc_is_read_or_refused_in_one_line(old, tmp_path):
    pytest.importorskip("ifcopenshell")
    path = write_ifc(tmp_path / "house.ifc")
    data = path.read_bytes()
    path.write_bytes(data.replace(old.encode(), old.encode() + b"9" * 5000, 1))
    with suppress(InputError):
        read_building(path, mesh=OPTIONS)


@pytest.mark.parametrize("numbers", [1, 3])
def test_places_in_a_picture_of_other_than_two_numbers_break_nothing(numbers, tmp_path):
    path = textured(tmp_path / "house.obj", Image.new("RGB", (4, 4), (200, 10, 10)))
    lines = path.read_text().splitlines()
    assert any(line.startswith("vt ") for line in lines)
    path.write_text("\n".join(
        " ".join([*line.split()[:3], "0"][: 1 + numbers]) if line.startswith("vt ") else line
        for line in lines
    ))  # fmt: skip
    building, _ = read_building(path, mesh=OPTIONS)
    assert len(building.xyz) > 100
