"""Settings files: what is written can be read, and what cannot be is refused in one line."""

import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcpseg_cli.config import (
    AugmentSettings,
    CheckpointSettings,
    SampleSettings,
    TrainSettings,
    WindowSettings,
)
from mcpseg_cli.errors import InputError
from mcpseg_cli.train.settings_file import SettingsFile, read_settings, settings_text

MODELS = Path(__file__).parents[2] / "models"
ADDED_LATER = {
    "right_angle", "grid_shift", "tilt_deg", "holes", "hole_radius", "no_ceiling",
    "mixed_boxes", "mixed_things", "stored_as", "label_smoothing",
}  # fmt: skip
"""Settings that there were not yet when some weights were trained; left out, they are off."""


def read(folder: Path, text: str) -> SettingsFile:
    (folder / "a.toml").write_text(text, encoding="utf-8")
    return read_settings(folder / "a.toml")


def text_of(file: SettingsFile) -> str:
    return settings_text(file.train, file.samples, file.augment, file.windows, file.classes)


def test_nothing_in_a_file_means_every_default(tmp_path):
    assert read(tmp_path, "") == SettingsFile()


def test_tables_are_the_settings(tmp_path):
    file = read(
        tmp_path,
        "[train]\nwarm_up = 1\n[samples]\nfloor = 'scan-min'\n[augment]\ngrey = 0\n"
        "[windows]\nyoung = 0.5\n[checkpoint]\nminutes = 0.5\nkeep = true\n"
        "[classes]\na = 'b'\nc = 'd'\ne = 'unknown'\n",
    )
    assert file.train == TrainSettings(warm_up=1.0)
    assert file.samples == SampleSettings(floor="scan-min")
    assert file.augment == AugmentSettings(grey=0.0)
    assert file.windows == WindowSettings(young=0.5)
    assert file.checkpoint == CheckpointSettings(minutes=0.5, keep=True)
    assert file.classes == {"a": "b", "c": "d"}


@given(
    architecture=st.sampled_from(["mcpnet", "unet"]),
    young=st.floats(0, 1),
    rate=st.floats(1e-12, 10, exclude_min=True),
    floor=st.one_of(st.just("scan-min"), st.floats(-65536, 65536)),
    labels=st.lists(st.text(st.characters(exclude_categories=["Cs"])), min_size=2, unique=True),
    num_batches=st.none() | st.integers(1, 10**12),
)
def test_what_is_written_reads_back_the_same(
    architecture, young, rate, floor, labels, num_batches, tmp_path_factory
):
    written = SettingsFile(
        train=TrainSettings(
            architecture=architecture,
            learning_rate=rate,
            batches_per_epoch=num_batches,
            best_by="loss",
        ),
        samples=SampleSettings(floor=floor),
        augment=AugmentSettings.off(),
        windows=WindowSettings(young=young) if architecture == "unet" else WindowSettings(),
        classes={label: "abc"[index % 3] for index, label in enumerate(labels)},
    )
    text = text_of(written)
    file = read(tmp_path_factory.getbasetemp(), text)
    assert file == written
    assert text_of(file) == text


@pytest.mark.parametrize("architecture", ["mcpnet", "unet"])
def test_every_setting_is_written(architecture):
    file = SettingsFile(train=TrainSettings(architecture=architecture))
    parts = {"train": file.train, "samples": file.samples, "augment": file.augment}
    if architecture == "unet":
        parts["windows"] = file.windows
    text = text_of(file)
    assert list(tomllib.loads(text)) == list(parts)
    for part in parts.values():
        for key, value in part:
            assert (f"\n# {key} is not set\n" if value is None else f"\n{key} = ") in text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("train", "Expected '=' after a key in a key/value pair (at end of document)"),
        ("[tarin]\n", "unknown [tarin]; expected some of [train], [samples], [augment]"),
        ("epochs = 3\n", "unknown [epochs]; expected some of [train], [samples]"),
        ("train = 3\n", "[train] = 3; expected a table; correct it, or leave it out"),
        ("[samples]\nrange = 3\n", "unknown [samples] range; expected some of voxel_size"),
        ("[train]\nepochs = 0\n", "[train] epochs = 0; expected greater than or equal to 1"),
        ("[train]\nepochs = '3'\n", '[train] epochs = "3"; expected a valid integer'),
        ("[train]\nepochs = 3.0\n", "[train] epochs = 3.0; expected a valid integer"),
        ("[train]\nwarm_up = true\n", "[train] warm_up = true; expected a valid number"),
        ("[train]\nprecision = 'fp8'\n", "[train] precision = \"fp8\"; expected 'fp32' or 'bf16'"),
        ("[train]\npatience = 1979-05-27\n", '[train] patience = "1979-05-27"; expected a valid'),
        ("[augment]\ngrey = nan\n", "[augment] grey = NaN; expected a finite number"),
        ("[samples]\nfloor = 'x'\n", "expected 'map' or 'scan-min' or a valid number"),
        ("[windows]\nrange = 3\n", "unknown [windows] range; expected some of voxel_size"),
        ("[windows]\nyoung = 2\n", "[windows] young = 2; expected less than or equal to 1"),
        ("[checkpoint]\nminutes = -1\n", "[checkpoint] minutes = -1; expected greater than"),
        ("[classes]\na = 1\n", "[classes] a = 1; expected a valid string"),
        ("[classes]\na = 'b'\n", "a.toml [classes]: 1 classes; expected two or more"),
        ("[classes]\na = 'b,c'\nd = 'e'\n", "a.toml [classes]: a class named 'b,c'"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line_that_names_file_and_setting(text, said, tmp_path):
    with pytest.raises(InputError) as caught:
        read(tmp_path, text)
    assert said in str(caught.value)
    assert "a.toml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_no_text_is_refused(tmp_path):
    (tmp_path / "a.toml").write_bytes(b"[train]\n\xff")
    with pytest.raises(InputError, match="expected TOML"):
        read_settings(tmp_path / "a.toml")


@pytest.mark.parametrize("path", sorted(MODELS.glob("*.safetensors")), ids=lambda path: path.stem)
def test_the_settings_of_bundled_weights_are_those_of_their_cards(path):
    file = read_settings(path.with_suffix(".toml"))
    card = path.with_suffix(".md").read_text()
    for name in ("train", "samples", "augment"):
        for key, value in getattr(file, name):
            if key in ADDED_LATER and key not in path.with_suffix(".toml").read_text():
                continue
            told = f"{value:g}" if isinstance(value, float) else "none" if value is None else value
            assert f"`{key}` {told}" in card
    assert f"--config models/{path.stem}.toml" in card
