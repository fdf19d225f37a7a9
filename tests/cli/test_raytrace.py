"""``mcpseg raytrace`` as people type it: from a labelled room to scans, poses and truth."""

import json
import resource
import signal
import subprocess
from pathlib import Path

import numpy as np
import pytest

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.formats import Cloud, read_cloud, write_cloud
from mcpseg_cli.formats.poses import read_poses
from mcpseg_cli.resumable import exclusive
from tests.commands import command, invoke, run_to_its_end, start, wait_until

COARSE = ("--h-res", "4", "--v-res", "4", "-q")
LOW, HIGH = np.array([0.0, 0.0, 0.0]), np.array([6.0, 4.0, 2.6])


def trace(room: Path, output: Path, *options: object):
    result = invoke("raytrace", room, "-o", output, *COARSE, *options)
    assert result.exit_code == 0, result.stderr
    return result


def faces(low, high, spacing: float, rng: np.random.Generator, sides) -> np.ndarray:
    parts = []
    for axis, side in sides:
        sizes = np.delete(np.subtract(high, low), axis)
        points = rng.uniform(low, high, (int(sizes.prod() / spacing**2), 3))
        points[:, axis] = (low, high)[side][axis]
        parts.append(points)
    return np.concatenate(parts)


def make_room(seed: int = 0) -> Cloud:
    """A room of 6 x 4 m with a table and a box, points 3 cm apart, an id for each object."""
    rng = np.random.default_rng(seed)
    every = [(axis, side) for axis in range(3) for side in range(2)]
    objects = [
        ("floor", faces(LOW, HIGH, 0.03, rng, [(2, 0)])),
        ("ceiling", faces(LOW, HIGH, 0.03, rng, [(2, 1)])),
        *(("wall", faces(LOW, HIGH, 0.03, rng, [side])) for side in every[:4]),
        ("table", faces((1.0, 1.0, 0.68), (2.4, 1.8, 0.72), 0.03, rng, every)),
        ("clutter", faces((4.5, 2.5, 0.0), (5.1, 3.0, 0.5), 0.03, rng, every)),
    ]
    xyz = np.concatenate([points for _, points in objects]).astype(np.float32)
    sizes = [len(points) for _, points in objects]
    rgb = np.random.default_rng(seed + 1).integers(0, 256, (len(xyz), 3)).astype(np.uint8)
    columns = {axis: xyz[:, column] for column, axis in enumerate("xyz")}
    columns |= {name: rgb[:, column] for column, name in enumerate(("red", "green", "blue"))}
    columns["semantic"] = np.repeat(
        [S3DIS_CLASSES.index(name) for name, _ in objects], sizes
    ).astype(np.uint8)
    columns["instance"] = np.repeat(np.arange(1, len(objects) + 1), sizes).astype(np.int32)
    return Cloud(columns, S3DIS_CLASSES)


