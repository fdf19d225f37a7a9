"""Labels as they were, played as the page plays them, against the checkpoint's own past."""

import numpy as np
import pytest

from mcpseg_cli.export.label_history import LabelHistory
from mcpseg_cli.segment.labelled_run import LabelledRun
from mcpseg_cli.segment.past_labels import PastLabels


@pytest.fixture(params=["changing_run", "labelled_run"])
def run(request):
    with LabelledRun(request.getfixturevalue(request.param).out) as run:
        yield run


class Played:
    """Labels after any scan, one step of the logs at a time, as labels.js does it."""

    def __init__(self, history, current):
        self.columns = history.columns(current)
        self.semantic = self.columns["first_semantic"].copy()
        self.object = self.columns["first_object"].copy()
        self.ids, self.scan = history.object_ids, 0

    def go_to(self, scan):
        for values, name in ((self.semantic, "class"), (self.object, "move")):
            ends = np.append(0, self.columns[f"{name}_ends"]).astype(int)
            first, last = sorted((ends[self.scan], ends[scan]))
            order = slice(first, last)
            rows, swaps = (self.columns[f"{name}_{what}"][order] for what in ("rows", "swaps"))
            np.bitwise_xor.at(values, rows, swaps)
        self.scan = scan

    @property
    def instance(self):
        survivor = np.arange(len(self.ids))
        end = np.append(0, self.columns["merge_ends"])[self.scan]
        for old, new in self.columns["merges"][:end]:
            survivor[old] = new
        owner = self.object
        while (survivor[owner] != owner).any():
            owner = survivor[owner]
        return self.ids[owner]


def test_any_moment_is_the_past_of_the_checkpoint_in_whatever_order(run):
    whole, last = run.whole(), len(run.scans)
    played = Played(LabelHistory.of(run, whole.ids), whole.instance)
    past = PastLabels(run._state, run.classes)
    for scan in [*range(1, last + 1), 1, last, 2, last]:
        played.go_to(scan)
        seen = np.arange(run.scans[scan - 1].num_voxels, dtype=np.int32)
        labels = past.after(scan - 1, seen)
        np.testing.assert_array_equal(played.semantic[seen], labels.semantic)
        np.testing.assert_array_equal(played.instance[seen], labels.instance)


def test_after_the_last_scan_labels_are_those_of_now(run):
    whole = run.whole()
    history = LabelHistory.of(run, whole.ids)
    played = Played(history, whole.instance)
    played.go_to(len(run.scans))
    np.testing.assert_array_equal(played.semantic, whole.semantic)
    np.testing.assert_array_equal(played.instance, whole.instance)
    np.testing.assert_array_equal(history.object_ids[played.columns["object"]], whole.instance)


def test_the_history_of_some_voxels_is_theirs(run):
    whole = run.whole()
    rows = np.random.default_rng(5).random(len(whole)) < 0.3
    some = Played(LabelHistory.of(run, whole.ids[rows]), whole.instance[rows])
    all_of_them = Played(LabelHistory.of(run, whole.ids), whole.instance)
    for scan in (len(run.scans), 2):
        for played in (some, all_of_them):
            played.go_to(scan)
        np.testing.assert_array_equal(some.semantic, all_of_them.semantic[rows])
        np.testing.assert_array_equal(some.instance, all_of_them.instance[rows])


def test_labels_do_change_in_this_run(changing_run):
    with LabelledRun(changing_run.out) as run:
        whole = run.whole()
        columns = LabelHistory.of(run, whole.ids).columns(whole.instance)
    assert len(columns["class_rows"]) > 100
    assert len(columns["move_rows"]) + len(columns["merges"]) > 0
