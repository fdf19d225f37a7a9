"""Sound buildings, areas and what was prepared from them, for the long campaign to damage."""

from __future__ import annotations

import importlib.util
import shutil
from pathlib import Path

import laspy
import numpy as np
import trimesh
from PIL import Image

from mcpseg_cli.config import SampleSettings
from mcpseg_cli.evaluate.prediction import read_prediction
from mcpseg_cli.evaluate.truth import open_truth
from mcpseg_cli.formats import Cloud, Labels, read_cloud, write_cloud
from mcpseg_cli.formats.buildings import read_building
from mcpseg_cli.formats.mesh_building import MeshOptions
from mcpseg_cli.formats.s3dis import read_area, write_room
from mcpseg_cli.networks.tensor_bundle import import_checkpoint
from mcpseg_cli.segment.events import MergedEvent, SkippedEvent, event_text, reconcile_events
from mcpseg_cli.synth.run import RECORD, SynthRequest, _read_record
from mcpseg_cli.train.folds import find_areas
from mcpseg_cli.train.replay import Replay
from mcpseg_cli.train.samples import AreaSamples, prepare_samples
from tests.areas import write_area
from tests.formats.test_meshes import write_ifc
from tests.networks.test_weights import voxnet_tensors, write_bundle
from tests.soak_sound import Sound, sound_in, sound_of

SAMPLES = SampleSettings(seen_again=10, num_context=8)
WINDOWS = SampleSettings(seen_again=10, num_context=0)
_COLOURS = {"shares": ("red", "green", "blue"), "splats": ("f_dc_0", "f_dc_1", "f_dc_2")}
_MESH = MeshOptions(up="z", scale=1.0, voxel_size=10.0)


def prepared(folder: Path) -> list[Sound]:
    """Write samples, areas, caches, buildings, LAS with odd records, and a checkpoint."""
    folder.mkdir(parents=True, exist_ok=True)
    found = [*_samples(folder), *_area(folder), *_rooms(folder), *_buildings(folder)]
    return [*found, *_las(folder), *_bundle(folder), _synth(folder), _events(folder)]


def _samples(folder: Path) -> list[Sound]:
    """Write the samples of an area; damaged ones are made again, or are what they were."""
    area = write_area(folder / "Area_1", num_scans=2, density=0.1)
    found = []
    for name, settings in (("samples", SAMPLES), ("windows", WINDOWS)):
        path = prepare_samples(area, settings, folder / f"{name}.h5").path
        sound, as_written = path.read_bytes(), _content(AreaSamples(path))

        def prepare(
            damaged: Path, settings: SampleSettings = settings, as_written: object = as_written
        ) -> None:
            samples = prepare_samples(area, settings, damaged)
            assert _content(samples) == as_written, "other samples, in silence"

        found.append(Sound(path.name, sound, prepare))
        found.append(Sound(f"opened-{path.name}", sound, lambda one: _content(AreaSamples(one))))
    return found


def _content(samples: AreaSamples) -> list[object]:
    """Read all there is; windows have but what each scan sees."""
    tables = [samples.xyz, samples.rgb, samples.semantic, samples.instance]
    tables += [samples.position, samples.floor, samples.starts, samples.seen_starts]
    if "seen" in vars(samples):
        tables.append(samples.seen)
    else:
        scans = [samples.scan(number) for number in range(samples.num_scans)]
        tables += [part for one in scans for part in (one.voxel, one.context, one.seen)]
        tables += [np.array([one.num_new for one in scans])]
    return [samples.name, samples.classes, *(table.tobytes() for table in tables)]


def _area(folder: Path) -> list[Sound]:
    """Write a ray-traced area, which ``mcpseg train`` reads and ``mcpseg eval`` compares with."""
    data = folder / "data"
    write_area(data / "Area_1", num_scans=2, density=0.1)

    def read(whole: Path) -> None:
        for area in find_areas(whole):
            for _ in Replay(area.folder, SAMPLES).run():
                pass
        for _ in open_truth(whole / "Area_1/gt").parts():
            pass

    inners = ("raytrace.json", "poses.csv", "scans/000000.ply", "gt/000001.ply")
    return [sound_in(data, f"Area_1/{inner}", read) for inner in inners]


