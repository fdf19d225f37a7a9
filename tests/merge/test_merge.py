"""``mcpseg merge``: maps of one frame become the folder of a run."""

import json
import shutil

import numpy as np
import pytest

from mcpseg_cli.formats import read_cloud, write_cloud
from mcpseg_cli.grid import voxel_of
from mcpseg_cli.merge.part import names_of
from mcpseg_cli.segment.checkpoint import State
from tests.commands import invoke, segment
from tests.recordings import write_recording, write_weights

FILES = ("map.ply", "objects.json", "events.jsonl", "state.sqlite")


@pytest.fixture(scope="module")
def runs(tmp_path_factory, unet_path):
    """Three robots in one corridor, and one that saw nothing near it; not to be changed."""
    folder = tmp_path_factory.mktemp("robots")
    for seed, name in enumerate(("one", "two", "three")):
        recording = write_recording(folder / "in" / name, num_scans=3, seed=seed)
        assert segment(recording, folder / name, "-w", unet_path).exit_code == 0
    scans, poses = write_recording(folder / "in" / "none", num_scans=1, seed=9)
    poses.write_text("x,y,z\n50,50,0\n")
    nothing = segment((scans, poses), folder / "none", "-w", unet_path)
    assert "nothing was labelled" in nothing.stderr
    return folder


@pytest.fixture(scope="module")
def building(runs, tmp_path_factory):
    """The merge of the three; not to be changed."""
    output = tmp_path_factory.mktemp("merged") / "building"
    result = invoke("merge", *(runs / name for name in ("one", "two", "three")), "-o", output)
    assert result.exit_code == 0, result.output
    return output


def merge(output, *words):
    result = invoke("merge", *words, "-o", output)
    assert result.exit_code == 0, result.output
    return output


def refused(*words) -> str:
    result = invoke("merge", *words)
    assert result.exit_code == 1, result.output
    return result.output


def known_of(folder):
    """Evidence of every voxel."""
    with State(folder / "state.sqlite") as state:
        rows = np.concatenate([part.xyz for part in state.map_rows()])
        evidence = np.concatenate(list(state.evidence())).astype(int)
    return dict(zip(map(tuple, voxel_of(rows, 0.1).tolist()), evidence, strict=True))


def same_outputs(one, other):
    return [name for name in FILES if (one / name).read_bytes() != (other / name).read_bytes()]


def test_the_order_of_the_maps_changes_no_byte(runs, building, tmp_path):
    other = merge(tmp_path / "b", *(runs / name for name in ("three", "one", "two")))
    assert same_outputs(building, other) == []


def test_a_map_without_a_voxel_changes_nothing_and_is_told(runs, building, tmp_path):
    words = [runs / name for name in ("none", "three", "one", "two")]
    result = invoke("merge", *words, "-o", tmp_path / "b")
    assert f"{runs / 'none'}: no voxel in it" in result.stderr
    assert same_outputs(building, tmp_path / "b") == []


def test_evidence_is_the_sum_of_that_of_the_maps(runs, building):
    parts = [known_of(runs / name) for name in ("one", "two", "three")]
    united = known_of(building)
    assert set(united) == set().union(*parts)
    assert sum(map(len, parts)) > 1.5 * len(united)
    for voxel, evidence in united.items():
        expected = sum(part[voxel] for part in parts if voxel in part)
        assert evidence.tolist() == expected.tolist()


def test_an_object_that_several_robots_saw_is_one_and_knows_its_parts(runs, building):
    objects = json.loads((building / "objects.json").read_text())
    assert any(len(item["parts"]) == 3 for item in objects)
    for name in ("one", "two", "three"):
        ids = {item["id"] for item in json.loads((runs / name / "objects.json").read_text())}
        named = {old for item in objects for old in item["parts"].get(name, [])}
        assert named <= ids
        assert len(named) > len(ids) / 2


