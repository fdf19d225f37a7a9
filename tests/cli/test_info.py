"""``mcpseg info``, and the same look in ``mcpseg segment``."""

import json
import shlex
import shutil
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mcpseg_cli.formats import Cloud, read_cloud, read_measured, write_cloud
from mcpseg_cli.segment.run_record import RunRecord
from tests.commands import invoke, outputs_of, segment
from tests.containers import (
    Sweep,
    cloud,
    odometry,
    pose_of,
    sweeps_of,
    write_e57,
    write_mcap,
    write_ptx,
)
from tests.walks import WALK, WAYS, write_walk


def test_info_says_what_a_recording_is_and_which_command_labels_it(tmp_path):
    scans, poses = write_walk(tmp_path / "in", lambda xyz: WAYS["y up"](xyz) * 1000)
    result = invoke("info", scans, poses)
    assert result.exit_code == 0
    assert f"mcpseg segment {scans} {poses} --scale 0.001 --up y" in result.stdout
    assert "millimetres: rooms 3.24e+03 high" in result.stdout
    document = json.loads(invoke("info", scans, poses, "--json").stdout)
    assert (document["frame"], document["unit"], document["up"]) == ("map", "millimetres", "y")
    assert document["options"] == ["--scale", "0.001", "--up", "y"]
    assert document["room_height"] == pytest.approx(3.24, abs=0.05)
    assert (document["range"], document["scans"]) == (2.0, 6)


def test_info_works_without_poses():
    document = json.loads(invoke("info", WALK / "scans", "--json").stdout)
    assert (document["scans"], document["poses"], document["frame"]) == (24, None, None)


def test_info_of_no_recording_is_one_line(tmp_path):
    result = invoke("info", tmp_path)
    assert (result.exit_code, len(result.stderr.splitlines())) == (1, 1)


@pytest.mark.parametrize(
    ("way", "options"),
    [
        ("millimetres", "--scale 0.001"),
        ("feet", "--scale 0.3048"),
        ("y up", "--up y"),
        ("y down", "--up -y"),
        ("georeferenced", "--offset auto"),
    ],
)
def test_segment_refuses_in_one_line_and_takes_what_it_says(
    tmp_path, weights_path, way, options, plain_map
):
    walk = write_walk(tmp_path / "in", WAYS[way])
    refused = segment(walk, tmp_path / "out", "-w", weights_path)
    assert (refused.exit_code, len(refused.stderr.splitlines())) == (1, 1)
    assert f"give {options}, or --no-check" in refused.stderr

    taken = segment(walk, tmp_path / "out", "-w", weights_path, *options.split())
    assert taken.exit_code == 0
    document = RunRecord.read(tmp_path / "out").configuration.as_json()
    assert {"up", "scale", "offset"} & document.keys()

    # the same place, but for rounding and which point is first in a voxel
    cloud = read_cloud(tmp_path / "out" / "map.ply")
    assert abs(len(cloud) - plain_map) < 0.05 * plain_map
    assert np.ptp(cloud.xyz, axis=0)[2] == pytest.approx(3.3, abs=0.2)


@pytest.fixture(scope="module")
def plain_map(tmp_path_factory, weights_path) -> int:
    """How many voxels the walk has as it is."""
    folder = tmp_path_factory.mktemp("plain")
    walk = write_walk(folder / "in", WAYS["metres"])
    assert segment(walk, folder / "out", "-w", weights_path).exit_code == 0
    return len(read_cloud(folder / "out" / "map.ply"))


def test_no_check_labels_as_told(tmp_path, weights_path):
    walk = write_walk(tmp_path / "in", WAYS["feet"], num_scans=5)
    result = segment(walk, tmp_path / "out", "-w", weights_path, "--no-check")
    assert (result.exit_code, result.stderr) == (0, "")


