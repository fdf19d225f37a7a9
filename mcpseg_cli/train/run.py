"""One training in a folder: weights, model card and record at its end, a checkpoint on the way."""

from __future__ import annotations

import hashlib
import json
import shlex
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

import torch
from pydantic import JsonValue

from mcpseg_cli import __version__
from mcpseg_cli.config import TrainSettings
from mcpseg_cli.errors import OutputError, StateError
from mcpseg_cli.networks.network import Network
from mcpseg_cli.networks.weights import Weights, WeightsInfo, build_network, save_weights
from mcpseg_cli.resumable import printable, write_whole
from mcpseg_cli.train.checkpoint import check_identity, read_checkpoint, write_checkpoint
from mcpseg_cli.train.fine_tuning import adopt
from mcpseg_cli.train.fold_data import DataSettings, FoldData
from mcpseg_cli.train.folds import Fold
from mcpseg_cli.train.model_card import model_card
from mcpseg_cli.train.progress import EpochReport, Progress
from mcpseg_cli.train.ranks import Ranks
from mcpseg_cli.train.schedule import balance
from mcpseg_cli.train.trainer import Trainer

_FORMAT = 1  # of the record


@dataclass(frozen=True)
class TrainFiles:
    """The files of one training.

    Attributes:
        folder: Where they are.
        name: What they are called before their endings.
    """

    folder: Path
    name: str

    def path(self, ending: str) -> Path:
        """Return the path of one of them: ``safetensors``, ``md``, ``json``, ``checkpoint`` or ``lock``."""
        return self.folder / f"{self.name}.{ending}"

    def check(self, *, resume: bool, overwrite: bool) -> None:
        """Make the folder; refuse to write over results, or over a training that was interrupted.

        Raises:
            OutputError: Something is there; says what, and how to go on.
            OSError: The folder cannot be made.
        """
        if self.folder.exists() and not self.folder.is_dir():
            raise OutputError(f"{self.folder}: a file; expected a folder; choose another -o")
        self.folder.mkdir(parents=True, exist_ok=True)
        if overwrite or resume:
            return
        if self.path("checkpoint").exists():
            raise OutputError(
                f"{self.path('checkpoint')}: a training that was not finished; expected none; "
                "give --resume to continue it or --overwrite to start anew"
            )
        present = [
            self.path(ending)
            for ending in ("safetensors", "md", "json")
            if self.path(ending).exists()
        ]
        if present:
            raise OutputError(
                f"{present[0]}: is there; expected a new name; choose another -o or --name, or give --overwrite"
            )

    def clear(self) -> None:
        """Delete what an earlier training left."""
        for ending in ("checkpoint", "safetensors", "md", "json"):
            self.path(ending).unlink(missing_ok=True)

    def record(self) -> dict[str, JsonValue] | None:
        """Read the record of a training that is complete; None where there is none.

        Raises:
            StateError: It is damaged.
        """
        path = self.path("json")
        if not path.is_file():
            return None
        try:
            document = json.loads(path.read_text())
        except ValueError as error:
            raise StateError(
                f"{path}: not JSON; expected a record of training; give --overwrite"
            ) from error
        return document if isinstance(document, dict) and document.get("complete") else None


@dataclass(frozen=True)
class TrainRequest:
    """What to train.

    Attributes:
        settings: Network and numbers.
        data: How scans become batches.
        fold: On what.
        init: Weights to start from.
        command: Command line, for the model card.
    """

    settings: TrainSettings
    data: DataSettings
    fold: Fold
    init: Weights | None = None
    command: Sequence[str] = ()