def test_the_merged_map_is_the_folder_of_a_run(building, runs, tmp_path):
    assert invoke("export", building, "-o", tmp_path / "map.ply", "-q").exit_code == 0
    exported, kept = read_cloud(tmp_path / "map.ply"), read_cloud(building / "map.ply")
    assert len(exported) == len(kept)
    result = invoke("eval", building, runs / "one" / "scans", "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["covered"] > 0
    listed = json.loads((building / "objects.json").read_text())
    assert invoke("export", building, "-o", tmp_path / "all.json", "-q").exit_code == 0
    without = [{k: v for k, v in item.items() if k != "parts"} for item in listed]
    assert json.loads((tmp_path / "all.json").read_text()) == without


def test_another_robot_continues_the_merged_map(building, unet_path, tmp_path):
    shutil.copytree(building, tmp_path / "b")
    before = known_of(tmp_path / "b")
    recording = write_recording(tmp_path / "in", num_scans=2, seed=5)
    result = segment(recording, tmp_path / "b", "-w", unet_path)
    assert result.exit_code == 0, result.output
    after = known_of(tmp_path / "b")
    assert len(after) > len(before)
    assert all((after[voxel] >= evidence).all() for voxel, evidence in before.items())
    objects = json.loads((tmp_path / "b" / "objects.json").read_text())
    assert sum(len(item["parts"]) == 3 for item in objects) > 0
    again = segment(recording, tmp_path / "b", "-w", unet_path)
    assert "nothing new" in again.stderr


def test_what_a_continued_merge_knows_can_be_merged_again(building, runs, unet_path, tmp_path):
    shutil.copytree(building, tmp_path / "b")
    recording = write_recording(tmp_path / "in", num_scans=2, seed=5)
    assert segment(recording, tmp_path / "b", "-w", unet_path).exit_code == 0
    assert segment(
        write_recording(tmp_path / "in2", num_scans=1, seed=6), tmp_path / "c", "-w", unet_path
    ).exit_code == 0  # fmt: skip
    merge(tmp_path / "all", tmp_path / "b", tmp_path / "c")
    assert "leave one" in refused(runs / "two", tmp_path / "all", "-o", tmp_path / "x")


def test_a_scan_of_a_merged_map_is_not_counted_again(building, runs, unet_path, tmp_path):
    shutil.copytree(building, tmp_path / "b")
    recording = (runs / "in" / "two" / "scans", runs / "in" / "two" / "poses.csv")
    result = segment(recording, tmp_path / "b", "-w", unet_path)
    assert result.exit_code == 1
    assert "in the map already, as two/000000.ply" in " ".join(result.output.split())


def test_a_map_is_not_merged_twice(runs, building, tmp_path):
    shutil.copytree(runs / "two", tmp_path / "copy")
    assert "leave one of the two out" in refused(
        runs / "two", tmp_path / "copy", "-o", tmp_path / "b"
    )
    assert "scan 000000.ply is one/000000.ply" in refused(
        runs / "one", building, "-o", tmp_path / "b"
    )
    assert not (tmp_path / "b").exists()


def test_the_same_merge_again_says_so_and_another_is_refused(runs, building, tmp_path):
    shutil.copytree(building, tmp_path / "b")
    names = [runs / name for name in ("two", "one", "three")]
    result = invoke("merge", *names, "-o", tmp_path / "b")
    assert (result.exit_code, "nothing new" in result.stderr) == (0, True)
    assert "give --overwrite" in refused(*names[:2], "-o", tmp_path / "b")
    merge(tmp_path / "b", *names[:2], "--overwrite")
    assert len(known_of(tmp_path / "b")) < len(known_of(building))


def test_a_map_of_another_frame_is_moved(runs, building, unet_path, tmp_path):
    # the second robot began three metres off, a quarter turned
    scans = runs / "in" / "two" / "scans"
    (tmp_path / "in").mkdir()
    turn = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]], float)
    for path in sorted(scans.iterdir()):
        cloud = read_cloud(path)
        xyz = ((cloud.xyz - (3, 0, 0)) @ turn.T).astype(np.float32)
        columns = {**cloud.columns, **{axis: xyz[:, i] for i, axis in enumerate("xyz")}}
        write_cloud(tmp_path / "in" / path.name, type(cloud)(columns))
    poses = [(turn @ (0.4 * number - 3, 0, 0.5)).tolist() for number in range(3)]
    lines = [",".join(map(str, pose)) for pose in poses]
    (tmp_path / "poses.csv").write_text("x,y,z\n" + "\n".join(lines) + "\n")
    recording = (tmp_path / "in", tmp_path / "poses.csv")
    assert segment(recording, tmp_path / "two", "-w", unet_path).exit_code == 0

    back = np.eye(4)
    back[:3, :3], back[0, 3] = turn.T, 3
    np.savetxt(tmp_path / "T.txt", back)
    words = [runs / "one", tmp_path / "two", runs / "three"]
    moved = merge(tmp_path / "b", *words, "--transform", f"{tmp_path / 'two'}={tmp_path / 'T.txt'}")
    one, other = set(known_of(building)), set(known_of(moved))
    assert len(one & other) > 0.99 * len(one | other)
    with State(moved / "state.sqlite") as state:
        positions = [scan.pose[:3, 3] for scan in state.scans() if scan.name.startswith("two/")]
    expected = [(0.4 * number, 0, 0.5) for number in range(3)]
    np.testing.assert_allclose(positions, expected, atol=1e-6)


