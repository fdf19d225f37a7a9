"""run.json: what it says comes back."""

import json

import pytest

from mcpseg_cli.config import SegmentSettings
from mcpseg_cli.errors import InputError
from mcpseg_cli.segment.run_record import RunConfiguration, RunRecord


def make_record(**facts) -> RunRecord:
    configuration = RunConfiguration(**SegmentSettings(voxel_size=0.2).model_dump(), frame="sensor")
    return RunRecord(configuration=configuration, classes=("wall", "floor"), **facts)


def written(record: RunRecord, folder) -> dict:
    record.write(folder)
    return json.loads((folder / "run.json").read_text())


def test_a_record_comes_back_as_it_was_written(tmp_path):
    record = make_record(mcpseg="1.2.3", command=("mcpseg", "segment", "scans \N{SNOWMAN}"))
    record.write(tmp_path)
    assert RunRecord.read(tmp_path) == record
    assert RunRecord.read(tmp_path).configuration.voxel_size == 0.2


def test_what_was_not_set_is_not_written(tmp_path):
    configuration = written(make_record(), tmp_path)["configuration"]
    assert list(configuration) == [*SegmentSettings.model_fields, "frame"]


def test_arguments_that_are_no_utf8_do_not_keep_a_run_from_being_described(tmp_path):
    make_record(command=("scans\udcff",)).write(tmp_path)
    assert RunRecord.read(tmp_path).command == ("scans\\xff",)


def test_keys_of_a_later_version_are_passed_over(tmp_path):
    document = written(make_record(), tmp_path)
    document["later"] = document["configuration"]["later"] = 1
    (tmp_path / "run.json").write_text(json.dumps(document))
    assert RunRecord.read(tmp_path) == make_record()


@pytest.mark.parametrize(
    ("change", "found"),
    [
        ({"classes": [1]}, "classes.0: Input should be a valid string"),
        ({"configuration": None}, "configuration: Input should be"),
        ({"configuration": {"voxel_size": 0}}, "configuration.voxel_size: Input should be greater"),
    ],
)
def test_what_segment_did_not_write_is_named(tmp_path, change, found):
    document = written(make_record(), tmp_path) | change
    (tmp_path / "run.json").write_text(json.dumps(document))
    with pytest.raises(InputError) as error:
        RunRecord.read(tmp_path)
    assert f"run.json: {found}" in str(error.value)
