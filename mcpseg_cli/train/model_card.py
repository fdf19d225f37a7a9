"""Model cards: what there is to say about weights, as a Markdown page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from pydantic import JsonValue

_MOST_ROWS = 25  # of the table of curves; the record beside the card has every epoch


def model_card(record: Mapping[str, JsonValue]) -> str:
    """Lay a training's record out as a page.

    Args:
        record: From ``TrainRun.write_results``.
    """
    identity = _part(record, "identity")
    settings = _part(identity, "settings")
    name = record["name"]
    lines = [f"# {name}", "", *_introduction(record), "", "| | |", "|---|---|"]
    lines += [f"| {key} | {value} |" for key, value in _facts(record, identity)]
    lines += ["", "## Scores", "", *_scores(record)]
    lines += ["", "## Curves", "", *_curves(record)]
    lines += ["", "## Settings", ""]
    augmentation = _part(identity, "augmentation")
    groups = (
        ("training", settings),
        ("samples", _part(identity, "samples")),
        ("augmentation", augmentation),
    )
    lines += [
        f"* {title}: " + ", ".join(f"`{key}` {_value(group[key])}" for key in group)
        for title, group in groups
    ]
    lines += ["", "## Make it again", "", f"    {record['command']}", ""]
    return "\n".join(lines)


def _introduction(record: Mapping[str, JsonValue]) -> list[str]:
    """Say in a sentence or two what this is."""
    lines = [
        f"Weights of the network `{record['architecture']}`, made by mcpseg {record['mcpseg']}."
    ]
    if not record["complete"]:
        lines.append(
            f"**Training was interrupted after {record['epochs']} epochs**; `--resume` continues it."
        )
    return lines


def _facts(
    record: Mapping[str, JsonValue], identity: Mapping[str, JsonValue]
) -> list[tuple[str, str]]:
    """Say in short lines what the weights are and come from."""
    classes = record["classes"]
    assert isinstance(classes, list)
    size, seconds = record["bytes"], record["seconds"]
    assert isinstance(size, int)
    assert isinstance(seconds, int | float)
    samples = _part(identity, "samples")
    chosen = f"epoch {record['best_epoch']} of {record['epochs']}"
    rows = [
        ("file", f"`{record['name']}.safetensors`, {size:,} bytes"),
        ("sha256", f"`{record['sha256']}`"),
        (
            "network",
            f"{record['architecture']}, {samples['num_context']} context points, `{samples['context_window']}`",
        ),
        ("voxels, range", f"{samples['voxel_size']} m, {samples['local_range']} m"),
        ("classes", f"{len(classes)}: {', '.join(map(str, classes))}"),
        ("trained on", _areas(identity["training_areas"])),
        ("held out", _areas(identity["validation_areas"]) or "nothing"),
        (
            "weights of",
            chosen + (", chosen by validation" if record["validation"] else ", the last"),
        ),
        ("time", f"{seconds:,.0f} s on {record['device']}, torch {record['torch']}"),
    ]
    if record["init_name"] is not None:
        fresh = record["new_classes"]
        assert isinstance(fresh, list)
        rows.append(
            (
                "started from",
                f"`{record['init_name']}`; classes new to it: {', '.join(map(str, fresh)) or 'none'}",
            )
        )
    return rows


def _areas(areas: JsonValue) -> str:
    """Name areas with their scans and samples."""
    assert isinstance(areas, list)
    parts = []
    for area in areas:
        assert isinstance(area, dict)
        parts.append(f"{area['name']} ({area['scans']:,} scans, {area['samples']:,} samples)")
    return ", ".join(parts)


def _scores(record: Mapping[str, JsonValue]) -> list[str]:
    """Lay out the scores of the weights: batches of the held-out areas, where there are any."""
    held_out = record["validation"] is not None
    if not held_out and record["train"] is None:
        return ["None yet."]
    scores = _part(record, "validation" if held_out else "train")
    where = (
        "Of batches of the held-out areas"
        if held_out
        else "Of training batches, for nothing was held out"
    )
    lines = [
        f"{where}; not of whole scans labelled by `mcpseg segment`, for which see `mcpseg eval`.",
        "",
    ]
    lines += [
        "| loss | class accuracy | mIoU (present classes) | embedding accuracy |",
        "|---|---|---|---|",
    ]
    keys = ("loss", "accuracy", "miou", "embedding_accuracy")
    lines += ["| " + " | ".join(_number(scores[key]) for key in keys) + " |", ""]
    classes, iou = record["classes"], scores["iou"]
    assert isinstance(classes, list)
    assert isinstance(iou, list)
    lines += ["| class | IoU |", "|---|---|"]
    return lines + [
        f"| {name} | {_number(value)} |" for name, value in zip(classes, iou, strict=True)
    ]


def _curves(record: Mapping[str, JsonValue]) -> list[str]:
    """Lay out some epochs, evenly chosen, the best and the last among them."""
    curves = record["curves"]
    assert isinstance(curves, list)
    step = -(-len(curves) // _MOST_ROWS)
    best, last = record["best_epoch"], len(curves)
    header = (
        "epoch",
        "learning rate",
        "loss",
        "accuracy",
        "embedding",
        "held-out loss",
        "accuracy",
        "mIoU",
        "embedding",
    )
    lines = [_row(header), "|" + "---|" * len(header)]
    for report in curves:
        assert isinstance(report, dict)
        epoch = report["epoch"]
        assert isinstance(epoch, int)
        if (epoch - 1) % max(step, 1) and epoch not in (best, last):
            continue
        train = _part(report, "train")
        held_out = {} if report["validation"] is None else _part(report, "validation")
        cells = [
            f"**{epoch}**" if epoch == best else str(epoch),
            _number(report["learning_rate"], 3),
        ]
        cells += [_number(train[key]) for key in ("loss", "accuracy", "embedding_accuracy")]
        cells += [
            _number(held_out.get(key)) for key in ("loss", "accuracy", "miou", "embedding_accuracy")
        ]
        lines.append(_row(cells))
    return lines


def _row(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _number(value: JsonValue, digits: int = 4) -> str:
    return f"{value:.{digits}g}" if isinstance(value, int | float) else "–"  # noqa: RUF001


def _value(value: JsonValue) -> str:
    return "none" if value is None else f"{value:g}" if isinstance(value, float) else str(value)


def _part(record: Mapping[str, JsonValue], key: str) -> Mapping[str, JsonValue]:
    part = record[key]
    assert isinstance(part, dict)
    return part
