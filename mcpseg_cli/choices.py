"""What may be chosen by name: one list of values for settings, code and command line.

The command line reads them before anything heavy is imported; so nothing is imported here.
"""

from typing import Literal

Architecture = Literal[
    "unet", "mcpnet", "mcpnet-nocontext", "pointnet", "pointnet2", "sgpn", "voxnet"
]

Method = Literal[
    "unet",
    "mcpnet",
    "mcpnet-nocontext",
    "pointnet",
    "pointnet2",
    "sgpn",
    "voxnet",
    "region-growing",
]
"""What labels: a network, or region growing (table II)."""

ContextWindow = Literal["cells", "coarse"]
"""Where context points come from: ``cells``, at most three cells away (III-B); ``coarse``, the 27
cells of three voxels a side around the point, as in the authors' program. Weights carry which of
the two they were trained with.
"""

Precision = Literal["auto", "fp32", "bf16"]
"""Arithmetic of context pooling."""

Frame = Literal["map", "sensor"]
"""Frame of the scans' coordinates."""

UpAxis = Literal["z", "-z", "y", "-y", "x", "-x"]
"""Which axis of a recording points up."""

ColourUnit = Literal["8-bit", "16-bit", "0-1"]
"""What the brightest colour of a recording is: 255, 65,535 or 1."""

Labelling = Literal["first", "fused"]
"""Which looks decide a voxel's class: the first (III-B), or all of them."""

Clustering = Literal["paper", "graph"]
"""What makes objects: any pair of similar neighbours (III-C), or all edges between two clusters."""

FloorRule = Literal["map", "scan-min"]

MeshUpAxis = Literal["y", "z"]
"""The axis of a mesh that points up."""

OnError = Literal["stop", "skip"]
"""What to do about a scan that cannot be read."""

ScanFormat = Literal["ply", "las", "laz", "npz", "pcd"]
"""Formats that scans are written in."""

CloudFormat = Literal["ply", "las", "laz", "pcd", "npz", "h5", "e57"]
"""Formats that labelled maps and objects are exported to."""

SplitFormat = Literal["ply", "las", "laz", "pcd", "npz", "h5", "e57", "html"]
"""What a map is split into: clouds, or the tiles of a page."""

ColourBy = Literal["rgb", "class", "instance", "embedding", "confidence"]
"""What the colours of points say."""

View = Literal["top", "cut", "perspective"]
"""Where a picture is seen from."""

SynthClasses = Literal["s3dis", "home"]
"""Which classes name the objects of a synthetic building: the 13 of S3DIS, or finer ones."""

ModelPart = Literal["train", "kept", "all"]
"""Which models furnish a synthetic building: those to train on, those kept from it, or all."""

Engine = Literal["processes", "dask"]
"""What runs many recordings: processes of this machine, or the workers of a Dask cluster."""

Sensor = Literal["sphere", "depth-camera", "lidar-16", "lidar-32"]
"""What a virtual robot looks with: rays in all directions (III-A), a hand-held depth camera, or a
lidar of 16 or 32 rings.
"""

Scanner = Literal["paper", "sphere", "authors", "depth-camera", "lidar-16", "lidar-32"]
"""Sensors with their settings: ``paper`` is the sphere (III-A), ``authors`` as much of it as the
authors' program covers.
"""

Schedule = Literal["constant", "cosine"]
"""How the learning rate goes: as in III-D, or falling to 0."""

ClassBalance = Literal["none", "sqrt"]
"""What an error costs: the same for all classes, or by the inverse root of their frequency."""

BestBy = Literal["miou", "loss"]
"""What makes weights the best."""

TrainPrecision = Literal["fp32", "bf16"]
"""Arithmetic of the network while training."""

StoredAs = Literal["fp32", "fp16"]
"""Numbers that weights are written in."""

Augmentation = Literal["default", "none"]
"""How training batches are changed: as its settings have it by default, or not at all."""
