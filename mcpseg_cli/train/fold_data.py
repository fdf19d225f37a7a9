"""The data of one fold: samples of its areas, prepared once, as sources of batches."""

from __future__ import annotations

import errno
import hashlib
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from mcpseg_cli.config import AugmentSettings, SampleSettings, TrainSettings, WindowSettings
from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.networks.weights import NETWORKS
from mcpseg_cli.train.batches import BatchSource
from mcpseg_cli.train.class_table import trained_classes, trained_names
from mcpseg_cli.train.folder import AreaFacts
from mcpseg_cli.train.folds import Area, Fold
from mcpseg_cli.train.samples import AreaSamples, prepare_samples
from mcpseg_cli.train.sources import Batches
from mcpseg_cli.train.windows import WindowSource

AreaProgress = Callable[[str, int, int], None]
"""Called with the name of an area, its scans that are done, and their number."""


@dataclass(frozen=True)
class DataSettings:
    """How scans become batches.

    Attributes:
        samples: How scans are replayed.
        augment: How training batches are changed; validation batches never are.
        windows: Which windows a network is trained on that sees whole ones.
        mapping: Class by label of the data; None: the data's own classes.
        cache: Folder for prepared samples; None: the areas' own.
    """

    samples: SampleSettings
    augment: AugmentSettings
    windows: WindowSettings = field(default_factory=WindowSettings)
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
        training_areas: What is trained on; with other areas, training is another.
        validation_areas: What is held out.
    """

    classes: tuple[str, ...]
    training: Batches
    validation: Batches | None
    plain: Batches
    training_areas: tuple[AreaFacts, ...]
    validation_areas: tuple[AreaFacts, ...]


def prepare(
    areas: Iterable[Area], settings: DataSettings, progress: AreaProgress
) -> dict[Area, AreaSamples]:
    """Replay areas whose samples are not prepared yet.

    Args:
        areas: Of all folds.
        settings: How.
        progress: Called after each scan that is replayed.

    Raises:
        McpsegError: An area that cannot be used.
        OSError: A file cannot be read, or the disk is full.
    """
    prepared = {}
    if settings.cache is not None:
        settings.cache.mkdir(parents=True, exist_ok=True)
    for area in areas:
        file = None if settings.cache is None else _cache_file(area, settings.cache)
        try:
            prepared[area] = prepare_samples(
                area.folder, settings.samples, file, partial(progress, area.name)
            )
        except OSError as error:
            if file is not None or error.errno not in (errno.EACCES, errno.EPERM, errno.EROFS):
                raise
            raise OutputError(
                f"{error.filename or area.folder}: {error.strerror}; expected to write the area's "
                "samples beside it; name a folder for them with --cache"
            ) from error
    return prepared


def _cache_file(area: Area, cache: Path) -> Path:
    """Name an area's file in the cache; names with / and with - would look the same."""
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
        train: Network, batch size, seed and draw.

    Raises:
        McpsegError: The class table does not fit the data, or no scan shows an object of a class.
    """
    # what is trained: the class table's classes, or those the areas have
    training = [prepared[area] for area in fold.training]
    validation = [prepared[area] for area in fold.validation]
    classes = trained_classes([area.classes for area in training + validation], data.mapping)
    _check_classes(classes, training, data.mapping)

    # objects are drawn evenly to learn from, points as segmentation sees them to validate
    make = _window_sources if NETWORKS[train.architecture].traits.sees_windows else _point_sources
    learned, validated, plain = make(training, validation, classes, data, train)
    return FoldData(
        classes,
        learned,
        validated,
        plain,
        training_areas=_facts(fold.training, prepared),
        validation_areas=_facts(fold.validation, prepared),
    )


def _window_sources(
    training: Sequence[AreaSamples],
    validation: Sequence[AreaSamples],
    classes: tuple[str, ...],
    data: DataSettings,
    train: TrainSettings,
) -> tuple[Batches, Batches | None, Batches]:
    """Make the sources of windows: to learn from, to validate on, and to count classes in."""

    def source(areas: Sequence[AreaSamples], augment: AugmentSettings | None) -> WindowSource:
        return WindowSource(
            areas,
            classes,
            data.mapping,
            windows_per_batch=train.batch_size or NETWORKS[train.architecture].traits.batch_size,
            settings=data.windows,
            augmentation=augment,
            seed=train.seed,
        )

    validated = source(validation, None) if validation else None
    return source(training, data.augment), validated, source(training, None)


def _point_sources(
    training: Sequence[AreaSamples],
    validation: Sequence[AreaSamples],
    classes: tuple[str, ...],
    data: DataSettings,
    train: TrainSettings,
) -> tuple[Batches, Batches | None, Batches]:
    """Make the sources of points: to learn from, to validate on, and to count classes in."""
    network = NETWORKS[train.architecture]

    def source(
        areas: Sequence[AreaSamples],
        with_context: bool,
        per_object: int,
        augment: AugmentSettings | None = None,
    ) -> BatchSource:
        return BatchSource(
            areas,
            classes,
            data.mapping,
            batch_size=train.batch_size or network.traits.batch_size,
            with_context=with_context,
            augmentation=augment,
            seed=train.seed,
            samples_per_instance=per_object,
            plain_share=train.plain_share,
        )

    per_object = train.samples_per_instance
    learned = source(training, network.traits.needs_context, per_object, data.augment)
    validated = source(validation, network.traits.needs_context, 0) if validation else None
    return learned, validated, source(training, False, per_object)


def _check_classes(
    classes: Sequence[str], training: Sequence[AreaSamples], mapping: Mapping[str, str] | None
) -> None:
    """Refuse data that shows fewer than two of the classes."""
    known = {name for area in training for name in trained_names(area.classes, mapping)}
    if len(known.intersection(classes)) < 2:
        labels = dict.fromkeys(name for area in training for name in area.classes)
        found = f"data labelled {', '.join(labels)}"
        raise InputError("--classes", found, "two classes or more of them", "check both")


def _facts(areas: Sequence[Area], prepared: Mapping[Area, AreaSamples]) -> tuple[AreaFacts, ...]:
    """Say what areas are."""
    return tuple(
        AreaFacts(
            name=area.name,
            scans=prepared[area].num_scans,
            samples=prepared[area].num_samples,
            fingerprint=bytes(prepared[area].fingerprint).hex(),
        )
        for area in areas
    )
