"""``mcpseg train`` as people type it."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file

from mcpseg_cli.cli.interrupt import Interrupt
from mcpseg_cli.config import (
    WINDOW_SAMPLES,
    WINDOW_TRAINING,
    AugmentSettings,
    SampleSettings,
    SegmentSettings,
    TrainSettings,
    option_of,
)
from mcpseg_cli.formats.recording import open_recording, read_scan
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.networks.weights import load_weights
from mcpseg_cli.resumable import exclusive
from mcpseg_cli.train.folder import TrainRecord
from tests.areas import CLASSES, write_area
from tests.commands import MOST_S, invoke, start, wait_until

SMALL = ("--batch-size", "64", "--context", "8", "--seed", "3")


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    write_area(folder / "Area_1", 6, seed=1)
    write_area(folder / "more" / "Area_2", 4, seed=2)
    return folder


def train(*words: object):
    return invoke("train", *words)


def arguments(data: Path, output: Path, *options: object) -> list[str]:
    return [str(word) for word in (data, "--holdout", "2", *SMALL, "-o", output, *options)]


def write_config(folder: Path, text: str) -> Path:
    (folder / "settings.toml").write_text(text)
    return folder / "settings.toml"


@pytest.fixture(scope="module")
def trained(data, tmp_path_factory) -> Path:
    output = tmp_path_factory.mktemp("trained")
    result = train(*arguments(data, output, "--epochs", "4", "-q"))
    assert result.exit_code == 0, result.stderr
    return output


def test_loss_falls_and_the_files_are_there(trained):
    record = json.loads((trained / "mcpnet-holdout2.json").read_text())
    losses = [report["train"]["loss"] for report in record["curves"]]
    assert losses[-1] < losses[0]
    assert record["complete"]
    assert sorted(path.name for path in trained.iterdir()) == [
        f"mcpnet-holdout2.{end}" for end in ("json", "md", "safetensors", "toml")
    ]


def test_areas_prepared_side_by_side_give_the_same_samples_and_weights(tmp_path):
    found = {}
    for name, words in (("one", []), ("two", ["--engine", "processes", "--cache", tmp_path / "c"])):
        data = tmp_path / name
        write_area(data / "Area_1", 4, seed=1)
        write_area(data / "more" / "Area_2", 4, seed=2)
        result = train(*arguments(data, tmp_path / f"{name}_trained", "--epochs", "1", *words))
        assert result.exit_code == 0, result.stderr
        found[name] = (tmp_path / f"{name}_trained" / "mcpnet-holdout2.safetensors").read_bytes()
    assert found["one"] == found["two"]
    assert len(list((tmp_path / "c").glob("*.h5"))) == 2


def test_one_area_can_be_prepared_and_no_other_is(data, tmp_path):
    words = (data, "--holdout", "none", *SMALL, "--cache", tmp_path, "--prepare")
    assert train(*words, "more/Area_2").exit_code == 0
    (made,) = tmp_path.glob("*.h5")
    assert made.name.startswith("more-Area_2-")
    assert train(*words, "Area_7").exit_code == 2


def test_the_card_says_what_the_weights_are(trained):
    weights = load_weights(trained / "mcpnet-holdout2.safetensors")
    card = (trained / "mcpnet-holdout2.md").read_text()
    for word in (
        weights.sha256,
        "Area_1 (6 scans",
        "more/Area_2 (4 scans",
        *CLASSES,
        "`learning_rate` 0.001",
    ):
        assert word in card
    assert weights.info.classes == CLASSES
    assert weights.info.num_context == 8
    assert weights.info.training["data"] == "Area_1"
    assert card.count("| 0.001 |") == 4  # epochs


def test_the_weights_label_scans(trained, data):
    weights = load_weights(trained / "mcpnet-holdout2.safetensors")
    segmenter = IncrementalSegmenter(weights, SegmentSettings())
    area = data / "more" / "Area_2"
    for source in open_recording(area / "scans", area / "poses.csv")[:2]:
        update = segmenter.register_scan(read_scan(source, "map", 0.1)[0])
    assert (update.point_ids >= 0).any()


def test_a_killed_training_resumes_to_the_same_weights(data, tmp_path):
    words = arguments(data, tmp_path / "whole", "--epochs", "30", "-q")
    assert train(*words).exit_code == 0
    words = arguments(data, tmp_path / "cut", "--epochs", "30", "-q")
    process = start("train", *words)
    wait_until((tmp_path / "cut" / "mcpnet-holdout2.checkpoint").exists, process)
    process.kill()
    process.wait()
    assert not (tmp_path / "cut" / "mcpnet-holdout2.json").exists()
    assert "--resume to continue it or --overwrite" in train(*words).stderr
    result = train(*words, "--resume")
    assert result.exit_code == 0, result.stderr
    whole, cut = (
        load_file(tmp_path / part / "mcpnet-holdout2.safetensors") for part in ("whole", "cut")
    )
    assert all(torch.equal(whole[name], cut[name]) for name in whole)


def test_an_interrupt_writes_what_is_trained_and_says_how_to_continue(data, tmp_path):
    words = arguments(data, tmp_path, "--epochs", "100000")
    process = start("train", *words, stderr=subprocess.PIPE)
    wait_until((tmp_path / "mcpnet-holdout2.checkpoint").exists, process)
    process.send_signal(signal.SIGINT)
    stderr = process.communicate(timeout=MOST_S)[1]
    assert process.returncode == 130
    assert "continue with: mcpseg train" in stderr.splitlines()[-1]
    assert stderr.splitlines()[-1].endswith("--resume")
    assert load_weights(tmp_path / "mcpnet-holdout2.safetensors").info.classes == CLASSES
    assert "interrupted after" in (tmp_path / "mcpnet-holdout2.md").read_text()
    assert (tmp_path / "mcpnet-holdout2.checkpoint").exists()


def test_no_weights_of_an_untrained_network_are_written(data, tmp_path, monkeypatch):
    always = property(lambda _: True, lambda _, asked: None)
    monkeypatch.setattr(Interrupt, "asked", always, raising=False)
    result = train(*arguments(data, tmp_path, "--epochs", "2"))
    assert result.exit_code == 130
    assert "interrupted after 0 epochs; continue with: mcpseg" in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["mcpnet-holdout2.checkpoint"]
    monkeypatch.undo()
    assert train(*arguments(data, tmp_path, "--epochs", "2", "--resume", "-q")).exit_code == 0


def test_two_processes_train_what_one_trains_with_twice_the_batches(data, tmp_path):
    options = ("--epochs", "3", "--net", "pointnet", "-q")
    words = arguments(data, tmp_path / "two", *options)
    launch = ["-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2"]
    launch += ["-m", "mcpseg_cli", "train"]
    run = subprocess.run(
        [sys.executable, *launch, *words], capture_output=True, text=True, timeout=MOST_S
    )
    assert run.returncode == 0, run.stderr
    config = write_config(tmp_path, "[train]\nbatches_per_step = 2\n")
    result = train(*arguments(data, tmp_path / "one", *options, "--config", config))
    assert result.exit_code == 0, result.stderr
    one, two = (
        load_file(tmp_path / part / "pointnet-holdout2.safetensors") for part in ("one", "two")
    )
    for name in one:
        torch.testing.assert_close(two[name], one[name], rtol=1e-3, atol=1e-4)
    records = [
        json.loads((tmp_path / part / "pointnet-holdout2.json").read_text())
        for part in ("one", "two")
    ]
    losses = [[report["train"]["loss"] for report in record["curves"]] for record in records]
    assert losses[0] == pytest.approx(losses[1], rel=1e-3)


def test_json_is_one_document_and_folds_are_a_list(data, tmp_path):
    words = (data, "--holdout", "all", *SMALL, "-o", tmp_path, "--net", "voxnet", "--epochs", "1")
    result = train(*words, "--json", "-q")
    document = json.loads(result.stdout)
    assert [record["holdout"] for record in document] == [1, 2]
    assert {path.stem for path in tmp_path.iterdir()} == {"voxnet-holdout1", "voxnet-holdout2"}
    again = train(*words, "--resume")
    assert again.stderr.count("nothing to do") == 2


def test_everything_can_be_trained_on(data, tmp_path):
    result = train(
        data, "--holdout", "none", *SMALL, "-o", tmp_path, "--epochs", "1", "--name", "mine", "-q"
    )
    record = json.loads((tmp_path / "mine.json").read_text())
    assert result.exit_code == 0
    assert record["validation"] is None
    assert "nothing was held out" in (tmp_path / "mine.md").read_text()


def test_paths_that_are_no_utf8_are_written_as_escapes(tmp_path):
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/d\xff"))
    try:
        write_area(folder / os.fsdecode(b"hall\xfe"), 3)
    except OSError:
        pytest.skip("this file system takes no such names")
    output = folder / "out"
    words = [
        os.fsencode(word) for word in (str(folder), "--holdout", "none", *SMALL, "-o", str(output))
    ]
    command = [sys.executable, "-m", "mcpseg_cli", "train", *words]
    command += ["--name", b"a\xfd", "--epochs", "1"]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    record = json.loads((output / os.fsdecode(b"a\xfd.json")).read_text())
    assert "d\\xff" in record["command"]
    assert "hall\\xfe" in (output / os.fsdecode(b"a\xfd.md")).read_text()
    shutil.copy(
        output / os.fsdecode(b"a\xfd.safetensors"), tmp_path / "a.safetensors"
    )  # safetensors reads UTF-8 only
    assert load_weights(tmp_path / "a.safetensors").info.training["data"] == "hall\\xfe"


def test_fine_tuning_for_other_classes(data, trained, tmp_path):
    table = tmp_path / "classes.csv"
    table.write_text("label,class\nfloor,ground\nwall,wall\n")
    first = trained / "mcpnet-holdout2.safetensors"
    words = (data, "--holdout", "none", "--batch-size", "64", "-w", first, "--classes", table)
    result = train(*words, "--epochs", "1", "-o", tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    assert "classes that start afresh: ground" in result.stderr
    info = load_weights(tmp_path / "out" / "mcpnet-all.safetensors").info
    assert info.classes == ("ground", "wall")
    assert info.num_context == 8


def test_what_is_there_is_not_overwritten_unasked(data, trained):
    result = train(*arguments(data, trained, "--epochs", "4"))
    assert result.exit_code == 1
    assert "mcpnet-holdout2.safetensors: is there; expected a new name" in result.stderr


@pytest.mark.parametrize("what", ["another network", "another class table", "too few batches"])
def test_what_is_there_stays_until_training_can_start(what, data, trained, tmp_path):
    table = tmp_path / "classes.csv"
    table.write_text("cow,cattle\nhorse,cattle\nsheep,flock\n")
    config = write_config(tmp_path, "[train]\nbatches_per_step = 99\n")
    options = {
        "another network": ("--weights", "voxnet"),
        "another class table": ("--classes", table),
        "too few batches": ("--config", config),
    }[what]
    output = tmp_path / "out"
    shutil.copytree(trained, output)
    result = train(*arguments(data, output, "--overwrite", *options))
    assert result.exit_code == 1
    assert len(result.stderr.splitlines()) == 1
    for path in trained.iterdir():
        assert (output / path.name).read_bytes() == path.read_bytes()


def test_overwriting_trains_anew(data, trained, tmp_path):
    output = tmp_path / "out"
    shutil.copytree(trained, output)
    result = train(*arguments(data, output, "--overwrite", "--epochs", "1", "--lr", "0.5"))
    assert result.exit_code == 0, result.stderr
    assert json.loads((output / "mcpnet-holdout2.json").read_text())["epochs"] == 1


def test_changed_settings_are_named_when_resuming(data, trained):
    result = train(*arguments(data, trained, "--epochs", "4", "--lr", "0.5", "--resume"))
    assert result.exit_code == 1
    assert "--lr 0.001, now 0.5" in result.stderr
    assert len(result.stderr.splitlines()) == 1


RARE = """
[train]
warm_up = 0.5
class_balance = "sqrt"
batches_per_epoch = 4
validation_batches = 2
epochs = 50

