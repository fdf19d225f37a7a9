"""Temperatures: found again where they are known, better than none, written where they belong."""

import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.special import log_softmax, softmax

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.config import WINDOW_SAMPLES, SampleSettings, WindowSettings
from mcpseg_cli.networks.description import WeightsInfo
from mcpseg_cli.networks.weights import build_network, load_weights, save_weights
from mcpseg_cli.train.calibration import calibrate, calibration_of, fit_temperature
from mcpseg_cli.train.samples import prepare_samples
from mcpseg_cli.train.windows import WindowSource
from tests.areas import CLASSES, write_area
from tests.commands import invoke


def draw(temperature: float, count: int = 20_000):
    """Logits whose classes are drawn from their probabilities at a temperature."""
    rng = np.random.default_rng(5)
    logits = rng.normal(0, 3, (count, 6)).astype(np.float32)
    cumulative = softmax(logits / temperature, axis=1).cumsum(axis=1)
    labels = (rng.random((count, 1)) > cumulative).sum(axis=1).clip(max=5)
    return logits, labels


@pytest.mark.parametrize("temperature", [0.4, 1.0, 2.5])
def test_the_temperature_that_labels_were_drawn_at_is_found(temperature):
    assert fit_temperature(*draw(temperature)) == pytest.approx(temperature, rel=0.05)


def test_it_is_the_best_of_all_that_are_near():
    logits, labels = draw(1.7, 500)

    def loss(temperature):
        return -log_softmax(logits / temperature, axis=1)[np.arange(500), labels].mean()

    found = fit_temperature(logits, labels)
    assert (
        loss(found) <= min(loss(temperature) for temperature in np.geomspace(0.1, 10, 400)) + 1e-6
    )


def test_confidence_is_what_is_right_afterwards():
    made = calibration_of(*draw(2.5))
    assert made.error < 0.02 < made.error_before
    assert sum(part.voxels for part in made.bins) == made.voxels == 20_000
    for part in made.bins:
        assert part.voxels < 200 or part.accuracy == pytest.approx(part.confidence, abs=0.07)


def make_network(architecture: str, classes=CLASSES):
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(7)
        return build_network(WeightsInfo(architecture=architecture, classes=classes)).eval()


@pytest.fixture(scope="module")
def area(tmp_path_factory) -> Path:
    return write_area(tmp_path_factory.mktemp("data") / "Area_9", 4, density=4, unlabelled=True)


@pytest.fixture(scope="module")
def held_out(area) -> WindowSource:
    samples = prepare_samples(area, SampleSettings.model_validate(WINDOW_SAMPLES))
    return WindowSource(
        [samples],
        CLASSES,
        windows_per_batch=2,
        settings=WindowSettings(),
        augmentation=None,
        seed=0,
    )


def test_a_network_is_calibrated_on_the_voxels_of_known_class(held_out):
    made = calibrate(make_network("unet"), held_out, torch.device("cpu"))
    known = sum(int((batch.semantic != 255).sum()) for batch in held_out.epoch(0))
    assert made is not None
    assert made.voxels == known > 0
    assert made == calibrate(make_network("unet"), held_out, torch.device("cpu"))
    fewer = calibrate(make_network("unet"), held_out, torch.device("cpu"), most_batches=1)
    assert fewer is not None
    assert fewer.voxels < made.voxels


def test_networks_of_the_paper_keep_their_confidence(held_out):
    assert calibrate(make_network("mcpnet"), held_out, torch.device("cpu")) is None


def test_training_writes_the_temperature_into_weights_card_and_record(area, tmp_path):
    write_area(tmp_path / "data/Area_1", 4, seed=1, density=4)
    (tmp_path / "data/Area_9").symlink_to(area)
    options = ["--net", "unet", "--epochs", "1", "-q", "-o", tmp_path / "out"]
    result = invoke("train", tmp_path / "data", "--holdout", "9", *options)
    assert result.exit_code == 0, result.stderr
    info = load_weights(tmp_path / "out/unet-holdout9.safetensors").info
    card = (tmp_path / "out/unet-holdout9.md").read_text()
    assert info.temperature != 1.0
    assert f"Logits are divided by {info.temperature:g}," in card
    assert "| 0.9 to 1.0 |" in card
    assert '"error_before"' in (tmp_path / "out/unet-holdout9.json").read_text()

    # nothing held out, nothing to fit on
    assert invoke("train", tmp_path / "data", "--holdout", "none", *options).exit_code == 0
    assert load_weights(tmp_path / "out/unet-all.safetensors").info.temperature == 1.0
    assert "## Confidence" not in (tmp_path / "out/unet-all.md").read_text()


def test_weights_made_earlier_can_be_calibrated(area, tmp_path, monkeypatch, capsys):
    monkeypatch.syspath_prepend(Path(__file__).parents[2])
    example = import_module("examples.calibrate")

    (tmp_path / "data").mkdir()
    (tmp_path / "data/Area_9").symlink_to(area)
    write_area(tmp_path / "data/Area_1", 2, seed=1)
    info = WeightsInfo(architecture="unet", classes=S3DIS_CLASSES)
    save_weights(tmp_path / "old.safetensors", make_network("unet", S3DIS_CLASSES), info)
    words = [tmp_path / "old.safetensors", tmp_path / "data", "-o", tmp_path / "new.safetensors"]
    monkeypatch.setattr(sys, "argv", ["calibrate", *map(str, words), "--holdout", "9"])
    example.main()
    after = load_weights(tmp_path / "new.safetensors")
    assert after.info == info.model_copy(update={"temperature": after.info.temperature})
    assert f"temperature {after.info.temperature:g}" in capsys.readouterr().out
