"""``mcpseg train``: train a network on ray-traced areas."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcpseg_cli.choices import Architecture, Augmentation, Engine, Schedule, TrainPrecision
from mcpseg_cli.cli.options import Device, Jobs, Json, Overwrite, Quiet, number_of_jobs
from mcpseg_cli.cli.recordings import run_all, words_of
from mcpseg_cli.cli.settings import settings_of

if TYPE_CHECKING:
    from pydantic import BaseModel

    from mcpseg_cli.networks.weights import Weights
    from mcpseg_cli.train.ranks import Ranks


_OF_SAMPLES = {"net", "context", "local_range", "config", "classes", "weights", "seed"}
"""What decides the samples of an area, by parameter."""


def train(
    command: typer.Context,
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
            help="Areas to validate on, by the number their names end in: 6; 1,2,3; all; none.",
        ),
    ] = "6",
    net: Annotated[Architecture | None, typer.Option(help="Network.  [default: mcpnet]")] = None,
    epochs: Annotated[
        int | None,
        typer.Option(
            help="Passes over the data, one batch of each scan.  [default: 100; unet: 10]"
        ),
    ] = None,
    lr: Annotated[
        float | None,
        typer.Option(help="Learning rate of Adam.  [default: 0.001; unet: 0.003]"),
    ] = None,
    schedule: Annotated[
        Schedule | None,
        typer.Option(
            help="cosine: the learning rate falls to 0.  [default: constant; unet: cosine]"
        ),
    ] = None,
    batch_size: Annotated[
        int | None,
        typer.Option(
            help="Points per batch; windows for the U-Net.  [default: the network's own; unet: 2]"
        ),
    ] = None,
    precision: Annotated[
        TrainPrecision | None, typer.Option(help="Arithmetic.  [default: fp32]")
    ] = None,
    context: Annotated[
        int | None,
        typer.Option(
            metavar="M",
            help="Context points per point.  [default: that of --weights, else 50; unet: 0]",
        ),
    ] = None,
    local_range: Annotated[
        float | None,
        typer.Option(
            "--range",
            metavar="METRES",
            help="Points used around the robot.  [default: 2.0; unet: 6.0]",
        ),
    ] = None,
    augment: Annotated[
        Augmentation | None,
        typer.Option(help="How training batches are changed.  [default: default]"),
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="TOML file of rarer settings; options win over it."),
    ] = None,
    classes: Annotated[
        Path | None,
        typer.Option(
            help="Class table: CSV 'label,class' or a JSON object; labels not in it are left out."
        ),
    ] = None,
    weights: Annotated[
        str | None,
        typer.Option(
            "-w",
            "--weights",
            help="Start from these, a .safetensors file or the name of bundled ones; classes of "
            "other names start afresh.",
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
    engine: Annotated[
        Engine | None, typer.Option(hidden=True, help="Prepare areas side by side.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(hidden=True, metavar="ADDRESS", help="Of --engine dask: tcp://HOST:PORT."),
    ] = None,
    prepare: Annotated[
        str | None,
        typer.Option(hidden=True, metavar="AREA", help="Prepare this area's samples, and end."),
    ] = None,
    tensorboard: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Log curves for TensorBoard.")
    ] = None,
    jobs: Jobs = None,
    device: Device = "cpu",
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed of every random choice.  [default: 0]")
    ] = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Train a network on ray-traced areas, some held out.

    DATA holds areas as 'mcpseg raytrace' writes them: all folders with a raytrace.json. For each
    fold the output folder gets NAME.safetensors (the weights that do best on the held-out areas),
    NAME.md (model card), NAME.json (curves, scores) and NAME.toml (all settings, as --config takes
    them); NAME.checkpoint is there until training is done. Ctrl-C stops after the step at hand.

    \b
    A settings file has tables [train], [samples], [augment] and, for the U-Net, [windows], whose
    settings NAME.toml lists, and [checkpoint]:
      [train]
      warm_up = 0.1           # epochs over which the learning rate rises
      class_balance = "sqrt"  # errors on rare classes cost more
      [augment]
      grey = 0.0
      [checkpoint]
      minutes = 30.0          # from one to the next within an epoch; keep = true: also when done

    Areas are prepared one after another; with --engine processes some at a time, as many as --jobs
    says, and with --engine dask --scheduler tcp://HOST:PORT by the workers of a Dask cluster.
    --prepare AREA prepares one and ends. With --device cuda, processes draw the batches, one for
    each of the --jobs but one.

    \b
    A class table, or the table [classes] of a settings file, says which labels of the data mean
    which class; two labels may mean the same:
      label,class
      office chair,chair
      armchair,chair
      laminate,floor

    \b
    Examples:
      mcpseg train --holdout 6
      mcpseg train data/ --holdout 6 --net unet
      mcpseg train data/ --holdout all --net voxnet -o trained/
      mcpseg train scans/ --holdout none -w mcpnet-holdout6.safetensors --classes mine.csv
      mcpseg train data/ --config trained/mcpnet-holdout6.toml --seed 1 -o again/
      torchrun --nproc-per-node 2 -m mcpseg_cli train --holdout 6 --device cuda
    """
    from mcpseg_cli.config import (
        WINDOW_SAMPLES,
        WINDOW_TRAINING,
        AugmentSettings,
        SampleSettings,
        TrainSettings,
    )
    from mcpseg_cli.formats.class_table import read_class_table
    from mcpseg_cli.train.folds import find_areas, make_folds
    from mcpseg_cli.train.settings_file import SettingsFile, read_settings

    # settings: options win over the file
    if resume and overwrite:
        raise typer.BadParameter("--resume and --overwrite exclude each other")
    file = SettingsFile() if config is None else read_settings(config)
    is_unet = (net or file.train.architecture) == "unet"
    settings = settings_of(
        TrainSettings,
        {
            "architecture": net,
            "epochs": epochs,
            "learning_rate": lr,
            "schedule": schedule,
            "batch_size": batch_size,
            "precision": precision,
            "seed": seed,
        },
        before={**(WINDOW_TRAINING if is_unet else {}), **_given(file.train)},
    )
    own = AugmentSettings.of_windows() if is_unet else AugmentSettings()
    changed = own.model_copy(update=_given(file.augment))
    parts = {"default": own, "none": AugmentSettings.off(), None: changed}
    mapping = file.classes if classes is None else read_class_table(classes)

    # what to train on
    areas = find_areas(data)
    folds = make_folds(areas, holdout, data)
    if name is not None and (len(folds) > 1 or Path(name).name != name):
        raise typer.BadParameter("--name is a file name, for one fold")
    if (engine == "dask") != (scheduler is not None):
        raise typer.BadParameter("--engine dask and --scheduler ADDRESS go together")
    chosen = [area for area in areas if area.name == prepare]
    if prepare is not None and not chosen:
        raise typer.BadParameter(f"--prepare {prepare}: none of the areas in {data}")

    from mcpseg_cli.cli.train_task import TaskOptions, TrainTask
    from mcpseg_cli.networks.device import use_threads
    from mcpseg_cli.networks.weights import NETWORKS
    from mcpseg_cli.train.fold_data import DataSettings
    from mcpseg_cli.train.folder import TrainFiles

    if jobs is not None:
        use_threads(jobs)

    # what is not given is that of the weights to start from, or the network's own
    initial = _initial(weights)
    samples = settings_of(
        SampleSettings,
        {"num_context": context, "local_range": local_range, "seed": seed},
        before={
            **(WINDOW_SAMPLES if is_unet else _context_of(initial)),
            **_given(file.samples),
        },
    )
    size = settings.batch_size or NETWORKS[settings.architecture].traits.batch_size
    settings = settings.model_copy(update={"batch_size": size})

    options = TaskOptions(
        resume=resume,
        overwrite=overwrite,
        checkpoint=file.checkpoint,
        tensorboard=tensorboard,
        quiet=quiet,
        as_json=as_json,
        command=("mcpseg", *sys.argv[1:]),
        jobs=jobs,
    )
    request = DataSettings(samples, parts[augment], file.windows, mapping, cache)
    task = TrainTask(settings, request, initial, _ranks(), device, options)
    if chosen:
        task.prepare(chosen)
        return
    if engine is not None and _ranks().rank == 0:
        used = {area for fold in folds for area in (*fold.training, *fold.validation)}
        words = words_of(
            command, {each.name or "" for each in command.command.params} - _OF_SAMPLES
        )
        words += [] if cache is None else ["--cache", str(cache.resolve())]
        commands = [
            (
                "train", str(data.resolve()), "--holdout", "none", *words,
                "--prepare", area.name, "-j", "1", "--quiet",
            )
            for area in areas if area in used
        ]  # fmt: skip
        num_jobs = min(number_of_jobs(jobs), len(commands))
        run_all(
            commands, "prepare samples", engine, scheduler, jobs=num_jobs, quiet=quiet or as_json
        )
    names = [name or f"{settings.architecture}-{fold.label}" for fold in folds]
    task.run(
        areas,
        [(fold, TrainFiles(output, each)) for fold, each in zip(folds, names, strict=True)],
    )


def _given(settings: BaseModel) -> dict[str, object]:
    """Give the settings that a file says something about."""
    return settings.model_dump(exclude_unset=True)


def _initial(name: str | None) -> Weights | None:
    """Load the weights to start from."""
    from mcpseg_cli.networks.description import find_weights
    from mcpseg_cli.networks.weights import load_weights

    return None if name is None else load_weights(find_weights(name))


def _context_of(weights: Weights | None) -> dict[str, object]:
    """Give the context that weights were trained with."""
    if weights is None:
        return {}
    info = weights.info
    return {"context_window": info.context_window, "num_context": info.num_context}


def _ranks() -> Ranks:
    """Read from torchrun's environment which of the processes this is."""
    from mcpseg_cli.train.ranks import Ranks

    rank, world = (
        int(os.environ.get(variable, default))
        for variable, default in (("RANK", 0), ("WORLD_SIZE", 1))
    )
    return Ranks(rank, world, int(os.environ.get("LOCAL_RANK", rank)))
