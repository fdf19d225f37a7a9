"""Settings with their defaults. Numbers from the paper appear here, once, with their section."""

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

NUM_CONTEXT = 50  # M: context points per point (III-B, figure 5)
NUM_FEATURES = 6  # X Y Z R G B (III-B)
HIDDEN = 200  # features of the intermediate layers (III-B)
EMBEDDING = 50  # dimensions of the instance embedding (III-C)
BATCH = 256  # N: points per batch of MCPNet (III-D)
BASELINE_BATCH = 1024  # points per batch of the networks it is compared with, in the authors' program
SIMILARITY = 0.9  # beta of MCPNet (IV-B)
SGPN_SIMILARITY = 0.98  # beta of SGPN (IV-B)
TRIPLET_MARGIN = 1.0  # alpha of the triplet loss on squared distances (III-C), as in the authors' program

ContextWindow = Literal["cells", "coarse"]
"""Where context points come from: ``cells``, at most three cells away (III-B); ``coarse``, the 27 cells of three voxels
a side around the point, as in the authors' program. Weights carry which of the two they were trained with."""

Architecture = Literal["mcpnet", "mcpnet-nocontext", "pointnet", "pointnet2", "sgpn", "voxnet"]
Precision = Literal["auto", "fp32", "bf16"]
Frame = Literal["map", "sensor"]
FloorRule = Literal["map", "scan-min"]


class SegmentSettings(BaseModel):
    """Everything that decides the labels of a run; lengths in metres.

    Batch size and similarity, where they are not given, are the network's own; the defaults here are MCPNet's.

    Attributes:
        voxel_size: Edge of a voxel of the look-up table (III-B).
        local_range: Points farther than this from the robot, horizontally, are left for a later scan (III-B).
        batch_size: N, points per network batch; networks pool over them, so it is part of the result (III-D).
        similarity: beta, cosine similarity above which neighbours are connected (III-C, IV-B).
        floor: Height of the floor: from the map around the robot, the scan's lowest point, or a number.
        seed: Seed of the context sample and the batch order; keyed with the scan number.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    voxel_size: float = Field(default=0.1, ge=0.01, le=10.0)
    local_range: float = Field(default=2.0, gt=0.0, le=1000.0)
    batch_size: int = Field(default=BATCH, ge=1, le=65536)
    similarity: float = Field(default=SIMILARITY, ge=-1.0, le=1.0)
    floor: FloorRule | Annotated[float, Field(ge=-65536.0, le=65536.0)] = "map"
    seed: int = Field(default=0, ge=0)


AUTHORS_SCANNER = {"lowest_deg": -45.0, "highest_deg": 80.0, "reach": 5.0}
"""What the simulated scanner of the authors' program covers; the paper says a full sphere (III-A)."""


