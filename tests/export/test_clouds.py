"""Exported clouds and objects, as our own reader and those of others find them."""

import csv
import json
import shutil
import subprocess

import numpy as np
import pytest

from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.export.map_cloud import MapCloud, write_map
from mcpseg_cli.export.object_list import write_object_clouds, write_objects
from mcpseg_cli.export.relabel import relabel_scans
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.formats import Cloud, read_cloud, write_cloud, write_parts
from mcpseg_cli.segment.labelled_run import LabelledRun

LABELS = ("semantic", "instance", "confidence")


@pytest.fixture
def run(labelled_run):
    with LabelledRun(labelled_run.out) as run:
        yield run


class Halves:
    """A cloud in two parts."""

    def __init__(self, cloud):
        self.cloud = cloud

    def __len__(self):
        return len(self.cloud)

    def __iter__(self):
        for rows in (slice(0, 100), slice(100, None)):
            yield Cloud(
                {name: column[rows] for name, column in self.cloud.columns.items()},
                self.cloud.classes,
            )


@pytest.mark.parametrize("suffix", [".ply", ".las", ".npz", ".pcd"])
def test_a_cloud_in_parts_is_the_file_of_the_whole(labelled_run, tmp_path, suffix):
    cloud = read_cloud(labelled_run.out / "map.ply")
    write_cloud(tmp_path / f"whole{suffix}", cloud)
    write_parts(tmp_path / f"parts{suffix}", Halves(cloud))
    whole, parts = read_cloud(tmp_path / f"whole{suffix}"), read_cloud(tmp_path / f"parts{suffix}")
    assert (parts.classes, list(parts.columns)) == (whole.classes, list(whole.columns))
    for name, column in whole.columns.items():
        is_rounded = suffix == ".las" and name in "xyz"  # the first part decides the offset
        atol = 2e-4 if is_rounded else 0
        np.testing.assert_allclose(parts.columns[name], column, rtol=0, atol=atol)


@pytest.mark.parametrize("suffix", [".ply", ".las", ".laz", ".pcd", ".npz"])
def test_our_reader_finds_the_map_again(run, tmp_path, suffix):
    path, whole = tmp_path / f"map{suffix}", run.whole()
    assert write_map(run, path, Selection()) == len(run)
    cloud = read_cloud(path)
    assert cloud.classes == run.classes
    np.testing.assert_allclose(cloud.xyz, whole.xyz, atol=6e-5)
    np.testing.assert_array_equal(cloud.rgb, whole.rgb)
    for name in LABELS:
        np.testing.assert_array_equal(cloud.label(name), getattr(whole, name))


def test_laspy_finds_the_labels(run, tmp_path):
    import laspy

    write_map(run, tmp_path / "map.laz", Selection())
    las, whole = laspy.read(tmp_path / "map.laz"), run.whole()
    for name in LABELS:
        np.testing.assert_array_equal(las[name], getattr(whole, name))
    np.testing.assert_array_equal(las.classification, whole.semantic + 64)


@pytest.mark.parametrize(("suffix", "prefix"), [(".ply", "scalar_"), (".pcd", "")])
def test_open3d_finds_the_labels(run, tmp_path, suffix, prefix):
    import open3d

    write_map(run, tmp_path / f"map{suffix}", Selection())
    cloud, whole = open3d.t.io.read_point_cloud(str(tmp_path / f"map{suffix}")), run.whole()
    np.testing.assert_array_equal(cloud.point.positions.numpy(), whole.xyz)
    for name in LABELS:
        np.testing.assert_array_equal(
            cloud.point[prefix + name].numpy()[:, 0], getattr(whole, name)
        )


def test_h5py_finds_the_labels(run, tmp_path):
    import h5py

    write_map(run, tmp_path / "map.h5", Selection())
    whole = run.whole()
    with h5py.File(tmp_path / "map.h5") as file:
        assert tuple(file.attrs["classes"]) == run.classes
        for name in ("xyz", "rgb", *LABELS):
            np.testing.assert_array_equal(file[name][...], getattr(whole, name))


