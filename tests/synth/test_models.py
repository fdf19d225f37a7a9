"""Models in place of synthetic things: read, chosen, placed and coloured."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcpseg_cli.errors import InputError
from mcpseg_cli.synth.area import make_building, plan_building
from mcpseg_cli.synth.geometry.collisions import boxes_of
from mcpseg_cli.synth.geometry.shapes import boxes
from mcpseg_cli.synth.geometry.solids import area_of
from mcpseg_cli.synth.models.boxes import cut
from mcpseg_cli.synth.models.library import read_models
from mcpseg_cli.synth.models.meshes import read_pieces
from mcpseg_cli.synth.models.stand_in import dressed, fitted, row_of, stand_in
from mcpseg_cli.synth.scanning.sampling import mesh_of, paint_samples, sample_mesh
from tests.synth.models import row, write_models, write_obj, write_table
from tests.synth.test_things import STYLE


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_models(tmp_path_factory.mktemp("models"))


def style_with(folder, part="train", share=1.0):
    return STYLE.model_copy(update={"models": read_models(folder, part, share)})


def model_named(style, name):
    return next(model for model in style.models.models if model.model == name)


# --- reading ---


def test_a_model_stands_on_the_floor_at_its_size_with_its_back_at_zero(folder):
    pieces = read_pieces(folder / "chair.obj", (), (0.5, 0.6, 0.9))
    corners = np.concatenate([piece.triangles for piece in pieces]).reshape(-1, 3)
    np.testing.assert_allclose(corners.min(axis=0), (-0.25, 0, 0), atol=1e-9)
    np.testing.assert_allclose(corners.max(axis=0), (0.25, 0.6, 0.9), atol=1e-9)


def test_the_front_of_a_mesh_comes_to_face_plus_y(folder):
    dark = [p for p in read_pieces(folder / "chair.obj", (), (1, 1, 1)) if p.colour[0] < 100]
    assert max(piece.triangles[..., 1].max() for piece in dark) < 0.2


def test_a_rotation_is_applied_before_the_size(folder):
    half_turn = (-1, 0, 0, 0, 1, 0, 0, 0, -1)
    pieces = read_pieces(folder / "chair.obj", half_turn, (1, 1, 1))
    dark = [piece for piece in pieces if piece.colour[0] < 100]
    assert min(piece.triangles[..., 1].min() for piece in dark) > 0.8


def test_faces_of_four_corners_are_whole(folder):
    pieces = read_pieces(folder / "sub/bin.obj", (), (1, 1, 1))
    assert sum(area_of(piece.triangles).sum() for piece in pieces) == pytest.approx(6)


def test_what_is_no_mesh_is_named(tmp_path):
    path = tmp_path / "broken.obj"
    path.write_text("nothing\n")
    with pytest.raises(InputError, match=r"broken\.obj: no .*expected"):
        read_pieces(path, (), (1, 1, 1))


# --- boxes for collisions ---


def test_the_space_under_a_table_is_free(folder):
    style = style_with(folder)
    table = dressed(model_named(style, "table.obj"), style, np.random.default_rng(0))
    own = boxes_of(table)
    under = (np.abs(own[:, 0]) < own[:, 4]) & (own[:, 6] < 0.3)  # over the middle, and low
    assert len(own) >= 5
    assert not under.any()


@given(st.integers(1, 40), st.integers(0, 1000))
def test_cutting_never_needs_more_room_than_the_whole(count, seed):
    rng = np.random.default_rng(seed)
    low = rng.uniform(-1, 1, (count, 3))
    triangles = boxes(low, low + rng.uniform(0.02, 0.4, (count, 3)))
    number = cut(triangles)
    assert number.min() == 0
    assert number.max() < 16

    def volume(some):
        return np.prod(np.ptp(some.reshape(-1, 3), axis=0))

    parts = sum(volume(triangles[number == box]) for box in np.unique(number))
    assert parts <= volume(triangles) * (1 + 1e-9)


# --- colours ---


def test_points_have_the_colours_of_the_picture_where_they_lie(folder):
    style, rng = style_with(folder), np.random.default_rng(3)
    item = dressed(model_named(style, "picture.obj"), style, rng)
    mesh = mesh_of([item.moved(x=5.0, y=-2.0, yaw=1.0)])
    samples = sample_mesh(mesh, 0.02, rng)
    painted = paint_samples(mesh, samples, rng)

    # seen from its front, the left of a picture is at +x
    along = (samples.xyz[:, 0] - 5.0) * np.cos(1.0) + (samples.xyz[:, 1] + 2.0) * np.sin(1.0)
    left, right = along > 0.02, along < -0.02
    assert painted[left, 0].min() > 3 * painted[left, 2].max()
    assert painted[right, 2].min() > 3 * painted[right, 0].max()


def test_what_one_can_see_through_is_glass(folder):
    style = style_with(folder)
    item = dressed(model_named(style, "pane.obj"), style, np.random.default_rng(0))
    assert {part.material.pattern for part in item.parts} == {"glass"}


def test_models_are_recoloured_now_and_then(folder):
    style, rng = style_with(folder), np.random.default_rng(0)
    model = model_named(style, "chair.obj")
    bases = [dressed(model, style, rng).parts[0].material.base for _ in range(12)]
    assert np.ptp(bases, axis=0).max() > 60


# --- choice ---


def test_without_models_nothing_is_drawn():
    rng = np.random.default_rng(1)
    before = rng.bit_generator.state
    assert stand_in("chair", "task", STYLE, rng) is None
    assert row_of("clutter", "counter", STYLE, rng, 2.0) is None
    assert fitted("door", "door", STYLE, rng, (0.9, 2.1)) is None
    assert rng.bit_generator.state == before


def test_a_model_of_the_right_class_stands_in(folder):
    style, rng = style_with(folder), np.random.default_rng(1)
    assert stand_in("chair", "task", style, rng).name == "chair"
    assert stand_in("clutter", "picture", style, rng).name == "clutter"
    assert stand_in("clutter", "carton", style, rng) is not None  # anything small on the floor
    assert stand_in("clutter", "bed", style, rng) is None


def test_a_model_is_about_as_wide_as_asked(folder):
    style, rng = style_with(folder), np.random.default_rng(1)
    assert stand_in("table", "meeting", style, rng, 1.5) is not None
    assert stand_in("table", "meeting", style, rng, 3.0) is None


def test_kept_models_are_kept_from_training(folder):
    rng = np.random.default_rng(1)
    assert stand_in("sofa", "sofa", style_with(folder), rng) is None
    assert stand_in("sofa", "sofa", style_with(folder, "kept"), rng).name == "sofa"
    assert stand_in("chair", "task", style_with(folder, "kept"), rng) is None
    assert len(read_models(folder, "all").models) == 6


def test_the_share_is_how_often_a_model_stands_in(folder):
    style, rng = style_with(folder, share=0.25), np.random.default_rng(1)
    found = sum(stand_in("chair", "task", style, rng) is not None for _ in range(400))
    assert 70 < found < 130


def test_a_row_of_models_is_no_wider_than_asked(tmp_path):
    write_obj(tmp_path / "unit.obj", [((0, 0, 0), (1, 1, 1), (0.9, 0.9, 0.9))])
    write_table(tmp_path, [row("unit.obj", "clutter", "counter", (0.6, 0.6, 0.9))])
    parts = row_of("clutter", "counter", style_with(tmp_path), np.random.default_rng(0), 2.0)
    xyz = np.concatenate([part.triangles.reshape(-1, 3) for part in parts])
    np.testing.assert_allclose(xyz.min(axis=0), (-0.9, 0, 0), atol=1e-9)
    np.testing.assert_allclose(xyz.max(axis=0), (0.9, 0.6, 0.9), atol=1e-9)


# --- buildings ---


def test_a_building_with_models_is_another_and_the_same_again(folder):
    def hashes(models):
        building = make_building(2, 1, num_rooms=2, spacing=0.1, models=models)
        return building.xyz.tobytes()

    models = read_models(folder, "train", 1.0)
    assert hashes(models) == hashes(models) != hashes(None)


# --- the table ---


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"class": "throne"}, "line 2: class 'throne'"),
        ({"width": "wide"}, "line 2: width 'wide'"),
        ({"height": "0"}, "line 2: height '0'"),
        ({"part": "some"}, "line 2: part 'some'"),
        ({"rotation": "1 2 3"}, "line 2: rotation"),
        ({"model": "away.obj"}, r"line 2: away\.obj is not there"),
        ({"part": "kept"}, "no model of part train"),
    ],
)
def test_a_damaged_row_is_named(tmp_path, changed, told):
    write_obj(tmp_path / "unit.obj", [((0, 0, 0), (1, 1, 1), (0.9, 0.9, 0.9))])
    write_table(tmp_path, [row("unit.obj", "chair", "", (1, 1, 1)) | changed])
    with pytest.raises(InputError, match=told):
        read_models(tmp_path)


def test_a_table_without_a_column_is_named(tmp_path):
    (tmp_path / "models.csv").write_text("model,class\nunit.obj,chair\n")
    with pytest.raises(InputError, match="a column is missing"):
        read_models(tmp_path)


def test_what_a_model_stands_for_has_to_be_known(tmp_path):
    write_obj(tmp_path / "unit.obj", [((0, 0, 0), (1, 1, 1), (0.9, 0.9, 0.9))])
    write_table(tmp_path, [row("unit.obj", "chair", "throne", (1, 1, 1))])
    with pytest.raises(InputError, match="stands for 'throne'; expected one of armchair"):
        plan_building(1, 0, 2, models=read_models(tmp_path))


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize(
    "text",
    [
        "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "v 0 0 1e300\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
        "v 0 0 0\nf 1 1\n", "v a b c\nf 1 1 1\n", "",
    ],
)  # fmt: skip
def test_a_damaged_model_is_refused_in_one_line(text, tmp_path):
    path = tmp_path / "chair.obj"
    path.write_text(text)
    with pytest.raises(InputError, match=r"chair\.obj: .*; expected .*; take its class out"):
        read_pieces(path, (), (0.5, 0.5, 0.9))
