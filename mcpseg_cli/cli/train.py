"""``mcpseg train``: train a network on ray-traced areas."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcpseg_cli.choices import (
    Architecture,
    BestBy,
    ClassBalance,
    ContextWindow,
    Schedule,
    TrainPrecision,
)
from mcpseg_cli.cli.options import Device, Jobs, Json, Overwrite, Quiet, Seed
from mcpseg_cli.cli.settings import settings_of

if TYPE_CHECKING:
    from mcpseg_cli.config import AugmentSettings
    from mcpseg_cli.networks.weights import Weights
    from mcpseg_cli.train.ranks import Ranks


def train(
    data: Annotated[
        Path,
        typer.Argument(
            metavar="[DATA]",
            help="Folder of ray-traced areas, also in folders in it.",
            show_default="data",
        ),
    ] = Path("data"),
    holdout: Annotated[
        str,
        typer.Option(
            metavar="NUMBERS",
            help="Areas to validate on, by the number at the end of their name: 6; 1,2,3; all; none.",
        ),
    ] = "6",
    net: Annotated[Architecture, typer.Option(help="Network.")] = "mcpnet",
    epochs: Annotated[
        int, typer.Option(help="Passes over the data, one batch of each scan.")
    ] = 100,
    lr: Annotated[float, typer.Option(help="Learning rate of Adam.")] = 1e-3,
    schedule: Annotated[
        Schedule, typer.Option(help="constant, or cosine: the learning rate falls to 0.")
    ] = "constant",
    warm_up: Annotated[
        float, typer.Option(metavar="EPOCHS", help="Let the learning rate rise over so many.")
    ] = 0.0,
    weight_decay: Annotated[
        float, typer.Option(help="Decoupled weight decay; 0 is plain Adam.")
    ] = 0.0,
    clip: Annotated[
        float | None, typer.Option(metavar="LENGTH", help="Cut longer gradients to this.")
    ] = None,
    margin: Annotated[float, typer.Option(help="Margin of the triplet loss.")] = 1.0,
    class_weight: Annotated[float, typer.Option(help="Weight of the class loss.")] = 1.0,
    instance_weight: Annotated[float, typer.Option(help="Weight of the instance loss.")] = 1.0,
    balance: Annotated[
        ClassBalance,
        typer.Option(
            help="sqrt: errors on rare classes cost more, by the root of their frequency."
        ),
    ] = "none",
    batch_size: Annotated[
        int | None, typer.Option(help="Points per batch.  [default: the network's own]")
    ] = None,
    batches: Annotated[
        int | None, typer.Option(metavar="N", help="End each epoch after so many batches.")
    ] = None,
    batches_per_step: Annotated[
        int, typer.Option(metavar="N", help="Batches averaged for one update.")
    ] = 1,
    validation_batches: Annotated[
        int | None, typer.Option(metavar="N", help="Validate on so many batches.")
    ] = None,
    validate_every: Annotated[
        int, typer.Option(metavar="EPOCHS", help="From one validation to the next.")
    ] = 1,
    patience: Annotated[
        int | None, typer.Option(help="Stop after so many validations without a better one.")
    ] = None,
    best_by: Annotated[BestBy, typer.Option(help="What the weights are chosen by.")] = "miou",
    precision: Annotated[TrainPrecision, typer.Option(help="Arithmetic.")] = "fp32",
    window: Annotated[
        ContextWindow | None,
        typer.Option(help="Where context comes from.  [default: that of --init, else cells]"),
    ] = None,
    context: Annotated[
        int | None,
        typer.Option(
            metavar="M", help="Context points per point.  [default: that of --init, else 50]"
        ),
    ] = None,
    voxel_size: Annotated[float, typer.Option(metavar="METRES", help="Edge of a voxel.")] = 0.1,
    local_range: Annotated[
        float, typer.Option("--range", metavar="METRES", help="Points used around the robot.")
    ] = 2.0,
    augment: Annotated[
        str,
        typer.Option(
            metavar="WHAT", help="default, none, or a JSON file of augmentation settings."
        ),
    ] = "default",
    classes: Annotated[
        Path | None,
        typer.Option(
            help="Class table: CSV 'label,class' or a JSON object; labels not in it are left out."
        ),
    ] = None,
    init: Annotated[
        str | None,
        typer.Option(
            metavar="WEIGHTS", help="Start from these; classes of other names start afresh."
        ),
    ] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the results.")] = Path(
        "trained"
    ),
    name: Annotated[
        str | None,
        typer.Option(help="Name of the files, for one fold.  [default: NET-holdoutNUMBER]"),
    ] = None,
    cache: Annotated[
        Path | None, typer.Option(help="Folder for prepared samples.  [default: in each area]")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue what was interrupted; skip what is done.")
    ] = False,
    checkpoint: Annotated[
        float, typer.Option(metavar="MINUTES", min=0.0, help="From one checkpoint to the next.")
    ] = 10,
    keep_checkpoint: Annotated[
        bool, typer.Option("--keep-checkpoint", help="Also when done.")
    ] = False,
    tensorboard: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Log curves for TensorBoard.")
    ] = None,
    jobs: Jobs = None,
    device: Device = "cpu",
    seed: Seed = 0,
    overwrite: Overwrite = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Train a network on ray-traced areas, some held out.

    DATA holds areas as 'mcpseg raytrace' writes them: all folders with a raytrace.json. For each
    fold the output folder gets NAME.safetensors (the weights that do best on the held-out areas),
    NAME.md (model card) and NAME.json (curves, scores, settings); NAME.checkpoint is there until
    training is done. Ctrl-C stops after the step at hand.

    \b
    A class table says which labels of the data mean which class; two labels may mean the same:
      label,class
      office chair,chair
      armchair,chair
      laminate,floor

    \b
    Examples:
      mcpseg train --holdout 6
      mcpseg train data/ --holdout all --net voxnet -o trained/
      mcpseg train scans/ --holdout none --init mcpnet --classes mine.csv --lr 1e-4 --epochs 20
      torchrun --nproc-per-node 2 -m mcpseg_cli train --holdout 6 --device cuda
    """
    from mcpseg_cli.config import TrainSettings
    from mcpseg_cli.train.folds import find_areas, make_folds

    if resume and overwrite:
        raise typer.BadParameter("--resume and --overwrite exclude each other")
    settings = settings_of(TrainSettings, {
        "architecture": net, "epochs": epochs, "learning_rate": lr, "schedule": schedule,
        "warm_up": warm_up, "weight_decay": weight_decay, "max_gradient": clip, "margin": margin,
        "class_weight": class_weight, "instance_weight": instance_weight,
        "class_balance": balance, "batch_size": batch_size, "batches_per_epoch": batches,
        "batches_per_step": batches_per_step, "validation_batches": validation_batches,
        "validate_every": validate_every, "patience": patience, "best_by": best_by,
        "precision": precision, "seed": seed,
    })  # fmt: skip
    areas = find_areas(data)
    folds = make_folds(areas, holdout, data)
    if name is not None and (len(folds) > 1 or Path(name).name != name):
        raise typer.BadParameter("--name is a file name, for one fold")
    mapping = _class_table(classes)
    augmentation = _augmentation(augment)

    from mcpseg_cli.cli.train_task import TaskOptions, TrainTask
    from mcpseg_cli.config import SampleSettings
    from mcpseg_cli.networks.device import use_threads
    from mcpseg_cli.train.fold_data import DataSettings
    from mcpseg_cli.train.run import TrainFiles, network_batch_size

    if jobs is not None:
        use_threads(jobs)
    initial = _initial(init)
    given_window = window if window else initial.info.context_window if initial else "cells"
    given_context = context if context is not None else initial.info.num_context if initial else 50
    samples = settings_of(SampleSettings, {
        "context_window": given_window, "num_context": given_context, "voxel_size": voxel_size,
        "local_range": local_range, "seed": seed,
    })  # fmt: skip
    settings = settings.model_copy(
        update={"batch_size": settings.batch_size or network_batch_size(settings)}
    )
    options = TaskOptions(
        resume=resume, overwrite=overwrite, keep_checkpoint=keep_checkpoint, minutes=checkpoint,
        tensorboard=tensorboard, quiet=quiet, as_json=as_json, command=("mcpseg", *sys.argv[1:]),
    )  # fmt: skip
    task = TrainTask(
        settings,
        DataSettings(samples, augmentation, mapping, cache),
        initial,
        _ranks(),
        device,
        options,
    )
    task.run(areas, [(fold, TrainFiles(output, name or f"{net}-{fold.label}")) for fold in folds])


