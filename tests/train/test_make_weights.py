"""The script that makes the U-Net's weights from nothing: its plan, and the smallest run."""

import shlex
import subprocess
from pathlib import Path

import pytest

from mcpseg_cli.networks.weights import load_weights

MODELS = Path(__file__).parents[2] / "models"
SETTINGS = """
[train]
architecture = "unet"
epochs = 1
batch_size = 2
batches_per_epoch = 2
validation_batches = 1
stored_as = "fp16"
[samples]
voxel_size = 0.05
local_range = 6.0
num_context = 0
seen_again = 0
[windows]
most_voxels = 500
"""


@pytest.fixture
def script(monkeypatch):
    monkeypatch.syspath_prepend(str(MODELS))
    import make_weights

    return make_weights


@pytest.fixture
def smallest(script, tmp_path, monkeypatch):
    """One training, on one building of two rooms, of hardly any batches."""
    settings = tmp_path / "settings"
    settings.mkdir()
    (settings / "unet-home.toml").write_text(SETTINGS, encoding="utf-8")
    areas = [script.Building(1, 1, classes="home"), script.Building(9, 9, classes="home")]
    monkeypatch.setattr(script, "TRAININGS", {"unet-home": (areas, "unet-home.toml", None)})
    monkeypatch.setattr(script, "MODELS", settings)
    monkeypatch.setattr(script, "SPACING", 0.05)
    return ["--without-models", "--rooms", "2", "--step", "4.0"]


def plan_of(script, capsys, *words: str) -> list[list[str]]:
    assert script.main(["work", "--plan", *words]) == 0
    return [shlex.split(line) for line in capsys.readouterr().out.splitlines()]


def test_the_plan_makes_every_building_before_it_is_scanned_and_scans_before_training(
    script, capsys
):
    steps = [words for words in plan_of(script, capsys) if "mcpseg_cli" in words]
    made: set[str] = set()
    kinds = []
    for words in steps:
        command = words[words.index("mcpseg_cli") + 1]
        kinds.append(command)
        target = words[words.index(command) + 1]
        if command == "synth":
            made.add(target)
        elif command == "raytrace":
            assert target in made
    assert kinds.index("train") == len(kinds) - 4
    assert kinds.count("synth") == len(made)


def test_each_training_starts_from_the_one_before(script, capsys):
    trainings = [words for words in plan_of(script, capsys) if "train" in words]
    starts = [words[words.index("-w") + 1] if "-w" in words else None for words in trainings]
    made = [words[words.index("--name") + 1] for words in trainings]
    assert starts == [None, *(f"work/trained/{name}.safetensors" for name in made[:-1])]


def test_no_held_out_area_is_trained_on(script):
    for areas, *_ in script.TRAININGS.values():
        held_out = [each.name for each in areas if each.number == 9]
        assert len(held_out) == 2
        assert all(each.number % 10 != 9 for each in areas if each.name not in held_out)


def test_models_kept_from_training_furnish_nothing(script, capsys):
    assert not any("--models-part" in words for words in plan_of(script, capsys))
    assert not any("--models" in words for words in plan_of(script, capsys, "--without-models"))


def test_weights_are_made_from_nothing_and_not_again(script, smallest, tmp_path, capsys):
    work = tmp_path / "work"
    assert script.main([str(work), *smallest]) == 0
    weights = load_weights(work / "trained" / "unet-home.safetensors")
    assert "bed" in weights.info.classes
    assert not list((work / "buildings").rglob("*.txt"))

    capsys.readouterr()
    assert script.main([str(work), *smallest]) == 0
    again = capsys.readouterr().out
    assert "synth" not in again
    assert "raytrace" not in again
    after = load_weights(work / "trained" / "unet-home.safetensors")
    assert after.sha256 == weights.sha256


def test_a_command_that_fails_ends_the_script_in_one_line(
    script, smallest, tmp_path, monkeypatch, capsys
):
    def fail(words, **_):
        raise subprocess.CalledProcessError(1, words)

    monkeypatch.setattr(subprocess, "run", fail)
    assert script.main([str(tmp_path / "work"), *smallest]) == 1
    assert "run again to go on" in capsys.readouterr().err.splitlines()[-1]
