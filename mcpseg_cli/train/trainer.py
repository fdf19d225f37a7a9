"""The training loop (III-D): batches, losses, Adam, validation.

``Trainer.run`` is the part to read first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from time import perf_counter

import numpy as np
import torch
from torch import Tensor

from mcpseg_cli.config import TrainSettings
from mcpseg_cli.errors import TrainingError
from mcpseg_cli.networks.network import Network
from mcpseg_cli.train.drawing import Drawing
from mcpseg_cli.train.objective import Objective, Tensors
from mcpseg_cli.train.progress import EpochReport, Progress, TrainState
from mcpseg_cli.train.ranks import Ranks
from mcpseg_cli.train.schedule import learning_rate
from mcpseg_cli.train.scores import Scores, Tally
from mcpseg_cli.train.sources import Batches
from mcpseg_cli.train.window_objective import WindowObjective

_REPORT_STEPS = 10  # from one progress report to the next


@contextmanager
def _in_memory() -> Iterator[None]:
    """Say in one line that memory does not suffice.

    Torch says so in many, and on the processor as any other error.
    """
    try:
        yield
    except (RuntimeError, MemoryError) as error:
        words = ("out of memory", "can't allocate memory", "not enough memory")
        if isinstance(error, MemoryError) or any(each in str(error) for each in words):
            raise TrainingError(
                "out of memory; expected room for a batch; lower --batch-size"
            ) from error
        raise


class Trainer:
    """Trains one network.

    Args:
        network: Fresh or pre-trained; trained in place on the device it is on.
        num_classes: C, of its logits.
        settings: All numbers.
        training: Batches to learn from.
        validation: Batches to choose the best weights by; None: the last weights are the best.
        ranks: The processes that share the work; each has its own ``Trainer`` of the same network.
        class_weights: (C,) float32: what an error on a point of each class costs; None: all the
            same.
        workers: Processes that draw batches; 0: a thread does. They change no result.

    Raises:
        TrainingError: There are too few batches for a step, or to validate in every process.
    """

    def __init__(
        self,
        network: Network,
        num_classes: int,
        settings: TrainSettings,
        training: Batches,
        validation: Batches | None = None,
        *,
        ranks: Ranks | None = None,
        class_weights: Tensor | None = None,
        workers: int = 0,
    ) -> None:
        self.network, self.settings, self.ranks = network, settings, ranks or Ranks()
        self.curves: list[EpochReport] = []
        self.best = 0
        self._best_network: dict[str, Tensor] = {}
        self._training, self._validation = training, validation

        self._parameters = list(network.parameters())
        self._device = self._parameters[0].device
        objective = WindowObjective if network.traits.sees_windows else Objective
        self._objective: Objective | WindowObjective = objective(
            settings, class_weights, self._device
        )
        self._drawing = Drawing(
            [training] if validation is None else [training, validation],
            self._objective.to_tensors,
            workers=workers,
            on_device=self._device.type != "cpu",
        )

        # with a weight decay of 0, AdamW is Adam (III-D)
        self._optimiser = torch.optim.AdamW(
            self._parameters, weight_decay=settings.weight_decay, fused=True
        )

        self._step = 0  # of the epoch at hand
        self._tally = Tally(num_classes, self._device)
        self._check()

    def _check(self) -> None:
        """Refuse data that is not enough for the processes there are."""
        if self.num_steps == 0:
            raise TrainingError(
                f"{len(self._training)} batches; expected enough for a step; give more scans"
            )
        if self._validation is not None and self._num_scored(self._validation) == 0:
            raise TrainingError(
                f"fewer held-out batches than the {self.ranks.world} processes; "
                "expected one for each; "
                "hold out more scans, raise validation_batches or start fewer processes"
            )

    def _num_scored(self, validation: Batches) -> int:
        """Count the held-out batches that this process scores."""
        most = self.settings.validation_batches or len(validation)
        return min(len(validation), most) // self.ranks.world

    @property
    def num_steps(self) -> int:
        """Steps of an epoch."""
        num_batches = min(
            len(self._training), self.settings.batches_per_epoch or len(self._training)
        )
        return num_batches // (self.settings.batches_per_step * self.ranks.world)

    @property
    def num_steps_done(self) -> int:
        """Steps done of the whole run."""
        return len(self.curves) * self.num_steps + self._step

    @property
    def is_finished(self) -> bool:
        """True after the last epoch, or when patience is at its end."""
        waited = sum(report.validation is not None for report in self.curves[self.best :])
        patience = self.settings.patience
        return len(self.curves) >= self.settings.epochs or (
            patience is not None and waited >= patience
        )

    def run(self, should_stop: Callable[[], bool] = lambda: False) -> Iterator[Progress]:
        """Train until the last epoch, or until validation has not improved for long enough.

        Args:
            should_stop: Asked after each step; True, in any process, ends the run early in all.

        Yields:
            Progress every ten steps and after every epoch; ``state`` may be saved then, to go on
            from.

        Raises:
            TrainingError: The loss is no longer a number, or the memory does not suffice.
        """
        try:
            yield from self._run(should_stop)
        finally:
            self._drawing.close()

    def _run(self, should_stop: Callable[[], bool]) -> Iterator[Progress]:
        """Train, see ``run``."""
        while not self.is_finished:
            started = perf_counter()

            # a step of Adam for the batch of every scan
            for batches in self._steps_left():
                self._learn(batches)
                self._step += 1
                stop = self.ranks.any(should_stop(), self._device)
                if stop or self._step % _REPORT_STEPS == 0:
                    yield self._progress(self._tally.scores())
                if stop:
                    return

            # held-out areas say which epoch's weights are the best
            scores = None
            if self._validation is not None and self._is_validation_due():
                scores = self._validate(self._validation, should_stop)
                if scores is None:  # asked to stop
                    return
            yield self._end_epoch(scores, started)

    def _steps_left(self) -> Iterator[list[Tensors]]:
        """Draw the batches of each step that is left of the epoch; a thread draws ahead."""
        each, world = self.settings.batches_per_step, self.ranks.world
        start, end = self._step * each, self.num_steps * each
        positions = range(start * world + self.ranks.rank, end * world, world)
        with self._drawing.batches(self._training, len(self.curves), positions) as batches:
            for _ in range(self._step, self.num_steps):
                yield [self._objective.move(batch) for batch in islice(batches, each)]

    @_in_memory()
    def _learn(self, batches: Sequence[Tensors]) -> None:
        """Change the parameters a little, by the mean gradient of some batches."""
        # learning rate of this step
        epoch, settings = len(self.curves), self.settings
        rate = learning_rate(self.num_steps_done, self.num_steps, settings)
        self._optimiser.param_groups[0]["lr"] = rate

        # class and instance loss of each batch, and their gradient
        self._optimiser.zero_grad(set_to_none=True)
        self.network.train()
        for index, batch in enumerate(batches):
            position = (self._step * len(batches) + index) * self.ranks.world + self.ranks.rank
            with _drop_out_by(settings.seed, epoch, position, device=self._device):
                outcome = self._objective.evaluate(self.network, batch)
            total = self._objective.total(outcome)
            (total / len(batches)).backward()  # type: ignore[no-untyped-call]
            self._tally.add(outcome, total, batch.semantic)

        # one step of Adam, the same in all processes
        self.ranks.average_gradients(self._parameters)
        if settings.max_gradient is not None:
            torch.nn.utils.clip_grad_norm_(self._parameters, settings.max_gradient)
        self._optimiser.step()

    def _is_validation_due(self) -> bool:
        epoch = len(self.curves) + 1
        return epoch % self.settings.validate_every == 0 or epoch == self.settings.epochs

    @_in_memory()
    @torch.no_grad()
    def _validate(self, validation: Batches, should_stop: Callable[[], bool]) -> Scores | None:
        """Score the held-out batches, the same ones every time; None when asked to stop."""
        self.network.eval()
        tally = Tally(self._tally.num_classes, self._device)
        world = self.ranks.world
        positions = range(self.ranks.rank, self._num_scored(validation) * world, world)
        with self._drawing.batches(validation, 0, positions) as batches:
            for drawn_batch in batches:
                batch = self._objective.move(drawn_batch)
                outcome = self._objective.evaluate(self.network, batch)
                tally.add(outcome, self._objective.total(outcome), batch.semantic)
                if self.ranks.any(should_stop(), self._device):
                    return None

        # means over the shares of all processes
        self.ranks.sum(tally.sums)
        return tally.scores()

    def _end_epoch(self, validation: Scores | None, started: float) -> Progress:
        """Record an epoch and keep its weights where they are the best."""
        # means over all processes
        self.ranks.sum(self._tally.sums)
        scores = self._tally.scores()
        report = EpochReport(
            epoch=len(self.curves) + 1,
            learning_rate=learning_rate(self.num_steps_done - 1, self.num_steps, self.settings),
            seconds=round(perf_counter() - started, 3),
            train=scores,
            validation=validation,
        )

        # the best weights so far
        if validation is not None and self._is_better(validation):
            self.best = report.epoch
            self._best_network = {
                name: tensor.clone() for name, tensor in self.network.state_dict().items()
            }

        # on to the next epoch
        progress = self._progress(scores, report)
        self.curves.append(report)
        self._step = 0
        self._tally = Tally(self._tally.num_classes, self._device)
        return progress

    def _is_better(self, validation: Scores) -> bool:
        """Compare with the best epoch so far; the earlier of equals stays."""
        best = self.curves[self.best - 1].validation if self.best else None
        if best is None:
            return True
        if self.settings.best_by == "loss":
            return validation.loss < best.loss
        return (validation.miou or 0.0) > (best.miou or 0.0)

    def _progress(self, scores: Scores, finished: EpochReport | None = None) -> Progress:
        if not math.isfinite(scores.loss):
            raise TrainingError(
                f"epoch {len(self.curves) + 1}: the loss is {scores.loss}; expected a number; "
                "lower --lr; the last checkpoint is from before"
            )
        return Progress(len(self.curves) + 1, self._step, self.num_steps, scores, finished)

    def best_network(self) -> dict[str, Tensor]:
        """Return the parameters that validation chose; where there was none, the last."""
        return self._best_network or self.network.state_dict()

    def state(self) -> TrainState:
        """Return all that changes; its tensors are in use: save them before training goes on."""
        # Adam's moments by number of the parameter and name
        moments = self._optimiser.state_dict()["state"]
        optimiser = {
            f"{index}.{name}": tensor
            for index in moments
            for name, tensor in moments[index].items()
        }

        return TrainState(
            step=self._step,
            curves=tuple(self.curves),
            best=self.best,
            network=self.network.state_dict(),
            best_network=self._best_network,
            optimiser=optimiser,
            sums=self._tally.sums,
        )

    def restore(self, state: TrainState) -> None:
        """Go on from what ``state`` returned, on any device."""
        self._step, self.curves, self.best = state.step, list(state.curves), state.best
        self.network.load_state_dict(state.network)
        self._best_network = {
            name: tensor.to(self._device) for name, tensor in state.best_network.items()
        }

        # Adam's moments
        moments: dict[int, dict[str, Tensor]] = {}
        for key, tensor in state.optimiser.items():
            index, _, name = key.partition(".")
            moments.setdefault(int(index), {})[name] = tensor
        groups = self._optimiser.state_dict()["param_groups"]
        self._optimiser.load_state_dict({"state": moments, "param_groups": groups})

        # other processes count their own share of the epoch anew
        self._tally.sums = (
            state.sums.to(self._device)
            if self.ranks.rank == 0
            else torch.zeros_like(self._tally.sums)
        )


@contextmanager
def _drop_out_by(seed: int, epoch: int, position: int, *, device: torch.device) -> Iterator[None]:
    """Draw drop-out from the batch's own key.

    So a resumed run and any number of processes draw the same.
    """
    key = int(np.random.SeedSequence((seed, epoch, position)).generate_state(1, np.uint64)[0] >> 1)
    with torch.random.fork_rng(devices=[device] if device.type == "cuda" else []):
        torch.manual_seed(key)
        yield
