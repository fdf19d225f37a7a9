"""Scores of maps with rooms, of several runs, by name, and as pictures."""

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from sklearn import metrics as sklearn_metrics

from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.evaluate import truth as truth_module
from mcpseg_cli.evaluate.dotted_names import bounded_metrics, flatten
from mcpseg_cli.evaluate.overlaps import PointLabels
from mcpseg_cli.evaluate.plots import (
    plot_class_iou,
    plot_confusion,
    plot_over_scans,
    plot_reliability,
    prepare_plots,
)
from mcpseg_cli.evaluate.pooled import average, pool
from mcpseg_cli.evaluate.room_scores import score_rooms
from mcpseg_cli.evaluate.run import evaluate_run
from mcpseg_cli.evaluate.score_curve import ScoreCurve
from mcpseg_cli.formats import Cloud, read_cloud, write_cloud
from mcpseg_cli.reliability import measure_reliability

CLASSES = ("floor", "wall", "chair")


def write_pair(
    folder: Path, seed=0, classes=CLASSES, named=True, num_points=400
) -> tuple[Path, Path]:
    """Write a labelled cloud and its truth: two rooms of two objects, a tenth of labels wrong."""
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(0, 5, (num_points, 3)).astype(np.float32)
    columns = {axis: xyz[:, number] for number, axis in enumerate("xyz")}
    (folder / "gt").mkdir(parents=True)

    # the truth
    instance = rng.integers(1, 5, num_points).astype(np.int32)
    names = np.array(["", "floor", "wall", "chair", "floor"])[instance]
    semantic = np.array([classes.index(name) for name in names], np.uint8)
    labels = {"semantic": semantic, "instance": instance}
    write_cloud(folder / "gt/0.ply", Cloud(columns | labels, classes if named else ()))

    # what is predicted: wrong classes, objects in pieces
    is_wrong = rng.random(num_points) < 0.1
    guess = np.where(is_wrong, rng.integers(0, 3, num_points), semantic).astype(np.uint8)
    parts = np.where(rng.random(num_points) < 0.3, instance + 10, instance).astype(np.int32)
    labels = {"semantic": guess, "instance": parts}
    write_cloud(folder / "map.ply", Cloud(columns | labels, classes))

    objects = [{"id": i, "name": f"room_{(i - 1) // 2}/thing_{i}"} for i in range(1, 5)]
    (folder / "raytrace.json").write_text(json.dumps({"objects": objects}))
    return folder / "map.ply", folder / "gt"


def test_clusters_of_rooms_are_means_of_scikit_learns_over_rooms():
    rng = np.random.default_rng(3)
    room = rng.integers(-1, 3, 300).astype(np.int32)
    instance = rng.integers(1, 6, 300) + 10 * (room + 1)
    predicted = np.where(rng.random(300) < 0.5, instance, rng.integers(1, 9, 300))
    semantic = (instance % 3).astype(np.uint8)
    true, pred = PointLabels(semantic, instance), PointLabels(semantic, predicted)
    scores = score_rooms(true, pred, room, rooms=("a", "b", "c"), classes=CLASSES).document()

    # scikit-learn, room by room
    parts = [np.flatnonzero(room == number) for number in range(3)]
    for name, score in (
        ("nmi", "normalized_mutual_info_score"),
        ("ami", "adjusted_mutual_info_score"),
        ("ari", "adjusted_rand_score"),
    ):
        values = [
            getattr(sklearn_metrics, score)(instance[part], predicted[part]) for part in parts
        ]
        assert scores[name] == pytest.approx(np.mean(values))
        assert [scores["by_room"][room][name] for room in "abc"] == pytest.approx(values)
    assert (scores["scored_over"], scores["rooms"]) == ("room", 3)
    assert scores["without_room"] == (room < 0).sum()