@pytest.fixture(scope="module")
def room(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("room") / "room.ply"
    write_cloud(path, make_room())
    return path


@pytest.fixture(scope="module")
def scans(room, tmp_path_factory) -> Path:
    output = tmp_path_factory.mktemp("scans") / "out"
    trace(room, output)
    return output


def files_of(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def numbers_of(folder: Path) -> list[str]:
    return [path.stem for path in sorted(folder.iterdir())]


def test_every_scan_has_a_pose_and_the_truth_about_the_same_points(scans):
    names = numbers_of(scans / "scans")
    assert names == [f"{number:06d}" for number in range(len(names))]
    assert names == numbers_of(scans / "gt") == list(read_poses(scans / "poses.csv").scans)
    assert len(names) > 10
    for name in names:
        scan, truth = read_cloud(scans / f"scans/{name}.ply"), read_cloud(scans / f"gt/{name}.ply")
        assert list(scan.columns) == ["x", "y", "z", "red", "green", "blue"]
        np.testing.assert_array_equal(scan.xyz, truth.xyz)
        np.testing.assert_array_equal(scan.rgb, truth.rgb)
        assert truth.classes == S3DIS_CLASSES


def test_every_scanned_point_is_a_point_of_the_room_with_its_colour_class_and_object(scans):
    cloud = make_room()
    labels = np.column_stack(
        [cloud.rgb, cloud.columns["semantic"], cloud.columns["instance"]]
    ).tolist()
    known = dict(zip(map(tuple, cloud.xyz.tolist()), labels, strict=True))
    for path in (scans / "gt").iterdir():
        truth = read_cloud(path)
        seen = np.column_stack(
            [truth.rgb, truth.columns["semantic"], truth.columns["instance"]]
        ).tolist()
        assert [known[tuple(point)] for point in truth.xyz.tolist()] == seen


def test_scans_are_one_step_apart_and_a_metre_over_the_floor(scans):
    position = read_poses(scans / "poses.csv").poses[:, :3, 3]
    steps = np.linalg.norm(np.diff(position, axis=0), axis=1)
    assert (steps < 0.2 + 1e-5).all()  # shorter across a corner
    assert np.median(steps) == pytest.approx(0.2, abs=1e-5)
    np.testing.assert_allclose(position[:, 2], 1.0, atol=1e-5)


def test_no_scan_has_two_points_in_one_voxel(scans):
    from mcpseg_cli.grid import voxel_of

    voxel = voxel_of(read_cloud(scans / "scans/000003.ply").xyz.astype(np.float32), 0.1)
    assert len(np.unique(voxel, axis=0)) == len(voxel)


def test_the_record_says_what_was_seen(scans):
    record = json.loads((scans / "raytrace.json").read_text())
    points = sum(len(read_cloud(path)) for path in (scans / "scans").iterdir())
    assert record["complete"]
    assert (record["points"], record["scans"]) == (points, len(numbers_of(scans / "scans")))
    assert record["voxels_seen"] == sum(record["voxels_seen_by_class"].values()) <= record["voxels"]
    assert record["classes"] == list(S3DIS_CLASSES)


def test_segment_and_eval_take_the_folder_as_it_is(room, tmp_path, weights_path):
    trace(room, tmp_path / "r", "--step", "1")
    recording, options = (tmp_path / "r/scans", tmp_path / "r/poses.csv"), ("-w", weights_path)
    result = invoke("segment", *recording, "-o", tmp_path / "out", *options)
    assert result.exit_code == 0, result.stderr
    scores = json.loads(invoke("eval", tmp_path / "out", tmp_path / "r/gt", "--json").stdout)
    assert scores["covered"] == scores["points"] > 5000
    assert scores["objects_true"] == 8


def test_without_o_scans_go_to_data_under_the_areas_name(room, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert invoke("raytrace", room, "--step", "2", *COARSE).exit_code == 0
    names = {path.name for path in (tmp_path / "data/room").iterdir()}
    assert names == {"scans", "gt", "poses.csv", "raytrace.json"}


def test_several_areas_get_a_folder_each(room, tmp_path):
    (tmp_path / "other.ply").write_bytes(room.read_bytes())
    areas, options = (room, tmp_path / "other.ply"), ("--step", "2", "--json", *COARSE)
    result = invoke("raytrace", *areas, "-o", tmp_path / "d", *options)
    sources = [document["source"] for document in json.loads(result.stdout)]
    assert sources == ["room.ply", "other.ply"]
    assert files_of(tmp_path / "d/room/scans") == files_of(tmp_path / "d/other/scans")


def test_areas_side_by_side_get_the_same_scans(room, tmp_path):
    write_cloud(tmp_path / "other.ply", make_room(seed=1))
    areas, options = (room, tmp_path / "other.ply"), ("--step", "2", *COARSE)
    assert invoke("raytrace", *areas, "-o", tmp_path / "one", *options).exit_code == 0
    words = ("-o", tmp_path / "two", *options, "--engine", "processes", "--json")
    result = invoke("raytrace", *areas, *words)
    assert result.exit_code == 0, result.output
    names = [Path(document["output"]).name for document in json.loads(result.stdout)]
    assert names == [room.stem, "other"]
    for path in (tmp_path / "one").rglob("*.ply"):
        other = tmp_path / "two" / path.relative_to(tmp_path / "one")
        assert path.read_bytes() == other.read_bytes()


def test_two_areas_of_one_name_are_a_usage_error(room):
    result = invoke("raytrace", room, room)
    assert result.exit_code == 2
    assert "same name" in result.stderr


def test_the_number_of_jobs_changes_nothing(room, tmp_path):
    options = ("--noise", "0.01", "--dropout", "0.2", "--step", "0.7")
    for jobs in (1, 3):
        trace(room, tmp_path / str(jobs), "--jobs", jobs, *options)
    assert files_of(tmp_path / "1") == files_of(tmp_path / "3")


def test_noise_moves_points_along_their_ray_only(room, tmp_path):
    trace(room, tmp_path / "clean", "--step", "1.5")
    trace(room, tmp_path / "noisy", "--step", "1.5", "--noise", "0.02")
    origin = read_poses(tmp_path / "clean/poses.csv").poses[0, :3, 3]
    clean = read_cloud(tmp_path / "clean/scans/000000.ply").xyz - origin
    noisy = read_cloud(tmp_path / "noisy/scans/000000.ply").xyz - origin
    along = ((noisy - clean) * clean).sum(axis=1) / np.linalg.norm(clean, axis=1)
    across = np.linalg.norm(np.cross(noisy, clean), axis=1) / np.linalg.norm(clean, axis=1)
    assert across.max() < 1e-5
    assert np.std(along) == pytest.approx(0.02, rel=0.1)


def test_dropout_loses_its_share_of_the_points(room, tmp_path):
    trace(room, tmp_path / "all", "--step", "1.5")
    trace(room, tmp_path / "some", "--step", "1.5", "--dropout", "0.3")
    sizes = [len(read_cloud(tmp_path / f"{name}/scans/000000.ply")) for name in ("all", "some")]
    assert sizes[1] / sizes[0] == pytest.approx(0.7, abs=0.05)


def test_the_authors_scanner_sees_neither_straight_down_nor_straight_up(room, tmp_path):
    trace(room, tmp_path / "out", "--step", "2", "--scanner", "authors")
    settings = json.loads((tmp_path / "out/raytrace.json").read_text())["settings"]
    names = ("lowest_deg", "highest_deg", "reach")
    assert [settings[name] for name in names] == [-45.0, 80.0, 5.0]
    origin = read_poses(tmp_path / "out/poses.csv").poses[0, :3, 3]
    ray = read_cloud(tmp_path / "out/scans/000000.ply").xyz - origin
    elevation = np.degrees(np.arctan2(ray[:, 2], np.hypot(ray[:, 0], ray[:, 1])))
    assert elevation.min() > -52  # a ray at -45 may end in a voxel whose point lies a little lower
    assert elevation.max() < 84


def test_an_option_overrides_the_preset(room, tmp_path):
    trace(room, tmp_path / "out", "--step", "2", "--scanner", "authors", "--range", "3")
    assert json.loads((tmp_path / "out/raytrace.json").read_text())["settings"]["reach"] == 3.0


@pytest.mark.parametrize("suffix", ["las", "npz"])
def test_other_formats_hold_the_same_points_and_labels(room, tmp_path, suffix):
    trace(room, tmp_path / "ply", "--step", "2")
    trace(room, tmp_path / suffix, "--step", "2", "--format", suffix)
    expected = read_cloud(tmp_path / "ply/gt/000000.ply")
    truth = read_cloud(tmp_path / f"{suffix}/gt/000000.{suffix}")
    np.testing.assert_allclose(truth.xyz, expected.xyz, atol=1e-3)
    np.testing.assert_array_equal(truth.label("semantic"), expected.label("semantic"))
    np.testing.assert_array_equal(truth.label("instance"), expected.label("instance"))


def test_waypoints_in_a_file_are_driven_past_and_those_in_walls_are_named(room, tmp_path):
    (tmp_path / "spots.txt").write_text("0.6 3.4\n5.4 0.6\n9.0 9.0\n")
    options = ("--waypoints", tmp_path / "spots.txt", "--h-res", "4", "--v-res", "4")
    result = invoke("raytrace", room, "-o", tmp_path / "out", *options)
    assert "waypoints not on free floor, skipped: (9.00, 9.00)" in result.stderr
    position = read_poses(tmp_path / "out/poses.csv").poses[:, :2, 3]
    for spot in ((0.6, 3.4), (5.4, 0.6)):
        assert np.linalg.norm(position - spot, axis=1).min() < 0.25


def test_scan_spots_in_the_area_are_found(room, tmp_path):
    area = tmp_path / "Area_1"
    area.mkdir()
    make_area(area)
    (area / "scan_spots.txt").write_text("1.0 0.6\n5.0 0.6\n")
    trace(area, tmp_path / "out")
    position = read_poses(tmp_path / "out/poses.csv").poses[:, :2, 3]
    assert position[:, 1].max() < 0.9
    assert json.loads((tmp_path / "out/raytrace.json").read_text())["route"]["waypoints"] == 2


def make_area(area: Path) -> None:
    """Write the room in the S3DIS layout."""
    cloud = make_room()
    folder = area / "office_1/Annotations"
    folder.mkdir(parents=True)
    for number in np.unique(cloud.columns["instance"]):
        rows = cloud.columns["instance"] == number
        name = S3DIS_CLASSES[int(cloud.columns["semantic"][rows][0])]
        lines = np.column_stack([cloud.xyz[rows], cloud.rgb[rows]])
        np.savetxt(folder / f"{name}_{number}.txt", lines, "%.3f %.3f %.3f %d %d %d")


def test_plot_draws_a_picture_of_the_route(room, tmp_path):
    trace(room, tmp_path / "out", "--plot", tmp_path / "route.png", "--step", "1")
    assert (tmp_path / "route.png").read_bytes().startswith(b"\x89PNG")


def test_running_again_says_there_is_nothing_to_do(room, scans):
    before = files_of(scans)
    result = invoke("raytrace", room, "-o", scans, "--h-res", "4", "--v-res", "4")
    assert result.exit_code == 0
    assert "nothing to do: all scans are made" in result.stderr
    assert files_of(scans) == before


def test_another_setting_is_refused_in_one_line_and_overwrite_replaces(room, tmp_path):
    trace(room, tmp_path / "out", "--step", "1")
    result = invoke("raytrace", room, "-o", tmp_path / "out", "--step", "2", *COARSE)
    assert result.exit_code == 1
    assert "made with --step 1.0, now 2.0; expected the same" in result.stderr
    assert len(result.stderr.splitlines()) == 1
    trace(room, tmp_path / "out", "--step", "2", "--overwrite")
    assert len(numbers_of(tmp_path / "out/scans")) == len(read_poses(tmp_path / "out/poses.csv"))


def test_scans_that_were_deleted_are_made_again(room, tmp_path):
    trace(room, tmp_path / "out", "--step", "1")
    before = files_of(tmp_path / "out")
    (tmp_path / "out/gt/000001.ply").unlink()
    trace(room, tmp_path / "out", "--step", "1")
    assert files_of(tmp_path / "out") == before


def test_positions_that_see_nothing_get_neither_scan_nor_pose(room, tmp_path):
    options = ("--step", "1", "--range", "1.5", "--v-min", "-5", "--v-max", "0")
    trace(room, tmp_path / "out", *options)
    before = files_of(tmp_path / "out")
    names = numbers_of(tmp_path / "out/scans")
    assert names == list(read_poses(tmp_path / "out/poses.csv").scans)
    assert json.loads((tmp_path / "out/raytrace.json").read_text())["blind_positions"] > 0
    (tmp_path / f"out/scans/{names[-1]}.ply").unlink()
    trace(room, tmp_path / "out", *options)
    assert files_of(tmp_path / "out") == before


@pytest.mark.parametrize(
    "options", [("--range", "0.1"), ("--height", "9"), ("--voxel-size", "0.01")]
)
def test_overwrite_keeps_the_earlier_run_until_the_new_one_can_be_made(room, tmp_path, options):
    trace(room, tmp_path / "out", "--step", "1")
    before = files_of(tmp_path / "out")
    result = invoke(
        "raytrace", room, "-o", tmp_path / "out", "--v-min", "70", *COARSE, *options, "--overwrite"
    )
    assert (result.exit_code, len(result.stderr.splitlines())) == (1, 1), result.stderr
    assert files_of(tmp_path / "out") == before


@pytest.mark.parametrize("text", ["not ours", "{}", "[" * 100_000])
def test_a_foreign_record_is_refused_and_nothing_beside_it_deleted(room, tmp_path, text):
    (tmp_path / "out/scans").mkdir(parents=True)
    (tmp_path / "out/scans/001.ply").write_text("precious")
    (tmp_path / "out/raytrace.json").write_text(text)
    for options in ((), ("--overwrite",)):
        result = invoke("raytrace", room, "-o", tmp_path / "out", *COARSE, *options)
        assert (result.exit_code, len(result.stderr.splitlines())) == (1, 1)
    assert (tmp_path / "out/scans/001.ply").read_text() == "precious"


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: text[: len(text) // 2],
        lambda text: text.replace("000001,", "abc,"),
        lambda text: "",
    ],
)
def test_a_damaged_pose_file_is_planned_anew(room, tmp_path, damage):
    trace(room, tmp_path / "out", "--step", "1")
    before = files_of(tmp_path / "out")
    poses = tmp_path / "out/poses.csv"
    poses.write_text(damage(poses.read_text()))
    trace(room, tmp_path / "out", "--step", "1")
    assert files_of(tmp_path / "out") == before


def test_an_empty_scan_file_is_made_again(room, tmp_path):
    trace(room, tmp_path / "out", "--step", "1")
    before = files_of(tmp_path / "out")
    (tmp_path / "out/scans/000001.ply").write_bytes(b"")
    trace(room, tmp_path / "out", "--step", "1")
    assert files_of(tmp_path / "out") == before


def test_a_second_process_in_the_folder_is_refused(room, tmp_path):
    with exclusive(tmp_path / "out"):
        result = invoke("raytrace", room, "-o", tmp_path / "out", *COARSE)
    assert result.exit_code == 1
    assert "another mcpseg is writing there" in result.stderr


def test_a_scanner_over_the_ceiling_is_refused(room, tmp_path):
    result = invoke("raytrace", room, "-o", tmp_path / "out", "--height", "4", *COARSE)
    assert result.exit_code == 1
    assert "expected a scanner below the ceiling" in result.stderr


def test_voxels_too_small_for_the_points_are_pointed_out(room, tmp_path):
    options = ("--voxel-size", "0.04", "--step", "2", "--h-res", "4", "--v-res", "4")
    assert (
        "rays may pass through walls"
        in invoke("raytrace", room, "-o", tmp_path / "out", *options).stderr
    )


def test_large_object_ids_are_counted_as_what_they_are(tmp_path):
    cloud = make_room()
    cloud.columns["instance"] = cloud.columns["instance"] + np.int32(2_000_000_000)
    write_cloud(tmp_path / "room.ply", cloud)
    document = json.loads(
        trace(tmp_path / "room.ply", tmp_path / "out", "--step", "2", "--json").stdout
    )
    assert document["objects"] == 8


def test_another_building_is_refused(room, tmp_path):
    trace(room, tmp_path / "out", "--step", "2")
    write_cloud(tmp_path / "room.ply", make_room(seed=5))
    result = invoke(
        "raytrace", tmp_path / "room.ply", "-o", tmp_path / "out", "--step", "2", *COARSE
    )
    assert result.exit_code == 1
    assert "another building" in result.stderr


def test_scans_that_no_run_made_are_never_written_over(room, tmp_path):
    (tmp_path / "out/scans").mkdir(parents=True)
    (tmp_path / "out/scans/000000.ply").write_text("precious")
    for options in ((), ("--overwrite",)):
        result = invoke("raytrace", room, "-o", tmp_path / "out", *COARSE, *options)
        assert result.exit_code == 1
        assert "no raytrace.json" in result.stderr
    assert (tmp_path / "out/scans/000000.ply").read_text() == "precious"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--step", "0"), "--step"),
        (("--v-min", "50", "--v-max", "20"), "--v-min must be below --v-max"),
        (("--dropout", "1"), "--dropout"),
        (("--h-res", "0"), "--h-res"),
        (("--range", "nan"), "--range"),
    ],
)
def test_a_setting_that_makes_no_sense_is_a_usage_error_that_names_the_option(
    room, tmp_path, options, said
):
    result = invoke("raytrace", room, "-o", tmp_path / "out", *options)
    assert result.exit_code == 2
    assert said in " ".join(result.stderr.split())
    assert not (tmp_path / "out").exists()


