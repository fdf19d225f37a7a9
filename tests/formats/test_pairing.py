"""Which pose belongs to which scan: names, then times, then order, and never wrong in silence."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.pairing import pair
from mcpseg_cli.formats.poses import Poses, read_poses

START = 1305031102.175304
TIMES = START + np.array([0.0, 0.036, 0.064696, 0.1, 0.136, 0.168366, 0.2, 0.224696])


def make_poses(num_poses: int) -> NDArray[np.float64]:
    """Poses whose x is their number, each turned a little more about z."""
    poses = np.tile(np.eye(4), (num_poses, 1, 1))
    turn = Rotation.from_euler("z", 0.1 * np.arange(num_poses)[:, None])
    poses[:, :3, :3] = turn.as_matrix()
    poses[:, 0, 3] = np.arange(num_poses)
    return poses


def table(num_poses: int, **columns: object) -> Poses:
    return replace(Poses(make_poses(num_poses)), **columns)


def rows(names: list[str], poses: Poses, **options: object) -> list[float | None]:
    """The number of the pose that each scan got; None for none."""
    pairing = pair(names, None, poses, **options)
    found = pairing.poses[:, 0, 3]
    assert sorted(pairing.unpaired) == np.flatnonzero(np.isnan(found)).tolist()
    assert sorted(pairing.order.tolist()) == list(range(len(names)))
    return [None if np.isnan(x) else round(float(x), 6) for x in found]


def numbered(count: int, first: int = 0) -> list[str]:
    return [f"{number:06d}.ply" for number in range(first, first + count)]


# --- names ---

SAME_NAMES = {
    "as it is": ("000001.ply", "000001.ply"),
    "without ending": ("000001.ply", "000001"),
    "other ending": ("000001.ply", "000001.bin"),
    "two endings": ("frame-01.cloud.ply", "frame-01.pose.txt"),
    "path": ("a_1.ply", "scans/a_1.ply"),
    "path of Windows": ("a_1.ply", "C:\\scans\\a_1.ply"),
    "case": ("Scan_1.PLY", "scan_1.ply"),
    "composed letters": ("Bu\u0308ro.ply", "B\u00fcro.ply"),
    "zeros in front": ("000001.ply", "1"),
    "zeros behind": ("1305031102.200000.ply", "1305031102.2"),
    "number alone": ("scan_000001.ply", "1"),
    "other words": ("cloud_0001.ply", "IMG_0001.jpg"),
}


@pytest.mark.parametrize(("scan", "row"), SAME_NAMES.values(), ids=SAME_NAMES)
def test_names_that_a_person_calls_the_same_pair(scan: str, row: str) -> None:
    pairing = pair([scan], None, table(1, scans=(row,)))
    assert not pairing.unpaired
    assert pairing.how.startswith("by name") or "number" in pairing.how


def test_names_in_another_order_pair_by_name() -> None:
    poses = table(3, scans=("2", "0", "1"))
    assert rows(["scan_0.ply", "scan_1.ply", "scan_2.ply"], poses) == [1, 2, 0]


def test_what_only_looks_alike_after_zeros_are_dropped_stays_apart() -> None:
    poses = table(2, scans=("1", "01"))
    assert rows(["1.ply", "01.ply"], poses) == [0, 1]


def test_names_that_count_from_another_number_are_refused() -> None:
    poses = table(3, scans=("1", "2", "3"))
    with pytest.raises(InputError, match=r"no pose for scan 000000\.ply \(names are like '1'\)"):
        pair(numbered(3), None, poses)


def test_scans_without_a_row_and_rows_without_a_scan_are_told() -> None:
    pairing = pair(["a.ply", "b.ply"], None, table(2, scans=("b", "c")))
    assert pairing.unpaired == {0: "no row for it"}
    assert pairing.surplus == ("c",)


@given(st.permutations(range(6)), st.sets(st.integers(0, 5), min_size=1))
def test_names_pair_whatever_the_order_and_whatever_is_missing(
    order: list[int], there: set[int]
) -> None:
    kept = [number for number in order if number in there]
    poses = table(6, scans=tuple(f"{number:03d}" for number in range(6)))
    poses = poses.select(np.array(kept, np.intp))
    names = [f"{number:03d}.ply" for number in range(6)]
    assert rows(names, poses) == [number if number in there else None for number in range(6)]


def test_numbers_of_poses_pair_where_every_row_has_its_scan() -> None:
    assert rows(numbered(4), table(3, ids=np.array([3, 0, 1]))) == [1, 2, None, 0]


def test_numbers_that_count_something_else_do_not_pair() -> None:
    assert rows(numbered(3), table(3, ids=np.array([1, 2, 3]))) == [0, 1, 2]  # by order
    with pytest.raises(InputError, match="30 poses for 3 scans"):
        pair(numbered(3), None, table(30, ids=np.arange(30)))


def test_scans_of_every_tenth_number_pair_by_it() -> None:
    names = [f"{number}.ply" for number in (0, 10, 20)]
    assert rows(names, table(30, ids=np.arange(30))) == [0, 10, 20]


# --- time ---


def spellings(times: NDArray[np.float64]) -> dict[str, list[str]]:
    """Time stamps in names as tools write them."""
    ns = [round(time * 1e6) * 1000 for time in times]
    dates = [datetime.fromtimestamp(time, UTC) for time in times]
    return {
        "six digits": [f"{time:.6f}" for time in times],
        "zeros dropped": [str(round(time, 6)) for time in times],
        "ns": [str(n) for n in ns],
        "us": [str(n // 10**3) for n in ns],
        "ms with a point": [f"{n / 10**6:.6f}" for n in ns],
        "ms": [str(n // 10**6) for n in ns],
        "seconds and nanoseconds": [f"capture{n // 10**9}{n % 10**9}" for n in ns],
        "seconds_nanoseconds": [f"{n // 10**9}_{n % 10**9:09d}" for n in ns],
        "seconds-nanoseconds, zeros dropped": [f"{n // 10**9}-{n % 10**9}" for n in ns],
        "seconds.nanoseconds, zeros dropped": [f"{n // 10**9}.{n % 10**9}" for n in ns],
        "behind a number": [f"scan_{number}_{time:.6f}" for number, time in enumerate(times)],
        "dates": [date.strftime("%Y-%m-%dT%H-%M-%S.%f") for date in dates],
        "dates without marks": [date.strftime("%Y%m%d_%H%M%S_%f") for date in dates],
    }


@pytest.mark.parametrize("spelling", spellings(TIMES))
@pytest.mark.parametrize("order", [range(8), range(8)[::-1], (3, 0, 7, 1, 2, 6, 4, 5)], ids=str)
def test_time_stamps_in_names_pair_in_any_spelling_and_order(
    spelling: str, order: list[int]
) -> None:
    names = [f"{name}.ply" for name in spellings(TIMES)[spelling]]
    poses = table(8, stamps=TIMES).select(np.array(order, np.intp))
    found = np.array(rows(names, poses), float)
    np.testing.assert_allclose(found, np.arange(8), atol=0.03)  # names in ms: between two poses


@given(st.lists(st.integers(0, 10**9 - 1), min_size=3, max_size=8, unique=True))
def test_nanoseconds_without_zeros_in_front_pair(parts: list[int]) -> None:
    stamps = [1700000000 + number for number in range(len(parts))]
    names = [f"{second}{part}.ply" for second, part in zip(stamps, parts, strict=True)]
    times = np.array(stamps) + 1e-9 * np.array(parts)
    assert rows(names, table(len(parts), stamps=times)) == list(range(len(parts)))


def test_scans_come_in_order_of_time() -> None:
    names = [f"{name}.ply" for name in spellings(TIMES)["zeros dropped"]]
    names.sort(key=len)
    pairing = pair(names, None, table(8, stamps=TIMES))
    assert pairing.poses[pairing.order, 0, 3].tolist() == list(range(8))


def test_dense_poses_are_interpolated() -> None:
    scans = 1.7e9 + np.arange(20) / 2 + 0.011
    poses = table(330, stamps=1.7e9 + np.arange(330) / 30)
    pairing = pair([f"{time:.6f}.ply" for time in scans], None, poses)
    np.testing.assert_allclose(pairing.poses[:, 0, 3], (scans - 1.7e9) * 30, atol=1e-4)
    turn = Rotation.from_matrix(pairing.poses[:, :3, :3]).as_rotvec()[:, 2]
    np.testing.assert_allclose(np.exp(1j * turn), np.exp(0.1j * pairing.poses[:, 0, 3]), atol=1e-4)
    assert "between two poses" in pairing.how
    assert not pairing.unpaired


@given(
    st.lists(st.floats(0, 9.9), min_size=2, max_size=20, unique=True),
    st.floats(0.001, 0.2),
)
@settings(max_examples=50)
def test_no_pose_is_farther_than_the_bound(times: list[float], gap: float) -> None:
    names = [f"{1.7e9 + time:.6f}.ply" for time in sorted({round(time, 3) for time in times})]
    stamps = 1.7e9 + np.arange(0, 10, 0.3)
    scans = np.array([float(name[:-4]) for name in names])
    away = np.abs(scans[:, None] - stamps).min(axis=1)
    try:
        pairing = pair(names, None, table(len(stamps), stamps=stamps), gap)
    except InputError:
        assert (away > gap - 1e-6).all()
        return
    found = np.isfinite(pairing.poses[:, 0, 3])
    assert found[away < gap - 1e-6].all()
    assert not found[away > gap + 1e-6].any()
    truth = (scans[found] - 1.7e9) / 0.3
    assert (np.abs(pairing.poses[found, 0, 3] - truth) <= gap / 0.3 + 1e-6).all()


def test_a_lost_pose_is_not_replaced_by_its_neighbour() -> None:
    poses = table(8, stamps=TIMES)
    poses.poses[3] = np.nan
    poses = replace(poses, lost={3: "nan in line 4"})
    names = [f"{time:.6f}.ply" for time in TIMES]
    assert rows(names, poses) == [0, 1, 2, None, 4, 5, 6, 7]


def test_numbers_that_count_are_no_times_of_dense_poses() -> None:
    poses = table(3000, stamps=np.arange(3000) / 30)
    with pytest.raises(InputError, match="3,000 poses for 90 scans"):
        pair(numbered(90), None, poses)


def test_numbers_that_every_pose_has_as_its_time_are_times() -> None:
    poses = table(4, stamps=np.array([0.0, 2.0, 3.0, 7.0]))
    assert rows([f"{number:06d}.ply" for number in (0, 2, 3, 7)], poses) == [0, 1, 2, 3]
    names = [f"{number}.ply" for number in (33, 66, 101)]  # ms since the start
    assert rows(names, table(3, stamps=np.array([0.033, 0.066, 0.101]))) == [0, 1, 2]


def test_two_poses_that_differ_at_one_moment_are_refused() -> None:
    names = [f"{time:.6f}.ply" for time in TIMES]
    with pytest.raises(InputError, match="poses that differ at the same time"):
        pair(names, None, table(9, stamps=np.append(TIMES, TIMES[2])))


def test_names_of_poses_are_time_stamps_too() -> None:
    dense = START + np.arange(60) / 30
    poses = table(60, scans=tuple(f"rgb/{time:.6f}.png" for time in dense))
    scans = START + np.array([0.0, 0.51, 1.03])  # the first has its pose by name, too
    found = np.array(rows([f"{time:.6f}.ply" for time in scans], poses), float)
    np.testing.assert_allclose(found, 30 * (scans - START), atol=1e-3)


def test_time_stamps_of_the_recording_count_like_those_in_names() -> None:
    pairing = pair(numbered(8), TIMES, table(8, stamps=TIMES).select(np.arange(8)[::-1]))
    assert pairing.poses[:, 0, 3].tolist() == list(range(8))


# --- order ---


def test_scans_and_poses_that_nothing_names_pair_by_order() -> None:
    pairing = pair(numbered(3), None, table(3))
    assert pairing.how == "by order (3 and 3)"
    assert pairing.poses[:, 0, 3].tolist() == [0, 1, 2]


def test_rows_out_of_order_of_time_are_put_in_order() -> None:
    poses = table(4, stamps=TIMES[:4]).select(np.array([2, 0, 3, 1]))
    assert rows(numbered(4), poses) == [0, 1, 2, 3]
    assert "order of time" in pair(numbered(4), None, poses).how


def test_two_clocks_that_go_alike_pair_by_order() -> None:
    names = [f"{time:.6f}.ply" for time in TIMES]
    pairing = pair(names, None, table(8, stamps=TIMES - START))
    assert pairing.poses[:, 0, 3].tolist() == list(range(8))
    assert "clocks 1.30503e+09 s apart" in pairing.how


def test_times_that_contradict_the_order_are_refused() -> None:
    names = [f"{time:.6f}.ply" for time in TIMES]
    with pytest.raises(InputError, match=r"time stamps from 0\.0.*for scans from 1305031102"):
        pair(names, None, table(8, stamps=np.arange(8.0)))


@given(st.integers(1, 20), st.integers(1, 20))
def test_order_needs_as_many_of_both(num_scans: int, num_poses: int) -> None:
    if num_scans == num_poses:
        assert rows(numbered(num_scans), table(num_poses)) == list(range(num_scans))
    else:
        with pytest.raises(InputError, match=f"{num_poses} poses for {num_scans} scans"):
            pair(numbered(num_scans), None, table(num_poses))


# --- while it grows ---


@given(st.integers(1, 30), st.integers(0, 3), st.sampled_from(["names", "times", "order"]))
def test_what_a_growing_recording_pairs_stays_so(count: int, ahead: int, way: str) -> None:
    """Scans at 5 Hz, poses at 30 Hz or one each."""
    times = 1.7e9 + np.arange(30) / 5
    if way == "times":
        names = [f"{time:.6f}.ply" for time in times]
        whole = table(200, stamps=1.7e9 - 0.01 + np.arange(200) / 30)
        part = whole.select(np.arange(min(6 * count + ahead, 200)))
    else:
        names = numbered(30)
        scans = tuple(name[:-4] for name in names) if way == "names" else None
        whole = table(30, scans=scans)
        part = whole.select(np.arange(min(count + ahead, 30)))
    early = pair(names[:count], None, part, is_growing=True)
    late = pair(names, None, whole)
    known = [scan for scan in range(count) if scan not in early.awaited]
    assert len(known) >= count - 1
    np.testing.assert_array_equal(early.poses[known], late.poses[known])


def test_dense_poses_of_a_growing_recording_do_not_pair_by_order() -> None:
    poses = table(30, stamps=np.arange(30) / 30)
    with pytest.raises(InputError, match="30 poses for 5 scans"):
        pair(numbered(5), None, poses, is_growing=True)


def test_messages_name_the_pose_file() -> None:
    with pytest.raises(InputError, match=r"^poses/a\.tum: 3 poses for 2 scans"):
        pair(numbered(2), None, table(3), source=Path("poses/a.tum"))


def test_one_pose_of_a_folder_of_them_is_refused_with_the_folder(tmp_path):
    for number in range(3):
        np.savetxt(tmp_path / f"{number}.txt", np.eye(4))
    poses = read_poses(tmp_path / "0.txt")
    with pytest.raises(InputError, match=rf"1 poses for 3 scans.*give {tmp_path}, if each scan"):
        pair(["a.ply", "b.ply", "c.ply"], None, poses, source=tmp_path / "0.txt")
