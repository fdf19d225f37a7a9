"""``mcpseg synth`` as people type it, and the way from nothing to scores."""

import json
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.formats.s3dis import read_area
from mcpseg_cli.resumable import exclusive
from tests.commands import command, invoke, run_to_its_end, start, wait_until
from tests.synth.models import write_models

REPOSITORY = Path(__file__).parents[2]
SMALL = ("--rooms", "3", "--spacing", "0.08", "--seed", "5", "-q")


@pytest.fixture(scope="module")
def area(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("b") / "Area_1"
    result = invoke("synth", path, *SMALL, "--jobs", "1")
    assert result.exit_code == 0, result.stderr
    return path


def texts_of(area: Path) -> dict[str, bytes]:
    return {str(path.relative_to(area)): path.read_bytes() for path in sorted(area.rglob("*.txt"))}


def test_the_area_has_the_layout_of_s3dis_and_is_read_back(area):
    building, report = read_area(area, use_cache=False)
    rooms = json.loads((area / "synth.json").read_text())["rooms"]
    assert list(building.rooms) == sorted(room["name"] for room in rooms)
    assert {path.parent.name for path in area.rglob("*.txt")} == {"Annotations"}
    assert len(building) == sum(sum(room["points"].values()) for room in rooms)
    assert (report.mended, report.dropped, report.other_classes) == ((), (), ())


def test_the_table_gives_points_and_objects_of_every_class_beside_the_shares_of_s3dis(tmp_path):
    result = invoke("synth", tmp_path / "Area_1", *SMALL[:-1])
    rows = {line.split()[0]: line.split() for line in result.stdout.splitlines()}
    assert set(S3DIS_CLASSES) <= set(rows)
    assert rows["wall"][4] == "26.4%"
    assert int(rows["floor"][1]) == 3


def test_json_is_one_document(tmp_path):
    document = json.loads(invoke("synth", tmp_path / "Area_1", *SMALL, "--json").stdout)
    assert document["rooms"] == 3
    assert sum(document["points_by_class"].values()) == document["points"] > 1000


def test_the_number_of_jobs_changes_nothing(area, tmp_path):
    run_to_its_end("synth", tmp_path / "Area_1", *SMALL, "--jobs", "2")
    assert texts_of(tmp_path / "Area_1") == texts_of(area)


def test_another_seed_and_another_style_give_other_buildings(area, tmp_path):
    invoke("synth", tmp_path / "seed/Area_1", *SMALL, "--seed", "6")
    invoke("synth", tmp_path / "style/Area_1", *SMALL, "--style", "3")
    assert texts_of(tmp_path / "seed/Area_1") != texts_of(area)
    assert texts_of(tmp_path / "style/Area_1") != texts_of(area)


def test_the_number_of_the_folder_decides_the_style(tmp_path):
    invoke("synth", tmp_path / "a/Area_3", *SMALL)
    invoke("synth", tmp_path / "b/Area_3", *SMALL, "--style", "3")
    invoke("synth", tmp_path / "c/Area_3", *SMALL, "--style", "1")
    assert (
        texts_of(tmp_path / "a/Area_3")
        == texts_of(tmp_path / "b/Area_3")
        != texts_of(tmp_path / "c/Area_3")
    )


def test_a_killed_command_continues_to_the_same_area(area, tmp_path):
    process = start("synth", tmp_path / "Area_1", *SMALL, "--jobs", "1")
    wait_until(lambda: any(tmp_path.glob("Area_1/*/Annotations")), process)
    process.kill()
    process.wait()
    assert process.returncode == -signal.SIGKILL
    assert len(list(tmp_path.glob("Area_1/[a-z]*/"))) < 3
    result = invoke("synth", tmp_path / "Area_1", *SMALL)
    assert result.exit_code == 0
    assert texts_of(tmp_path / "Area_1") == texts_of(area)


def test_running_again_makes_nothing_new_and_prints_the_same(area):
    before = {path: path.stat().st_mtime_ns for path in area.rglob("*.txt")}
    again = json.loads(invoke("synth", area, *SMALL, "--json").stdout)
    assert {path: path.stat().st_mtime_ns for path in area.rglob("*.txt")} == before
    assert again["points"] == sum(len(text.splitlines()) for text in texts_of(area).values())


def test_another_seed_in_the_same_folder_is_refused_and_overwrite_replaces(tmp_path):
    invoke("synth", tmp_path / "Area_1", *SMALL)
    before = texts_of(tmp_path / "Area_1")
    result = invoke("synth", tmp_path / "Area_1", *SMALL, "--seed", "6")
    assert result.exit_code == 1
    assert "made with --seed 5, now 6; expected the same" in result.stderr
    assert texts_of(tmp_path / "Area_1") == before
    assert invoke("synth", tmp_path / "Area_1", *SMALL, "--seed", "6", "--overwrite").exit_code == 0
    assert texts_of(tmp_path / "Area_1") != before


def test_a_folder_with_other_things_is_never_written_to(tmp_path):
    (tmp_path / "Area_1/office_1").mkdir(parents=True)
    for options in ((), ("--overwrite",)):
        result = invoke("synth", tmp_path / "Area_1", *SMALL, *options)
        assert result.exit_code == 1
        assert "has office_1 but no synth.json" in result.stderr
    assert (tmp_path / "Area_1/office_1").is_dir()
    assert not list((tmp_path / "Area_1").rglob("*.txt"))


def test_overwrite_leaves_files_alone_that_synth_did_not_make(tmp_path):
    invoke("synth", tmp_path / "Area_1", *SMALL)
    (tmp_path / "Area_1/scan_spots.txt").write_text("1 1\n")
    assert invoke("synth", tmp_path / "Area_1", *SMALL, "--seed", "6", "--overwrite").exit_code == 0
    assert (tmp_path / "Area_1/scan_spots.txt").read_text() == "1 1\n"


@pytest.mark.parametrize("planned", [["../precious"], [""], ["."], ["/"]])
def test_a_forged_record_deletes_nothing_outside_the_rooms(area, tmp_path, planned):
    (tmp_path / "precious").mkdir()
    (tmp_path / "Area_1").mkdir()
    (tmp_path / "Area_1/mine").mkdir()
    record = json.loads((area / "synth.json").read_text()) | {"planned": planned, "rooms": []}
    (tmp_path / "Area_1/synth.json").write_text(json.dumps(record))
    invoke("synth", tmp_path / "Area_1", *SMALL, "--overwrite")
    assert (tmp_path / "precious").is_dir()
    assert (tmp_path / "Area_1/mine").is_dir()


@pytest.mark.parametrize(
    "change", [{"planned": ["../precious"]}, {"rooms": [{"name": "office_1"}]}, {"unknown": 1},
               {"rooms": [{"name": "office_1", "points": {"tree": 1}, "objects": {}}]}]
)  # fmt: skip
def test_a_record_with_other_content_is_one_line(area, tmp_path, change):
    (tmp_path / "Area_1").mkdir()
    record = json.loads((area / "synth.json").read_text()) | change
    (tmp_path / "Area_1/synth.json").write_text(json.dumps(record))
    result = invoke("synth", tmp_path / "Area_1", *SMALL)
    assert (result.exit_code, len(result.stderr.splitlines())) == (1, 1)
    assert "not what mcpseg synth wrote" in result.stderr


@pytest.mark.parametrize("text", ["", "{}", "[" * 100_000, '{"rooms": 4}', "null"])
def test_a_damaged_record_is_one_line(tmp_path, text):
    (tmp_path / "Area_1").mkdir()
    (tmp_path / "Area_1/synth.json").write_text(text)
    result = invoke("synth", tmp_path / "Area_1", *SMALL, "--overwrite")
    assert result.exit_code == 1
    assert len(result.stderr.splitlines()) == 1


def test_a_second_process_in_the_folder_is_refused(tmp_path):
    with exclusive(tmp_path / "Area_1"):
        result = invoke("synth", tmp_path / "Area_1", *SMALL)
    assert result.exit_code == 1
    assert "another mcpseg is writing there" in result.stderr


def test_a_full_disk_is_one_line_and_leaves_no_half_room(area, tmp_path):
    def limit_file_size() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, 30_000))

    full = subprocess.run(
        command("synth", tmp_path / "Area_1", *SMALL, "--jobs", "1"),
        preexec_fn=limit_file_size,
        capture_output=True,
        text=True,
    )
    assert full.returncode == 1
    assert len(full.stderr.splitlines()) == 1
    assert "expected room on the disk" in full.stderr
    made = texts_of(tmp_path / "Area_1")
    assert made.items() <= texts_of(area).items()


