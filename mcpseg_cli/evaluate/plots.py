"""Pictures of scores: confusion matrix, IoU by class, mean IoU over the scans."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import OutputError, naming
from mcpseg_cli.evaluate.class_scores import score_classes
from mcpseg_cli.evaluate.score_curve import ScoreCurve

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
            f"{folder}: no matplotlib to draw with; expected the extra 'plot'; run: pip install 'mcpseg[plot]'"
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
        confusion: (C, C + 1) from ``metrics.confusion_matrix``.
        classes: C names.
        unit: What is counted, such as ``voxel``.

    Raises:
        OSError: The file cannot be written.
    """
    from matplotlib.figure import Figure

    columns = len(classes) + bool(confusion[:, -1].any())
    names = [*classes, "none"][:columns]
    total = confusion.sum(axis=1)
    shares = np.where(total > 0, confusion[:, :columns].T / np.maximum(total, 1), np.nan).T
    figure = Figure(figsize=(2.6 + 0.55 * columns, 2.0 + 0.48 * len(classes)), layout="constrained")
    axes = figure.add_subplot()
    axes.set_facecolor(_PALE)  # of rows without a true point
    image = axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for row, column in np.argwhere(shares >= 0.005):
        colour = "white" if shares[row, column] > _DARK else "black"
        text = f"{100 * shares[row, column]:.0f}"
        axes.text(column, row, text, ha="center", va="center", fontsize=8, color=colour)
    axes.set_xticks(
        range(columns), names, rotation=45, ha="right", rotation_mode="anchor", parse_math=False
    )
    labels = [f"{name}  {count:,}" for name, count in zip(classes, total.tolist(), strict=True)]
    axes.set_yticks(range(len(classes)), labels, parse_math=False)
    axes.set(xlabel="predicted class", ylabel=f"true class and its {unit}s")
    accuracy = score_classes(confusion, classes).point_accuracy
    axes.set_title(f"Percent of each true class; accuracy {100 * accuracy:.1f} %", fontsize=11)
    figure.colorbar(
        image,
        ax=axes,
        shrink=0.6,
        aspect=30,
        pad=0.01,
        format=lambda share, _: f"{100 * share:.0f} %",
    )
    _save(figure, path)


def plot_class_iou(path: Path, confusion: NDArray[np.int64], classes: tuple[str, ...]) -> None:
    """Draw a bar for the IoU of every class, and the means, as PNG.

    Args:
        path: The picture; replaced if there.
        confusion: (C, C + 1) from ``metrics.confusion_matrix``.
        classes: C names.

    Raises:
        OSError: The file cannot be written.
    """
    from matplotlib.figure import Figure

    scores = score_classes(confusion, classes)
    values = [scores.iou[name] for name in classes]
    figure = Figure(figsize=(max(6.0, 1.5 + 0.62 * len(classes)), 4.2), layout="constrained")
    axes = figure.add_subplot()
    axes.bar(
        range(len(classes)), [value or 0.0 for value in values], color=_BLUE, width=0.7, zorder=2
    )
    for index, value in enumerate(values):
        text = "none" if value is None else f"{value:.2f}"
        colour = _GREY if value is None else "black"
        axes.text(
            index, (value or 0.0) + 0.012, text, ha="center", va="bottom", fontsize=8, color=colour
        )
    means = (("mIoU", scores.miou, "--"), ("mIoU of the classes present", scores.miou_present, ":"))
    for name, mean, style in means:
        axes.axhline(
            mean, color=_RED, linestyle=style, linewidth=1.2, label=f"{name} {mean:.3f}", zorder=3
        )
    axes.set_xticks(
        range(len(classes)),
        classes,
        rotation=45,
        ha="right",
        rotation_mode="anchor",
        parse_math=False,
    )
    axes.set(ylim=(0.0, 1.06), ylabel="IoU")
    figure.legend(loc="outside upper center", ncols=2, fontsize=9, frameon=False)
    _tidy(axes)
    _save(figure, path)


def plot_over_scans(path: Path, curves: Mapping[str, ScoreCurve]) -> None:
    """Draw the mean IoU of the map so far over the scans, as PNG; of several runs a line each, over the share of scans.

    Args:
        path: The picture; replaced if there.
        curves: At least one, by name of the run; with a single one its accuracy is drawn as well.

    Raises:
        OSError: The file cannot be written.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 4.2), layout="constrained")
    axes = figure.add_subplot()
    single = len(curves) == 1
    for name, curve in curves.items():
        scans = np.arange(1, len(curve.voxels) + 1) * (1.0 if single else 100.0 / len(curve.voxels))
        label = "mIoU of the classes seen so far" if single else name.lstrip("_")
        axes.plot(
            scans, curve.miou_present, linewidth=1.6, label=label, color=_BLUE if single else None
        )
        if single:
            axes.plot(
                scans,
                curve.point_accuracy,
                linewidth=1.3,
                label="accuracy",
                color=_GREY,
                linestyle="--",
            )
    axes.set(ylim=(0.0, 1.0), xlabel="scans" if single else "% of the scans of each run")
    axes.set_ylabel("score of the map so far" if single else "mIoU of the classes seen so far")
    axes.set_xlim(
        1 if single else 0, max(2, len(next(iter(curves.values())).voxels)) if single else 100
    )
    axes.locator_params(axis="x", integer=True)
    if len(curves) <= _MOST_NAMED:
        for text in axes.legend(fontsize=9).get_texts():
            text.set_parse_math(False)
    _tidy(axes)
    _save(figure, path)


def _tidy(axes: Axes) -> None:
    """Leave out the frame, add faint lines to read values at."""
    axes.grid(axis="y", color=_PALE, linewidth=0.8, zorder=0)
    axes.spines[["top", "right"]].set_visible(False)


def _save(figure: Figure, path: Path) -> None:
    """Write a picture."""
    with naming(path), path.open("wb") as file:
        figure.savefig(file, format="png", dpi=150)
