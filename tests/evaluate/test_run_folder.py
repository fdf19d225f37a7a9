"""The folder of a run: what is read of it, once."""

import json

import pytest

from mcpseg_cli.errors import InputError
from mcpseg_cli.evaluate.run_folder import RunFolder

EVENTS = '{"name": "0.las", "ms": {"read": 1.0}}\n{"name": "1.las", "skipped": "cut"}\n'


def write_folder(folder, **configuration):
    (folder / "events.jsonl").write_text(EVENTS)
    record = {"configuration": configuration, "classes": ["wall"]}
    (folder / "run.json").write_text(json.dumps(record))
    return folder


def test_record_and_events_are_read(tmp_path):
    folder = RunFolder.read(write_folder(tmp_path, voxel_size=0.2, frame="sensor"))
    assert (folder.configuration.voxel_size, folder.configuration.frame) == (0.2, "sensor")
    assert [(event.name, event.skipped) for event in folder.events] == [
        ("0.las", False),
        ("1.las", True),
    ]


@pytest.mark.parametrize(("ending", "name"), [(None, "0.las"), ("npz", "0.npz")])
def test_labelled_scans_are_those_that_were_read_in_the_format_they_were_written_in(
    tmp_path, ending, name
):
    folder = RunFolder.read(write_folder(tmp_path, format=ending))
    assert folder.labelled_scans() == [tmp_path / "scans" / name]


def test_a_map_alone_has_neither_record_nor_events(tmp_path):
    folder = RunFolder.read(tmp_path)
    assert (folder.configuration.voxel_size, folder.events) == (0.1, None)
    assert folder.labelled_scans() == []


def test_events_without_a_record_are_refused(tmp_path):
    (write_folder(tmp_path) / "run.json").unlink()
    with pytest.raises(InputError, match=r"run\.json: not there"):
        RunFolder.read(tmp_path)
