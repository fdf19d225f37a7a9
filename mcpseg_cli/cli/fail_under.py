"""``--fail-under NAME=VALUE``: a pipeline's demands on the scores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import typer

from mcpseg_cli.errors import BelowThresholdError
from mcpseg_cli.evaluate.dotted_names import bounded_metrics

_HINT = "'--fail-under'"
_PARTS = ("pooled.", "mean.")


def parse_demands(demands: Sequence[str]) -> dict[str, float]:
    """Read ``NAME=VALUE`` demands.

    Raises:
        typer.BadParameter: One of them is not of this form.
    """
    parsed: dict[str, float] = {}
    for demand in demands:
        name, _, text = demand.partition("=")
        try:
            value = float(text)
        except ValueError:
            value = float("nan")

        if not name or not abs(value) < float("inf"):
            raise typer.BadParameter(
                f"{demand!r} is not a figure and a number, such as miou=0.35", param_hint=_HINT
            )
        parsed[name.strip()] = max(value, parsed.get(name.strip(), value))
    return parsed


def check_names(demands: Mapping[str, float], document: Mapping[str, object]) -> None:
    """Refuse demands that name no metric.

    Args:
        demands: Least value by name.
        document: The scores.

    Raises:
        typer.BadParameter: Names the first such demand and lists the metrics there are.
    """
    metrics = bounded_metrics(document)
    plain = [name for name in metrics if ".by_room." not in name and not name.startswith(_PARTS)]
    for name in demands:
        if name not in metrics:
            found = f"no figure {name!r}; there are {', '.join(plain)}"
            raise typer.BadParameter(found, param_hint=_HINT)


def check_demands(demands: Mapping[str, float], document: Mapping[str, object]) -> None:
    """Compare metrics with demands that ``check_names`` has passed.

    Args:
        demands: Least value by name.
        document: The scores.

    Raises:
        BelowThresholdError: Names every metric that is below, in one line.
    """
    metrics = bounded_metrics(document)
    failed = []
    for name, least in demands.items():
        value = metrics[name]
        if value is None:
            failed.append(f"{name} has no value (the class is nowhere), demanded {least:g}")
        elif value < least:
            failed.append(f"{name} is {value:.6g}, below {least:g}")
    if failed:
        raise BelowThresholdError("; ".join(failed))
