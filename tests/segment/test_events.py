"""Events: records that come back from the checkpoint, lines that a killed run left behind."""

import json

import numpy as np
import pytest

from mcpseg_cli.incremental.segmenter import ScanUpdate
from mcpseg_cli.segment.events import (
    LabelledEvent,
    SkippedEvent,
    append_event,
    event_text,
    parse_event,
    read_events,
    reconcile_events,
)

SKIPPED = SkippedEvent(1, "000001ü.ply", "it is damaged")


@pytest.fixture
def labelled() -> LabelledEvent:
    update = ScanUpdate(
        index=0, point_ids=np.array([0, -1, 1, 1], np.int32), first_new=0, num_new=2, num_seen=0,
        merges=np.array([[3, 1]], np.int32), splits=np.array([[2, 6]], np.int32),
        moved=np.array([7], np.int32), changed=np.array([5, 7], np.int32),
        relabelled=np.array([5], np.int32), num_reclassified=1, judged=np.array([5], np.int32),
        floor=-0.125, ms={},
    )  # fmt: skip
    return LabelledEvent.of(0, "000000.ply", 4, update, 5)


def test_an_event_says_what_a_scan_did(labelled):
    assert json.loads(event_text(labelled)) == {
        "scan": 0, "name": "000000.ply", "points": 4, "points_in_range": 3, "voxels_new": 2,
        "voxels_seen": 0, "voxels": 2, "objects": 5, "merges": [[3, 1]], "splits": [[2, 6]],
        "label_changes": 2, "class_changes": 1, "floor": -0.125,
    }  # fmt: skip


def test_times_stand_behind_the_rest_to_microseconds(labelled):
    text = event_text(labelled)
    assert event_text(labelled, {"read": 1.23456, "write": 2}) == (
        text[:-1] + ', "ms": {"read": 1.235, "write": 2}}'
    )
    assert event_text(labelled, {}) == text
    assert event_text(labelled, {"read": 1.0}, is_first=True).endswith('}, "warm_up": true}')


def test_events_come_back_as_they_were_to_the_byte(labelled):
    for event in (labelled, SKIPPED):
        assert parse_event(event_text(event)) == event
        assert event_text(parse_event(event_text(event))) == event_text(event)


@pytest.mark.parametrize("text", ["", "[", "3", "null", "{}", '{"scan": 1}', '{"skipped": "no"}'])
def test_what_is_no_event_is_refused(text):
    with pytest.raises(ValueError, match=r"no event|Expecting"):
        parse_event(text)


@pytest.mark.parametrize(
    "left", ["", "half a li", "{}\n", "null\n", "one too many\nand a half", None]
)
def test_lines_are_kept_as_far_as_they_are_of_these_scans(labelled, left, tmp_path):
    path = tmp_path / "events.jsonl"
    append_event(path, labelled, {"read": 1.0}, is_first=True)
    append_event(path, SKIPPED, None)
    whole = path.read_text()
    if left is None:
        path.unlink()
    else:
        path.write_text(whole + left)
    reconcile_events(path, [labelled, SKIPPED])
    times_are_lost = whole.replace(', "ms": {"read": 1.0}, "warm_up": true', "")
    assert path.read_text() == (times_are_lost if left is None else whole)


def test_a_line_of_another_scan_and_all_after_it_are_replaced(labelled, tmp_path):
    path = tmp_path / "events.jsonl"
    other = SkippedEvent(0, "other.ply", "why")
    for event in (other, SKIPPED):
        append_event(path, event, {"read": 1.0})
    reconcile_events(path, [labelled, SKIPPED])
    assert path.read_text() == f"{event_text(labelled)}\n{event_text(SKIPPED)}\n"


def test_what_is_measured_of_events_is_their_time_and_whether_they_were_skipped(labelled, tmp_path):
    path = tmp_path / "events.jsonl"
    append_event(path, labelled, {"read": 1.5, "write": 2.0})
    append_event(path, SKIPPED, None)
    events = read_events(path)
    assert [(event.name, event.skipped, event.ms) for event in events] == [
        ("000000.ply", False, 3.5),
        (SKIPPED.name, True, None),
    ]
