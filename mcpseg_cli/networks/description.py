"""What there is to know of networks and their weights before torch is needed."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator
from safetensors import SafetensorError, safe_open

from mcpseg_cli.choices import Architecture, ContextWindow, Precision
from mcpseg_cli.classes import MOST_CLASSES, TABLE_EXPECTED, table_problem
from mcpseg_cli.config import (
    BASELINE_BATCH,
    BATCH,
    NUM_CONTEXT,
    SGPN_SIMILARITY,
    SIMILARITY,
    SegmentSettings,
)
from mcpseg_cli.errors import WeightsError

DEFAULT_WEIGHTS = "unet"
METADATA = "mcpseg"
"""Key of the description in a weights file."""


@dataclass(frozen=True)
class Traits:
    """What a network is like.

    Attributes:
        needs_context: Whether it pools context points; then ``forward`` must be given them.
        sees_windows: Whether it is given whole windows of the map: see ``unet``.
        has_embedding: Whether it embeds points for clustering; if not, objects are neighbours of
            one class (IV-B).
        batch_size: N, points per batch in the paper's experiments, or windows. What a network says
            about a point depends on the other points of its batch.
        similarity: beta, the cosine similarity above which neighbours are one object (IV-B).
    """

    needs_context: bool = False
    sees_windows: bool = False
    has_embedding: bool = False
    batch_size: int = BASELINE_BATCH
    similarity: float = SIMILARITY

    def complete(self, settings: SegmentSettings) -> SegmentSettings:
        """Fill in what was not given by what the network was made for."""
        own = {"batch_size": self.batch_size, "similarity": self.similarity}
        return settings.model_copy(
            update={name: own[name] for name in own.keys() - settings.model_fields_set}
        )


TRAITS: dict[Architecture, Traits] = {
    "unet": Traits(sees_windows=True, has_embedding=True, batch_size=2),
    "mcpnet": Traits(needs_context=True, has_embedding=True, batch_size=BATCH),
    "mcpnet-nocontext": Traits(has_embedding=True, batch_size=BATCH),
    "pointnet": Traits(),
    "pointnet2": Traits(),
    "sgpn": Traits(has_embedding=True, similarity=SGPN_SIMILARITY),
    "voxnet": Traits(),
}


class WeightsInfo(BaseModel):
    """What weights say about themselves.

    Attributes:
        architecture: Which network they are for.
        classes: Class table: what the logits mean.
        context_window: Where the context points they were trained with came from.
        num_context: M, context points per point.
        temperature: What logits are divided by, so that confidence is the share that is right.
        notice: A warning to show whenever they are used; empty for weights meant for use.
        training: Facts for the reader: data, epochs, scores, source.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    architecture: Architecture
    classes: tuple[str, ...] = Field(min_length=2, max_length=MOST_CLASSES)
    context_window: ContextWindow = "cells"
    num_context: int = Field(default=NUM_CONTEXT, ge=1, le=1024)
    temperature: float = Field(default=1.0, gt=0.0, le=100.0)
    notice: str = ""
    training: dict[str, str | int | float] = {}

    @field_validator("classes")
    @classmethod
    def _check_classes(cls, classes: tuple[str, ...]) -> tuple[str, ...]:
        """Refuse names that would break the headers of clouds."""
        if problem := table_problem(classes):
            raise ValueError(f"{problem}; expected {TABLE_EXPECTED}")
        return classes

    @property
    def traits(self) -> Traits:
        """What the network is like."""
        return TRAITS[self.architecture]


@dataclass(frozen=True)
class DescribedWeights:
    """A weights file of which only the description was read.

    Attributes:
        path: The file.
        info: Architecture, classes, context.
        sha256: Hash of the file, hex.
        name: File name without its ending.
    """

    path: Path
    info: WeightsInfo
    sha256: str
    name: str


def find_weights(name_or_path: str) -> Path:
    """Find a weights file: a path, or the name of bundled weights.

    Raises:
        WeightsError: Neither.
    """
    path = Path(name_or_path)
    if path.suffix == ".safetensors" or path.is_file():
        return path

    # a wheel has the bundled weights inside, a checkout beside the package
    package = Path(__file__).parents[1]
    folders = [package / "models", package.parent / "models"]
    for folder in folders:
        if (folder / f"{name_or_path}.safetensors").is_file():
            return folder / f"{name_or_path}.safetensors"

    bundled = sorted(file.stem for folder in folders for file in folder.glob("*.safetensors"))
    expected = f"a .safetensors file or one of {', '.join(bundled)}"
    raise WeightsError(name_or_path, "no such weights", expected, "check the name")


def describe_weights(path: Path) -> DescribedWeights:
    """Read what a weights file says about itself, without its tensors.

    Args:
        path: A .safetensors file written by ``save_weights``.

    Raises:
        WeightsError: Damaged, or not mcpseg's.
        OSError: The file cannot be opened.
    """
    with path.open("rb") as file:
        sha256 = hashlib.file_digest(file, "sha256").hexdigest()
    try:
        with safe_open(path, framework="np") as tensors:
            metadata = tensors.metadata() or {}
    except (SafetensorError, ValueError) as error:
        found = f"not readable ({str(error).strip()[:80]})"
        remedy = "import TensorFlow checkpoints with 'mcpseg import-weights'"
        raise WeightsError(path, found, "a safetensors file", remedy) from error

    if METADATA not in metadata:
        found, remedy = "no mcpseg description", "use bundled or imported weights"
        raise WeightsError(path, found, "weights made by mcpseg", remedy)
    try:
        info = WeightsInfo.model_validate_json(metadata[METADATA])
    except ValidationError as error:
        problem = error.errors()[0]
        found = f"{'.'.join(map(str, problem['loc']))}: {problem['msg']}"
        expected = "a description this version knows"
        raise WeightsError(path, found, expected, "update mcpseg") from error
    return DescribedWeights(path, info, sha256, path.stem)


def resolve_precision(precision: Precision, device: str = "cpu") -> Precision:
    """Replace ``auto`` by what this machine does best: bf16 where it is native, else fp32."""
    if precision != "auto":
        return precision
    return "bf16" if device == "cpu" and _cpu_has_bf16() else "fp32"


def _cpu_has_bf16() -> bool:
    """Tell, by what Linux reports, if the processor multiplies bfloat16 (AMX or AVX512-BF16)."""
    try:
        flags = Path("/proc/cpuinfo").read_text().split()
    except OSError:
        return False
    return "avx512_bf16" in flags or "amx_bf16" in flags