def test_from_nothing_to_scores(area, tmp_path, weights_path):
    coarse = ("--step", "1.5", "--h-res", "3", "--v-res", "3", "-q")
    assert invoke("raytrace", area, "-o", tmp_path / "r", *coarse).exit_code == 0
    recording, options = (tmp_path / "r/scans", tmp_path / "r/poses.csv"), ("-w", weights_path)
    scans = invoke("segment", *recording, "-o", tmp_path / "o", *options)
    assert scans.exit_code == 0
    scores = json.loads(invoke("eval", tmp_path / "o", tmp_path / "r/gt", "--json").stdout)
    assert scores["covered"] == scores["points"] > 500


def test_rooms_are_drawn_from_inside_and_above(area, tmp_path):
    room = next(path.name for path in area.iterdir() if path.is_dir())
    script = [
        sys.executable,
        REPOSITORY / "examples/render_building.py",
        area,
        "--rooms",
        room,
        "--above",
    ]
    subprocess.run([*script, "-o", tmp_path], check=True, capture_output=True)
    for name in (room, "above"):
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_models_furnish_the_rooms_and_another_share_is_refused(tmp_path):
    folder, area = write_models(tmp_path / "furniture"), tmp_path / "Area_1"
    options = (*SMALL, "--jobs", "1", "--models", folder)
    assert invoke("synth", area, *options).exit_code == 0
    before = texts_of(area)
    assert invoke("synth", area, *options).exit_code == 0
    assert texts_of(area) == before

    refused = invoke("synth", area, *options, "--models-share", "1")
    assert refused.exit_code == 1
    assert "hash of the models" in refused.stderr


def test_a_folder_without_a_table_of_models_is_named(tmp_path):
    result = invoke("synth", tmp_path / "Area_1", *SMALL, "--models", tmp_path)
    assert result.exit_code == 1
    assert "models.csv: cannot be read; expected the table of the models" in result.stderr
