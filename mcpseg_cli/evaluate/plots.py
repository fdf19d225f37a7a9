"""Pictures of scores: confusion matrix, IoU by class, reliability, mean IoU over the scans."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import OutputError, naming
from mcpseg_cli.evaluate.class_scores import score_classes
from mcpseg_cli.evaluate.score_curve import ScoreCurve
from mcpseg_cli.reliability import Reliability

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BLUE, _GREY, _RED, _PALE = "#2563a8", "#6b7280", "#c2410c", "#e5e7eb"
_DARK = 0.55  # share from which a cell of the matrix is so dark that its number is white
_MOST_NAMED = 10  # curves that fit a legend


def prepare_plots(folder: Path) -> None:
    """Make the folder of the pictures, and see that there is something to draw them with.

    Raises:
        OutputError: matplotlib is not installed.
        OSError: The folder cannot be made or written.
    """
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError as error:
        raise OutputError(
            f"{folder}: no matplotlib to draw with; expected the extra 'plot'; "
            "run: pip install 'mcpseg[plot]'"
        ) from error
    folder.mkdir(parents=True, exist_ok=True)
    probe = folder / ".mcpseg.part"
    probe.touch()
    probe.unlink()


def plot_confusion(
    path: Path, confusion: NDArray[np.int64], classes: tuple[str, ...], unit: str
) -> None:
    """Draw the confusion matrix, each row as shares of its true class, as PNG.

    Args:
        path: The picture; replaced if there.
        confusion: (C, C + 1) from ``class_scores.confusion_matrix``.
        classes: C names.
        unit: What is counted, such as ``voxel``.

    Raises:
        OSError: The file cannot be written.
    """
    from matplotlib.figure import Figure

    # shares of each true class; a last column for what has no predicted class, if anything has none
    columns = len(classes) + bool(confusion[:, -1].any())
    names = [*classes, "none"][:columns]
    total = confusion.sum(axis=1)
    shares = np.where(total > 0, confusion[:, :columns].T / np.maximum(total, 1), np.nan).T

    # a cell for each pair, with its number where that rounds to anything
    figure = Figure(figsize=(2.6 + 0.55 * columns, 2.0 + 0.48 * len(classes)), layout="constrained")
    axes = figure.add_subplot()
    axes.set_facecolor(_PALE)  # of rows without a true point
    image = axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for row, column in np.argwhere(shares >= 0.005):
        colour = "white" if shares[row, column] > _DARK else "black"
        text = f"{100 * shares[row, column]:.0f}"
        axes.text(column, row, text, ha="center", va="center", fontsize=8, color=colour)

    # what rows and columns are
    _name_columns(axes, names)
    labels = [f"{name}  {count:,}" for name, count in zip(classes, total.tolist(), strict=True)]
    axes.set_yticks(range(len(classes)), labels, parse_math=False)
    axes.set(xlabel="predicted class", ylabel=f"true class and its {unit}s")
    accuracy = score_classes(confusion, classes).point_accuracy
    axes.set_title(f"Percent of each true class; accuracy {100 * accuracy:.1f} %", fontsize=11)

    def in_percent(share: float, _: int) -> str:
        return f"{100 * share:.0f} %"

    figure.colorbar(image, ax=axes, shrink=0.6, aspect=30, pad=0.01, format=in_percent)
    _save(figure, path)


def plot_class_iou(path: Path, confusion: NDArray[np.int64], classes: tuple[str, ...]) -> None:
    """Draw a bar for the IoU of every class of the truth, and their mean, as PNG.

    Classes without a true point have no bar; they are named, and those predicted all the same with
    their number of points.

    Args:
        path: The picture; replaced if there.
        confusion: (C, C + 1) from ``class_scores.confusion_matrix``.
        classes: C names.

    Raises:
        OSError: The file cannot be written.
    """
    from matplotlib.figure import Figure

    scores = score_classes(confusion, classes)
    present = confusion.sum(axis=1) > 0
    names = [name for name, is_there in zip(classes, present, strict=True) if is_there]
    figure = Figure(figsize=(max(6.0, 1.5 + 0.62 * len(names)), 4.2), layout="constrained")
    axes = figure.add_subplot()

    # a bar with its number for each class
    heights = [scores.iou[name] or 0.0 for name in names]
    axes.bar(range(len(names)), heights, color=_BLUE, width=0.7, zorder=2)
    for index, height in enumerate(heights):
        axes.text(index, height + 0.012, f"{height:.2f}", ha="center", va="bottom", fontsize=8)

    # a line for the mean, a word for the classes that are not in it
    label = f"mIoU of {len(names)} classes {scores.miou_present:.3f}"
    axes.axhline(
        scores.miou_present, color=_RED, linestyle="--", linewidth=1.2, label=label, zorder=3
    )
    if absent := _absent(confusion, classes):
        axes.set_xlabel(f"not in the truth: {absent}", fontsize=8, color=_GREY, wrap=True)

    _name_columns(axes, names)
    axes.set(ylim=(0.0, 1.06), ylabel="IoU")
    figure.legend(loc="outside upper center", fontsize=9, frameon=False)
    _tidy(axes)
    _save(figure, path)


def _absent(confusion: NDArray[np.int64], classes: tuple[str, ...]) -> str:
    """Name the classes without a true point, and how many points each was predicted for."""
    true, predicted = confusion.sum(axis=1), confusion[:, : len(classes)].sum(axis=0)
    words = [
        f"{name} (predicted for {count:,})" if count else name
        for name, total, count in zip(classes, true.tolist(), predicted.tolist(), strict=True)
        if total == 0
    ]
    return ", ".join(words)


def plot_reliability(path: Path, reliability: Reliability, unit: str) -> None:
    """Draw the accuracy in each bin over confidence, and what share of all is in it, as PNG.

    Args:
        path: The picture; replaced if there.
        reliability: At least one label in any bin.
        unit: What is counted, such as ``voxel``.

    Raises:
        OSError: The file cannot be written.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.4, 6.2), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    width = 1 / len(reliability.count)
    left = np.arange(len(reliability.count)) * width

    # accuracy, and where it would be if confidence were what it says
    heights = np.nan_to_num(reliability.accuracy)
    upper.bar(left, heights, width, align="edge", color=_BLUE, edgecolor="white", zorder=2)
    upper.plot(
        reliability.mean_confidence, reliability.mean_confidence, "o", color=_RED, markersize=4,
        label="mean confidence", zorder=4,
    )  # fmt: skip
    upper.plot([0, 1], [0, 1], color=_GREY, linewidth=1.0, linestyle="--", zorder=3)
    upper.set(xlim=(0, 1), ylim=(0, 1), ylabel="share of right classes")
    error = reliability.expected_error or 0.0
    upper.set_title(f"Expected calibration error {error:.3f}", fontsize=11)
    upper.legend(fontsize=9, loc="upper left", frameon=False)

    # how many there are
    share = 100 * reliability.count / max(int(reliability.count.sum()), 1)
    lower.bar(left, share, width, align="edge", color=_GREY, edgecolor="white", zorder=2)
    lower.set(xlabel="confidence", ylabel=f"% of {unit}s")
    _tidy(upper)
    _tidy(lower)
    _save(figure, path)


