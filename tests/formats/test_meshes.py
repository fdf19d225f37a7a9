"""Meshes as buildings: parts, names, colours, axes, units, classes, points on triangles."""

import json
import re
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.classes import S3DIS_CLASSES, UNKNOWN
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.buildings import read_building
from mcpseg_cli.formats.mesh_building import MeshOptions, _draw, _spread, class_of
from mcpseg_cli.formats.meshes import is_mesh, read_mesh
from tests.houses import BOXES, CLASSES, colour_of, meshes, write_glb, write_obj

COARSE = {"voxel_size": 0.4}


def building_of(path: Path, **options):
    return read_building(path, mesh=MeshOptions(**COARSE | options))


def check_house(building, names):
    """Every object has its class, and lies in its box."""
    assert sorted(building.object_names) == sorted(names)
    for number, name in enumerate(building.object_names, start=1):
        own = building.instance == number
        expected = S3DIS_CLASSES.index(CLASSES[name]) if CLASSES[name] else UNKNOWN
        assert (building.semantic[own] == expected).all()
        low, high = np.array(BOXES[name])
        assert (building.xyz[own] >= low - 1e-4).all()
        assert (building.xyz[own] <= high + 1e-4).all()
        assert np.ptp(building.xyz[own], axis=0) == pytest.approx(high - low, abs=0.25)


def test_a_glb_is_turned_upright_and_its_nodes_are_objects_with_classes_and_colours(tmp_path):
    building, notices = building_of(write_glb(tmp_path / "house.glb"))
    check_house(building, BOXES)
    assert len(notices) == 1
    assert "1 objects of no class, unknown in the truth: Thing" in notices[0]
    for number, name in enumerate(building.object_names, start=1):
        assert (building.rgb[building.instance == number] == colour_of(name)).all()


@pytest.mark.parametrize("keyword", ["o", "g"])
def test_an_obj_keeps_its_objects_its_quads_and_its_colours(tmp_path, keyword):
    path = write_obj(tmp_path / "house.obj", keyword, scale=1000.0)
    building, _ = building_of(path, up="z", scale=0.001)
    check_house(building, BOXES)
    assert len(building.mesh.triangles) == 12 * len(BOXES)
    assert np.abs(building.rgb.astype(int) - [255, 128, 0]).max() <= 1


def test_an_obj_without_its_materials_is_grey(tmp_path):
    path = write_obj(tmp_path / "house.obj")
    (tmp_path / "house.mtl").unlink()
    building, _ = building_of(path, up="z")
    check_house(building, BOXES)
    assert np.ptp(building.rgb) == 0


def test_faces_of_five_corners_are_whole(tmp_path):
    text = "v 0 0 0\nv 4 0 0\nv 4 0 3\nv 2 0 4\nv 0 0 3\nf 1 2 3 4 5\n"
    (tmp_path / "gable.obj").write_text(text)
    (part,) = read_mesh(tmp_path / "gable.obj")
    sides = part.triangles[:, 1:] - part.triangles[:, :1]
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum() / 2
    assert (part.name, area) == ("gable", pytest.approx(14.0))


def test_a_node_of_two_materials_is_one_object(tmp_path):
    scene = trimesh.Scene()
    for name, mesh in list(meshes().items())[:2]:
        scene.add_geometry(mesh, node_name=name, geom_name=f"{name}-mesh")
    scene.export(tmp_path / "two.glb")
    binary = (tmp_path / "two.glb").read_bytes()
    size = struct.unpack("<I", binary[12:16])[0]
    tree = json.loads(binary[20 : 20 + size])
    tree["meshes"][0]["primitives"] += tree["meshes"][1]["primitives"]
    tree["nodes"] = tree["nodes"][:1]
    tree["scenes"] = [{"nodes": [0]}]
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    rest = binary[20 + size :]
    head = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A)
    (tmp_path / "one.glb").write_bytes(head + text + rest)
    parts = read_mesh(tmp_path / "one.glb")
    assert [part.name for part in parts] == ["Floor", "Floor"]
    assert sum(len(part.triangles) for part in parts) == 24