class TrainRun:
    """Trains one network on one fold and keeps its files.

    Args:
        files: Where; no other process may be writing there.
        request: What.
        data: The fold's.
        device: Where to train.
        ranks: The processes that share the work; only rank 0 writes.
        anew: Ignore what is there; ``files.clear`` deletes it.

    Raises:
        StateError: The checkpoint there was made with other settings or data, or is damaged.
        TrainingError: There are too few batches.
        WeightsError: The weights to start from do not fit.
    """

    def __init__(
        self,
        files: TrainFiles,
        request: TrainRequest,
        data: FoldData,
        device: torch.device,
        ranks: Ranks,
        *,
        anew: bool = False,
    ) -> None:
        settings, samples = request.settings, request.data.samples
        self.files, self.request, self.data, self.ranks, self.device = (
            files,
            request,
            data,
            ranks,
            device,
        )
        self.info = WeightsInfo(
            architecture=settings.architecture,
            classes=data.classes,
            context_window=samples.context_window,
            num_context=samples.num_context,
        )
        self.new_classes: list[str] = []
        self.identity = self._identity()
        self.record = None if anew else files.record()
        network = self._first_network().to(device)
        class_weights = (
            balance(data.plain, len(data.classes)) if settings.class_balance == "sqrt" else None
        )
        self.trainer = Trainer(
            network, len(data.classes), settings, data.training, data.validation,
            ranks=ranks, class_weights=class_weights,
        )  # fmt: skip
        self.has_resumed = False
        if self.record is not None:
            before = self.record.get("identity")
            check_identity(
                files.path("json"), before if isinstance(before, dict) else {}, self.identity
            )
        elif not anew and files.path("checkpoint").exists():
            self.trainer.restore(read_checkpoint(files.path("checkpoint"), self.identity))
            self.has_resumed = True

    @property
    def batch_size(self) -> int:
        """Points per batch."""
        return self.request.settings.batch_size or self.trainer.network.batch_size

    def _identity(self) -> dict[str, JsonValue]:
        """Return what must be the same for a training to go on."""
        request = self.request
        return {
            "settings": request.settings.model_dump(mode="json"),
            "samples": request.data.samples.model_dump(mode="json"),
            "augmentation": request.data.augment.model_dump(mode="json"),
            "classes": list(self.data.classes),
            "class_table": None if request.data.mapping is None else dict(request.data.mapping),
            **self.data.facts,
            "init": None if request.init is None else request.init.sha256,
            "processes": self.ranks.world,
        }

    def _first_network(self) -> Network:
        """Build the network as it is before the first step."""
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(self.request.settings.seed)
            network = build_network(self.info)
        if self.request.init is not None:
            self.new_classes = adopt(network, self.info, self.request.init)
        return network

    def run(
        self, minutes: float, should_stop: Callable[[], bool] = lambda: False
    ) -> Iterator[Progress]:
        """Train what is left; a checkpoint is written every few minutes, after every epoch and when stopped.

        Args:
            minutes: From one checkpoint to the next within an epoch.
            should_stop: Asked after each step.

        Yields:
            Progress, once its checkpoint is written where one is due.

        Raises:
            TrainingError: The loss is no longer a number.
            OSError: The disk is full or the folder not writable; the checkpoint before stays.
        """
        written = monotonic()
        for progress in self.trainer.run(should_stop):
            if progress.finished is not None or monotonic() - written >= 60 * minutes:
                self._write_checkpoint()
                written = monotonic()
            yield progress
        if not self.trainer.is_finished:  # asked to stop
            self._write_checkpoint()

    def _write_checkpoint(self) -> None:
        if self.ranks.rank == 0:
            write_checkpoint(self.files.path("checkpoint"), self.trainer.state(), self.identity)

    def write_results(self, *, keep_checkpoint: bool = False) -> dict[str, JsonValue]:
        """Write weights, card and record of what is trained so far; the checkpoint goes when that is all.

        Before the end of the first epoch nothing is written: no one wants weights that nothing was
        learned in.

        Args:
            keep_checkpoint: It stays nevertheless.

        Returns:
            The record.

        Raises:
            OSError: The disk is full or the folder not writable; the checkpoint stays.
        """
        if not self.trainer.curves:
            return self._record(None, 0)
        network = build_network(self.info)
        network.load_state_dict(
            {name: tensor.cpu() for name, tensor in self.trainer.best_network().items()}
        )
        info = self.info.model_copy(update={"training": self._facts()})
        path = self.files.path("safetensors")
        save_weights(path, network, info)
        record = self._record(hashlib.sha256(path.read_bytes()).hexdigest(), path.stat().st_size)
        write_whole(self.files.path("md"), model_card(record))
        write_whole(self.files.path("json"), json.dumps(record, indent=1) + "\n")
        if self.trainer.is_finished and not keep_checkpoint:
            self.files.path("checkpoint").unlink(missing_ok=True)
        self.record = record if self.trainer.is_finished else None
        return record

    def _best(self) -> EpochReport | None:
        """Return the report of the epoch whose weights are given out."""
        curves = self.trainer.curves
        return curves[(self.trainer.best or len(curves)) - 1] if curves else None

    def _facts(self) -> dict[str, str | int | float]:
        """Say in the weights themselves where they come from."""
        best, settings = self._best(), self.request.settings
        facts: dict[str, str | int | float] = {
            "data": ", ".join(area.name for area in self.request.fold.training),
            "holdout": self.request.fold.label,
            "epochs": len(self.trainer.curves),
            "epoch": best.epoch if best else 0,
            "learning_rate": settings.learning_rate,
            "seed": settings.seed,
        }
        scores = best.validation if best else None
        if scores is not None:
            facts |= {"validation_loss": scores.loss, "validation_accuracy": scores.accuracy}
            facts |= {} if scores.miou is None else {"validation_miou": scores.miou}
        return facts

    def _record(self, sha256: str | None, size: int) -> dict[str, JsonValue]:
        """Say all there is to say about the weights."""
        best = self._best()
        return {
            "format": _FORMAT,
            "mcpseg": __version__,
            "torch": torch.__version__,
            "complete": self.trainer.is_finished,
            "name": printable(self.files.name),
            "sha256": sha256,
            "bytes": size,
            "architecture": self.info.architecture,
            "classes": list(self.info.classes),
            "new_classes": list(self.new_classes) if self.request.init else None,
            "init_name": printable(self.request.init.name) if self.request.init else None,
            "holdout": self.request.fold.holdout,
            "epochs": len(self.trainer.curves),
            "best_epoch": best.epoch if best else 0,
            "train": best.train.model_dump(mode="json") if best else None,
            "validation": best.validation.model_dump(mode="json")
            if best and best.validation
            else None,
            "seconds": round(sum(report.seconds for report in self.trainer.curves), 1),
            "device": self.device.type,
            "command": printable(shlex.join(self.request.command)),
            "curves": [report.model_dump(mode="json") for report in self.trainer.curves],
            "identity": self.identity,
        }


def network_batch_size(settings: TrainSettings) -> int:
    """Return the batch size of a network's own (III-D), for settings that give none."""
    info = WeightsInfo(architecture=settings.architecture, classes=("a", "b"))
    with torch.random.fork_rng(devices=[]):
        return build_network(info).batch_size
