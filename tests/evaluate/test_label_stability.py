"""Label stability and scores over the scans, against cases counted by hand and slow twins."""

import json

import numpy as np
import pytest

from mcpseg_cli.errors import InputError
from mcpseg_cli.evaluate.class_scores import confusion_matrix, intersection_over_union
from mcpseg_cli.evaluate.label_stability import LabelHistory
from mcpseg_cli.evaluate.scan_by_scan import measure_latency
from mcpseg_cli.evaluate.score_curve import CurveRecorder
from mcpseg_cli.segment.events import ScanEvent, read_events


def history_of(true, *looks):
    history = LabelHistory(np.array(true, np.uint8))
    for ids, semantic, instance in looks:
        history.look(np.array(ids), np.array(semantic, np.uint8), np.array(instance, np.int32))
    return history


def finish(history, semantic, instance):
    return history.finish(np.array(semantic, np.uint8), np.array(instance, np.int32))


def test_flips_are_counted_against_the_look_before():
    history = history_of(
        [1, 1, 1, 255],
        ([0, 1, 2, 3], [0, 1, 0, 0], [1, 1, 1, 1]),
        ([0, 1, 3], [1, 0, 1], [1, 1, 1]),
    )
    stability = finish(history, [1, 0, 2, 1], [1, 1, 1, 1])
    assert (stability.looks_again, stability.flips, stability.flips_per_look) == (3, 3, 1.0)

    # nothing is known about voxel 3
    assert (stability.flips_to_right, stability.flips_to_wrong) == (1, 1)
    assert stability.flips_unseen == 1  # voxel 2, never looked at again


def test_an_object_that_goes_over_into_another_is_merged():
    history = history_of([0] * 4, ([0, 1, 2, 3], [0] * 4, [1, 1, 2, 2]), ([2, 3], [0, 0], [1, 1]))
    stability = finish(history, [0] * 4, [1] * 4)
    assert (stability.ids_switched, stability.ids_merged, stability.ids_split) == (2, 1, 0)
    assert (stability.switches_per_look, stability.ids_switched_unseen) == (1.0, 0)


def test_a_merge_out_of_sight_shows_in_the_final_map():
    history = history_of([0] * 2, ([0, 1], [0, 0], [1, 2]))
    stability = finish(history, [0, 0], [1, 1])
    assert (stability.ids_switched, stability.ids_merged) == (0, 1)
    assert stability.ids_switched_unseen == 1


def test_an_object_found_under_two_ids_is_split():
    history = history_of([0] * 3, ([0, 1, 2], [0] * 3, [1, 1, 1]), ([0, 1, 2], [0] * 3, [1, 5, 5]))
    stability = finish(history, [0] * 3, [1, 5, 5])
    assert (stability.ids_switched, stability.ids_merged, stability.ids_split) == (2, 0, 1)


def test_a_new_name_for_an_object_is_a_switch_and_no_merge():
    history = history_of([0] * 2, ([0, 1], [0, 0], [1, 1]), ([0, 1], [0, 0], [7, 7]))
    stability = finish(history, [0, 0], [7, 7])
    assert (stability.ids_switched, stability.ids_merged, stability.ids_split) == (2, 0, 0)


def test_one_look_at_everything_has_nothing_to_be_unsteady():
    stability = finish(history_of([0], ([0], [0], [1])), [0], [1])
    assert stability.looks_again == stability.flips_per_look == stability.switches_per_look == 0


def test_the_curve_is_the_score_of_the_labels_last_seen():
    rng = np.random.default_rng(1)
    true = rng.choice([0, 1, 2, 255], 50).astype(np.uint8)
    recorder, last = CurveRecorder(true, 3), np.full(50, -1)

    # the scores of all that was seen, counted anew after every scan
    expected = []
    for _ in range(12):
        ids = rng.choice(50, 20, replace=False)
        semantic = rng.choice([0, 1, 2, 255], 20).astype(np.uint8)
        recorder.look(ids, semantic)
        last[ids] = semantic
        known = (last >= 0) & (true != 255)
        confusion = confusion_matrix(true[known], last[known], 3)
        present = confusion.sum(axis=1) > 0
        miou = intersection_over_union(confusion)[present].mean()
        expected.append((known.sum(), miou, np.trace(confusion) / known.sum()))

    curve = recorder.curve()
    found = np.stack([curve.voxels, curve.miou_present, curve.point_accuracy], axis=1)
    np.testing.assert_allclose(found, expected)
    assert curve.document()["miou_present"][-1] == pytest.approx(expected[-1][1])


def test_the_curve_follows_voxels_that_change_out_of_sight():
    recorder = CurveRecorder(np.array([0, 0, 1], np.uint8), 2)
    recorder.look(np.array([0, 1]), np.array([1, 0], np.uint8))
    recorder.change(np.array([0, 2]), np.array([0, 1], np.uint8))  # voxel 2 was not seen yet
    recorder.look(np.array([1]), np.array([0], np.uint8))
    curve = recorder.curve()
    assert curve.point_accuracy.tolist() == [0.5, 1.0]
    assert curve.voxels.tolist() == [2, 2]


def test_a_curve_of_one_scan_has_it_at_every_tenth():
    recorder = CurveRecorder(np.zeros(2, np.uint8), 1)
    recorder.look(np.array([0]), np.array([0], np.uint8))
    assert recorder.curve().document()["point_accuracy"] == [1.0] * 10


def test_latency_sums_the_stages_and_passes_over_what_was_skipped(tmp_path):
    lines = [{"name": f"{n}.ply", "ms": {"read": n, "network": 1.0}} for n in range(1, 101)]
    lines += [{"name": "bad.ply", "skipped": "cut"}, {"name": "lost.ply"}]
    (tmp_path / "events.jsonl").write_text(
        "".join(json.dumps(line) + "\n" for line in lines) + '{"name": "half'
    )
    events = read_events(tmp_path / "events.jsonl")
    assert (len(events), sum(event.skipped for event in events)) == (102, 1)
    latency = measure_latency(events)
    assert (latency.p50, latency.p95, latency.max) == pytest.approx((51.5, 96.05, 101.0))
    assert measure_latency(events[-2:]) is None


def test_first_scans_of_a_start_are_left_out_of_the_latency_unless_there_are_no_others():
    events = [ScanEvent("a", False, 9_000.0, True), ScanEvent("b", False, 10.0)]
    latency = measure_latency([*events, ScanEvent("c", False, 500.0, True)])
    assert (latency.p50, latency.p95, latency.max, latency.warm_up) == (10.0, 10.0, 10.0, 9_000.0)
    assert latency.text() == "10.0 median, 10.0 p95, 10.0 max; the first, 9,000, is not counted"
    alone = measure_latency(events[:1])
    assert (alone.max, alone.warm_up) == (9_000.0, None)


@pytest.mark.parametrize(
    "line", ["{", "[]", "{}", '{"name": "a", "ms": 3}', '{"name": "a", "ms": {"read": "x"}}']
)
def test_a_line_that_is_no_event_is_named(tmp_path, line):
    (tmp_path / "events.jsonl").write_text(f'{{"name": "0.ply"}}\n{line}\n')
    with pytest.raises(InputError, match=r"events\.jsonl: line 2 that is no event"):
        read_events(tmp_path / "events.jsonl")
