"""Settings with their defaults. Numbers from the paper appear here, once, with their section."""

from typing import Annotated, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from mcpseg_cli.choices import (
    Architecture,
    BestBy,
    ClassBalance,
    Clustering,
    ContextWindow,
    FloorRule,
    Labelling,
    Scanner,
    Schedule,
    Sensor,
    StoredAs,
    TrainPrecision,
)

NUM_CONTEXT = 50  # M: context points per point (III-B, figure 5)
NUM_FEATURES = 6  # X Y Z R G B (III-B)
HIDDEN = 200  # features of the intermediate layers (III-B)
EMBEDDING = 50  # dimensions of the instance embedding (III-C)
BATCH = 256  # N: points per batch of MCPNet (III-D)
BASELINE_BATCH = 1024  # of the networks it is compared with, in the authors' program
SIMILARITY = 0.9  # beta of MCPNet (IV-B)
SGPN_SIMILARITY = 0.98  # beta of SGPN (IV-B)
OFFLINE_BLOCK = 1.0  # metres, columns a complete cloud is labelled in, in the authors' program
TRIPLET_MARGIN = 1.0  # alpha, on squared distances (III-C), as in the authors' program


class MapSettings(BaseModel):
    """How scans enter the voxel map: the same for segmentation and for training; lengths in metres.

    Attributes:
        voxel_size: Edge of a voxel of the look-up table (III-B).
        local_range: Points farther than this from the robot, horizontally, are left for a later
            scan (III-B).
        floor: Height of the floor: from the map around the robot, the scan's lowest point, or a
            number.
        seed: Seed of the context sample and of every other choice; keyed with the scan number.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    voxel_size: float = Field(default=0.1, ge=0.01, le=10.0)
    local_range: float = Field(default=2.0, gt=0.0, le=1000.0)
    floor: FloorRule | Annotated[float, Field(ge=-65536.0, le=65536.0)] = "map"
    seed: int = Field(default=0, ge=0)


class SegmentSettings(MapSettings):
    """Everything that decides the labels of a run.

    Batch size and similarity, where they are not given, are the network's own; the defaults here
    are MCPNet's.

    Attributes:
        batch_size: N, points per network batch; networks pool over them, so it is part of the
            result (III-D).
        labelling: ``first``, labels stay as they were when a voxel was first seen (III-B), or
            ``fused``, evidence of all looks decides; None: what the method is made for.
        similarity: beta, cosine similarity above which neighbours are connected (III-C, IV-B).
        clustering: ``paper``, similar neighbours are connected and never parted (III-C), or
            ``graph``, average linkage of all evidence; None: what the method is made for.
        affinity: Of the graph: mean affinity along a boundary above which two clusters are one
            object.
        object_voxels: Of the graph: voxels of the smallest object, unless its class is certain.
    """

    batch_size: int = Field(default=BATCH, ge=1, le=65536)
    similarity: float = Field(default=SIMILARITY, ge=-1.0, le=1.0)
    labelling: Labelling | None = None
    clustering: Clustering | None = None
    affinity: float = Field(default=0.7, ge=0.0, le=1.0)
    object_voxels: int = Field(default=10, ge=1)


class RegionGrowingSettings(BaseModel):
    """Which neighbouring voxels are one surface to region growing (table II).

    The paper gives no numbers; these were chosen on a synthetic building that no table is made
    with.

    Attributes:
        reach: Cells from a voxel to the points that decide its normal.
        min_points: Fewest points that make a surface.
        max_curvature: Surfaces of more are rough: the least variance's share of all, 0 for a plane.
        max_angle_deg: Normals farther apart are not one surface.
        max_colour: Colours farther apart are not; Euclidean, of 0 to 441.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    reach: int = Field(default=2, ge=1, le=4)
    min_points: int = Field(default=6, ge=3)
    max_curvature: float = Field(default=0.08, ge=0.0, le=1 / 3)
    max_angle_deg: float = Field(default=12.0, ge=0.0, le=180.0)
    max_colour: float = Field(default=40.0, ge=0.0)


_LIDAR: dict[str, object] = {"height": 0.7, "reach": 30.0, "horizontal_deg": 0.2, "noise": 0.02}
SCANNERS: dict[Scanner, dict[str, object]] = {
    "paper": {},
    "sphere": {},
    "authors": {"lowest_deg": -45.0, "highest_deg": 80.0, "reach": 5.0},
    "depth-camera": {"sensor": "depth-camera", "views": 3, "height": 1.45, "noise": 0.002},
    "lidar-16": {"sensor": "lidar-16", **_LIDAR},
    "lidar-32": {"sensor": "lidar-32", **_LIDAR},
}
"""Settings of each scanner, where they are not the defaults: the full sphere of III-A."""