def test_an_offset_is_kept_in_map_and_exports(tmp_path, weights_path):
    walk = write_walk(tmp_path / "in", WAYS["georeferenced"], num_scans=3)
    out = tmp_path / "out"
    assert segment(walk, out, "-w", weights_path, "--offset", "auto").exit_code == 0
    assert b"comment mcpseg offset 500000 5400000 0\n" in (out / "map.ply").read_bytes()[:600]
    local = read_cloud(out / "map.ply").xyz
    assert np.abs(local[:, :2]).max() < 100

    # exports are where the recording is; labelled scans stay what they were
    names = ("map.laz", "map.ply", "objects.json")
    outputs = [word for name in names for word in ("-o", tmp_path / name)]
    assert invoke("export", out, *outputs).exit_code == 0
    for name in names[:2]:
        exported = read_cloud(tmp_path / name).xyz
        np.testing.assert_allclose(
            exported, local + np.array([500_000.0, 5_400_000.0, 0.0]), atol=2e-4
        )
    listed = json.loads((tmp_path / "objects.json").read_text())
    assert all(item["centroid"][0] > 499_000 for item in listed)
    scan = next(walk[0].iterdir())
    np.testing.assert_array_equal(read_cloud(out / "scans" / scan.name).xyz, read_cloud(scan).xyz)

    # the same command continues, and the truth is where the recording is
    again = segment(walk, out, "-w", weights_path, "--offset", "auto")
    assert "nothing new" in again.stderr
    assert "other" not in again.stderr


def test_what_was_decided_stays_when_scans_are_added(tmp_path, weights_path):
    def write(folder, num_scans):
        return write_walk(
            folder, WAYS["metres"], num_scans=num_scans, change=as_16_bit, suffix=".las"
        )

    whole = write(tmp_path / "whole", 4)
    assert segment(whole, tmp_path / "a", "-w", weights_path).exit_code == 0
    held = sorted(whole[0].iterdir())[2:]
    contents = {path: path.read_bytes() for path in held}
    rows = whole[1].read_text().splitlines()
    for path in held:
        path.unlink()
    whole[1].write_text("\n".join(rows[:3]) + "\n")
    assert segment(whole, tmp_path / "b", "-w", weights_path).exit_code == 0
    for path, content in contents.items():
        path.write_bytes(content)
    whole[1].write_text("\n".join(rows) + "\n")
    assert segment(whole, tmp_path / "b", "-w", weights_path).exit_code == 0
    assert outputs_of(tmp_path / "a") == outputs_of(tmp_path / "b")
    assert RunRecord.read(tmp_path / "b").configuration.colour == "16-bit"


def as_16_bit(columns):
    return columns | {
        name: columns[name].astype(np.uint16) * 257 for name in ("red", "green", "blue")
    }


def with_holes(columns):
    """A pixel that saw nothing behind every point."""
    holes = {}
    for name, column in columns.items():
        holes[name] = np.zeros(2 * len(column), np.float32 if name in "xyz" else column.dtype)
        holes[name][::2] = column
        holes[name][1::2] = np.nan if name in "xyz" else 0
    return holes


def test_scans_with_holes_give_the_same_map_and_holes_carry_255(tmp_path, weights_path):
    plain = write_walk(tmp_path / "plain", WAYS["metres"], num_scans=3)
    holed = write_walk(tmp_path / "holed", WAYS["metres"], num_scans=3, change=with_holes)
    # float32 as the other: only holes differ
    first = segment(plain, tmp_path / "a", "-w", weights_path, "--json")
    second = segment(holed, tmp_path / "b", "-w", weights_path, "--json")
    documents = [json.loads(result.stdout) for result in (first, second)]
    assert [document["points_left_out"] for document in documents] == [
        0,
        documents[0]["points"],
    ]
    assert documents[0]["points"] == documents[1]["points"]
    assert documents[0]["voxels"] == documents[1]["voxels"]
    labelled = sorted((tmp_path / "b" / "scans").iterdir())[0]
    cloud = read_measured(labelled)
    assert set(cloud.columns["semantic"][1::2].tolist()) == {255}
    assert cloud.valid[::2].all()
    assert not cloud.valid[1::2].any()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda c: {"x": c["x"], "y": c["y"], "z": c["z"]}, "none among x, y, z; taken as grey"),
        (
            lambda c: c | {name: c[name] * 0 for name in ("red", "green", "blue")},
            "are 0 everywhere",
        ),
        (as_16_bit, "16-bit (red, green, blue)"),
    ],
)
def test_the_summary_says_what_colours_were_taken_for(tmp_path, weights_path, change, says):
    walk = write_walk(tmp_path / "in", WAYS["metres"], num_scans=2, change=change)
    result = segment(walk, tmp_path / "out", "-w", weights_path)
    assert result.exit_code == 0
    assert says in result.stdout


