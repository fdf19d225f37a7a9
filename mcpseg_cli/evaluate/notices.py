"""What the user of scores should know: what is lacking, and what could not be measured."""

from __future__ import annotations

from collections.abc import Iterator

from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.evaluate.class_map import ClassMap
from mcpseg_cli.evaluate.class_scores import is_probability
from mcpseg_cli.evaluate.pairing import PairedTruth
from mcpseg_cli.evaluate.prediction import Prediction
from mcpseg_cli.evaluate.scan_by_scan import ScanByScan
from mcpseg_cli.evaluate.truth import Truth


def find_notices(
    prediction: Prediction,
    truth: Truth,
    paired: PairedTruth,
    scans: ScanByScan | None,
    class_map: ClassMap | None,
) -> Iterator[str]:
    """Say what is not scored, and why.

    Args:
        prediction: What is scored.
        truth: What it is compared with.
        paired: The truth about its points.
        scans: What its scans tell; None where there is nothing.
        class_map: What its classes and those of the truth stand for; None for their own names.

    Yields:
        A line for each thing.
    """
    yield from truth.notices
    if class_map is not None:
        yield from _of_map(prediction, paired, class_map)

    # true classes and labels that are lacking
    others = {name: points for name, points in paired.other_classes.items() if points}
    if others:
        lacking = "that the run does not have" if class_map is None else "without a class"
        yield f"true classes {lacking} count as unlabelled: {_listed(others)}"
    if not (paired.semantic != UNKNOWN).any():
        yield f"{truth.source}: no covered point has a class; class and object figures are 0"
    elif not (paired.instance > 0).any():
        yield f"{truth.source}: no covered point is in an object; cluster and object figures are 0"

    if not (prediction.semantic != UNKNOWN).any():
        nothing = "no point has a class, as of region growing"
        yield f"{prediction.source}: {nothing}; class figures are 0, objects count by shape alone"

    # confidence that says something else
    if prediction.confidence is not None and not is_probability(prediction.confidence):
        yield f"{prediction.source}: confidence beyond 0 to 1; its calibration is not measured"

    # scans that are lacking
    if prediction.folder and scans is None:
        missing = "times, stability and the curve over scans are not measured"
        yield f"{prediction.folder.events_path} is not there; {missing}"
    elif scans and scans.missing:
        yield scans.missing


def _of_map(prediction: Prediction, paired: PairedTruth, class_map: ClassMap) -> Iterator[str]:
    """Say which classes of the prediction stand for none, and which rows of the map for nothing."""
    wrong = {name: points for name, points in prediction.unmapped.items() if points}
    if wrong:
        yield f"predicted classes without a class count as wrong: {_listed(wrong)}"
    known = {*prediction.labels, *paired.labels}
    idle = [label for label in (*class_map.table, *class_map.dropped) if label not in known]
    if idle:
        yield f"{class_map.source}: rows of classes that neither side has: {', '.join(idle)}"


def _listed(points: dict[str, int]) -> str:
    """List classes with their points."""
    return ", ".join(f"{name} ({count:,} points)" for name, count in points.items())
