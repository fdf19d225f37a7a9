"""map.ply: a valid PLY at every moment, changed in place."""

import os
import re
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import read_cloud
from mcpseg_cli.incremental.map_rows import MapRows
from mcpseg_cli.segment.map_ply import LabelledMap

CLASSES = ("floor", "wall")


def rows_of(count: int, instance_step: int = 1) -> MapRows:
    index = np.arange(count)
    return MapRows(
        xyz=np.column_stack([index, index + 0.25, -index]).astype(np.float32),
        rgb=(index[:, None] % [251, 7, 13]).astype(np.uint8),
        semantic=(index % 2).astype(np.uint8),
        confidence=(index / max(count, 1)).astype(np.float32),
        instance=(index * instance_step).astype(np.int32),
        embedding=np.zeros((count, 50), np.int16),
    )


@pytest.mark.parametrize("counts", [[1], [9, 10, 11], [99, 1001, 1001]])
def test_the_file_opens_after_every_update_with_the_rows_so_far(tmp_path, counts):
    rows = rows_of(counts[-1])
    with LabelledMap(tmp_path / "map.ply", CLASSES) as labelled:
        for count in counts:
            so_far = MapRows(
                *(getattr(rows, name)[:count] for name in MapRows.__dataclass_fields__)
            )
            labelled.update(so_far, np.empty(0, np.int32))

            # read while it is open
            cloud = read_cloud(tmp_path / "map.ply")
            assert len(cloud) == count
            np.testing.assert_array_equal(cloud.xyz, so_far.xyz)
            np.testing.assert_array_equal(cloud.label("instance"), so_far.instance)
    assert cloud.classes == CLASSES


def test_changed_vertices_are_patched_and_the_rest_is_left_alone(tmp_path):
    before, after = rows_of(5000), rows_of(5000, instance_step=3)
    changed = np.array([0, 17, 18, 600, 4999], np.int32)
    mixed = before.instance.copy()
    mixed[changed] = after.instance[changed]

    with LabelledMap(tmp_path / "map.ply", CLASSES) as labelled:
        labelled.update(before, np.empty(0, np.int32))
        labelled.update(replace(before, instance=mixed), changed)
    np.testing.assert_array_equal(read_cloud(tmp_path / "map.ply").label("instance"), mixed)


def test_an_update_writes_only_what_changed(tmp_path, monkeypatch):
    written, original, rows = [], LabelledMap._write, rows_of(100_000)

    def counting(self, offset, data):
        written.append(len(data))
        original(self, offset, data)

    with LabelledMap(tmp_path / "map.ply", CLASSES) as labelled:
        labelled.update(rows, np.empty(0, np.int32))
        monkeypatch.setattr(LabelledMap, "_write", counting)
        labelled.update(rows, np.array([5, 99_000], np.int32))
    assert sum(written) < 100


def test_open3d_reads_the_map(tmp_path):
    o3d = pytest.importorskip("open3d")
    rows = rows_of(321)
    with LabelledMap(tmp_path / "map.ply", CLASSES) as labelled:
        labelled.update(rows, np.empty(0, np.int32))
    cloud = o3d.t.io.read_point_cloud(str(tmp_path / "map.ply"))
    np.testing.assert_array_equal(cloud.point.positions.numpy(), rows.xyz)
    np.testing.assert_array_equal(cloud.point.colors.numpy(), rows.rgb)
    np.testing.assert_array_equal(cloud.point["semantic"].numpy()[:, 0], rows.semantic)
    np.testing.assert_array_equal(cloud.point["instance"].numpy()[:, 0], rows.instance)
    np.testing.assert_array_equal(cloud.point["confidence"].numpy()[:, 0], rows.confidence)


def test_reconciling_an_equal_file_writes_nothing(tmp_path, monkeypatch):
    rows = rows_of(70_000)
    with LabelledMap(tmp_path / "map.ply", CLASSES) as labelled:
        labelled.update(rows, np.empty(0, np.int32))
    monkeypatch.setattr(LabelledMap, "_write", lambda self, offset, data: pytest.fail("wrote"))
    with LabelledMap(tmp_path / "map.ply", CLASSES) as labelled:
        labelled.reconcile(rows)


def test_reconciling_cuts_vertices_the_checkpoint_does_not_know(tmp_path):
    with LabelledMap(tmp_path / "map.ply", CLASSES) as labelled:
        labelled.update(rows_of(50), np.empty(0, np.int32))
    with LabelledMap(tmp_path / "map.ply", CLASSES) as labelled:
        labelled.reconcile(rows_of(20))
    assert len(read_cloud(tmp_path / "map.ply")) == 20


def test_the_map_of_no_voxels_is_a_ply_of_no_vertices(tmp_path):
    with LabelledMap(tmp_path / "map.ply", CLASSES) as labelled:
        labelled.reconcile(rows_of(0))
    assert b"element vertex 0\n" in (tmp_path / "map.ply").read_bytes()


def test_at_any_moment_of_an_update_the_header_names_no_more_vertices_than_there_are(
    tmp_path, monkeypatch
):
    path, write, found = tmp_path / "map.ply", os.pwrite, []

    def look() -> None:
        data = path.read_bytes()
        end = data.index(b"end_header\n") + len(b"end_header\n")
        promised = int(re.search(rb"element vertex (\d+)", data)[1])
        found.append((promised, (len(data) - end) // 24))

    def write_in_parts(file, data, offset):
        whole = bytes(data) if offset == 0 else bytes(data[: max(1, len(data) // 3)])
        written = write(file, whole, offset)
        look()
        return written

    monkeypatch.setattr(os, "pwrite", write_in_parts)
    nobody = np.empty(0, np.int32)
    for before, sizes in ((0, [5, 9, 10, 12]), (7, [7, 8]), (0, [3])):  # grows, is cut back
        with LabelledMap(path, ("a", "b")) as labelled_map:
            look()
            labelled_map.reconcile(rows_of(before))
            for size in sizes:
                labelled_map.update(rows_of(size), nobody)
                look()
    assert all(promised <= there for promised, there in found)
    assert found[-1] == (3, 3)


def test_a_map_read_between_its_new_vertices_and_its_header_is_read_again(tmp_path, monkeypatch):
    path, nobody, moments = tmp_path / "map.ply", np.empty(0, np.int32), []
    write = os.pwrite

    def keep_moments(file, data, offset):
        written = write(file, data, offset)
        moments.append(path.read_bytes())
        return written

    with LabelledMap(path, CLASSES) as labelled:
        labelled.update(rows_of(5), nobody)
        monkeypatch.setattr(os, "pwrite", keep_moments)
        labelled.update(rows_of(9), nobody)
    assert len(moments) == 2

    waiting = iter(moments)
    monkeypatch.setattr(Path, "read_bytes", lambda self: next(waiting))
    assert len(read_cloud(path)) == 9

    # one that stays so is refused, at once if it is old
    path.write_bytes(moments[0])
    monkeypatch.setattr(Path, "read_bytes", lambda self: moments[0])
    for age_s in (0, 3600):
        os.utime(path, (time.time() - age_s, time.time() - age_s))
        with pytest.raises(InputError, match="5 vertices promised, 9 found"):
            read_cloud(path)