def test_eval_of_a_part_says_so_first_and_fails_unless_allowed(tmp_path, weights_path):
    walk = write_walk(tmp_path / "in", lambda xyz: xyz + np.array([-32.0, -22.0, 0.0]), num_scans=2)
    assert segment(walk, tmp_path / "out", "-w", weights_path).exit_code == 0
    truth = tmp_path / "truth.npz"
    parts = [read_cloud(path) for path in sorted((WALK / "gt").glob("*.ply"))]
    columns = {
        name: np.concatenate([part.columns[name] for part in parts]) for name in parts[0].columns
    }
    write_cloud(truth, replace(parts[0], columns=columns))
    partial = invoke("eval", tmp_path / "out", truth, "--json")
    assert partial.exit_code == 1
    assert "only" in partial.stderr.splitlines()[0]
    assert "give --allow-partial" in partial.stderr.splitlines()[-1]
    assert json.loads(partial.stdout)["truth_points"] > 0
    allowed = invoke("eval", tmp_path / "out", truth, "--allow-partial", "-q")
    assert (allowed.exit_code, allowed.stderr) == (0, "")

    # of truth scan by scan, only what so many scans can see is asked for
    by_scan = invoke("eval", tmp_path / "out", WALK / "gt")
    assert by_scan.exit_code == 0
    assert "only" in by_scan.stderr.splitlines()[0]


def test_eval_takes_labels_by_other_names(tmp_path, weights_path):
    walk = write_walk(tmp_path / "in", lambda xyz: xyz + np.array([-32.0, -22.0, 0.0]), num_scans=2)
    assert segment(walk, tmp_path / "out", "-w", weights_path).exit_code == 0
    (tmp_path / "gt").mkdir()
    for path in sorted((WALK / "gt").iterdir())[:2]:
        cloud = read_cloud(path)
        columns = {name: cloud.columns[name] for name in "xyz"}
        columns |= {"mine": cloud.columns["semantic"], "object_id": cloud.columns["instance"]}
        write_cloud(tmp_path / "gt" / path.name, Cloud(columns, cloud.classes))
    refused = invoke("eval", tmp_path / "out", tmp_path / "gt")
    assert refused.exit_code == 1
    assert "points without semantic, with x, y, z, mine, object_id" in refused.stderr
    taken = invoke("eval", tmp_path / "out", tmp_path / "gt", "--semantic-field", "mine", "--json")
    assert taken.exit_code == 0
    assert json.loads(taken.stdout)["uncovered"] == 0


# --- recordings that hold their poses ---


@pytest.fixture(scope="module")
def sweeps() -> list[Sweep]:
    return sweeps_of(WALK / "scans", WALK / "poses.csv", 6)


def command_of(printed: str) -> list[str]:
    """Take the command that ``mcpseg info`` prints."""
    line = next(line for line in printed.splitlines() if line.startswith("command"))
    return shlex.split(line)[2:]


def bag(path, sweeps, *other):
    return write_mcap(
        path, [one for each in sweeps for one in (cloud(each), odometry(each))] + list(other)
    )


@pytest.mark.parametrize("kind", ["e57", "ptx", "mcap"])
def test_the_frame_of_a_recording_is_its_own_and_the_command_runs(
    tmp_path, sweeps, weights_path, kind
):
    write = {"e57": write_e57, "ptx": write_ptx, "mcap": bag}[kind]
    path = write(tmp_path / f"my walk.{kind}", sweeps[:3])
    result = invoke("info", path)
    assert "sensor, as the recording says: points of" in result.stdout
    words = command_of(result.stdout)
    assert words == ["segment", str(path)]
    labelled = invoke(*words, "-o", tmp_path / "out", "-w", weights_path)
    assert labelled.exit_code == 0, labelled.stderr


def test_a_single_station_is_seen_from_where_it_stands(tmp_path, sweeps):
    path = write_e57(tmp_path / "one.e57", sweeps[:1])
    document = json.loads(invoke("info", path, "--json").stdout)
    assert (document["frame"], document["kind"], document["range"]) == ("sensor", "E57 file", 2.0)
    assert document["room_height"] == pytest.approx(3.24, abs=0.1)