def _rooms(folder: Path) -> list[Sound]:
    """Write an area of rooms with classes of its own, and its cache."""
    rng = np.random.default_rng(3)
    root = folder / "Area_2"
    for room in ("office_1", "hall_2"):
        points = rng.random((12, 3)).astype("f4"), rng.integers(0, 256, (12, 3)).astype("u1")
        write_room(root, room, [("chair", *points), ("sofa", *points), ("rug", *points)])
    (root / "classes.txt").write_text("# home\nchair\nsofa\nrug\nclutter\n")
    own = ("classes.txt", "office_1/Annotations/sofa_1.txt")
    found = [sound_in(root, inner, lambda one: read_area(one, use_cache=False)) for inner in own]

    cached = folder / "Area_3"
    shutil.copytree(root, cached)
    sound, _ = read_area(cached)

    def read_cached(whole: Path) -> None:
        again, _ = read_area(whole)
        for name in ("xyz", "rgb", "semantic", "instance"):
            assert (getattr(again, name) == getattr(sound, name)).all(), "another area, in silence"
        assert again.classes == sound.classes

    return [*found, sound_in(cached, ".mcpseg.h5", read_cached)]


def _buildings(folder: Path) -> list[Sound]:
    """Write labelled clouds, meshes with materials and pictures, and IFC if it can be read."""
    rng = np.random.default_rng(5)
    columns: dict[str, np.ndarray] = {axis: rng.random(30).astype("f4") for axis in "xyz"}
    columns["semantic"], columns["instance"] = np.arange(30) % 2, np.arange(30) // 8
    columns["confidence"] = rng.random(30).astype("f4")
    typed = {"semantic": "u1", "instance": "i4", "confidence": "f4"}
    columns |= {name: columns[name].astype(dtype) for name, dtype in typed.items()}
    found = []
    for suffix in (".ply", ".las", ".laz", ".npz", ".pcd"):
        path = folder / f"labelled{suffix}"
        write_cloud(path, Cloud(columns, ("floor", "wall")))
        found.append(sound_of(path, _read_labelled))
    for kind, names in _COLOURS.items():
        path = folder / f"{kind}.ply"
        shades = {name: rng.random(30).astype("f4") for name in names}
        write_cloud(path, Cloud({axis: columns[axis] for axis in "xyz"} | shades))
        found.append(sound_of(path, lambda one: read_cloud(one).colour(None, one)))
    found += _meshes(folder / "mesh")
    if importlib.util.find_spec("ifcopenshell") is not None:
        found.append(sound_of(write_ifc(folder / "house.ifc"), _read_mesh, is_slow=True))
    return found


def _read_labelled(path: Path) -> None:
    """Read a labelled cloud as raytrace does, and as eval does on both sides."""
    for read in (
        lambda: read_building(path), lambda: read_prediction(path),
        lambda: list(open_truth(path).parts()),
    ):  # fmt: skip
        read()


def _read_mesh(path: Path) -> object:
    return read_building(path, mesh=_MESH)


def _meshes(folder: Path) -> list[Sound]:
    """Write a mesh with a picture as glTF and OBJ, of several files each."""
    box = trimesh.creation.box(extents=(4, 3, 2.5))
    picture = Image.fromarray(np.arange(48, dtype=np.uint8).reshape(4, 4, 3))
    uv = box.vertices[:, :2] % 1.0
    box.visual = trimesh.visual.TextureVisuals(uv=uv, image=picture)
    for name, inner in (("gltf", "house.gltf"), ("obj", "house.obj")):
        (folder / name).mkdir(parents=True)
        box.export(folder / name / inner)

    return [
        sound_in(folder / name, one.name, lambda at, inner=inner: _read_mesh(at / inner))
        for name, inner in (("gltf", "house.gltf"), ("obj", "house.obj"))
        for one in sorted((folder / name).iterdir())
    ]