[samples]
seen_again = 30
floor = 0

[augment]
grey = 0.75
context_dropout = 0

[classes]
floor = "ground"
wall = "building"
lamp = "-"
"a \\"tab\\"\\t" = "Möbel"
"""


def test_the_settings_written_beside_the_weights_give_the_same_training(data, tmp_path):
    config = write_config(tmp_path, RARE)
    words = (data, "--holdout", "2", "-q")
    result = train(*words, *SMALL, "--epochs", "2", "--config", config, "-o", tmp_path / "one")
    assert result.exit_code == 0, result.stderr
    written = tmp_path / "one" / "mcpnet-holdout2.toml"
    result = train(*words, "--config", written, "-o", tmp_path / "two")
    assert result.exit_code == 0, result.stderr
    one, two = (tmp_path / part / "mcpnet-holdout2.json" for part in ("one", "two"))
    first, second = (TrainRecord.model_validate_json(path.read_bytes()) for path in (one, two))
    assert first.identity == second.identity
    assert first.sha256 == second.sha256
    assert written.read_text() == (tmp_path / "two" / "mcpnet-holdout2.toml").read_text()


def test_options_win_over_the_settings_file(data, tmp_path):
    config = write_config(tmp_path, RARE)
    words = ("--epochs", "1", "--augment", "none", "--range", "1.5", "--config", config)
    result = train(data, "--holdout", "2", *SMALL, *words, "-o", tmp_path / "out", "-q")
    assert result.exit_code == 0, result.stderr
    record = (tmp_path / "out" / "mcpnet-holdout2.json").read_bytes()
    identity = TrainRecord.model_validate_json(record).identity
    assert identity.settings.epochs == 1
    assert identity.settings.warm_up == 0.5
    assert identity.augmentation == AugmentSettings.off()
    assert (identity.samples.local_range, identity.samples.floor) == (1.5, 0.0)
    assert identity.classes == ("ground", "building", "Möbel")


def test_a_bad_settings_file_is_one_line_that_names_it(data, tmp_path):
    config = write_config(tmp_path, "[train]\nepoch = 3\n")
    result = train(*arguments(data, tmp_path / "out", "--config", config))
    assert result.exit_code == 1
    assert "settings.toml: unknown [train] epoch; expected some of architecture" in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_second_process_is_refused(data, tmp_path):
    with exclusive(tmp_path, "mcpnet-holdout2.lock"):
        result = train(*arguments(data, tmp_path))
    assert result.exit_code == 1
    assert "another mcpseg is writing there" in result.stderr


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--holdout", "6"), "no area of number 6; expected one of 1, 2"),
        (("--holdout", "six"), "--holdout six: not a number; expected one of 1, 2, all or none"),
        (("-w", "nothing.safetensors"), "nothing.safetensors: No such file"),
        (("-w", "mcpnet", "--net", "voxnet"), "--weights mcpnet: mcpnet; expected voxnet"),
        (("--device", "cuda:77"), "--device cuda:77: not available here"),
        (("--classes", "absent.csv"), "absent.csv: No such file"),
        (("--config", "absent.toml"), "absent.toml: No such file"),
    ],
)
def test_bad_input_is_one_line(options, words, data, tmp_path):
    result = train(*arguments(data, tmp_path / "out", *options))
    assert result.exit_code == 1
    assert words in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_bad_data_is_one_line(tmp_path):
    assert "no such folder; expected ray-traced areas" in train(tmp_path / "none").stderr
    (tmp_path / "empty").mkdir()
    assert "no raytrace.json in it" in train(tmp_path / "empty").stderr
    area = write_area(tmp_path / "d" / "Area_6", 1)
    assert "only areas of number 6" in train(tmp_path / "d").stderr
    (area / "gt").rename(area / "old")
    result = train(tmp_path / "d")
    assert result.exit_code == 1
    assert "Area_6: no gt; expected scans/, gt/ and poses.csv" in result.stderr


@pytest.mark.parametrize(
    ("option", "said"),
    [
        ("--lr", "--lr: Input should be greater than 0"),
        ("--range", "--range: Input should be greater than 0"),
        ("--context", "--context: Input should be greater than or equal to 0"),
        ("--batch-size", "--batch-size: Input should be greater than or equal to 2"),
    ],
)
def test_options_out_of_range_are_usage_errors_that_name_the_option(data, option, said):
    result = train(data, "--holdout", "2", option, "-1")
    assert result.exit_code == 2
    assert said in " ".join(result.stderr.replace("│", " ").split())


def test_help_has_examples_and_few_options():
    text = train("--help").stdout
    assert "Examples:" in text
    options = {word for line in text.splitlines() for word in re.findall(r"^  (-[^ ,]*)", line)}
    assert 20 < len(options) <= 25


def test_help_says_the_defaults_that_the_settings_have():
    settings = {name: each.default for name, each in TrainSettings.model_fields.items()}
    settings |= {name: each.default for name, each in SampleSettings.model_fields.items()}
    called = {option_of(name): name for name in settings}
    told = dict.fromkeys(["architecture", "epochs", "learning_rate", "schedule", "precision"])
    text = " ".join(train("--help").stdout.split())
    found = re.findall(r"(--[a-z-]+) [^[]*\[default: ([^\];]+)(?:; unet: ([\w.]+))?\]", text)
    for option, default, _ in found:
        name = called.get(option)
        if name is not None and option not in ("--batch-size", "--context"):
            assert str(settings[name]) == default
            told.pop(name, None)
    assert not told

    # those of the U-Net, where they are others
    own = WINDOW_TRAINING | WINDOW_SAMPLES
    windows = {called[option]: default for option, _, default in found if default}
    options = {"epochs", "learning_rate", "schedule", "batch_size", "num_context", "local_range"}
    assert windows == {name: str(own[name]) for name in options}