def test_topics_are_chosen_as_of_segment(tmp_path, sweeps):
    other = [cloud(each, "/other") for each in sweeps]
    path = bag(tmp_path / "two.mcap", sweeps, *other)
    assert "choose with --topic" in invoke("info", path).stderr
    words = command_of(invoke("info", path, "--topic", "/points").stdout)
    assert words == ["segment", str(path), "--topic", "/points"]


def test_a_bag_without_poses_needs_a_file_of_them(tmp_path, sweeps):
    path = write_mcap(tmp_path / "walk.mcap", [cloud(each) for each in sweeps])
    assert command_of(invoke("info", path).stdout) == ["segment", str(path), "POSES"]

    # as a tracker writes them: ten times as many, with a gap
    times = [each.stamp_ns / 1e9 for each in sweeps]
    rows = [
        " ".join(f"{value:.9f}" for value in (time + 0.004, *each.position, *each.quaternion))
        for time, each in zip(times[:-1], sweeps[:-1], strict=True)
    ]
    (tmp_path / "poses.tum").write_text("\n".join(rows) + "\n")
    result = invoke("info", path, tmp_path / "poses.tum")
    assert "by time, time stamps of the scans" in result.stdout
    assert "1 scans without a pose" in result.stdout
    words = command_of(result.stdout)
    assert words[3:] == ["--on-error", "skip", "--frame", "sensor"]


def test_what_a_recording_says_itself_is_not_asked_for(tmp_path, sweeps):
    registered = [each._replace(xyz=in_map(each)) for each in sweeps]
    path = write_e57(tmp_path / "walk.e57", registered)
    result = invoke("segment", path, "-o", tmp_path / "out")
    assert (result.exit_code, len(result.stderr.splitlines())) == (1, 1)
    assert "coincide as they are" in result.stderr
    assert "give other poses in a file after the recording" in result.stderr


def in_map(sweep: Sweep) -> np.ndarray:
    pose = pose_of(sweep)
    return (sweep.xyz @ pose[:3, :3].T + pose[:3, 3]).astype(np.float32)


def test_an_axis_that_scans_contradict_is_doubted(tmp_path, sweeps, weights_path):
    path = write_e57(tmp_path / "walk.e57", sweeps)
    words = ("-o", tmp_path / "out", "-w", weights_path, "--up", "y")
    assert "z is up, not y as --up says" in invoke("segment", path, *words).stderr


@pytest.mark.parametrize("way", ["millimetres", "y up"])
def test_stations_in_another_unit_or_axis_are_taken_as_clouds_are(
    tmp_path, sweeps, weights_path, way
):
    turned = WAYS[way](np.eye(3)).T
    scale = np.linalg.norm(turned[0])
    changed = [
        each._replace(
            xyz=(scale * each.xyz).astype(np.float32),
            position=WAYS[way](each.position[None])[0],
            quaternion=Rotation.from_matrix(turned / scale @ pose_of(each)[:3, :3]).as_quat(),
        )
        for each in sweeps[:3]
    ]
    options = {"millimetres": ["--scale", "0.001"], "y up": ["--up", "y"]}[way]
    clouds = []
    for name, which, words in (("a", sweeps[:3], []), ("b", changed, options)):
        path = write_e57(tmp_path / f"{name}.e57", which)
        out = tmp_path / name
        result = invoke("segment", path, "-o", out, "-w", weights_path, "--no-check", *words)
        assert result.exit_code == 0, result.stderr
        clouds.append(read_cloud(out / "map.ply").xyz)
    assert abs(len(clouds[0]) - len(clouds[1])) < 0.02 * len(clouds[0])
    np.testing.assert_allclose(clouds[0].min(axis=0), clouds[1].min(axis=0), atol=0.02)
    np.testing.assert_allclose(clouds[0].max(axis=0), clouds[1].max(axis=0), atol=0.02)


def test_a_run_with_an_offset_is_scored_against_truth_where_the_recording_is(
    tmp_path, weights_path
):
    walk = write_walk(tmp_path / "in", WAYS["georeferenced"], num_scans=3)
    out = tmp_path / "out"
    assert segment(walk, out, "-w", weights_path, "--offset", "auto").exit_code == 0
    shutil.copytree(out / "scans", tmp_path / "gt")
    scored = json.loads(invoke("eval", out, tmp_path / "gt", "--json").stdout)
    assert scored["uncovered"] == 0
    assert scored["point_accuracy"] > 0.95
