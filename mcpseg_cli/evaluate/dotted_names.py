"""Metrics by dotted name: ``iou.wall`` is the entry ``wall`` of the entry ``iou`` of a document."""

from __future__ import annotations

from collections.abc import Mapping

Metric = float | int | str | None
"""The value of a metric, or a word beside them; None where there is no value."""

_LESS_IS_BETTER = ("cluster_ratio", "ece", "ms_per_scan", "stability")


def flatten(document: Mapping[str, object], prefix: str = "") -> dict[str, Metric]:
    """List every metric of a nested document by its dotted name; lists are left out.

    Args:
        document: From ``Scores.document`` and the like.
        prefix: Put before every name.

    Returns:
        The metrics in the order of the document.
    """
    flat: dict[str, Metric] = {}
    for name, value in document.items():
        if isinstance(value, Mapping):
            flat |= flatten(value, f"{prefix}{name}.")
        elif value is None or isinstance(value, float | int | str):
            flat[f"{prefix}{name}"] = value
    return flat


def bounded_metrics(document: Mapping[str, object]) -> dict[str, float | None]:
    """List the metrics of which more is better, by dotted name; None is one that has no value here.

    Args:
        document: That of one run, or ``runs``, ``pooled`` and ``mean`` of several: then a name
            without ``pooled.`` or ``mean.`` is the pooled metric where there is one, else the mean.
    """
    flat = {
        name: value
        for name, value in flatten(document).items()
        if (isinstance(value, float) or (value is None and "iou." in name)) and not _is_cost(name)
    }

    # plain names of several runs, pooled ones before means
    for part in ("mean.", "pooled.") if "pooled" in document else ():
        parts = {name: value for name, value in flat.items() if name.startswith(part)}
        flat |= {name.removeprefix(part): value for name, value in parts.items()}
    return flat


def _is_cost(name: str) -> bool:
    """Tell the metrics of which less is better."""
    return any(part in _LESS_IS_BETTER for part in name.split("."))
