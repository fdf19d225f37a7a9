"""The files of a training: its record reads back as written, and nothing else is taken for one."""

import json

import pytest

from mcpseg_cli.config import AugmentSettings, SampleSettings, TrainSettings
from mcpseg_cli.errors import OutputError, StateError
from mcpseg_cli.train.folder import AreaFacts, TrainFiles, TrainIdentity, TrainRecord
from mcpseg_cli.train.model_card import model_card
from mcpseg_cli.train.progress import EpochReport
from mcpseg_cli.train.scores import Scores

SCORES = Scores(
    loss=1.25,
    class_loss=1.0,
    instance_loss=0.25,
    accuracy=0.5,
    miou=None,
    embedding_accuracy=None,
    iou=(0.5, None),
)


def make_record(num_epochs: int = 3, *, complete: bool = True, validation=None) -> TrainRecord:
    area = AreaFacts(name="more/Area_2", scans=1234, samples=56789, fingerprint="ab")
    curves = [
        EpochReport(epoch=number, learning_rate=1e-3, seconds=2.0, train=SCORES, validation=None)
        for number in range(1, num_epochs + 1)
    ]
    return TrainRecord(
        mcpseg="0.2.0",
        torch="2.13.0",
        complete=complete,
        name="mine",
        sha256="cd",
        bytes=585204,
        architecture="voxnet",
        classes=("floor", "Wände"),
        new_classes=("Wände",),
        init_name="voxnet",
        holdout=None,
        epochs=num_epochs,
        best_epoch=num_epochs,
        train=SCORES,
        validation=validation,
        seconds=6.0,
        device="cpu",
        command="mcpseg train",
        curves=tuple(curves),
        identity=TrainIdentity(
            settings=TrainSettings(),
            samples=SampleSettings(floor=0.25),
            augmentation=AugmentSettings.off(),
            classes=("floor", "Wände"),
            class_table={"wall": "Wände"},
            training_areas=(area,),
            validation_areas=(),
            init="ef",
            processes=1,
        ),
    )


def write(files: TrainFiles, record: TrainRecord) -> None:
    files.path("json").write_text(json.dumps(record.model_dump(mode="json"), indent=1))


@pytest.fixture
def files(tmp_path) -> TrainFiles:
    return TrainFiles(tmp_path, "mine")


def test_a_record_reads_back_as_it_was_written(files):
    write(files, make_record())
    assert files.read_record() == make_record()


def test_a_training_that_was_cut_short_has_no_record_yet(files):
    assert files.read_record() is None
    write(files, make_record(complete=False))
    assert files.read_record() is None


@pytest.mark.parametrize("text", ["{", "[]", '{"complete": true}', '{"format": 2}'])
def test_what_is_no_record_is_refused_in_one_line(files, text):
    files.path("json").write_text(text)
    with pytest.raises(
        StateError, match=r"mine\.json: not a record of training.*--overwrite"
    ) as at:
        files.read_record()
    assert "\n" not in str(at.value)


@pytest.mark.parametrize("ending", ["safetensors", "md", "json", "toml"])
def test_every_result_is_looked_for_before_training_and_cleared(files, ending):
    files.path(ending).write_text("")
    with pytest.raises(OutputError, match=rf"mine\.{ending}: is there"):
        files.check(resume=False, overwrite=False)
    files.check(resume=False, overwrite=True)
    files.clear()
    files.check(resume=False, overwrite=False)


def test_a_card_names_areas_new_classes_and_what_has_no_score():
    card = model_card(make_record())
    assert "more/Area_2 (1,234 scans, 56,789 samples)" in card
    assert "| started from | `voxnet`; classes new to it: Wände |" in card
    assert "nothing was held out" in card
    assert "| Wände | – |" in card  # noqa: RUF001
    assert "`max_gradient` none, `margin` 1," in card


def test_a_card_shows_evenly_chosen_epochs_with_the_last():
    rows = [line for line in model_card(make_record(60)).splitlines() if " 0.001 |" in line]
    assert [row.split("|")[1].strip() for row in rows][:2] == ["1", "4"]
    assert rows[-1].startswith("| **60** |")
    assert len(rows) == 21