_OF_THE_SPHERE = ("vertical_deg", "lowest_deg", "highest_deg")


class RaytraceSettings(BaseModel):
    """Everything that decides virtual scans; lengths in metres, angles in degrees.

    What only other sensors have is neither given nor written to a record.

    Attributes:
        sensor: What the robot looks with.
        views: Scans in a ``step``, each turned elsewhere; of a depth camera.
        voxel_size: Edge of a voxel of the grid that rays are cast in (III-A).
        step: Way between two scans (III-A), or from ``views`` of them to the next.
        height: The scanner's height over the floor; a depth camera is carried around it.
        reach: Farthest a ray goes.
        horizontal_deg: Horizontal angle between rays (III-A); not of a depth camera.
        vertical_deg: Vertical angle between rays (III-A); of the sphere.
        lowest_deg: Elevation of the lowest rays; -90 is straight down; of the sphere.
        highest_deg: Elevation that rays stay below; of the sphere.
        noise: Standard deviation of the measured range; of a depth camera at 1 m, from where it
            grows with the square of the range.
        dropout: Share of the points that are lost.
        seed: Seed of the noise, the drop-out, of which point stands for a voxel, and of how a
            sensor is carried.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    sensor: Sensor = "sphere"
    views: int = Field(default=1, ge=1, le=100)
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

    @model_validator(mode="after")
    def _only_its_own(self) -> Self:
        for setting in _foreign(self.sensor):
            if setting in self.model_fields_set:
                raise ValueError(f"{setting} is no setting of a {self.sensor}; leave it out")
        return self

    @model_serializer(mode="wrap")
    def _without_foreign(self, handler: SerializerFunctionWrapHandler) -> dict[str, object]:
        """Leave out what the sensor does not have."""
        values: dict[str, object] = handler(self)
        left_out = {*_foreign(self.sensor), *(("sensor",) if self.sensor == "sphere" else ())}
        return {name: value for name, value in values.items() if name not in left_out}


def _foreign(sensor: Sensor) -> tuple[str, ...]:
    """Name the settings that a sensor does not have."""
    if sensor == "sphere":
        return ("views",)
    if sensor == "depth-camera":
        return ("horizontal_deg", *_OF_THE_SPHERE)
    return ("views", *_OF_THE_SPHERE)


class TrainSettings(BaseModel):
    """Everything that decides trained weights, apart from the data.

    Attributes:
        architecture: Which network.
        epochs: Passes over the training data (III-D).
        batch_size: N, points per batch, or windows for the U-Net; None: the network's own, 256 for
            MCPNet (III-D).
        learning_rate: Of Adam (III-D).
        schedule: ``constant`` (III-D), or ``cosine``: it falls to 0 over the run.
        warm_up: Epochs over which the learning rate rises to its value; a fraction is fine.
        weight_decay: Decoupled from the gradient (AdamW); 0 is the paper's Adam.
        max_gradient: Gradients longer than this are cut to it; None: never.
        margin: alpha of the triplet loss.
        class_weight: Weight of the class loss in the sum.
        instance_weight: Weight of the triplet loss, or of SGPN's double hinge, in the sum.
        confidence_weight: Weight of SGPN's confidence loss in the sum.
        label_smoothing: Share of certainty that the U-Net's class loss does not ask for.
        class_balance: What an error costs: the same for all classes, or by the inverse root of
            their frequency.
        batches_per_epoch: An epoch ends after so many batches; None: after one of every scan.
        batches_per_step: Batches whose gradients are averaged for one update, in each process.
        samples_per_instance: Points taken from a random object at a time until a batch is full; 0:
            all points alike.
        plain_share: Share of the training batches whose points are drawn alike even so; of
            validation, all are.
        validation_batches: Most batches a validation takes; None: one of every scan.
        validate_every: Epochs from one validation to the next; the last epoch always has one.
        patience: Stop when so many validations in a row were no better; None: never.
        best_by: What makes weights the best: the highest mIoU, or the lowest loss.
        precision: Arithmetic of the network; ``bf16`` keeps parameters and losses in float32.
        stored_as: Numbers of the weights file; ``fp16`` halves it, and the network is rounded
            before its confidence is calibrated.
        seed: Seed of first parameters, order, drop-out and augmentation.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    architecture: Architecture = "mcpnet"
    epochs: int = Field(default=100, ge=1, le=1_000_000)
    batch_size: int | None = Field(default=None, ge=2, le=65536)
    learning_rate: float = Field(default=1e-3, gt=0.0, le=10.0)
    schedule: Schedule = "constant"
    warm_up: float = Field(default=0.0, ge=0.0)
    weight_decay: float = Field(default=0.0, ge=0.0, le=10.0)
    max_gradient: float | None = Field(default=None, gt=0.0)
    margin: float = Field(default=TRIPLET_MARGIN, gt=0.0, le=4.0)
    class_weight: float = Field(default=1.0, ge=0.0)
    instance_weight: float = Field(default=1.0, ge=0.0)
    confidence_weight: float = Field(default=1.0, ge=0.0)
    label_smoothing: float = Field(default=0.0, ge=0.0, lt=1.0)
    class_balance: ClassBalance = "none"
    batches_per_epoch: int | None = Field(default=None, ge=1)
    batches_per_step: int = Field(default=1, ge=1, le=1024)
    samples_per_instance: int = Field(default=16, ge=0, le=65536)
    plain_share: float = Field(default=0.25, ge=0.0, le=1.0)
    validation_batches: int | None = Field(default=None, ge=1)
    validate_every: int = Field(default=1, ge=1)
    patience: int | None = Field(default=None, ge=1)
    best_by: BestBy = "miou"
    precision: TrainPrecision = "fp32"
    stored_as: StoredAs = "fp32"
    seed: int = Field(default=0, ge=0, lt=1 << 63)