def test_a_building_without_free_floor_is_refused_in_one_line(tmp_path):
    cloud = make_room()
    columns = {
        name: column[cloud.columns["semantic"] == 2] for name, column in cloud.columns.items()
    }  # walls only
    write_cloud(tmp_path / "walls.ply", Cloud(columns, S3DIS_CLASSES))
    result = invoke("raytrace", tmp_path / "walls.ply", "-o", tmp_path / "out", *COARSE)
    assert result.exit_code == 1
    assert len(result.stderr.splitlines()) == 1


def words_of(room: Path, output: Path) -> list[object]:
    options = ["--step", "0.02", "--h-res", "3", "--v-res", "3", "-q", "--noise", "0.01"]
    return ["raytrace", room, "-o", output, *options]


def num_scans(output: Path) -> int:
    return len(list((output / "scans").glob("[0-9]*"))) if (output / "scans").exists() else 0


def test_a_killed_run_leaves_whole_scans_only_and_continues_to_the_same_files(room, tmp_path):
    run_to_its_end(*words_of(room, tmp_path / "whole"))
    for wanted in (1, 150):
        process = start(*words_of(room, tmp_path / "out"))
        wait_until(lambda wanted=wanted: num_scans(tmp_path / "out") >= wanted, process)
        process.kill()
        process.wait()
        assert process.returncode == -signal.SIGKILL
        made = [
            path for name in ("scans", "gt") for path in (tmp_path / "out" / name).glob("[0-9]*")
        ]
        whole = tmp_path / "whole"
        assert all(
            path.read_bytes() == (whole / path.relative_to(tmp_path / "out")).read_bytes()
            for path in made
        )
    assert not json.loads((tmp_path / "out/raytrace.json").read_text())["complete"]
    run_to_its_end(*words_of(room, tmp_path / "out"))
    assert files_of(tmp_path / "out") == files_of(tmp_path / "whole")


def test_a_full_disk_is_one_line_and_loses_nothing(room, tmp_path):
    def limit_file_size() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    full = subprocess.run(
        command(*words_of(room, tmp_path / "out")),
        preexec_fn=limit_file_size,
        capture_output=True,
        text=True,
    )
    assert full.returncode == 1
    assert len(full.stderr.splitlines()) == 1
    assert "expected room on the disk" in full.stderr
    assert not list((tmp_path / "out").rglob(".*part*"))


def test_the_real_room_is_scanned_as_downloaded(shared_folder, tmp_path):
    area = shared_folder / "real/s3dis_room/Area_1"
    options = ("--cache", tmp_path, "--step", "0.5", "--json", *COARSE)
    result = invoke("raytrace", area, "-o", tmp_path / "r", *options)
    document = json.loads(result.stdout)
    assert (document["building_points"], document["objects"]) == (480_470, 90)
    assert document["objects_seen"] > 60
    lines = np.concatenate([np.loadtxt(path) for path in sorted(area.rglob("*_*.txt"))])
    known = {tuple(point) for point in lines[:, :3].astype(np.float32).tolist()}
    for path in (tmp_path / "r/gt").iterdir():
        assert known.issuperset(map(tuple, read_cloud(path).xyz.tolist()))
