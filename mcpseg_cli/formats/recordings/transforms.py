"""Frames of a robot and the transforms between them over time, as TF and odometry tell them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.formats.rigid import Trajectory

ROBOT_FRAMES = ("base_link", "base_footprint", "body")
"""Frames that move with the robot by convention (REP 105): never the map."""
_STILL = 1e-9  # metres, or of a rotation matrix


@dataclass
class Edge:
    """How a frame moves in its parent.

    Attributes:
        parent: Name of the parent.
        is_fixed: Whether it never moves there.
        times_ns: When.
        poses: Where, (4, 4) float64 each, frame to parent.
    """

    parent: str
    is_fixed: bool
    times_ns: list[int] = field(default_factory=list)
    poses: list[NDArray[np.float64]] = field(default_factory=list)
    _trajectory: Trajectory | None = None

    def at(self, time_ns: int) -> NDArray[np.float64] | None:
        """Return the pose at a moment; of one that never moves the last."""
        if self.is_fixed:
            return self.poses[-1]
        if self._trajectory is None:
            times, poses = np.array(self.times_ns, np.int64), np.stack(self.poses)
            self._trajectory = Trajectory.of(times, poses)
        if np.ptp(self._trajectory.poses, axis=0).max() < _STILL:
            still: NDArray[np.float64] = self._trajectory.poses[0]
            return still
        return self._trajectory.at(time_ns)


class TransformTree:
    """Frames by name; each has at most one parent."""

    def __init__(self) -> None:
        self.edges: dict[str, Edge] = {}
        self.two_parents: dict[str, tuple[str, str]] = {}

    def add(
        self,
        parent: str,
        child: str,
        time_ns: int,
        pose: NDArray[np.float64],
        *,
        is_fixed: bool = False,
    ) -> None:
        """Add a transform, (4, 4) float64, child to parent."""
        parent, child = parent.lstrip("/"), child.lstrip("/")
        edge = self.edges.setdefault(child, Edge(parent, is_fixed))
        if edge.parent != parent:
            self.two_parents[child] = (edge.parent, parent)
            return
        edge.times_ns.append(time_ns)
        edge.poses.append(pose)

    def way_up(self, frame: str) -> list[str]:
        """Name the frames from one up to its root, itself first."""
        way = [frame.lstrip("/")]
        while way[-1] in self.edges and self.edges[way[-1]].parent not in way:
            way.append(self.edges[way[-1]].parent)
        return way

    def pose(self, way: list[str], time_ns: int) -> NDArray[np.float64] | None:
        """Return the pose (4, 4) of the first frame of a way in its last; None at a gap."""
        pose: NDArray[np.float64] | None = None
        for frame in way[:-1]:
            step = self.edges[frame].at(time_ns)
            if step is None:
                return None
            pose = step if pose is None else step @ pose
        return np.eye(4) if pose is None else pose

    def moves(self, way: list[str]) -> bool:
        """Tell whether a frame moves in another up the tree."""
        return any(not self.edges[frame].is_fixed for frame in way[:-1])

    def moving_below(self, root: str) -> list[str]:
        """List the frames that move in a root and in which none moves further, by name."""
        below = [frame for frame in self.edges if self.way_up(frame)[-1] == root]
        below = [frame for frame in below if self.moves(self.way_up(frame))]
        moving = [frame for frame in below if not self.edges[frame].is_fixed]
        parents = {one for frame in moving for one in self.way_up(frame)[1:]}
        return sorted(frame for frame in moving if frame not in parents)

    def names(self) -> list[str]:
        """Name all frames."""
        return sorted({*self.edges, *(edge.parent for edge in self.edges.values())})
