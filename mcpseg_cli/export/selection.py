"""Which voxels of a map to export."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.incremental.objects import MapObject
from mcpseg_cli.segment.labelled_run import LabelledRun, MapPart


@dataclass(frozen=True)
class Selection:
    """A choice of voxels; all of its conditions hold at once, None is no condition.

    Attributes:
        classes: Class names.
        instances: Object ids.
        min_confidence: Least confidence, 0-1.
        box: Lowest and highest corner (x, y, z, x, y, z), metres, map frame; its faces belong to
            it.
        min_points: Least number of voxels of an object; voxels of smaller ones, or of none, are
            left out. ``of`` turns it into object ids.
    """

    classes: tuple[str, ...] | None = None
    instances: tuple[int, ...] | None = None
    min_confidence: float | None = None
    box: tuple[float, ...] | None = None
    min_points: int | None = None

    @property
    def is_everything(self) -> bool:
        """Whether there is no condition."""
        return self == Selection()

    def of(self, run: LabelledRun) -> Selection:
        """Return the same choice for one run, told by object ids where it was by their sizes."""
        if self.min_points is None:
            return self
        sizes = np.bincount(run.instance_after(len(run.scans) - 1)[: len(run)])
        sizes[:1] = 0  # of no object
        large = np.flatnonzero(sizes >= self.min_points).tolist()
        if self.instances is not None:
            large = [owner for owner in large if owner in self.instances]
        return replace(self, instances=tuple(large), min_points=None)

    def check(self, run: LabelledRun) -> None:
        """Refuse class names that the run does not have.

        Raises:
            InputError: Names them.
        """
        unknown = [name for name in self.classes or () if name not in run.classes]
        if unknown:
            known = ", ".join(run.classes) or "a map with classes"
            raise InputError(run.folder, f"no class {', '.join(unknown)}", known, "check --class")

    def mask(self, part: MapPart, classes: Sequence[str]) -> NDArray[np.bool_]:
        """Mark the voxels chosen.

        Args:
            part: Voxels of the map.
            classes: Names that their ``semantic`` indexes.

        Returns:
            (V,) bool.
        """
        chosen = np.ones(len(part), bool)

        # each condition that there is takes some away
        if self.classes is not None:
            wanted = [index for index, name in enumerate(classes) if name in self.classes]
            chosen &= np.isin(part.semantic, wanted)
        if self.instances is not None:
            chosen &= np.isin(part.instance, self.instances)
        if self.min_confidence is not None:
            chosen &= part.confidence >= self.min_confidence
        if self.box is not None:
            chosen &= ((part.xyz >= self.box[:3]) & (part.xyz <= self.box[3:])).all(axis=1)
        return chosen

    def parts(self, run: LabelledRun) -> Iterator[MapPart]:
        """Iterate over what is chosen of a map, in id order.

        Raises:
            InputError: The run has no such class, or nothing is chosen.
        """
        self.check(run)
        is_empty = True
        for part in run.parts():
            chosen = part if self.is_everything else part.select(self.mask(part, run.classes))
            if len(chosen):
                is_empty = False
                yield chosen
        if is_empty:
            raise self.nothing_chosen(run)

    def has_object(self, item: MapObject) -> bool:
        """Tell whether a whole object is chosen: by its class, id, confidence and centroid."""
        low, high = (self.box[:3], self.box[3:]) if self.box else (item.centroid, item.centroid)
        return (
            (self.classes is None or item.class_name in self.classes)
            and (self.instances is None or item.id in self.instances)
            and (self.min_confidence is None or item.confidence >= self.min_confidence)
            and all(a <= x <= b for a, x, b in zip(low, item.centroid, high, strict=True))
        )

    def nothing_chosen(self, run: LabelledRun) -> InputError:
        """Say that no part of the map was chosen."""
        return InputError(
            run.folder, "nothing in the map that was asked for", "at least one point",
            "widen --class, --instance, --min-points, --min-confidence or --box",
        )  # fmt: skip