def _las(folder: Path) -> list[Sound]:
    """Write LAS and LAZ with records of many kinds, and names that are no ASCII."""
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales = [0.001] * 3
    extra = laspy.ExtraBytesParams
    header.add_extra_dims(
        [
            extra("h??he", "u2", "H??he", scales=np.array([0.01]), offsets=np.array([1.0])),
            extra("normal", "3f4"), extra("plain", "f8"),
        ]
    )  # fmt: skip
    header.vlrs.append(laspy.VLR("LASF_Projection", 2112, "WKT", b'GEOGCS["WGS 84"]\0'))
    header.vlrs.append(laspy.VLR("LASF_Spec", 0, "classes", b"\x02ground".ljust(32, b"\0")))
    keys = np.array([1, 1, 0, 2, 1024, 0, 1, 1, 2049, 34737, 7, 0], "<u2").tobytes()
    header.vlrs.append(laspy.VLR("LASF_Projection", 34735, "keys", keys))
    header.vlrs.append(laspy.VLR("LASF_Projection", 34736, "numbers", np.ones(2).tobytes()))
    header.vlrs.append(laspy.VLR("LASF_Projection", 34737, "texts", b"WGS 84|\0"))
    header.vlrs.append(laspy.VLR("LASF_Spec", 100, "wave", bytes(26)))
    header.vlrs.append(laspy.VLR("own??he", 42, "note", b"kept"))
    header.vlrs.append(laspy.VLR("mcpseg", 1, "class names", b"floor,wall"))
    header.evlrs = laspy.vlrs.vlrlist.VLRList([laspy.VLR("owner", 43, "far", b"kept as well")])
    las = laspy.LasData(header)
    las.x, las.y, las.z = np.random.default_rng(9).random((3, 30))
    las["h??he"] = np.linspace(1, 9, 30)
    found = []
    for suffix in (".las", ".laz"):
        for kind, patch in (("utf-8", "öhe".encode()), ("latin-1", "öhen".encode("latin-1"))):
            path = folder / f"{kind}{suffix}"
            las.write(path)
            path.write_bytes(path.read_bytes().replace(b"??he", patch))
            found.append(sound_of(path, _write_labelled))
    return found


def _write_labelled(path: Path) -> None:
    """Read a scan, write its labelled copy, and read that."""
    cloud = read_cloud(path)
    count = len(cloud)
    confidence = np.linspace(0, 1, count, dtype=np.float32)
    labels = Labels(np.ones(count, np.uint8), np.arange(count, dtype=np.int32), confidence, ("a",))
    output = path.with_name(f"copy{path.suffix}")
    write_cloud(output, cloud.with_labels(labels))
    again = read_cloud(output)
    assert (again.label("instance") == labels.instance).all(), "other labels"
    np.testing.assert_allclose(again.xyz, cloud.xyz, rtol=1e-6, atol=1e-3)


def _bundle(folder: Path) -> list[Sound]:
    """Write a checkpoint of TensorFlow."""
    root = folder / "bundle"
    root.mkdir()
    write_bundle(root / "model", voxnet_tensors())
    endings = (".index", ".data-00000-of-00001")

    def read(whole: Path) -> object:
        return import_checkpoint(whole / "model")

    return [sound_in(root, f"model{ending}", read) for ending in endings]


def _synth(folder: Path) -> Sound:
    """Write the record of an area that was built."""
    from mcpseg_cli.synth.run import RoomCounts, _Record

    root = folder / "built"
    root.mkdir()
    request = SynthRequest(number=1, seed=2, num_rooms=3, spacing=0.1, style=1)
    room = RoomCounts(name="office_1", points={"wall": 9}, objects={"wall": 1})
    record = _Record(version=1, request=request, style_name="a", planned=["office_1"], rooms=[room])
    (root / RECORD).write_text(record.model_dump_json(indent=1))
    return sound_in(root, RECORD, _read_record)


def _events(folder: Path) -> Sound:
    """Write events that a killed run left, which are brought to those of its checkpoint."""
    events = [
        SkippedEvent(0, "0.ply", "no points"), MergedEvent(1, "1.ply", 9, "a"),
        SkippedEvent(2, "2.ply", "cut short"),
    ]  # fmt: skip
    path = folder / "killed.jsonl"
    path.write_text("".join(f"{event_text(event)}\n" for event in events))
    sound = path.read_text()

    def reconcile(damaged: Path) -> None:
        reconcile_events(damaged, events)
        assert len(damaged.read_text().splitlines()) == len(sound.splitlines())

    return sound_of(path, reconcile)
