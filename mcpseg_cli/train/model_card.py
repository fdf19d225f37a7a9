"""Model cards: what there is to say about weights, as a Markdown page."""

from __future__ import annotations

from collections.abc import Iterable

from pydantic import BaseModel

from mcpseg_cli.train.calibration import Calibration
from mcpseg_cli.train.folder import AreaFacts, TrainRecord
from mcpseg_cli.train.progress import EpochReport
from mcpseg_cli.train.scores import Scores

_MOST_ROWS = 25  # of the table of curves; the record beside the card has every epoch


def model_card(record: TrainRecord) -> str:
    """Lay a training's record out as a page.

    Args:
        record: From ``TrainRun.write_results``.
    """
    identity = record.identity
    groups = [
        ("training", identity.settings),
        ("samples", identity.samples),
        ("augmentation", identity.augmentation),
    ]
    if identity.settings.architecture == "unet":
        groups.append(("windows", identity.windows))
    parts = [
        f"# {record.name}",
        _introduction(record),
        _table(("", ""), _facts(record)),
        "## Scores",
        _scores(record),
        *_calibration(record.calibration),
        "## Curves",
        _curves(record),
        "## Settings",
        "\n".join(f"* {title}: {_settings(group)}" for title, group in groups),
        "## Make it again",
        f"    {record.command}",
    ]
    return "\n\n".join(parts) + "\n"


def _introduction(record: TrainRecord) -> str:
    """Say in a sentence or two what this is."""
    lines = [f"Weights of the network `{record.architecture}`, made by mcpseg {record.mcpseg}."]
    if not record.complete:
        lines.append(
            f"**Training was interrupted after {record.epochs} epochs**; `--resume` continues it."
        )
    return "\n".join(lines)


def _facts(record: TrainRecord) -> list[tuple[str, str]]:
    """Say in short lines what the weights are and come from."""
    identity, samples = record.identity, record.identity.samples
    context = f"{samples.num_context} context points, `{samples.context_window}`"
    if not samples.num_context:
        context = "whole windows of the map"
    chosen = "chosen by validation" if record.validation else "the last"
    rows = [
        ("file", f"`{record.name}.safetensors`, {record.bytes:,} bytes"),
        ("sha256", f"`{record.sha256}`"),
        ("network", f"{record.architecture}, {context}"),
        ("voxels, range", f"{samples.voxel_size} m, {samples.local_range} m"),
        ("classes", f"{len(record.classes)}: {', '.join(record.classes)}"),
        ("trained on", _areas(identity.training_areas)),
        ("held out", _areas(identity.validation_areas) or "nothing"),
        ("weights of", f"epoch {record.best_epoch} of {record.epochs}, {chosen}"),
        ("time", f"{record.seconds:,.0f} s on {record.device}, torch {record.torch}"),
    ]

    # fine-tuning
    if record.init_name is not None:
        new = ", ".join(record.new_classes or ()) or "none"
        rows.append(("started from", f"`{record.init_name}`; classes new to it: {new}"))
    return rows


def _areas(areas: Iterable[AreaFacts]) -> str:
    """Name areas with their scans and samples."""
    return ", ".join(
        f"{area.name} ({area.scans:,} scans, {area.samples:,} samples)" for area in areas
    )


def _scores(record: TrainRecord) -> str:
    """Lay out the scores of the weights: of held-out batches, where there are any."""
    # of what
    scores = record.validation or record.train
    if scores is None:
        return "None yet."
    where = "Of training batches, for nothing was held out"
    if record.validation is not None:
        where = "Of batches of the held-out areas"

    header = ("loss", "class accuracy", "mIoU (present classes)", "embedding accuracy")
    iou = zip(record.classes, map(_number, scores.iou), strict=True)
    told = f"{where}; not of whole scans labelled by `mcpseg segment`, for which see `mcpseg eval`."
    return "\n\n".join([told, _table(header, [_means(scores)]), _table(("class", "IoU"), iou)])


def _calibration(calibration: Calibration | None) -> list[str]:
    """Lay out how well confidence tells the share that is right; nothing where it is not fitted."""
    if calibration is None:
        return []
    told = (
        f"Logits are divided by {calibration.temperature:g}, fitted on {calibration.voxels:,} "
        f"voxels of the held-out areas; expected calibration error {calibration.error_before:.4f} "
        f"before, {calibration.error:.4f} after (10 bins, the same voxels)."
    )
    rows = [
        (
            f"{part.up_to - 0.1:.1f} to {part.up_to:.1f}",
            f"{part.voxels:,}",
            _number(part.confidence, 3),
            _number(part.accuracy, 3),
        )
        for part in calibration.bins
    ]
    header = ("confidence", "voxels", "mean confidence", "accuracy")
    return ["## Confidence", told, _table(header, rows)]


def _curves(record: TrainRecord) -> str:
    """Lay out some epochs, evenly chosen, the best and the last among them."""
    step = max(-(-len(record.curves) // _MOST_ROWS), 1)
    told = [
        report
        for report in record.curves
        if (report.epoch - 1) % step == 0 or report.epoch in (record.best_epoch, record.epochs)
    ]
    trained = ("epoch", "learning rate", "loss", "accuracy", "embedding")
    held_out = ("held-out loss", "accuracy", "mIoU", "embedding")
    rows = [_epoch(report, is_best=report.epoch == record.best_epoch) for report in told]
    return _table((*trained, *held_out), rows)


def _epoch(report: EpochReport, *, is_best: bool) -> list[str]:
    """Lay out an epoch as a row."""
    number = f"**{report.epoch}**" if is_best else str(report.epoch)
    loss, accuracy, _, embedding = _means(report.train)
    rate = _number(report.learning_rate, 3)
    return [number, rate, loss, accuracy, embedding, *_means(report.validation)]


def _means(scores: Scores | None) -> list[str]:
    """Write loss, class accuracy, mIoU and embedding accuracy."""
    if scores is None:
        return [_number(None)] * 4
    values = (scores.loss, scores.accuracy, scores.miou, scores.embedding_accuracy)
    return [_number(value) for value in values]


def _settings(group: BaseModel) -> str:
    """List settings with their values."""
    return ", ".join(f"`{key}` {_value(value)}" for key, value in group)


def _table(header: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Lay rows out below a header."""
    names = list(header)
    return "\n".join([_row(names), "|" + "---|" * len(names), *map(_row, rows)])


def _row(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _number(value: float | None, digits: int = 4) -> str:
    return "–" if value is None else f"{value:.{digits}g}"  # noqa: RUF001


def _value(value: object) -> str:
    return "none" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
