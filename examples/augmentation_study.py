"""What each part of the augmentation is worth: MCPNet trained with one part left out at a time.

    python examples/augmentation_study.py data/ --holdout 6 -o study/
    python examples/augmentation_study.py data/ -o study/ --batches 3000 --recording office=scans_9/

Each network is scored on batches of the held-out area as they are, then changed as another sensor,
light or map would change them. ``--recording`` adds folders that ``mcpseg raytrace`` wrote,
labelled online by ``mcpseg segment``. What is trained is kept in the output folder and not trained
again; ``study.md`` and ``study.json`` hold the figures.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from itertools import islice
from pathlib import Path

import torch

from mcpseg_cli.config import BATCH, AugmentSettings, SampleSettings, TrainSettings
from mcpseg_cli.networks.device import use_threads
from mcpseg_cli.networks.weights import load_weights
from mcpseg_cli.train.batches import BatchSource
from mcpseg_cli.train.fold_data import DataSettings, fold_data, prepare
from mcpseg_cli.train.folder import TrainFiles
from mcpseg_cli.train.folds import Area, Fold, find_areas, make_folds
from mcpseg_cli.train.objective import Objective
from mcpseg_cli.train.ranks import Ranks
from mcpseg_cli.train.run import TrainRequest, TrainRun
from mcpseg_cli.train.samples import AreaSamples
from mcpseg_cli.train.scores import Tally

PARTS = {  # what is left out together
    "turn, mirror": ("turn_deg", "mirror"),
    "scale": ("scale", "height_scale"),
    "jitter": ("jitter",),
    "robot's place": ("robot_offset",),
    "floor": ("floor_error", "floor_lost", "floor_lost_by"),
    "light": (
        "gain",
        "channel_gain",
        "contrast",
        "offset",
        "gamma",
        "hue_deg",
        "light_gradient",
        "colour_noise",
        "luminance",
    ),
    "grey": ("grey",),
    "context": ("context_dropout", "context_dropout_share", "same_scan"),
    "partial view": ("partial_view",),
    "thinning": ("thinning", "thinning_share"),
}
CONDITIONS: dict[str, dict[str, float]] = {  # how held-out batches are changed
    "as they are": {},
    "turned": {"turn_deg": 180.0, "mirror": 0.5},
    "other size": {"scale": 0.15, "height_scale": 0.06},
    "scattered": {"jitter": 0.05},
    "off centre": {"robot_offset": 0.5},
    "floor missed": {"floor_lost": 1.0, "floor_lost_by": 0.3},
    "other light": {
        "gain": 0.5,
        "channel_gain": 0.2,
        "contrast": 0.5,
        "offset": 30.0,
        "gamma": 0.5,
        "hue_deg": 40.0,
        "light_gradient": 0.2,
        "colour_noise": 20.0,
    },
    "no colour": {"grey": 1.0},
    "first look": {"same_scan": 1.0},
    "narrow view": {"partial_view": 1.0},
    "sparse": {"thinning": 1.0, "thinning_share": 0.9},
}


def variants() -> dict[str, AugmentSettings]:
    """Name the augmentations compared: all of it, one part less, none."""
    full = AugmentSettings()
    without = {
        f"without {part}": full.model_copy(update=dict.fromkeys(names, 0.0))
        for part, names in PARTS.items()
    }
    return {"all": full, **without, "none": AugmentSettings.off()}


def train(
    name: str,
    augment: AugmentSettings,
    fold: Fold,
    prepared: Mapping[Area, AreaSamples],
    options: argparse.Namespace,
) -> Path:
    """Train one network, unless it is there."""
    files = TrainFiles(options.output, name.replace(" ", "_").replace(",", "").replace("'", ""))
    files.check(resume=True, overwrite=False)

    # as the bundled weights of MCPNet, but short
    settings = TrainSettings(
        epochs=1,
        batches_per_epoch=options.batches,
        schedule="cosine",
        warm_up=0.1,
        batch_size=BATCH,
        precision="bf16",
        class_balance="sqrt",
        validation_batches=options.validation_batches,
        seed=options.seed,
    )
    data = DataSettings(SampleSettings(), augment)
    request = TrainRequest(settings, data, fold, command=sys.argv)
    sources = fold_data(fold, prepared, data, settings)

    run = TrainRun(files, request, sources, torch.device("cpu"), Ranks())
    if run.record is None:
        for _ in run.run(minutes=5):
            pass
        run.write_results()
    return files.path("safetensors")


@torch.no_grad()
def score(
    weights: Path, area: AreaSamples, options: argparse.Namespace
) -> dict[str, tuple[float, float]]:
    """Score a network under every condition: point accuracy and mIoU of the classes present."""
    network = load_weights(weights).network.eval()
    objective = Objective(TrainSettings(precision="bf16"), None, torch.device("cpu"))
    results = {}
    for condition, changes in CONDITIONS.items():
        # the held-out batches, changed
        augment = AugmentSettings.model_validate({**AugmentSettings.off().model_dump(), **changes})
        source = BatchSource(
            [area],
            area.classes,
            batch_size=BATCH,
            with_context=True,
            augmentation=augment,
            seed=1,
            samples_per_instance=0,
        )

        tally = Tally(len(area.classes), torch.device("cpu"))
        for batch in map(objective.to_tensors, islice(source.epoch(0), options.validation_batches)):
            outcome = objective.evaluate(network, batch)
            tally.add(outcome, objective.total(outcome), batch.semantic)
        scores = tally.scores()
        results[condition] = (scores.accuracy, scores.miou or 0.0)
    return results


def label(weights: Path, recording: Path) -> tuple[float, float]:
    """Label a ray-traced recording online and score it.

    Returns:
        Point accuracy and mIoU of the classes present.
    """
    mcpseg = [sys.executable, "-m", "mcpseg_cli"]
    with tempfile.TemporaryDirectory() as folder:
        scans = [str(recording / "scans"), str(recording / "poses.csv")]
        command = [*mcpseg, "segment", *scans, "-o", folder + "/out", "-w", str(weights), "-q"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        command = [*mcpseg, "eval", folder + "/out", str(recording / "gt"), "--json"]
        answer = subprocess.run(command, check=True, capture_output=True)

    scores = json.loads(answer.stdout)
    return scores["point_accuracy"], scores["miou_present"]


def table(results: Mapping[str, Mapping[str, tuple[float, float]]]) -> str:
    """Lay the figures out as Markdown: point accuracy / mIoU in per cent."""
    columns = list(results["all"])
    lines = ["| augmentation | " + " | ".join(columns) + " |", "|---|" + "---|" * len(columns)]
    for name, row in results.items():
        cells = [f"{100 * row[column][0]:.1f} / {100 * row[column][1]:.1f}" for column in columns]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Train, score, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=Path)
    parser.add_argument("--holdout", default="6")
    parser.add_argument("--batches", type=int, default=3000)
    parser.add_argument("--validation-batches", type=int, default=150)
    parser.add_argument("--recording", action="append", default=[], metavar="NAME=FOLDER")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("-o", "--output", type=Path, required=True)
    options = parser.parse_args()
    use_threads(options.threads)

    # areas, one held out
    areas = find_areas(options.data)
    [fold] = make_folds(areas, options.holdout, options.data)
    prepared = prepare(areas, DataSettings(SampleSettings(), AugmentSettings()), lambda *_: None)
    recordings = dict(entry.split("=", 1) for entry in options.recording)
    results: dict[str, dict[str, tuple[float, float]]] = {}

    # a network for each part left out; figures are kept as they come
    for name, augment in variants().items():
        weights = train(name, augment, fold, prepared, options)
        results[name] = score(weights, prepared[fold.validation[0]], options)
        results[name] |= {
            title: label(weights, Path(folder)) for title, folder in recordings.items()
        }
        (options.output / "study.json").write_text(json.dumps(results, indent=1) + "\n")
        (options.output / "study.md").write_text(table(results))
        figures = {key: round(accuracy, 3) for key, (accuracy, _) in results[name].items()}
        print(name, figures, flush=True)


if __name__ == "__main__":
    main()
