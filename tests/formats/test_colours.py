"""Colours are found under any usual name, in any shape, and their unit is told once."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import Cloud, read_cloud
from mcpseg_cli.formats.colours import as_bytes, decide_unit, find_colour
from mcpseg_cli.scan import GREY

RGB = np.array([[0, 10, 20], [128, 129, 130], [255, 254, 253]], np.uint8)
PACKED = (RGB.astype(np.uint32) << np.array([16, 8, 0], np.uint32)).sum(axis=1).astype(np.uint32)
WITH_ALPHA = np.column_stack([RGB, np.full(3, 255, np.uint8)])


def channels(*names: str, of: np.ndarray = RGB) -> dict[str, np.ndarray]:
    return {name: of[:, place] for place, name in enumerate(names)}


def cloud_of(columns: dict[str, np.ndarray]) -> Cloud:
    return Cloud({axis: np.zeros(3, np.float32) for axis in "xyz"} | columns)


@pytest.mark.parametrize(
    "columns",
    [
        channels("red", "green", "blue"),
        channels("Red", "Green", "Blue"),
        channels("r", "g", "b"),
        channels("R", "G", "B"),
        channels("diffuse_red", "diffuse_green", "diffuse_blue"),
        channels("scalar_R", "scalar_G", "scalar_B", of=RGB.astype(np.float32)),
        channels("scalar_red", "scalar_green", "scalar_blue", of=RGB.astype(np.float32)),
        channels("vertex_red", "vertex_green", "vertex_blue"),
        channels("colorRed", "colorGreen", "colorBlue"),
        channels("Rf", "Gf", "Bf", of=(RGB / 255).astype(np.float32)),
        channels("rgb_0", "rgb_1", "rgb_2"),
        channels("f_dc_0", "f_dc_1", "f_dc_2", of=(RGB / 255 - 0.5) / 0.28209479177387814),
        {"rgb": RGB},
        {"RGB": WITH_ALPHA},
        {"rgba": WITH_ALPHA},
        {"colors": RGB / 255},
        {"colour": RGB.astype(np.uint16) * 257},
        {"color": RGB.astype(np.uint16) * 256},
        {"bgr": RGB[:, ::-1]},
        {"rgb": PACKED},
        {"rgb": PACKED.view(np.float32)},
        {"rgb": PACKED.view(np.float32).astype(np.float64)},
        {"rgb": PACKED.astype(np.float64)},
        {"rgba": PACKED | np.uint32(0xFF000000)},
        {"rgb": PACKED.astype(np.int64)},
    ],
    ids=lambda columns: "-".join(f"{name}:{part.dtype}" for name, part in columns.items()),
)
def test_every_way_of_writing_colours_gives_the_same(columns):
    np.testing.assert_array_equal(cloud_of(columns).rgb, RGB)


@pytest.mark.parametrize(
    "columns",
    [channels("nx", "ny", "nz"), {"intensity": RGB[:, 0]}, channels("r", "g", "range")],
    ids=lambda columns: "-".join(columns),
)
def test_other_attributes_are_no_colours(columns):
    assert find_colour(columns) is None


def test_bytes_and_their_16_bit_forms_and_shares_are_the_same_colours():
    for values in (RGB, RGB.astype(np.uint16) * 257, RGB.astype(np.int32) * 256, RGB / 255.0):
        np.testing.assert_array_equal(as_bytes(values, decide_unit([values])), RGB)


@given(st.floats(1.0, 10.0), st.integers(1, 8))
def test_a_few_shares_above_1_leave_the_others_shares(top, count):
    values = np.linspace(0, 1, 3000).reshape(-1, 3)
    values[:count, 0] = top
    assert decide_unit([values]) == "0-1"
    assert as_bytes(values, "0-1")[-1].tolist() == [255, 255, 255]
    assert as_bytes(values, "0-1")[0].tolist() == [255, 0, 0]


def test_a_dark_scan_has_the_unit_of_its_recording():
    dark, light = np.full((9, 3), 200, np.uint16), np.full((9, 3), 40_000, np.uint16)
    assert decide_unit([dark]) == "8-bit"
    assert decide_unit([dark, light]) == "16-bit"
    assert as_bytes(dark, "16-bit").max() == 0
    assert as_bytes(dark, None).max() == 200
    assert decide_unit([np.zeros((9, 3), np.uint16)]) is None


def test_dark_floats_of_0_to_255_are_no_shares():
    values = np.zeros((1000, 3))
    values[:5] = 200.0
    assert decide_unit([values]) == "8-bit"


def test_points_without_colour_are_grey():
    values = np.array([[np.nan, 0.5, 0.5], [1.0, 0.0, 1.0]], np.float32)
    assert as_bytes(values, "0-1").tolist() == [[128, 128, 128], [255, 0, 255]]


def test_colours_that_are_0_everywhere_are_none():
    black = cloud_of(channels("red", "green", "blue", of=np.zeros((3, 3), np.uint16)))
    assert black.colour(None, Path("a.las")) is None
    assert black.rgb.max() == 0  # as a file to write it has them


@pytest.mark.parametrize(
    ("values", "unit"),
    [(np.full((3, 3), 40_000, np.uint16), "8-bit"), (np.full((3, 3), 200.0), "0-1")],
)
def test_colours_that_contradict_the_recording_are_refused(values, unit):
    cloud = cloud_of(channels("red", "green", "blue", of=values))
    with pytest.raises(InputError, match=rf"a\.las: colours up to .* expected {unit} colours"):
        cloud.colour(unit, Path("a.las"))


def test_arrays_of_coordinates_under_other_names_are_read(tmp_path):
    xyz = np.arange(9, dtype=np.float32).reshape(3, 3)
    for arrays in ({"points": xyz}, {"coords": xyz}, dict(zip("XYZ", xyz.T, strict=True))):
        np.savez(tmp_path / "a.npz", colors=RGB, **arrays)
        cloud = read_cloud(tmp_path / "a.npz")
        np.testing.assert_array_equal(cloud.xyz, xyz)
        np.testing.assert_array_equal(cloud.rgb, RGB)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("names", [("red", "green", "blue"), ("f_dc_0", "f_dc_1", "f_dc_2")])
@pytest.mark.parametrize("bits", [0x7FA00000, 0x7FC00000])
def test_colours_that_are_no_number_of_any_kind_are_grey(bits, names):
    shares = np.full((3, 3), 0.25, np.float32)
    shares.view(np.uint32)[1, 2] = bits
    columns = {name: shares[:, place] for place, name in enumerate(names)}
    cloud = Cloud({axis: np.zeros(3) for axis in "xyz"} | columns)
    rgb = cloud.colour(None, Path("a.ply"))
    assert (rgb[1] == GREY).all()
    assert (rgb[0] == rgb[2]).all()
    wide = Cloud({axis: np.zeros(3) for axis in "xyz"} | {n: np.full(3, 1e308) for n in names})
    assert wide.colour(None, Path("a.ply")).shape == (3, 3)
