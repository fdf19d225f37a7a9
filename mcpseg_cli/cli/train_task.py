"""What ``mcpseg train`` does, fold by fold, and what people see of it."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import typer

from mcpseg_cli.cli.display import notice, print_table, progress_bar
from mcpseg_cli.cli.interrupt import Interrupt
from mcpseg_cli.config import TrainSettings
from mcpseg_cli.networks.device import find_device
from mcpseg_cli.networks.weights import Weights
from mcpseg_cli.resumable import exclusive
from mcpseg_cli.train.batches import AreaSamples
from mcpseg_cli.train.fold_data import DataSettings, fold_data, prepare
from mcpseg_cli.train.folds import Area, Fold
from mcpseg_cli.train.progress import EpochReport, Progress
from mcpseg_cli.train.ranks import Ranks, joined
from mcpseg_cli.train.run import TrainFiles, TrainRequest, TrainRun
from mcpseg_cli.train.tensorboard_log import TensorBoardLog

if TYPE_CHECKING:
    from pydantic import JsonValue


@dataclass(frozen=True, kw_only=True)
class TaskOptions:
    """Options that do not change what is trained; as ``mcpseg train --help`` says."""

    resume: bool
    overwrite: bool
    keep_checkpoint: bool
    minutes: float
    tensorboard: Path | None
    quiet: bool
    as_json: bool
    command: tuple[str, ...]


class TrainTask:
    """What all folds of one command have in common.

    Args:
        settings: Network and numbers, batch size included.
        data: How scans become batches.
        initial: Weights to start from.
        ranks: The processes that share the work.
        device: As torch names it; several processes each take their own of its kind.
        options: The rest.
    """

    def __init__(
        self,
        settings: TrainSettings,
        data: DataSettings,
        initial: Weights | None,
        ranks: Ranks,
        device: str,
        options: TaskOptions,
    ) -> None:
        self.settings, self.data, self.initial, self.ranks, self.options = (
            settings,
            data,
            initial,
            ranks,
            options,
        )
        own = f"cuda:{ranks.local}" if device == "cuda" and ranks.world > 1 else device
        self.device = find_device(own)
        self.is_first = ranks.rank == 0
        self.quiet = options.quiet or not self.is_first
        self.show_progress = not (self.quiet or options.as_json)

    def run(self, areas: Sequence[Area], folds: Sequence[tuple[Fold, TrainFiles]]) -> None:
        """Train every fold, one after the other, and print the results."""
        with ExitStack() as stack:
            if self.is_first:
                for _, files in folds:
                    files.check(resume=self.options.resume, overwrite=self.options.overwrite)
                    stack.enter_context(exclusive(files.folder, files.path("lock").name))
            stack.enter_context(joined(self.ranks, self.device))
            used = [
                area
                for area in areas
                if any(area in (*fold.training, *fold.validation) for fold, _ in folds)
            ]
            prepared = self._prepare(used)
            runs = [
                self._make_run(fold, files, prepared) for fold, files in folds
            ]  # refuses what cannot be trained
            if self.options.overwrite and self.is_first:
                for _, files in folds:
                    files.clear()
            self.ranks.wait()
            interrupt = stack.enter_context(Interrupt(is_patient=self.ranks.world > 1))
            records = []
            for run in runs:
                records.append(self._train(run, interrupt))
                if not records[-1]["complete"]:
                    break
        if self.is_first:
            self._print(records, folds[0][1])
        if not records[-1]["complete"]:
            self._say_how_to_continue(records[-1])
            raise typer.Exit(130)

    def _prepare(self, areas: Sequence[Area]) -> Mapping[Area, AreaSamples]:
        """Prepare samples under a progress bar; other processes wait for the first, then find them prepared."""
        if not self.is_first:
            self.ranks.wait()
        with progress_bar("prepare samples", quiet=not self.show_progress) as bar:
            task = bar.add_task("", total=None, state="")

            def note(name: str, done: int, total: int) -> None:
                bar.update(task, completed=done, total=total, state=f"scans  {name}")

            prepared = prepare(areas, self.data, note)
        if self.is_first:
            self.ranks.wait()
        return prepared

    def _make_run(
        self, fold: Fold, files: TrainFiles, prepared: Mapping[Area, AreaSamples]
    ) -> TrainRun:
        """Check that a fold can be trained, and get it ready; nothing is changed."""
        request = TrainRequest(self.settings, self.data, fold, self.initial, self.options.command)
        data = fold_data(fold, prepared, self.data, self.settings)
        return TrainRun(files, request, data, self.device, self.ranks, anew=self.options.overwrite)

    def _train(self, run: TrainRun, interrupt: Interrupt) -> Mapping[str, JsonValue]:
        """Train one fold; return its record."""
        if run.record is not None:
            notice(
                f"mcpseg: {run.files.path('safetensors')}: nothing to do: trained to the end",
                quiet=self.quiet,
            )
            return run.record
        if run.new_classes:
            notice(
                f"mcpseg: classes that start afresh: {', '.join(run.new_classes)}", quiet=self.quiet
            )
        if run.has_resumed:
            notice(
                f"mcpseg: {run.files.name}: continuing in epoch {len(run.trainer.curves) + 1}",
                quiet=self.quiet,
            )
        with ExitStack() as stack:
            log = None
            if self.options.tensorboard is not None and self.is_first:
                first = len(run.trainer.curves) + 1
                log = stack.enter_context(
                    TensorBoardLog(self.options.tensorboard / run.files.name, first)
                )
            self._follow(run, log, interrupt)
        if self.is_first:
            return run.write_results(keep_checkpoint=self.options.keep_checkpoint)
        return {"complete": run.trainer.is_finished}

    def _follow(self, run: TrainRun, log: TensorBoardLog | None, interrupt: Interrupt) -> None:
        """Train under a progress bar; a line for every epoch."""
        epochs, per_step = self.settings.epochs, self.settings.batches_per_step * self.ranks.world
        started, first = perf_counter(), run.trainer.num_steps_done
        with progress_bar(f"train {run.files.name}", quiet=not self.show_progress) as bar:
            task = bar.add_task("", total=epochs * run.trainer.num_steps, completed=first, state="")
            for progress in run.run(self.options.minutes, lambda: interrupt.asked):
                done = (progress.epoch - 1) * progress.num_steps + progress.step
                rate = (done - first) * per_step / (perf_counter() - started)
                bar.update(
                    task, completed=done, state=_state(progress, epochs, rate, run.batch_size)
                )
                if progress.finished is not None:
                    notice(
                        _epoch_line(run.files.name, progress.finished),
                        quiet=self.quiet,
                        console=bar.console,
                    )
                    if log is not None:
                        log.add(progress.finished)

    def _say_how_to_continue(self, record: Mapping[str, JsonValue]) -> None:
        words = [word for word in self.options.command if word not in ("--overwrite", "--resume")]
        again = shlex.join([*words, "--resume"])
        if self.is_first:
            notice(f"mcpseg: interrupted after {record['epochs']} epochs; continue with: {again}")

    def _print(self, records: Sequence[Mapping[str, JsonValue]], files: TrainFiles) -> None:
        """Print the results of all folds."""
        if self.options.as_json:
            typer.echo(json.dumps(records[0] if len(records) == 1 else records))
            return
        for record in records:
            if record["epochs"] == 0:  # no weights yet
                continue
            print_table(_rows(record, files.folder))
        accuracies = [_score(record, "accuracy") for record in records]
        mious = [_score(record, "miou") for record in records]
        if len(records) > 1:
            print_table([
                ("mean of folds", f"class accuracy {_mean(accuracies)}, mIoU {_mean(mious)}"),
            ])  # fmt: skip


def _state(progress: Progress, epochs: int, rate: float, batch_size: int) -> str:
    """Say where training is, in the width of a line."""
    scores = progress.scores
    embedding = (
        "" if scores.embedding_accuracy is None else f"  embedding {scores.embedding_accuracy:.1%}"
    )
    return (
        f"epoch {progress.epoch}/{epochs}  loss {scores.loss:.3f}  class {scores.accuracy:.1%}{embedding}  "
        f"{rate:.1f} batches/s  {rate * batch_size:,.0f} points/s"
    )


def _epoch_line(name: str, report: EpochReport) -> str:
    """Sum one epoch up."""
    line = f"mcpseg: {name}: epoch {report.epoch}: loss {report.train.loss:.3f}, class {report.train.accuracy:.1%}"
    line += (
        ""
        if report.train.embedding_accuracy is None
        else f", embedding {report.train.embedding_accuracy:.1%}"
    )
    if (scores := report.validation) is not None:
        line += f"; held out: loss {scores.loss:.3f}, class {scores.accuracy:.1%}, mIoU {scores.miou or 0:.1%}"
        line += (
            ""
            if scores.embedding_accuracy is None
            else f", embedding {scores.embedding_accuracy:.1%}"
        )
    return f"{line}; {report.seconds:.0f} s"


def _rows(record: Mapping[str, JsonValue], folder: Path) -> list[tuple[str, str]]:
    """Lay a record out as the rows of a table."""
    held_out = record["validation"] is not None
    scores = record["validation"] if held_out else record["train"]
    rows = [("weights", str(folder / f"{record['name']}.safetensors"))]
    rows.append(("epoch", f"{record['best_epoch']} of {record['epochs']}"))
    if isinstance(scores, dict):
        where = "held out" if held_out else "training"
        names = {
            "loss": "loss",
            "accuracy": "class accuracy",
            "miou": "mIoU",
            "embedding_accuracy": "embedding accuracy",
        }
        values = [(label, scores[key]) for key, label in names.items()]
        rows += [
            (f"{label}, {where}", f"{value:.4f}")
            for label, value in values
            if isinstance(value, int | float)
        ]
    return [*rows, ("time", f"{record['seconds']} s"), ("sha256", str(record["sha256"]))]


def _score(record: Mapping[str, JsonValue], key: str) -> float | None:
    scores = record["validation"]
    value = scores[key] if isinstance(scores, dict) else None
    return float(value) if isinstance(value, int | float) else None


def _mean(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{sum(known) / len(known):.4f}" if known else "unknown"