WINDOW_TRAINING: dict[str, object] = {
    "epochs": 10,
    "batch_size": 2,
    "learning_rate": 3e-3,
    "schedule": "cosine",
    "warm_up": 0.1,
    "weight_decay": 0.02,
    "max_gradient": 5.0,
    "class_balance": "sqrt",
    "label_smoothing": 0.05,
}
"""How the sparse U-Net is trained where nothing else is said."""

WINDOW_SAMPLES: dict[str, object] = {
    "voxel_size": 0.05,
    "local_range": 6.0,
    "num_context": 0,
    "seen_again": 0,
}
"""How areas are replayed for it: finer than its voxels, as far as scanners see in rooms."""


class SampleSettings(MapSettings):
    """Everything that decides the training samples of an area.

    Where the map's settings are not those of segmentation, training sees what that does not.

    Attributes:
        context_window: Where context points come from.
        num_context: M, context points per point (III-B); 0 for networks that see whole windows.
        seen_again: Of the voxels a scan sees again, how many become samples once more: a later look
            has more context.
    """

    context_window: ContextWindow = "cells"
    num_context: int = Field(default=NUM_CONTEXT, ge=0, le=1024)
    seen_again: int = Field(default=256, ge=0, le=1 << 20)


class WindowSettings(BaseModel):
    """Which windows of the map the sparse U-Net is trained on; lengths in metres.

    Attributes:
        voxel_size: Edge of a voxel of the network; areas are replayed on a finer grid.
        shortest_range: Ranges are drawn evenly from this ...
        longest_range: ... to this.
        young: Share of the windows that a few scans in a row made, not all there were.
        most_scans: Most such scans; their number is log-uniform.
        most_voxels: Most voxels of a window; those nearest the robot stay.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    voxel_size: float = Field(default=0.1, ge=0.01, le=10.0)
    shortest_range: float = Field(default=2.0, gt=0.0, le=1000.0)
    longest_range: float = Field(default=5.0, gt=0.0, le=1000.0)
    young: float = Field(default=0.7, ge=0.0, le=1.0)
    most_scans: int = Field(default=80, ge=1)
    most_voxels: int = Field(default=6000, ge=500)


class CheckpointSettings(BaseModel):
    """When a training writes checkpoints, apart from the end of each epoch.

    Attributes:
        minutes: From one to the next.
        keep: Whether the last stays when training is done.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    minutes: float = Field(default=10.0, ge=0.0)
    keep: bool = False


_Share = Annotated[float, Field(ge=0.0, le=1.0)]


