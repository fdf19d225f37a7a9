"""A cloud too large to hold at once, written part by part."""

from collections.abc import Iterator
from typing import Protocol

from mcpseg_cli.formats.cloud import Cloud


class CloudParts(Protocol):
    """A cloud in parts, which can be gone through repeatedly.

    All have the same attributes, types and class table.
    """

    def __len__(self) -> int:
        """Return the number of points in all parts."""

    def __iter__(self) -> Iterator[Cloud]:
        """Iterate over the parts, at least one; one after another they are the cloud."""


class OnePart:
    """A cloud that is held at once, as its only part."""

    def __init__(self, cloud: Cloud) -> None:
        self._cloud = cloud

    def __len__(self) -> int:
        return len(self._cloud)

    def __iter__(self) -> Iterator[Cloud]:
        yield self._cloud