def test_pye57_finds_points_and_the_extension_the_labels(run, tmp_path):
    pye57 = pytest.importorskip("pye57")

    write_map(run, tmp_path / "map.e57", Selection())
    whole = run.whole()
    types = {"semantic": np.uint8, "instance": np.longlong, "confidence": np.float32}
    with pye57.E57(str(tmp_path / "map.e57")) as file:
        # what any reader finds
        scan = file.read_scan_raw(0, ignore_unsupported_fields=True)
        np.testing.assert_array_equal(scan["cartesianX"], whole.xyz[:, 0])
        np.testing.assert_array_equal(scan["colorBlue"], whole.rgb[:, 2])

        # our own fields
        header = file.get_header(0)
        arrays, buffers = {}, pye57.libe57.VectorSourceDestBuffer()
        for name, dtype in types.items():
            field, arrays[name] = f"mcpseg:{name}", np.empty(len(run), dtype)
            assert field in header.point_fields
            options = (field, arrays[name], len(run), True, True)
            buffers.append(pye57.libe57.SourceDestBuffer(file.image_file, *options))
        header.points.reader(buffers).read()
    for name, array in arrays.items():
        np.testing.assert_array_equal(array, getattr(whole, name))


@pytest.mark.skipif(shutil.which("CloudCompare") is None, reason="CloudCompare is not installed")
def test_cloudcompare_finds_the_labels_unasked(run, tmp_path):
    write_map(run, tmp_path / "map.ply", Selection())

    # as text with a header
    words = "CloudCompare -SILENT -AUTO_SAVE OFF -O map.ply -C_EXPORT_FMT ASC -ADD_HEADER"
    command = [*words.split(), "-SAVE_CLOUDS", "FILE", "map.asc"]
    environment = {"QT_QPA_PLATFORM": "offscreen", "HOME": str(tmp_path), "PATH": "/usr/bin:/bin"}
    subprocess.run(command, cwd=tmp_path, env=environment, check=True, capture_output=True)

    header, *_ = (tmp_path / "map.asc").read_text().splitlines()
    assert header.split() == ["//X", "Y", "Z", "R", "G", "B", *LABELS]
    table, whole = np.loadtxt(tmp_path / "map.asc", skiprows=1), run.whole()
    for column, name in enumerate(LABELS, start=6):
        np.testing.assert_allclose(table[:, column], getattr(whole, name), atol=1e-6)


def test_conditions_hold_at_once(run, tmp_path):
    whole = run.whole()
    common = run.classes[np.bincount(whole.semantic).argmax()]
    least = float(np.median(whole.confidence))
    selection = Selection((common,), None, least, (-1.0, -2.0, 0.1, 1.0, 2.0, 3.0))
    write_map(run, tmp_path / "some.ply", selection)
    cloud = read_cloud(tmp_path / "some.ply")

    # the same, one after another
    x, y, z = whole.xyz.T
    expected = (whole.semantic == run.classes.index(common)) & (whole.confidence >= least)
    expected &= (np.abs(x) <= 1.0) & (np.abs(y) <= 2.0) & (z >= 0.1)
    assert 0 < len(cloud) < len(run)
    np.testing.assert_array_equal(cloud.xyz, whole.xyz[expected])


def test_one_object_can_be_exported(run, tmp_path):
    whole = run.whole()
    wanted = int(whole.instance[-1])
    count = write_map(run, tmp_path / "one.npz", Selection(instances=(wanted,)))
    assert count == (whole.instance == wanted).sum()


@pytest.mark.parametrize(
    "selection", [Selection(instances=(10**8,)), Selection(box=(90.0, 90, 90, 91, 91, 91))]
)
def test_nothing_chosen_is_one_line(run, tmp_path, selection):
    for write in (write_map, write_objects):
        with pytest.raises(InputError, match="widen --class"):
            write(run, tmp_path / ("a.ply" if write is write_map else "a.csv"), selection)
    assert not list(tmp_path.iterdir())


def test_an_unknown_class_is_one_line_that_names_the_known(run):
    with pytest.raises(InputError, match=r"no class cupboard; expected ceiling, floor"):
        MapCloud(run, Selection(classes=("wall", "cupboard")))


def test_a_full_disk_leaves_nothing_behind(run, tmp_path, monkeypatch):
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    for suffix in (".ply", ".las", ".npz", ".h5"):
        with pytest.raises(OSError, match=f"map{suffix}"):  # noqa: PT012
            resource.setrlimit(resource.RLIMIT_FSIZE, (4000, before[1]))
            try:
                write_map(run, tmp_path / f"map{suffix}", Selection())
            finally:
                resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not list(tmp_path.iterdir())


