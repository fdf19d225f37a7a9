"""Settings with their defaults. Numbers from the paper appear here, once, with their section."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

NUM_CONTEXT = 50  # M: context points per point (III-B, figure 5)
NUM_FEATURES = 6  # X Y Z R G B (III-B)
HIDDEN = 200  # features of the intermediate layers (III-B)
EMBEDDING = 50  # dimensions of the instance embedding (III-C)

ContextWindow = Literal["cells", "coarse"]
"""Where context points come from: ``cells``, at most three cells away (III-B); ``coarse``, the 27 cells of three voxels
a side around the point, as in the authors' program. Weights carry which of the two they were trained with."""

Precision = Literal["auto", "fp32", "bf16"]
Frame = Literal["map", "sensor"]
FloorRule = Literal["map", "scan-min"]


class SegmentSettings(BaseModel):
    """Everything that decides the labels of a run; lengths in metres.

    Attributes:
        voxel_size: Edge of a voxel of the look-up table (III-B).
        local_range: Points farther than this from the robot, horizontally, are left for a later scan (III-B).
        batch_size: N, points per network batch; the class branch pools over them, so it is part of the result (III-D).
        similarity: beta, cosine similarity above which neighbours are connected (III-C, IV-B).
        floor: Height of the floor: from the map around the robot, the scan's lowest point, or a number.
        seed: Seed of the context sample and the batch order; keyed with the scan number.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    voxel_size: float = Field(default=0.1, ge=0.01, le=10.0)
    local_range: float = Field(default=2.0, gt=0.0, le=1000.0)
    batch_size: int = Field(default=256, ge=1, le=65536)
    similarity: float = Field(default=0.9, ge=-1.0, le=1.0)
    floor: FloorRule | Annotated[float, Field(ge=-65536.0, le=65536.0)] = "map"
    seed: int = Field(default=0, ge=0)
