"""Class maps: what the classes of both sides are scored as, what is not, and what is refused."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.classes import HOME_CLASSES
from mcpseg_cli.errors import InputError
from mcpseg_cli.evaluate.class_map import read_class_map
from mcpseg_cli.evaluate.run import evaluate_run
from mcpseg_cli.formats import Cloud, write_cloud
from tests.commands import invoke
from tests.test_architecture import PACKAGE

TABLE = "label,class\nkitchen,cabinet\ncounter,cabinet\nbed,bed\nplant,-\nrug,floor\nfloor,floor\n"


def write_labels(path, names, classes):
    """A cloud of points one metre apart, labelled by name; None for no class."""
    semantic = [255 if name is None else classes.index(name) for name in names]
    columns = {axis: np.zeros(len(names), np.float32) for axis in "yz"}
    columns |= {"x": np.arange(len(names), dtype=np.float32)}
    columns |= {"semantic": np.array(semantic, np.uint8)}
    columns |= {"instance": np.arange(1, len(names) + 1, dtype=np.int32)}
    write_cloud(path, Cloud(columns, tuple(classes)))
    return path


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "map.csv"
    path.write_text(TABLE)
    return path


@pytest.fixture
def pair(tmp_path):
    out = ("floor", "rug", "kitchen", "bed", "plant", "sofa")
    gt = ("counter", "floor", "cabinet", "bed", "lamp", "plant")
    predicted = ["floor", "rug", "kitchen", "plant", "sofa", "bed", "kitchen"]
    true = ["floor", "floor", "counter", "bed", "cabinet", "lamp", "plant"]
    return (
        write_labels(tmp_path / "out.ply", predicted, out),
        write_labels(tmp_path / "gt.ply", true, gt),
    )


def test_both_sides_are_scored_in_the_classes_of_the_table(pair, table):
    scores = evaluate_run(*pair, class_map=read_class_map(table))
    assert scores.classes == ("cabinet", "bed", "floor")
    assert scores.confusion.tolist() == [[1, 0, 0, 1], [0, 0, 0, 1], [0, 0, 2, 0]]
    assert scores.document()["classes_from"] == str(table)


def test_true_classes_of_no_class_are_not_scored_and_predicted_ones_are_wrong(pair, table):
    scores = evaluate_run(*pair, class_map=read_class_map(table))
    assert (scores.counts.labelled, scores.counts.unpredicted) == (5, 2)
    told = "\n".join(scores.notices)
    assert "predicted classes without a class count as wrong: plant (1 points), sofa" in told
    assert "true classes without a class count as unlabelled: lamp (1 points), plant" in told


def test_the_document_says_what_became_of_every_class(pair, table):
    document = evaluate_run(*pair, class_map=read_class_map(table)).document()["class_map"]
    assert document["out"]["kitchen"] == document["gt"]["counter"] == "cabinet"
    assert document["gt"]["cabinet"] == "cabinet"  # a class of the scores stands for itself
    assert document["out"]["sofa"] is document["out"]["plant"] is document["gt"]["lamp"] is None


def test_a_class_of_the_scores_that_is_dropped_does_not_stand_for_itself(tmp_path):
    (tmp_path / "t.csv").write_text("cot,bed\nfloor,floor\nbed,-\n")
    named = read_class_map(tmp_path / "t.csv").named(["cot", "bed", "floor"])
    assert named == {"cot": "bed", "bed": None, "floor": "floor"}


def test_rows_of_classes_that_neither_side_has_are_named(pair, tmp_path):
    path = tmp_path / "typo.csv"
    path.write_text(TABLE + "kitchn,cabinet\n")
    (told,) = [
        notice
        for notice in evaluate_run(*pair, class_map=read_class_map(path)).notices
        if "neither side" in notice
    ]
    assert told == f"{path}: rows of classes that neither side has: kitchn"


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), min_size=1, max_size=40))
def test_a_map_of_every_class_to_itself_changes_no_score(tmp_path_factory, labels):
    folder, classes = tmp_path_factory.mktemp("same"), ("a", "b", "c", "d")
    out = write_labels(folder / "out.ply", [classes[one] for one, _ in labels], classes)
    gt = write_labels(folder / "gt.ply", [classes[other] for _, other in labels], classes)
    (folder / "t.csv").write_text("".join(f"{name},{name}\n" for name in classes))
    plain = evaluate_run(out, gt).document()
    mapped = evaluate_run(out, gt, class_map=read_class_map(folder / "t.csv")).document()
    assert mapped.pop("class_map")["out"] == {name: name for name in classes}
    assert mapped | {"classes_from": ""} == plain | {"classes_from": ""}


@pytest.mark.parametrize(
    ("side", "classes", "words"),
    [
        ("out", (), r"out\.ply: no class names; expected names, which .*map\.csv gives"),
        ("gt", (), r"gt\.ply: no class names; expected names"),
        ("out", ("Bett", "Wand"), r"out\.ply: classes Bett, Wand; expected some that .*map\.csv"),
        ("gt", ("Bett", "Wand"), r"gt\.ply: classes Bett, Wand; expected some of cabinet, bed"),
    ],
)
def test_what_no_table_can_map_is_refused_in_one_line(pair, table, side, classes, words):
    path = dict(zip(("out", "gt"), pair, strict=True))[side]
    columns = {axis: np.arange(2, dtype=np.float32) for axis in "xyz"}
    labels = {"semantic": np.zeros(2, np.uint8), "instance": np.ones(2, np.int32)}
    write_cloud(path, Cloud(columns | labels, classes))
    with pytest.raises(InputError, match=words) as caught:
        evaluate_run(*pair, class_map=read_class_map(table))
    assert len(str(caught.value).splitlines()) == 1


def test_the_command_lists_which_classes_were_mapped_and_which_not(pair, table):
    result = invoke("eval", *pair, *pair, "--class-map", table, "--full")
    lines = [line.split() for line in result.stdout.splitlines()]
    assert ["cabinet", "kitchen", "counter,", "cabinet"] in lines
    assert ["none", "plant,", "sofa", "lamp,", "plant"] in lines
    pooled = json.loads(invoke("eval", *pair, *pair, "--class-map", table, "--json").stdout)
    assert pooled["pooled"]["confusion"] == [[2, 0, 0, 2], [0, 0, 0, 2], [0, 0, 4, 0]]


def test_a_table_that_cannot_be_used_is_refused_before_anything_is_read(pair, tmp_path):
    (tmp_path / "t.csv").write_text("kitchen,cabinet,what\n")
    result = invoke("eval", *pair, "--class-map", tmp_path / "t.csv")
    assert (result.exit_code, result.stdout) == (1, "")
    assert "3 columns in 'kitchen,cabinet,what'; expected lines 'label,class'" in result.stderr


def test_the_table_that_comes_along_has_every_class_of_homes():
    table = read_class_map(PACKAGE.parent / "models/home_to_nyu40.csv")
    assert set(HOME_CLASSES) <= {*table.table, *table.dropped}
    assert len({*table.table, *table.dropped} - set(HOME_CLASSES)) == 26
    assert table.named(["kitchen", "counter", "clutter"])["kitchen"] == "cabinet"
