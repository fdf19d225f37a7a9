"""One training in a folder: what there is at its end, and a checkpoint on the way."""

from __future__ import annotations

import hashlib
import json
import shlex
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from time import monotonic

import torch

from mcpseg_cli import __version__
from mcpseg_cli.config import NUM_CONTEXT, TrainSettings
from mcpseg_cli.networks.description import WeightsInfo
from mcpseg_cli.networks.network import Network
from mcpseg_cli.networks.weights import Weights, build_network, rounded_network, save_weights
from mcpseg_cli.resumable import printable, write_whole
from mcpseg_cli.train.calibration import Calibration, calibrate
from mcpseg_cli.train.checkpoint import check_identity, read_checkpoint, write_checkpoint
from mcpseg_cli.train.fine_tuning import adopt
from mcpseg_cli.train.fold_data import DataSettings, FoldData
from mcpseg_cli.train.folder import TrainFiles, TrainIdentity, TrainRecord
from mcpseg_cli.train.folds import Fold
from mcpseg_cli.train.model_card import model_card
from mcpseg_cli.train.progress import EpochReport, Progress
from mcpseg_cli.train.ranks import Ranks
from mcpseg_cli.train.schedule import balance
from mcpseg_cli.train.settings_file import settings_text
from mcpseg_cli.train.trainer import Trainer


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
        workers: Processes that draw batches; 0: a thread does.

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
        workers: int = 0,
    ) -> None:
        self.files, self.request, self.device, self.ranks = files, request, device, ranks
        self._held_out = data.validation
        settings, samples = request.settings, request.data.samples
        self.info = WeightsInfo(
            architecture=settings.architecture,
            classes=data.classes,
            context_window=samples.context_window,
            num_context=samples.num_context or NUM_CONTEXT,  # of a network that has none
        )
        self.identity = self._identify(data)

        # a network as it is before the first step, or that of other weights
        self.new_classes: list[str] = []
        network = self._first_network().to(device)
        is_balanced = settings.class_balance == "sqrt"
        self.trainer = Trainer(
            network,
            len(data.classes),
            settings,
            data.training,
            data.validation,
            ranks=ranks,
            class_weights=balance(data.plain, len(data.classes)) if is_balanced else None,
            workers=workers,
        )

        # what an earlier run of the same request has done
        self.record = None if anew else files.read_record()
        self.has_resumed = False
        now, checkpoint = self.identity.model_dump(mode="json"), files.path("checkpoint")
        if self.record is not None:
            before = self.record.identity.model_dump(mode="json")
            check_identity(files.path("json"), before, now)
        elif not anew and checkpoint.exists():
            self.trainer.restore(read_checkpoint(checkpoint, now))
            self.has_resumed = True

    @property
    def batch_size(self) -> int:
        """Points per batch."""
        return self.request.settings.batch_size or self.trainer.network.traits.batch_size

    @property
    def is_complete(self) -> bool:
        """True when there is nothing left to train."""
        return self.record is not None or self.trainer.is_finished

    def _identify(self, data: FoldData) -> TrainIdentity:
        """Collect what must be the same for a training to go on."""
        request, mapping = self.request, self.request.data.mapping
        return TrainIdentity(
            settings=request.settings,
            samples=request.data.samples,
            augmentation=request.data.augment,
            windows=request.data.windows,
            classes=data.classes,
            class_table=None if mapping is None else dict(mapping),
            training_areas=data.training_areas,
            validation_areas=data.validation_areas,
            init=None if request.init is None else request.init.sha256,
            processes=self.ranks.world,
        )

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
        """Train what is left.

        A checkpoint is written every few minutes, after every epoch and when asked to stop.

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
            identity = self.identity.model_dump(mode="json")
            write_checkpoint(self.files.path("checkpoint"), self.trainer.state(), identity)

    def write_results(self, *, keep_checkpoint: bool = False) -> TrainRecord:
        """Write weights, card, record and settings of what is trained so far.

        The checkpoint goes when that is all. Before the end of the first epoch nothing is written:
        no one wants weights that nothing was learned in.

        Args:
            keep_checkpoint: It stays nevertheless.

        Returns:
            The record.

        Raises:
            OSError: The disk is full or the folder not writable; the checkpoint stays.
        """
        best = self._best()
        if best is None:
            return self._record(None, None, None, 0)

        # weights on the processor, rounded as they will be stored, with what they are
        stored_as = self.request.settings.stored_as
        network = build_network(self.info)
        network.load_state_dict(
            {name: tensor.cpu() for name, tensor in self.trainer.best_network().items()}
        )
        network = rounded_network(network, self.info, stored_as)
        calibration = self._calibrate(network)
        info = self.info.model_copy(update={"training": self._facts(best)})
        if calibration is not None:
            info = info.model_copy(update={"temperature": calibration.temperature})
        path = self.files.path("safetensors")
        save_weights(path, network, info, stored_as)

        # what people and programs read about them
        sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
        record = self._record(best, calibration, sha256, path.stat().st_size)
        write_whole(self.files.path("md"), model_card(record))
        write_whole(self.files.path("toml"), self._settings())
        document = json.dumps(record.model_dump(mode="json"), indent=1)
        write_whole(self.files.path("json"), document + "\n")

        if self.trainer.is_finished and not keep_checkpoint:
            self.files.path("checkpoint").unlink(missing_ok=True)
        self.record = record if self.trainer.is_finished else None
        return record

    def _calibrate(self, network: Network) -> Calibration | None:
        """Fit the temperature on what is held out; None where nothing is, or for the paper's."""
        if self._held_out is None:
            return None
        return calibrate(network.eval().to(self.device), self._held_out, self.device)

    def _best(self) -> EpochReport | None:
        """Return the report of the epoch whose weights are given out."""
        curves = self.trainer.curves
        return curves[(self.trainer.best or len(curves)) - 1] if curves else None

    def _facts(self, best: EpochReport) -> dict[str, str | int | float]:
        """Say in the weights themselves where they come from."""
        settings, scores = self.request.settings, best.validation
        facts: dict[str, str | int | float] = {
            "data": ", ".join(area.name for area in self.request.fold.training),
            "holdout": self.request.fold.label,
            "epochs": len(self.trainer.curves),
            "epoch": best.epoch,
            "learning_rate": settings.learning_rate,
            "seed": settings.seed,
        }
        if scores is not None:
            facts |= {"validation_loss": scores.loss, "validation_accuracy": scores.accuracy}
            facts |= {} if scores.miou is None else {"validation_miou": scores.miou}
        return facts

    def _settings(self) -> str:
        """Write out the settings as --config takes them."""
        data = self.request.data
        return settings_text(
            self.request.settings, data.samples, data.augment, data.windows, data.mapping
        )

    def _record(
        self,
        best: EpochReport | None,
        calibration: Calibration | None,
        sha256: str | None,
        size: int,
    ) -> TrainRecord:
        """Say all there is to say about the weights."""
        init, curves = self.request.init, tuple(self.trainer.curves)
        return TrainRecord(
            mcpseg=__version__,
            torch=torch.__version__,
            complete=self.trainer.is_finished,
            name=printable(self.files.name),
            sha256=sha256,
            bytes=size,
            architecture=self.info.architecture,
            classes=self.info.classes,
            new_classes=tuple(self.new_classes) if init else None,
            init_name=printable(init.name) if init else None,
            holdout=self.request.fold.holdout,
            epochs=len(curves),
            best_epoch=best.epoch if best else 0,
            train=best.train if best else None,
            validation=best.validation if best else None,
            calibration=calibration,
            seconds=round(sum(report.seconds for report in curves), 1),
            device=self.device.type,
            command=printable(shlex.join(self.request.command)),
            curves=curves,
            identity=self.identity,
        )