def test_pictures_are_on_the_points(tmp_path):
    from PIL import Image

    picture = np.zeros((64, 64, 3), np.uint8)
    picture[:32] = [250, 0, 0]  # the upper half
    picture[32:] = [0, 0, 250]
    wall = trimesh.Trimesh(
        [[0, 0, 0], [4, 0, 0], [4, 0, 3], [0, 0, 3]], [[0, 1, 2], [0, 2, 3]], process=False
    )
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(picture))
    uv = [[0, 0], [1, 0], [1, 1], [0, 1]]
    wall.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    trimesh.Scene(wall).export(tmp_path / "wall.glb")
    building, _ = building_of(tmp_path / "wall.glb", up="z")
    upper = building.xyz[:, 2] > 1.5
    assert building.rgb[upper, 0].min() > 200 > 50 > building.rgb[upper, 2].max()
    assert building.rgb[~upper, 2].min() > 200


def test_a_ply_with_faces_is_a_mesh_unless_its_points_have_classes(tmp_path):
    trimesh.util.concatenate(list(meshes().values())).export(tmp_path / "house.ply")
    assert is_mesh(tmp_path / "house.ply")
    building, notices = building_of(tmp_path / "house.ply", up="z")
    assert building.object_names == ("house",)
    assert "house" in notices[0]
    text = "ply\nformat ascii 1.0\nelement vertex 0\nproperty uchar semantic\nelement face 3\n"
    (tmp_path / "cloud.ply").write_text(text + "end_header\n")
    assert not is_mesh(tmp_path / "cloud.ply")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({}, ".obj does not say what is up; expected --up y or --up z"),
        ({"up": "z", "scale": 0.001}, "m high; expected a building of 1.8 to 500 m; give --scale"),
    ],
)
def test_what_a_file_does_not_say_has_to_be_given(tmp_path, options, said):
    with pytest.raises(InputError, match=r"house\.obj") as error:
        building_of(write_obj(tmp_path / "house.obj"), **options)
    assert said in str(error.value)


@pytest.mark.parametrize("text", ["", "v 0 0 0\n", "f 1 2 3\n", "v 0 0 0\nf 1 2 7\n"])
def test_files_without_a_mesh_are_one_line(tmp_path, text):
    (tmp_path / "bad.obj").write_text(text)
    with pytest.raises(InputError, match=r"bad\.obj: no "):
        building_of(tmp_path / "bad.obj", up="z")


@pytest.mark.parametrize("content", [b"", b"glTF", b"glTF\x02\x00\x00\x00"])
def test_a_cut_glb_is_one_line(tmp_path, content):
    (tmp_path / "bad.glb").write_bytes(content)
    with pytest.raises(InputError, match=r"bad\.glb: no "):
        building_of(tmp_path / "bad.glb")


@pytest.mark.parametrize("field", [b"byteLength", b"byteOffset", b"count"])
def test_a_glb_that_promises_more_than_it_has_is_one_line(tmp_path, field):
    path = write_glb(tmp_path / "bad.glb")
    promise = re.compile(b'"%b":\\d' % field)
    path.write_bytes(promise.sub(b'"%b":9' % field, path.read_bytes()))
    with pytest.raises(InputError, match=r"bad\.glb: no mesh"):
        read_mesh(path)


def test_meshes_are_no_buildings_where_nobody_asks_for_them(tmp_path):
    with pytest.raises(InputError, match=r"a file ending in '\.glb'"):
        read_building(write_glb(tmp_path / "house.glb"))


# --- classes ---


@pytest.mark.parametrize(
    ("labels", "found"),
    [
        (("Wall.001",), "wall"), (("Basic Wall: window side", "IfcWall"), "wall"),
        (("officeChair_12",), "chair"), (("Chairs",), "chair"), (("Desk lamp desk",), "table"),
        (("Slab:300", "IfcSlab.FLOOR", "IfcSlab"), "floor"), (("x", "IfcSlab.ROOF"), "ceiling"),
        (("Upper", "IfcSlab.UNDERSIDE", "IfcSlab"), "ceiling"), (("Mesh 3",), ""), ((), ""),
        (("Sofa 2", "IfcFurniture"), "sofa"), (("Plant", "IfcFurniture"), "clutter"),
        (("node", "Window frame"), "window"), (("Cellar",), ""),
    ],
)  # fmt: skip
def test_classes_follow_from_names_and_types(labels, found):
    assert class_of(labels, None) == found


@pytest.mark.parametrize(
    ("label", "found"),
    [("Oak Door 3", "door"), ("oak door", "door"), ("PLANT-7", "green"), ("wall", ""), ("x", "")],
)
def test_a_table_says_which_names_mean_which_class(label, found):
    assert class_of((label,), {"Oak Door": "door", "plant*": "green"}) == found


