"""``mcpseg raytrace`` on meshes, as people type it."""

import json

import numpy as np

from mcpseg_cli.formats import read_cloud
from tests.commands import invoke
from tests.houses import BOXES, write_glb, write_obj

COARSE = ("--h-res", "4", "--v-res", "4", "--step", "1")


def test_a_house_becomes_scans_with_truth(tmp_path):
    house, out = write_glb(tmp_path / "house.glb"), tmp_path / "out"
    result = invoke("raytrace", house, "-o", out, *COARSE)
    assert result.exit_code == 0, result.stderr
    assert "Thing" in result.stderr
    record = json.loads((out / "raytrace.json").read_text())
    assert {item["name"] for item in record["objects"]} == set(BOXES)
    assert all(item["voxels_seen"] > 0 for item in record["objects"])
    truth = read_cloud(out / "gt/000000.ply")
    assert set(np.unique(truth.label("semantic"))) > {0, 1, 2, 255}
    again = invoke("raytrace", house, "-o", out, *COARSE, "-q")
    assert (again.exit_code, again.stdout, again.stderr) == (0, "", "")


def test_classes_come_from_a_table_and_another_table_is_another_run(tmp_path):
    (tmp_path / "names.csv").write_text("label,class\nwall,solid\nfloor,solid\nthing,thing\n")
    words = ("raytrace", write_glb(tmp_path / "house.glb"), "-o", tmp_path / "out", *COARSE, "-q")
    result = invoke(*words, "--classes", tmp_path / "names.csv")
    assert result.exit_code == 0, result.stderr
    assert json.loads((tmp_path / "out/raytrace.json").read_text())["classes"] == ["solid", "thing"]
    other = invoke(*words)
    assert (other.exit_code, len(other.stderr.splitlines())) == (1, 1)


def test_an_obj_in_millimetres_asks_for_axis_and_unit(tmp_path):
    house = write_obj(tmp_path / "house.obj", scale=1000.0)
    words = ("raytrace", house, "-o", tmp_path / "out", *COARSE, "-q")
    for options, said in (((), "--up y or --up z"), (("--up", "z"), "give --scale")):
        result = invoke(*words, *options)
        assert (result.exit_code, len(result.stderr.splitlines())) == (1, 1)
        assert said in result.stderr
    result = invoke(*words, "--up", "z", "--scale", "0.001")
    assert result.exit_code == 0, result.stderr