@pytest.mark.parametrize(
    ("options", "found"),
    [
        (("--voxel-size", "0.2"), "--voxel-size 0.1, now 0.2"),
        (("--clustering", "paper"), "--clustering paper"),
        (("--labelling", "first"), "--labelling fused, now first"),
        (("--offline",), "labelled offline"),
    ],
)
def test_maps_made_otherwise_are_refused(runs, unet_path, tmp_path, options, found):
    recording = write_recording(tmp_path / "in", num_scans=2, seed=7)
    assert segment(recording, tmp_path / "other", "-w", unet_path, *options).exit_code == 0
    assert found in refused(runs / "one", tmp_path / "other", "-o", tmp_path / "b")
    assert not (tmp_path / "b").exists()


def test_maps_of_other_weights_and_of_the_papers_methods_are_refused(runs, weights_path, tmp_path):
    recording = write_recording(tmp_path / "in", num_scans=1, seed=7)
    assert segment(recording, tmp_path / "paper", "-w", weights_path).exit_code == 0
    assert "labelled by mcpnet" in refused(runs / "one", tmp_path / "paper", "-o", tmp_path / "b")
    others = write_weights(tmp_path / "other.safetensors", "unet", seed=8)
    assert segment(recording, tmp_path / "other", "-w", others).exit_code == 0
    assert "--weights" in refused(runs / "one", tmp_path / "other", "-o", tmp_path / "b")


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("1 2 3", "3 numbers"),
        ("a b", "no numbers"),
        ("2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1", "scales"),
        ("1e200 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", "scales"),
    ],
)
@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_transform_that_is_none_is_refused(runs, tmp_path, text, found):
    (tmp_path / "T.txt").write_text(text)
    words = (runs / "one", "-o", tmp_path / "b", "--transform")
    assert found in refused(*words, f"{runs / 'one'}={tmp_path / 'T.txt'}")


def test_a_transform_of_no_map_is_refused(runs, tmp_path):
    np.savetxt(tmp_path / "T.txt", np.eye(4))
    words = (runs / "one", "-o", tmp_path / "b", "--transform")
    assert "no map to merge" in refused(*words, f"{runs / 'two'}={tmp_path / 'T.txt'}")


def test_what_is_no_run_is_refused(runs, tmp_path):
    assert "no state.sqlite" in refused(runs / "one", tmp_path, "-o", tmp_path / "b")
    assert "another folder" in refused(runs / "one", "-o", runs / "one")
    assert "nothing but empty" in refused(runs / "none", "-o", tmp_path / "b")


def test_maps_are_named_by_as_many_folders_as_it_takes(tmp_path):
    assert names_of([tmp_path / "a", tmp_path / "b"]) == ["a", "b"]
    assert names_of([tmp_path / "a" / "out", tmp_path / "b" / "out"]) == ["a/out", "b/out"]
