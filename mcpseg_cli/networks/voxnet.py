"""VoxNet (Maturana and Scherer 2015), as the MCPNet authors compare with it (table I).

The features of a grid of what is occupied around the robot are joined to every point.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional

from mcpseg_cli.config import NUM_FEATURES
from mcpseg_cli.networks.network import Network, initialise

_CELLS = 32  # along each edge of the grid
_REACH = 2.0  # metres from the robot to the grid's sides
_HEIGHT = 6.0  # metres from the floor to its top
_CHANNELS, _HIDDEN = 32, 128


class VoxNet(Network):
    """Class of a point from its six features and the shape of what is occupied around the robot.

    Args:
        num_classes: C, classes to tell apart.
    """

    def __init__(self, num_classes: int) -> None:
        super().__init__()
        self.convolve_1 = nn.Conv3d(1, _CHANNELS, 5, stride=2)
        self.convolve_2 = nn.Conv3d(_CHANNELS, _CHANNELS, 3)
        self.hidden = nn.Linear(NUM_FEATURES + _CHANNELS, _HIDDEN)
        self.classify = nn.Linear(_HIDDEN, num_classes)
        self.apply(initialise)

    def label(self, centre: Tensor, pooled: Tensor | None = None) -> tuple[None, Tensor]:
        """Classify points; see ``Network``."""
        grid = occupancy(centre.reshape(-1, *centre.shape[-2:]))  # (B, 1, 32, 32, 32)
        grid = functional.relu(self.convolve_1(grid))  # (B, 32, 14, 14, 14)
        grid = functional.relu(self.convolve_2(grid))  # (B, 32, 12, 12, 12)

        # the whole grid beside every point
        shape = grid.amax(dim=(2, 3, 4)).view(*centre.shape[:-2], 1, _CHANNELS)
        shape = shape.expand(*centre.shape[:-1], -1)  # (..., N, 32)
        hidden = functional.relu(self.hidden(torch.cat([centre, shape], dim=-1)))  # (..., N, 128)
        return None, self.classify(hidden)


def occupancy(centre: Tensor) -> Tensor:
    """Mark the cells that hold points; points outside the grid count in the cell at its border.

    Args:
        centre: (B, N, 6), metres: x and y from the robot, z from the floor.

    Returns:
        (B, 1, 32, 32, 32) of 0 and 1, axes x, y, z.
    """
    x, y, z = centre.detach()[..., :3].unbind(dim=-1)
    per_metre = _CELLS / (2 * _REACH)
    steps = [(x + _REACH) * per_metre, (y + _REACH) * per_metre, z / _HEIGHT * _CELLS]
    cell_x, cell_y, cell_z = (step.long().clamp(0, _CELLS - 1) for step in steps)  # each (B, N)
    grid = centre.new_zeros(len(centre), _CELLS**3)
    grid.scatter_(1, (cell_x * _CELLS + cell_y) * _CELLS + cell_z, 1.0)
    return grid.view(-1, 1, _CELLS, _CELLS, _CELLS)
