"""Maps as tiles."""

import json

import numpy as np
import pytest

from mcpseg_cli.export import tiles
from mcpseg_cli.formats import read_cloud
from tests.commands import invoke


def rows_of(cloud):
    names = ("semantic", "instance", "confidence")
    found = [cloud.columns.get(name, cloud.columns.get(f"scalar_{name}")) for name in names]
    return {
        tuple(row): label
        for row, *label in zip(np.round(cloud.xyz, 3).tolist(), *found, strict=True)
    }


@pytest.mark.parametrize("ending", ["ply", "laz"])
def test_every_voxel_is_in_the_tile_of_its_place(labelled_run, tmp_path, ending):
    words = ("export", labelled_run.out, "-o", tmp_path / "t", "--split", ending)
    result = invoke(*words, "--tiles", 1)
    assert result.exit_code == 0, result.output
    index = json.loads((tmp_path / "t" / tiles.INDEX).read_text())
    assert f"{len(index['tiles'])} tiles" in result.output
    assert sorted(path.name for path in (tmp_path / "t").iterdir()) == sorted(
        [tiles.INDEX, *(tile["file"] for tile in index["tiles"])]
    )
    clouds = {tile["file"]: read_cloud(tmp_path / "t" / tile["file"]) for tile in index["tiles"]}
    whole = read_cloud(labelled_run.out / "map.ply")
    assert len(index["tiles"]) > 4
    assert sum(map(len, clouds.values())) == len(whole)
    for tile in index["tiles"]:
        cloud = clouds[tile["file"]]
        assert tile["points"] == len(cloud)
        np.testing.assert_allclose(cloud.xyz.min(axis=0), tile["low"], atol=0.001)
        place = [int(word) for word in tile["file"].rpartition(".")[0].split("_")]
        inside = np.floor(np.array([tile["low"], tile["high"]])[:, :2])
        assert (inside == place).all()
    if ending == "ply":
        joined = {key: value for cloud in clouds.values() for key, value in rows_of(cloud).items()}
        assert joined == rows_of(whole)


def test_tiles_have_what_is_chosen_and_need_a_format(labelled_run, tmp_path):
    words = ("export", labelled_run.out, "-q", "-o", tmp_path / "t", "--tiles", 5)
    assert "--tiles needs --split" in " ".join(invoke(*words).output.split())
    least = float(np.median(read_cloud(labelled_run.out / "map.ply").columns["confidence"]))
    result = invoke(*words, "--split", "ply", "--min-confidence", least)
    assert result.exit_code == 0, result.output
    index = json.loads((tmp_path / "t" / tiles.INDEX).read_text())
    cloud = read_cloud(tmp_path / "t" / index["tiles"][0]["file"])
    confidence = cloud.columns.get("confidence", cloud.columns.get("scalar_confidence"))
    assert confidence.min() >= np.float32(least)
    points = sum(tile["points"] for tile in index["tiles"])
    assert 0 < points < len(read_cloud(labelled_run.out / "map.ply"))
    assert list((tmp_path / "t").glob(".tiles*")) == []