def test_objects_match_within_their_room():
    # One predicted object spans two rooms: over the whole map it meets neither object, in each room
    # it is exact.
    true = PointLabels(np.zeros(200, np.uint8), np.repeat([1, 2], 100))
    pred = PointLabels(np.zeros(200, np.uint8), np.ones(200, int))
    room = np.repeat([0, 1], 100).astype(np.int32)
    scores = score_rooms(true, pred, room, rooms=("a", "b"), classes=("wall",)).objects
    assert scores.mcov == scores.mprec == scores.mrec == scores.pq == scores.ap == 1.0


def test_truth_without_rooms_has_no_figures_by_room(tmp_path):
    output, truth = write_pair(tmp_path)
    assert evaluate_run(output, truth).document()["rooms"]["rooms"] == 2
    (tmp_path / "raytrace.json").unlink()
    assert evaluate_run(output, truth).document()["rooms"] is None


def test_every_point_is_accounted_for(tmp_path):
    output, truth = write_pair(tmp_path)
    counts = evaluate_run(output, truth).counts
    assert counts.points == counts.covered + counts.uncovered
    assert counts.covered == counts.labelled + counts.unlabelled
    assert counts.truth_points == 400


def test_truth_without_class_names_is_said_to_have_the_runs(tmp_path):
    scores = evaluate_run(*write_pair(tmp_path, named=False))
    assert scores.classes_from == "out"
    assert "names no classes; they are taken to be those of" in scores.notices[0]
    assert "floor 0 … chair 2" in scores.notices[0]


def test_it_is_said_what_ranks_objects(tmp_path):
    output, truth = write_pair(tmp_path)
    assert evaluate_run(output, truth).document()["ap_ranked_by"] == "nothing"
    cloud = read_cloud(output)
    columns = cloud.columns | {"confidence": np.ones(len(cloud), np.float32)}
    write_cloud(output, Cloud(columns, cloud.classes))
    assert evaluate_run(output, truth).document()["ap_ranked_by"] == "mean confidence"


def with_confidence(output: Path, confidence: np.ndarray) -> None:
    cloud = read_cloud(output)
    columns = cloud.columns | {"confidence": confidence.astype(np.float32)}
    write_cloud(output, Cloud(columns, cloud.classes))


def test_confidence_is_compared_with_the_share_that_is_right(tmp_path):
    output, truth = write_pair(tmp_path / "a")
    is_right = read_cloud(output).label("semantic") == read_cloud(truth / "0.ply").label("semantic")
    with_confidence(output, np.full(400, is_right.mean()))
    assert evaluate_run(output, truth).document()["ece"] == pytest.approx(0, abs=1e-6)

    # of two maps, all points together
    other, other_truth = write_pair(tmp_path / "b", 5)
    with_confidence(other, np.full(400, 1.0))
    runs = [evaluate_run(output, truth), evaluate_run(other, other_truth)]
    wrong = runs[1].document()["ece"]
    assert wrong == pytest.approx(1 - runs[1].document()["point_accuracy"])
    assert pool(runs)["ece"] == pytest.approx(wrong / 2, abs=1e-6)


def test_points_without_a_predicted_class_do_not_count_for_calibration(tmp_path):
    output, truth = write_pair(tmp_path)
    cloud = read_cloud(output)
    semantic = read_cloud(truth / "0.ply").label("semantic").copy()
    semantic[:100] = 255
    columns = cloud.columns | {"semantic": semantic, "confidence": np.ones(400, np.float32)}
    write_cloud(output, Cloud(columns, cloud.classes))
    assert evaluate_run(output, truth).document()["ece"] == 0.0


def test_confidence_that_is_no_probability_is_not_scored_and_said_so(tmp_path):
    output, truth = write_pair(tmp_path)
    with_confidence(output, np.full(400, 97.0))
    scores = evaluate_run(output, truth)
    assert scores.document()["ece"] is None
    assert "confidence beyond 0 to 1" in scores.notices[-1]


