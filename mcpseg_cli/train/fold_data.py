"""The data of one fold: samples of its areas, prepared once, as sources of batches."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import JsonValue

from mcpseg_cli.config import AugmentSettings, SampleSettings, TrainSettings
from mcpseg_cli.errors import InputError
from mcpseg_cli.train.batches import AreaSamples, Batches, BatchSource, prepare_samples
from mcpseg_cli.train.class_table import trained_classes
from mcpseg_cli.train.folds import Area, Fold

Note = Callable[[str, int, int], None]
"""Told an area, its scans done and its scans in all."""


@dataclass(frozen=True)
class DataSettings:
    """How scans become batches.

    Attributes:
        samples: How scans are replayed.
        augment: How training batches are changed; validation batches never are.
        mapping: Class by label of the data; None: the data's own classes.
        cache: Folder for prepared samples; None: the areas' own.
    """

    samples: SampleSettings
    augment: AugmentSettings
    mapping: Mapping[str, str] | None = None
    cache: Path | None = None


@dataclass(frozen=True)
class FoldData:
    """The data of one fold, ready to draw from.

    Attributes:
        classes: What is trained, C names.
        training: Batches, changed as the settings say.
        validation: Batches as segmentation sees them; None where nothing is held out.
        plain: The training batches without change and context, to count classes in.
        facts: What the data is; with other facts, training is another.
    """

    classes: tuple[str, ...]
    training: Batches
    validation: Batches | None
    plain: Batches
    facts: dict[str, JsonValue]


def prepare(areas: Iterable[Area], settings: DataSettings, note: Note) -> dict[Area, AreaSamples]:
    """Replay areas whose samples are not prepared yet.

    Args:
        areas: Of all folds.
        settings: How.
        note: Told how far it is.

    Raises:
        McpsegError: An area that cannot be used.
        OSError: A file cannot be read, or the disk is full.
    """
    prepared = {}
    if settings.cache is not None:
        settings.cache.mkdir(parents=True, exist_ok=True)
    for area in areas:
        file = None if settings.cache is None else _cache_file(area, settings.cache)

        def progress(done: int, total: int, name: str = area.name) -> None:
            note(name, done, total)

        prepared[area] = prepare_samples(area.folder, settings.samples, file, progress)
    return prepared


def _cache_file(area: Area, cache: Path) -> Path:
    """Name an area's file in the cache so that no other area has it: names with / and with - would look the same."""
    digest = hashlib.sha256(os.fsencode(area.folder.resolve())).hexdigest()
    return cache / f"{area.name.replace('/', '-')}-{digest[:12]}.h5"


def fold_data(
    fold: Fold, prepared: Mapping[Area, AreaSamples], data: DataSettings, train: TrainSettings
) -> FoldData:
    """Make the sources of one fold's batches.

    Args:
        fold: Which areas.
        prepared: From ``prepare``; those of other folds may be among them.
        data: How scans become batches.
        train: Network, seed and draw; its batch size is given.

    Raises:
        McpsegError: The class table does not fit the data, or no scan shows an object of a class.
    """
    assert train.batch_size is not None
    batch_size, seed = train.batch_size, train.seed
    classes = trained_classes(
        [prepared[area].classes for area in [*fold.training, *fold.validation]], data.mapping
    )
    needs_context = train.architecture == "mcpnet"
    training = [_renamed(prepared[area], data.mapping) for area in fold.training]
    validation = [_renamed(prepared[area], data.mapping) for area in fold.validation]
    known = {name for area in training for name in area.classes if name in classes}
    if len(known) < 2:
        labels = dict.fromkeys(name for area in fold.training for name in prepared[area].classes)
        raise InputError(
            "--classes",
            f"data labelled {', '.join(labels)}",
            "two classes or more of them",
            "check both",
        )

    def source(with_context: bool, augment: AugmentSettings | None) -> BatchSource:
        return BatchSource(
            training,
            classes,
            batch_size=batch_size,
            with_context=with_context,
            augmentation=augment,
            seed=seed,
            samples_per_instance=train.samples_per_instance,
            plain_share=train.plain_share,
        )

    held_out = (
        BatchSource(
            validation,
            classes,
            batch_size=batch_size,
            with_context=needs_context,
            augmentation=None,
            seed=seed,
            samples_per_instance=0,
        )
        if validation
        else None
    )
    facts: dict[str, JsonValue] = {
        "training_areas": _facts(fold.training, prepared),
        "validation_areas": _facts(fold.validation, prepared),
    }
    return FoldData(
        classes, source(needs_context, data.augment), held_out, source(False, None), facts
    )


def _renamed(area: AreaSamples, mapping: Mapping[str, str] | None) -> AreaSamples:
    """Name an area's labels by the classes they mean; labels that mean none get no name, and are not drawn."""
    if mapping is None:
        return area
    renamed = AreaSamples(area.path)
    renamed.classes = tuple(mapping.get(name, "") for name in area.classes)
    return renamed


def _facts(areas: Sequence[Area], prepared: Mapping[Area, AreaSamples]) -> JsonValue:
    return [
        {
            "name": area.name,
            "scans": prepared[area].num_scans,
            "samples": prepared[area].num_samples,
            "fingerprint": bytes(prepared[area].fingerprint).hex(),
        }
        for area in areas
    ]