def test_a_table_is_the_class_table_of_the_building(tmp_path):
    table = {"floor": "ground", "wall": "wall", "door": "wall"}
    building, notices = building_of(write_glb(tmp_path / "house.glb"), classes=table)
    assert building.classes == ("ground", "wall")
    assert "4 objects of no class" in notices[0]


# --- points ---


@given(st.integers(0, 2**32 - 1), st.floats(0.05, 0.5))
@settings(max_examples=25)
def test_points_lie_on_their_triangles_and_are_as_many_as_their_area_asks_for(seed, spacing):
    rng = np.random.default_rng(seed)
    triangles = rng.uniform(-2, 2, (20, 3, 3))
    drawn = _draw(triangles, spacing, rng)
    row, weight = _spread(*drawn, 0, int(drawn[0].sum()))
    assert (np.diff(row) >= 0).all()
    assert (np.unique(row) == np.arange(20)).all()
    assert (weight >= -1e-12).all()
    np.testing.assert_allclose(weight.sum(axis=1), 1.0)
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(normal, axis=1) / 2
    count = np.bincount(row, minlength=20)
    assert (np.abs(count - np.maximum(area / spacing**2, 1)) <= 1).all()


def test_every_triangle_knows_a_point_on_it(tmp_path):
    building, _ = building_of(write_glb(tmp_path / "house.glb"))
    points = building.xyz[building.mesh.points].astype(float)
    corners = building.mesh.triangles.astype(float)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    off = np.einsum("tc,tc->t", normal, points - corners[:, 0])
    np.testing.assert_allclose(off, 0.0, atol=1e-5)


# --- IFC ---


def test_an_ifc_names_classes_by_type_in_metres_with_ceilings_under_slabs(tmp_path):
    pytest.importorskip("ifcopenshell")
    building, _ = building_of(write_ifc(tmp_path / "house.ifc"))
    found = {
        name.split(" #")[0] + name[name.find(" under") :] * (" under" in name): S3DIS_CLASSES[
            int(building.semantic[building.instance == number][0])
        ]
        for number, name in enumerate(building.object_names, start=1)
    }
    assert found == {
        "Ground": "floor", "Ground underside": "ceiling", "Wall to the window": "wall",
        "Chair 3": "chair", "Thing": "clutter",
    }  # fmt: skip
    assert building.xyz.max(axis=0) == pytest.approx([5.0, 4.0, 2.6], abs=0.01)


def write_ifc(path: Path) -> Path:
    """Write some elements in millimetres, a space among them."""
    import ifcopenshell.api

    run = ifcopenshell.api.run
    file = run("project.create_file")
    run("root.create_entity", file, ifc_class="IfcProject", name="project")
    unit = run("unit.add_si_unit", file, unit_type="LENGTHUNIT", prefix="MILLI")
    run("unit.assign_unit", file, units=[unit])
    model = run("context.add_context", file, context_type="Model")
    body = run(
        "context.add_context", file, context_type="Model", context_identifier="Body",
        target_view="MODEL_VIEW", parent=model,
    )  # fmt: skip
    faces = [[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
    for kind, name, (a, b, c), (x, y, z) in (
        ("IfcSlab", "Ground", (0, 0, -0.2), (5, 4, 0)),
        ("IfcWall", "Wall to the window", (0, 3.8, 0), (5, 4, 2.6)),
        ("IfcFurniture", "Chair 3", (2, 2, 0), (2.5, 2.5, 0.5)),
        ("IfcFurniture", "Thing", (3, 2, 0), (3.5, 2.5, 0.5)),
        ("IfcSpace", "Room", (0, 0, 0), (9, 9, 9)),
    ):
        element = run("root.create_entity", file, ifc_class=kind, name=name)
        corners = [(u, v, w) for w in (c, z) for u, v in ((a, b), (x, b), (x, y), (a, y))]
        vertices = [[tuple(map(float, corner)) for corner in corners]]
        shape = run(
            "geometry.add_mesh_representation", file, context=body, vertices=vertices, faces=[faces]
        )
        run("geometry.assign_representation", file, product=element, representation=shape)
        run("geometry.edit_object_placement", file, product=element)
    file.write(str(path))
    return path