class AugmentSettings(BaseModel):
    """How training batches are changed, each anew; 0 turns a part off.

    Lengths are in metres, colours in 0-255.
    ``grey``, ``luminance``, ``mirror``, ``context_dropout``, ``same_scan``, ``partial_view``,
    ``thinning`` and ``floor_lost`` are shares of the batches. The rest, where nothing else is said,
    is the half-width of a uniform distribution: ``gain: 0.3`` is a factor of 0.7 to 1.3.

    Attributes:
        turn_deg: Angle about the vertical through the robot.
        mirror: Mirrored across a vertical plane through the robot.
        scale: Of everything, around the robot's foot.
        height_scale: Of heights, on top of that.
        jitter: Largest standard deviation of a displacement of every point; real sensors and poses
            scatter.
        robot_offset: Of the robot's position, each way: sensors are carried off the robot's centre.
        floor_error: Standard deviation of the floor's height, which is estimated where there is no
            truth.
        floor_lost: Floor farther off: as where no floor is in view.
        floor_lost_by: Largest error then; the smallest is a third of it.
        gain: Factor of all colours: exposure.
        channel_gain: Factor of each colour channel: white balance.
        contrast: Factor of the distance from the mean colour.
        offset: Added to all colours.
        gamma: Exponent of the colours, as a power of e: 0.3 is an exponent of 0.74 to 1.35.
        hue_deg: Turn of the colours about the grey axis.
        light_gradient: Brightness that falls off to one side, as a power of e per metre: badly lit
            rooms.
        colour_noise: Largest standard deviation of every point's colour.
        luminance: Colours dropped to their luminance.
        grey: All colours set to the grey that a scan without colour has.
        context_dropout: A part of each point's context replaced by repeating the rest: sparse maps.
        context_dropout_share: Largest part replaced.
        same_scan: Only context that this scan sees: nothing remembered from earlier ones.
        partial_view: A half-space or a sector around the robot cut away, from the points and their
            context.
        thinning: Voxels dropped at random, from the points and their context.
        thinning_share: Largest part dropped.
        grid_shift: Windows only: in voxels, each way; floors are not where voxels begin.
        tilt_deg: Windows only: standard deviation of the map's tilt, about both axes.
        right_angle: Windows only: turned by a multiple of 90 degrees, as most maps lie.
        holes: Windows only: balls of points gone, as behind what stands before them.
        hole_radius: Largest radius of a hole.
        no_ceiling: Windows only: all above some height gone.
        mixed_boxes: Windows only: a part of the room exchanged for that of another window.
        mixed_things: Windows only: things of another window stood on free floor.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    turn_deg: float = Field(default=180.0, ge=0.0, le=180.0)
    mirror: _Share = 0.5
    scale: float = Field(default=0.1, ge=0.0, le=0.5)
    height_scale: float = Field(default=0.04, ge=0.0, le=0.5)
    jitter: float = Field(default=0.015, ge=0.0, le=1.0)
    robot_offset: float = Field(default=0.2, ge=0.0, le=10.0)
    floor_error: float = Field(default=0.02, ge=0.0, le=1.0)
    floor_lost: _Share = 0.1
    floor_lost_by: float = Field(default=0.3, ge=0.0, le=10.0)
    gain: float = Field(default=0.3, ge=0.0, le=1.0)
    channel_gain: float = Field(default=0.1, ge=0.0, le=1.0)
    contrast: float = Field(default=0.3, ge=0.0, le=1.0)
    offset: float = Field(default=20.0, ge=0.0, le=255.0)
    gamma: float = Field(default=0.3, ge=0.0, le=2.0)
    hue_deg: float = Field(default=20.0, ge=0.0, le=180.0)
    light_gradient: float = Field(default=0.1, ge=0.0, le=2.0)
    colour_noise: float = Field(default=10.0, ge=0.0, le=255.0)
    luminance: _Share = 0.1
    grey: _Share = 0.25
    context_dropout: _Share = 0.25
    context_dropout_share: _Share = 0.8
    same_scan: _Share = 0.1
    partial_view: _Share = 0.3
    thinning: _Share = 0.3
    thinning_share: _Share = 0.5
    grid_shift: float = Field(default=0.0, ge=0.0, le=1.0)
    tilt_deg: float = Field(default=0.0, ge=0.0, le=10.0)
    right_angle: _Share = 0.0
    holes: _Share = 0.0
    hole_radius: float = Field(default=0.0, ge=0.0, le=10.0)
    no_ceiling: _Share = 0.0
    mixed_boxes: _Share = 0.0
    mixed_things: _Share = 0.0

    @classmethod
    def of_windows(cls) -> Self:
        """Return the defaults for the U-Net: a map lies any way, and much of it is unseen."""
        return cls(
            jitter=0.03,
            floor_error=0.03,
            grey=0.2,
            partial_view=0.3,
            thinning=0.25,
            thinning_share=0.6,
            grid_shift=0.5,
            tilt_deg=0.7,
            right_angle=0.3,
            holes=0.4,
            hole_radius=0.8,
            no_ceiling=0.3,
        )

    @classmethod
    def off(cls) -> Self:
        """Return settings that change nothing."""
        return cls.model_validate(dict.fromkeys(cls.model_fields, 0.0))


_OPTIONS = {
    "architecture": "--net",
    "highest_deg": "--v-max",
    "horizontal_deg": "--h-res",
    "init": "--weights",
    "learning_rate": "--lr",
    "local_range": "--range",
    "lowest_deg": "--v-min",
    "num_context": "--context",
    "num_rooms": "--rooms",
    "reach": "--range",
    "vertical_deg": "--v-res",
}


def option_of(setting: str) -> str:
    """Return the option of the command line that gives a setting."""
    return _OPTIONS.get(setting, f"--{setting.replace('_', '-')}")