@pytest.mark.parametrize("named", [True, False])
def test_the_truth_is_read_once_where_only_it_may_name_the_classes(tmp_path, monkeypatch, named):
    output, truth = write_pair(tmp_path, named=named)
    cloud = read_cloud(output)
    write_cloud(output, Cloud(cloud.columns))
    reads = []
    monkeypatch.setattr(
        truth_module, "read_measured", lambda path: reads.append(path) or read_cloud(path)
    )
    scores = evaluate_run(output, truth)
    assert reads == [truth / "0.ply"]
    assert scores.classes == (CLASSES if named else ("class_0", "class_1", "class_2"))
    assert scores.classes_from == ("gt" if named else "neither")


def test_a_run_is_followed_in_the_table_of_the_scores(labelled_run):
    truth = labelled_run.out / "map.ply"
    own = evaluate_run(labelled_run.out, truth)
    other = evaluate_run(labelled_run.out, truth, classes=own.classes[::-1])
    assert other.classes == own.classes[::-1]
    assert other.scan_by_scan.stability == own.scan_by_scan.stability
    for name in ("voxels", "miou_present", "point_accuracy"):
        curves = [getattr(scores.scan_by_scan.curve, name) for scores in (own, other)]
        np.testing.assert_allclose(*curves, rtol=1e-12)


def test_truth_that_says_nothing_is_refused(tmp_path):
    columns = {axis: np.zeros(2, np.float32) for axis in "xyz"}
    nothing = {"semantic": np.full(2, 255, np.uint8), "instance": np.zeros(2, np.int32)}
    write_cloud(tmp_path / "none.ply", Cloud(columns | nothing, CLASSES))
    write_cloud(tmp_path / "same.ply", Cloud(columns | nothing, CLASSES))
    with pytest.raises(InputError, match="neither class nor object"):
        evaluate_run(tmp_path / "same.ply", tmp_path / "none.ply")


def test_pooled_classes_are_those_of_the_summed_confusion_matrices(tmp_path):
    runs = [
        evaluate_run(*write_pair(tmp_path / str(seed), seed, num_points=200 * seed))
        for seed in (1, 2)
    ]
    pooled, mean = pool(runs), average([run.document() for run in runs])

    # sums
    confusion = runs[0].confusion + runs[1].confusion
    assert pooled["confusion"] == confusion.tolist()
    assert pooled["point_accuracy"] == pytest.approx(np.trace(confusion) / 600)
    assert (pooled["points"], pooled["objects_true"], pooled["rooms"]["rooms"]) == (600, 8, 4)

    # means
    accuracies = [run.document()["point_accuracy"] for run in runs]
    assert mean["point_accuracy"] == pytest.approx(np.mean(accuracies))
    assert mean["point_accuracy"] != pytest.approx(pooled["point_accuracy"], abs=1e-6)
    by_room = [run.rooms.document()["nmi"] for run in runs]
    assert mean["rooms"]["nmi"] == pytest.approx(np.mean(by_room))
    assert "points" not in mean


def test_a_run_pooled_with_itself_scores_as_it_did(tmp_path):
    run = evaluate_run(*write_pair(tmp_path))
    alone, twice = run.document(), pool([run, run])
    of_classes = ["miou", "point_accuracy"]
    of_objects = ["object_accuracy", "pq", "pq_with_stuff", "ap25", "mcov", "mrec", "cluster_ratio"]
    for name in of_classes + of_objects:
        assert twice[name] == pytest.approx(alone[name]), name
        if name in of_objects:
            assert twice["rooms"][name] == pytest.approx(alone["rooms"][name], rel=0.05), name


def test_means_leave_out_classes_that_a_run_does_not_have():
    assert average([{"iou": {"wall": 0.5, "door": None}}, {"iou": {"wall": 0.7, "door": 0.2}}]) == {
        "iou": {"wall": pytest.approx(0.6), "door": 0.2}
    }


def test_runs_of_another_class_order_are_scored_in_the_first_ones_table(tmp_path):
    first, second = write_pair(tmp_path / "1"), write_pair(tmp_path / "2", classes=CLASSES[::-1])
    expected = evaluate_run(*second)
    scores = evaluate_run(*second, classes=CLASSES)
    assert scores.classes == CLASSES == evaluate_run(*first).classes
    assert scores.document()["iou"] == pytest.approx(expected.document()["iou"])
    assert scores.objects.pq == pytest.approx(expected.objects.pq)