def plot_over_scans(path: Path, curves: Mapping[str, ScoreCurve]) -> None:
    """Draw the mean IoU of the map so far over the scans, as PNG.

    Args:
        path: The picture; replaced if there.
        curves: At least one, by name of the run. With a single one its accuracy is drawn as well;
            several are drawn over the share of their scans.

    Raises:
        OSError: The file cannot be written.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 4.2), layout="constrained")
    axes = figure.add_subplot()
    axes.set(ylim=(0.0, 1.0))
    if len(curves) == 1:
        _draw_curve(axes, *curves.values())
    else:
        _draw_curves(axes, curves)

    axes.locator_params(axis="x", integer=True)
    if len(curves) <= _MOST_NAMED:
        for text in axes.legend(fontsize=9).get_texts():
            text.set_parse_math(False)
    _tidy(axes)
    _save(figure, path)


def _draw_curve(axes: Axes, curve: ScoreCurve) -> None:
    """Draw the scores of one run over its scans."""
    scans = np.arange(1, len(curve.voxels) + 1) * 1.0
    label = "mIoU of the classes seen so far"
    axes.plot(scans, curve.miou_present, linewidth=1.6, label=label, color=_BLUE)
    axes.plot(scans, curve.point_accuracy, linewidth=1.3, label="accuracy", color=_GREY, ls="--")
    axes.set(xlabel="scans", ylabel="score of the map so far", xlim=(1, max(2, len(curve.voxels))))


def _draw_curves(axes: Axes, curves: Mapping[str, ScoreCurve]) -> None:
    """Draw the mean IoU of several runs, however many scans each has."""
    for name, curve in curves.items():
        scans = np.arange(1, len(curve.voxels) + 1) * (100.0 / len(curve.voxels))
        axes.plot(scans, curve.miou_present, linewidth=1.6, label=name.lstrip("_"))
    axes.set(xlabel="% of the scans of each run", ylabel="mIoU of the classes seen so far")
    axes.set_xlim(0, 100)


def _name_columns(axes: Axes, names: Sequence[str]) -> None:
    """Write names aslant under columns."""
    axes.set_xticks(range(len(names)), names, parse_math=False)
    for label in axes.get_xticklabels():
        label.set(rotation=45, ha="right", rotation_mode="anchor")


def _tidy(axes: Axes) -> None:
    """Leave out the frame, add faint lines to read values at."""
    axes.grid(axis="y", color=_PALE, linewidth=0.8, zorder=0)
    axes.spines[["top", "right"]].set_visible(False)


def _save(figure: Figure, path: Path) -> None:
    """Write a picture."""
    with naming(path), path.open("wb") as file:
        figure.savefig(file, format="png", dpi=150)