def _class_table(path: Path | None) -> dict[str, str] | None:
    """Read the class table."""
    from mcpseg_cli.train.class_table import read_class_table

    return None if path is None else read_class_table(path)


def _augmentation(what: str) -> AugmentSettings:
    """Read how training batches are changed."""
    from pydantic import ValidationError

    from mcpseg_cli.config import AugmentSettings
    from mcpseg_cli.errors import InputError

    if what in ("default", "none"):
        return AugmentSettings() if what == "default" else AugmentSettings.off()
    path = Path(what)
    try:
        return AugmentSettings.model_validate_json(path.read_bytes())
    except ValidationError as error:
        problem = error.errors()[0]
        found = f"{'.'.join(map(str, problem['loc'])) or 'no settings'}: {problem['msg']}"
        expected = f"a JSON object of {', '.join(AugmentSettings.model_fields)}"
        raise InputError(path, found, expected, "settings left out keep their default") from error


def _initial(name: str | None) -> Weights | None:
    """Load the weights to start from."""
    from mcpseg_cli.networks.weights import find_weights, load_weights

    return None if name is None else load_weights(find_weights(name))


def _ranks() -> Ranks:
    """Read from torchrun's environment which of the processes this is."""
    from mcpseg_cli.train.ranks import Ranks

    rank, world = (
        int(os.environ.get(variable, default))
        for variable, default in (("RANK", 0), ("WORLD_SIZE", 1))
    )
    return Ranks(rank, world, int(os.environ.get("LOCAL_RANK", rank)))