def test_e57_without_its_library_says_what_to_install(run, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pye57", None)
    monkeypatch.delitem(__import__("sys").modules, "mcpseg_cli.formats.e57", raising=False)
    with pytest.raises(OutputError, match=r"map.e57: needs pye57.*pip install 'mcpseg\[e57\]'"):
        write_map(run, tmp_path / "map.e57", Selection())


def test_csv_and_json_hold_the_same_objects(run, tmp_path):
    for suffix in ("json", "csv"):
        write_objects(run, tmp_path / f"objects.{suffix}", Selection())
    items = json.loads((tmp_path / "objects.json").read_text())
    with (tmp_path / "objects.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["id"]) for row in rows] == [item["id"] for item in items]
    assert [float(row["centroid_y"]) for row in rows] == [item["centroid"][1] for item in items]
    assert [float(row["obb_size_height"]) for row in rows] == [
        item["obb_size"][2] for item in items
    ]


def test_footprints_are_closed_rings_around_their_objects(run, tmp_path):
    write_objects(run, tmp_path / "objects.geojson", Selection())
    features = json.loads((tmp_path / "objects.geojson").read_text())["features"]
    whole = run.whole()
    for feature in features:
        (ring,) = feature["geometry"]["coordinates"]
        corners = np.array(ring)
        assert (corners[0] == corners[-1]).all()

        # every point lies to the left of every edge
        edges = np.diff(corners, axis=0)
        points = whole.xyz[whole.instance == feature["id"], :2].astype(np.float64)
        offset = points[:, None] - corners[None, :-1]
        turn = edges[:, 0] * offset[..., 1] - edges[:, 1] * offset[..., 0]
        assert (turn > -1e-3).all()


def test_every_object_becomes_a_cloud_of_its_own(run, tmp_path):
    names = run.classes[:6]
    count = write_object_clouds(run, tmp_path / "objects", ".ply", Selection(classes=names))
    expected = [item for item in run.objects() if item.class_name in names]
    assert count == len(expected) > 0

    paths = sorted((tmp_path / "objects").iterdir())
    titles = [f"{item.id:06d}_{item.class_name}.ply" for item in expected]
    assert [path.name for path in paths] == titles
    for path, item in zip(paths, expected, strict=True):
        cloud = read_cloud(path)
        assert len(cloud) == item.num_points
        assert (cloud.label("instance") == item.id).all()


def test_scans_get_the_final_labels_in_their_own_order(run, labelled_run, tmp_path):
    paths = list(relabel_scans(run, labelled_run.scans, tmp_path / "relabelled"))
    assert [path.name for path in paths] == [record.name for record in run.scans]

    # where each voxel is in the map
    whole = run.whole()
    voxels = np.floor(whole.xyz / 0.1 + 0.5).astype(int).tolist()
    place = {tuple(voxel): row for row, voxel in enumerate(voxels)}

    for path in paths:
        cloud, original = read_cloud(path), read_cloud(labelled_run.scans / path.name)
        for name, column in original.columns.items():
            np.testing.assert_array_equal(cloud.columns[name], column)

        voxels = np.floor(original.xyz.astype(np.float64) / 0.1 + 0.5).astype(int).tolist()
        rows = np.array([place.get(tuple(voxel), -1) for voxel in voxels])
        instance = np.where(rows < 0, 0, whole.instance[rows])
        semantic = np.where(rows < 0, 255, whole.semantic[rows])
        np.testing.assert_array_equal(cloud.label("instance"), instance)
        np.testing.assert_array_equal(cloud.label("semantic"), semantic)


def test_points_out_of_range_then_have_labels_if_they_were_mapped_later(
    run, labelled_run, tmp_path
):
    (first, *_) = relabel_scans(run, labelled_run.scans, tmp_path / "relabelled")
    then = read_cloud(labelled_run.out / "scans" / first.name).label("semantic")
    assert (read_cloud(first).label("semantic") != 255).sum() >= (then != 255).sum()


@pytest.mark.parametrize("damage", ["missing", "changed"])
def test_scans_that_are_not_those_of_the_run_are_refused(run, labelled_run, tmp_path, damage):
    scans = tmp_path / "scans"
    shutil.copytree(labelled_run.scans, scans)
    path = scans / run.scans[2].name
    if damage == "missing":
        path.unlink()
    else:
        data = bytearray(path.read_bytes())
        data[-1] ^= 1
        path.write_bytes(data)

    said = {"missing": "no such scan", "changed": "changed since it was labelled"}[damage]
    with pytest.raises(InputError, match=said):
        list(relabel_scans(run, scans, tmp_path / "relabelled"))
    assert not (tmp_path / "relabelled").exists()


def test_scans_are_never_written_over_themselves(run, labelled_run):
    with pytest.raises(OutputError, match="holds the input scans"):
        list(relabel_scans(run, labelled_run.scans, labelled_run.scans))