class RaytraceSettings(BaseModel):
    """Everything that decides virtual scans; lengths in metres, angles in degrees.

    Attributes:
        voxel_size: Edge of a voxel of the grid that rays are cast in (III-A).
        step: Way between two scans (III-A).
        height: The scanner's height over the floor.
        reach: Farthest a ray goes.
        horizontal_deg: Horizontal angle between rays (III-A).
        vertical_deg: Vertical angle between rays (III-A).
        lowest_deg: Elevation of the lowest rays; -90 is straight down.
        highest_deg: Elevation that rays stay below.
        noise: Standard deviation of the measured range.
        dropout: Share of the points that are lost.
        seed: Seed of the noise, the drop-out and of which point stands for a voxel.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    voxel_size: float = Field(default=0.1, ge=0.01, le=10.0)
    step: float = Field(default=0.2, ge=0.01, le=100.0)
    height: float = Field(default=1.0, gt=0.0, le=10.0)
    reach: float = Field(default=5.0, ge=0.1, le=1000.0)
    horizontal_deg: float = Field(default=1.0, ge=0.05, le=90.0)
    vertical_deg: float = Field(default=1.0, ge=0.05, le=90.0)
    lowest_deg: float = Field(default=-90.0, ge=-90.0, le=90.0)
    highest_deg: float = Field(default=90.0, ge=-90.0, le=90.0)
    noise: float = Field(default=0.0, ge=0.0, le=1.0)
    dropout: float = Field(default=0.0, ge=0.0, le=0.95)
    seed: int = Field(default=0, ge=0, lt=1 << 63)

    @model_validator(mode="after")
    def _some_elevation(self) -> Self:
        if self.lowest_deg >= self.highest_deg:
            raise ValueError("lowest_deg must be below highest_deg")
        return self


class TrainSettings(BaseModel):
    """Everything that decides trained weights, apart from the data.

    Attributes:
        architecture: Which network.
        epochs: Passes over the training data (III-D).
        batch_size: N, points per batch; None: the network's own, 256 for MCPNet (III-D).
        learning_rate: Of Adam (III-D).
        schedule: ``constant`` (III-D), or ``cosine``: it falls to 0 over the run.
        warm_up: Epochs over which the learning rate rises to its value; a fraction is fine.
        weight_decay: Decoupled from the gradient (AdamW); 0 is the paper's Adam.
        max_gradient: Gradients longer than this are cut to it; None: never.
        margin: alpha of the triplet loss.
        class_weight: Weight of the class loss in the sum.
        instance_weight: Weight of the triplet loss, or of SGPN's double hinge, in the sum.
        confidence_weight: Weight of SGPN's confidence loss in the sum.
        class_balance: What an error costs: the same for all classes, or by the inverse root of their frequency.
        batches_per_epoch: An epoch ends after so many batches; None: after one of every scan.
        batches_per_step: Batches whose gradients are averaged for one update, in each process.
        samples_per_instance: Points taken from a random object at a time until a batch is full; 0: all points alike.
        plain_share: Share of the training batches whose points are drawn alike even so; of validation, all are.
        validation_batches: Most batches a validation takes; None: one of every scan.
        validate_every: Epochs from one validation to the next; the last epoch always has one.
        patience: Stop when so many validations in a row were no better; None: never.
        best_by: What makes weights the best: the highest mIoU, or the lowest loss.
        precision: Arithmetic of the network; ``bf16`` keeps parameters and losses in float32.
        seed: Seed of first parameters, order, drop-out and augmentation.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    architecture: Architecture = "mcpnet"
    epochs: int = Field(default=100, ge=1, le=1_000_000)
    batch_size: int | None = Field(default=None, ge=2, le=65536)
    learning_rate: float = Field(default=1e-3, gt=0.0, le=10.0)
    schedule: Literal["constant", "cosine"] = "constant"
    warm_up: float = Field(default=0.0, ge=0.0)
    weight_decay: float = Field(default=0.0, ge=0.0, le=10.0)
    max_gradient: float | None = Field(default=None, gt=0.0)
    margin: float = Field(default=TRIPLET_MARGIN, gt=0.0, le=4.0)
    class_weight: float = Field(default=1.0, ge=0.0)
    instance_weight: float = Field(default=1.0, ge=0.0)
    confidence_weight: float = Field(default=1.0, ge=0.0)
    class_balance: Literal["none", "sqrt"] = "none"
    batches_per_epoch: int | None = Field(default=None, ge=1)
    batches_per_step: int = Field(default=1, ge=1, le=1024)
    samples_per_instance: int = Field(default=16, ge=0, le=65536)
    plain_share: float = Field(default=0.25, ge=0.0, le=1.0)
    validation_batches: int | None = Field(default=None, ge=1)
    validate_every: int = Field(default=1, ge=1)
    patience: int | None = Field(default=None, ge=1)
    best_by: Literal["miou", "loss"] = "miou"
    precision: Literal["fp32", "bf16"] = "fp32"
    seed: int = Field(default=0, ge=0, lt=1 << 63)
