"""``mcpseg train --net unet`` from areas to a labelled map."""

import json
import tomllib
from pathlib import Path

import pytest

from mcpseg_cli.formats import read_cloud
from mcpseg_cli.networks.unet import UNet
from mcpseg_cli.networks.weights import load_weights
from mcpseg_cli.train.settings_file import read_settings
from tests.areas import CLASSES, write_area
from tests.commands import invoke, segment, start, wait_until

NAME = "unet-holdout2"
SETTINGS = """
[train]
batches_per_epoch = 4
validation_batches = 1
warm_up = 0.25
[windows]
shortest_range = 1.5
longest_range = 2.5
most_voxels = 700
[augment]
grey = 0.0
"""


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    write_area(folder / "Area_1", 8, seed=1, density=2.0)
    write_area(folder / "Area_2", 2, seed=2, density=2.0)
    (folder / "a.toml").write_text(SETTINGS)
    return folder


def words_of(data: Path, output: Path, *options: object, config: Path | None = None) -> list[str]:
    words = (data, "--holdout", "2", "--config", config or data / "a.toml", "-o", output, *options)
    return [*map(str, words), "-q"]


def train(*words: str):
    result = invoke("train", *words)
    assert result.exit_code == 0, result.stderr
    return result


@pytest.fixture(scope="module")
def trained(data, tmp_path_factory) -> Path:
    output = tmp_path_factory.mktemp("trained")
    train(*words_of(data, output, "--net", "unet", "--epochs", "3", "--seed", "3"))
    return output


def test_loss_falls_and_the_files_are_there(trained):
    record = json.loads((trained / f"{NAME}.json").read_text())
    losses = [report["train"]["loss"] for report in record["curves"]]
    assert losses[-1] < 0.8 * losses[0]
    assert record["complete"]
    assert sorted(path.name for path in trained.iterdir()) == [
        f"{NAME}.{end}" for end in ("json", "md", "safetensors", "toml")
    ]


def test_what_it_learns_is_scored(trained):
    record = json.loads((trained / f"{NAME}.json").read_text())
    for scores in (record["validation"], record["train"]):
        assert 0 < scores["accuracy"] <= 1
        assert 0 < scores["miou"] <= 1
        assert 0 <= scores["embedding_accuracy"] <= 1
        assert scores["instance_loss"] > 0


def test_the_weights_and_their_card_say_what_they_are(trained):
    weights = load_weights(trained / f"{NAME}.safetensors")
    card = (trained / f"{NAME}.md").read_text()
    assert isinstance(weights.network, UNet)
    assert weights.info.classes == CLASSES
    for word in (
        weights.sha256,
        "Area_1 (8 scans",
        "unet, whole windows of the map",
        "`learning_rate` 0.003",
        "* windows: `voxel_size` 0.1",
        "`most_voxels` 700",
    ):
        assert word in card


def test_settings_not_given_are_those_of_windows(trained):
    settings = read_settings(trained / f"{NAME}.toml")
    assert settings.train.architecture == "unet"
    assert (settings.train.batch_size, settings.train.class_balance) == (2, "sqrt")
    assert (settings.samples.num_context, settings.samples.voxel_size) == (0, 0.05)
    assert settings.windows.longest_range == 2.5  # given
    assert settings.windows.young == 0.7
    assert settings.augment.grey == 0.0  # given
    assert settings.augment.no_ceiling == 0.3


def test_the_settings_written_beside_the_weights_give_the_same_training(data, trained, tmp_path):
    train(*words_of(data, tmp_path, config=trained / f"{NAME}.toml"))
    for end in ("safetensors", "toml"):
        ours, theirs = ((folder / f"{NAME}.{end}").read_bytes() for folder in (tmp_path, trained))
        assert ours == theirs


def test_a_killed_training_resumes_to_the_same_bytes(data, trained, tmp_path):
    words = words_of(data, tmp_path, "--net", "unet", "--epochs", "3", "--seed", "3")
    process = start("train", *words)
    wait_until((tmp_path / f"{NAME}.checkpoint").exists, process)
    process.kill()
    process.wait()
    assert not (tmp_path / f"{NAME}.json").exists()

    train(*words, "--resume")
    ours, theirs = (folder / f"{NAME}.safetensors" for folder in (tmp_path, trained))
    assert ours.read_bytes() == theirs.read_bytes()


@pytest.mark.parametrize("options", [(), ("--offline",)])
def test_the_weights_label_scans(data, trained, options, tmp_path):
    area = data / "Area_2"
    recording = (area / "scans", area / "poses.csv")
    weights = trained / f"{NAME}.safetensors"
    result = segment(recording, tmp_path / "out", "-q", "-w", weights, *options)
    assert result.exit_code == 0, result.stderr
    cloud = read_cloud(tmp_path / "out" / "map.ply")
    assert cloud.classes == CLASSES
    assert (cloud.label("semantic") < len(CLASSES)).all()


def test_the_method_by_name_takes_these_weights(data, trained, tmp_path):
    area = data / "Area_2"
    recording = (area / "scans", area / "poses.csv")
    options = ("-q", "-w", trained / f"{NAME}.safetensors", "--method")
    right = segment(recording, tmp_path / "out", *options, "unet")
    assert right.exit_code == 0, right.stderr
    wrong = segment(recording, tmp_path / "out", *options, "mcpnet")
    assert wrong.exit_code != 0
    assert "weights of unet; expected weights of mcpnet" in wrong.stderr


def test_other_networks_write_no_windows(data, tmp_path):
    options = ("--net", "pointnet", "--epochs", "1", "--batch-size", "64")
    train(*words_of(data, tmp_path, *options))
    settings = tomllib.loads((tmp_path / "pointnet-holdout2.toml").read_text())
    assert "windows" not in settings


def test_changed_windows_are_named_when_resuming(data, trained, tmp_path):
    (tmp_path / "b.toml").write_text(SETTINGS.replace("most_voxels = 700", "most_voxels = 701"))
    options = ("--net", "unet", "--epochs", "3", "--seed", "3", "--resume")
    words = words_of(data, trained, *options, config=tmp_path / "b.toml")
    result = invoke("train", *words)
    assert result.exit_code == 1
    assert "made with [windows] most_voxels 700, now 701; expected the same" in result.stderr
    assert len(result.stderr.splitlines()) == 1