def test_runs_with_classes_of_their_own_are_not_pooled(tmp_path):
    output, truth = write_pair(tmp_path)
    with pytest.raises(InputError, match="expected those of the first run: floor, sofa"):
        evaluate_run(output, truth, classes=("floor", "sofa"))


def test_metrics_have_dotted_names():
    rooms = {"by_room": {"x": {"nmi": 0.1}}}
    document = {"a": 1, "iou": {"wall": 0.5, "door": None}, "confusion": [[1]], "rooms": rooms}
    names = ["a", "iou.wall", "iou.door", "rooms.by_room.x.nmi"]
    assert flatten(document) == dict(zip(names, [1, 0.5, None, 0.1], strict=True))


def test_only_metrics_of_which_more_is_better_can_be_demanded():
    document = {"miou": 0.5, "points": 3, "rooms": {"ari": 0.2}}
    document |= {"cluster_ratio": 3.0, "ms_per_scan": {"p50": 1.0}}
    assert bounded_metrics(document) == {"miou": 0.5, "rooms.ari": 0.2}


def test_of_several_runs_a_plain_name_is_pooled_where_it_can_be():
    document = {"runs": [], "pooled": {"miou": 0.4}, "mean": {"miou": 0.5, "nmi": 0.9}}
    metrics = bounded_metrics(document)
    assert (metrics["miou"], metrics["nmi"], metrics["mean.miou"]) == (0.4, 0.9, 0.5)


def test_pictures_show_the_scores(tmp_path):
    # one of each kind
    image = pytest.importorskip("matplotlib.image")
    prepare_plots(tmp_path / "new/pictures")
    confusion = np.array([[90, 10, 0, 0], [20, 70, 0, 10], [0, 0, 0, 0]])
    plot_confusion(tmp_path / "matrix.png", confusion, ("floor", "$wall_1$", "chair"), "voxel")
    plot_class_iou(tmp_path / "iou.png", confusion, CLASSES)
    curve = ScoreCurve(np.array([10, 20]), np.array([0.2, 0.4]), np.array([0.5, 0.6]))
    plot_over_scans(tmp_path / "curve.png", {"out": curve})
    plot_over_scans(tmp_path / "curves.png", {"_out": curve, "$out$": curve})

    sure = measure_reliability(np.array([0.1, 0.8, 0.9]), np.array([False, True, True]))
    plot_reliability(tmp_path / "reliability.png", sure, "voxel")

    for name in ("matrix", "iou", "curve", "curves", "reliability"):
        picture = image.imread(tmp_path / f"{name}.png")[:, :, :3]
        assert min(picture.shape[:2]) > 300
        assert np.ptp(picture, axis=2).max() > 0.4, name  # something in colour


def test_pictures_without_matplotlib_are_refused_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(OutputError, match=r"no matplotlib to draw with; expected the extra 'plot'"):
        prepare_plots(tmp_path)


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("far", [1e30, -1e9, np.inf, np.nan])
def test_points_of_a_labelled_scan_that_lie_where_no_map_goes_are_passed_over(
    far, labelled_run, tmp_path
):
    shutil.copytree(labelled_run.out, tmp_path / "out")
    write_cloud(tmp_path / "truth.ply", read_cloud(tmp_path / "out/map.ply"))
    before = evaluate_run(tmp_path / "out", tmp_path / "truth.ply").scan_by_scan
    path = tmp_path / "out/scans/000001.ply"
    cloud = read_cloud(path)
    x = cloud.columns["x"].copy()
    x[:3] = far
    write_cloud(path, Cloud(cloud.columns | {"x": x}, cloud.classes))
    after = evaluate_run(tmp_path / "out", tmp_path / "truth.ply").scan_by_scan
    assert before is not None
    assert before.curve is not None
    assert after is not None
    assert after.curve is not None
    lost = before.curve.voxels - after.curve.voxels
    assert lost[0] == 0
    assert (lost >= 0).all()
    assert (lost <= 3).all()
