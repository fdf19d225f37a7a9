"""What a run keeps of its consumed scans while it goes on."""

import tracemalloc

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mcpseg_cli.formats.fingerprint import Fingerprint
from mcpseg_cli.segment.events import SkippedEvent
from mcpseg_cli.segment.scan_log import ScanLog
from mcpseg_cli.segment.scan_record import ScanRecord


def make_record(number: int, error: str | None = None) -> ScanRecord:
    pose = np.eye(4)
    pose[:3] = np.random.default_rng(number).normal(size=(3, 4))
    event = SkippedEvent(number, f"{number}.ply", error or "")
    file = Fingerprint(number, number, f"{number:064x}")
    return ScanRecord(f"{number}.ply", file, pose, 9, 10 * number, 0.1 * number, error, event, 99)


@given(st.lists(st.none() | st.just("damaged"), max_size=20))
def test_it_counts_scans_and_names_those_that_were_skipped(errors):
    records = [make_record(number, error) for number, error in enumerate(errors)]
    log = ScanLog(records)
    assert len(log) == len(records)
    assert log.floor == (records[-1].floor if records else None)
    assert log.num_voxels == (records[-1].num_voxels if records else 0)
    assert log.num_used == sum(record.error is None for record in records)
    assert log.errors == [error for error in errors if error]
    assert log.skipped == {number: f"{number}.ply" for number, error in enumerate(errors) if error}


def test_scans_take_no_memory():
    record, log = make_record(3), ScanLog()
    tracemalloc.start()
    for _ in range(10_000):
        log.append(record)
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert held < 10_000
