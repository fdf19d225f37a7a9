"""What ``mcpseg train`` does, fold by fold, and what people see of it."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import typer

from mcpseg_cli.cli.compiling import told_of_compiling
from mcpseg_cli.cli.display import notice, plain, print_table, progress_bar
from mcpseg_cli.cli.interrupt import Interrupt
from mcpseg_cli.cli.options import number_of_jobs
from mcpseg_cli.config import CheckpointSettings, TrainSettings
from mcpseg_cli.errors import FULL, OutputError
from mcpseg_cli.networks.device import find_device
from mcpseg_cli.networks.weights import Weights
from mcpseg_cli.resumable import exclusive
from mcpseg_cli.train.fold_data import DataSettings, fold_data, prepare
from mcpseg_cli.train.folder import TrainFiles, TrainRecord
from mcpseg_cli.train.folds import Area, Fold
from mcpseg_cli.train.progress import EpochReport, Progress
from mcpseg_cli.train.ranks import Ranks, joined
from mcpseg_cli.train.run import TrainRequest, TrainRun
from mcpseg_cli.train.samples import AreaSamples
from mcpseg_cli.train.scores import Scores
from mcpseg_cli.train.tensorboard_log import TensorBoardLog


@dataclass(frozen=True, kw_only=True)
class TaskOptions:
    """Options that do not change what is trained; as ``mcpseg train --help`` says."""

    resume: bool
    overwrite: bool
    checkpoint: CheckpointSettings
    tensorboard: Path | None
    quiet: bool
    as_json: bool
    command: tuple[str, ...]
    jobs: int | None = None


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
        self.settings, self.data, self.initial = settings, data, initial
        self.ranks, self.options = ranks, options
        own = f"cuda:{ranks.local}" if device == "cuda" and ranks.world > 1 else device
        self.device = find_device(own)

        # only the first process shows and writes
        self.is_first = ranks.rank == 0
        self.quiet = options.quiet or not self.is_first
        self.show_progress = not (self.quiet or options.as_json)

    def run(self, areas: Sequence[Area], folds: Sequence[tuple[Fold, TrainFiles]]) -> None:
        """Train every fold, one after the other, and print the results."""
        try:
            self._run(areas, folds)
        except OSError as error:
            begun = any(files.path("checkpoint").exists() for _, files in folds)
            if error.errno not in FULL or self.options.resume or not begun:
                raise
            raise OutputError(
                f"{error.filename}: {error.strerror}; expected room on the disk; make space and "
                "run the same command with --resume, the last checkpoint is kept"
            ) from error

    def _run(self, areas: Sequence[Area], folds: Sequence[tuple[Fold, TrainFiles]]) -> None:
        """Train every fold, see ``run``."""
        with ExitStack() as stack:
            stack.enter_context(told_of_compiling(quiet=not self.show_progress))

            # nobody else writes these files, and nothing there is lost
            if self.is_first:
                for _, files in folds:
                    files.check(resume=self.options.resume, overwrite=self.options.overwrite)
                    stack.enter_context(exclusive(files.folder, files.path("lock").name))
            stack.enter_context(joined(self.ranks, self.device))

            # what cannot be trained is refused before anything is
            used = {area for fold, _ in folds for area in (*fold.training, *fold.validation)}
            prepared = self.prepare([area for area in areas if area in used])
            runs = [self._make_run(fold, files, prepared) for fold, files in folds]
            if self.options.overwrite and self.is_first:
                for _, files in folds:
                    files.clear()
            self.ranks.wait()

            # fold by fold, until asked to stop
            interrupt = stack.enter_context(Interrupt(is_patient=self.ranks.world > 1))
            records = []
            for run in runs:
                records += self._train(run, interrupt)
                if not run.is_complete:
                    break
            self.ranks.wait()  # ended with its last thread, a process is now and then aborted

        if self.is_first:
            self._print(records, folds[0][1].folder)
        if not run.is_complete:
            self._say_how_to_continue(run)
            raise typer.Exit(130)

    def prepare(self, areas: Sequence[Area]) -> Mapping[Area, AreaSamples]:
        """Prepare samples under a progress bar, in the first process; the others find them.

        Args:
            areas: Those whose samples are needed.

        Raises:
            McpsegError: An area that cannot be used.
            OSError: A file cannot be read, or the disk is full.
        """
        if not self.is_first:
            self.ranks.wait()

        with progress_bar("prepare samples", quiet=not self.show_progress) as bar:
            task = bar.add_task("", total=None, state="")

            def progress(name: str, done: int, total: int) -> None:
                bar.update(task, completed=done, total=total, state=plain(f"scans  {name}"))

            prepared = prepare(areas, self.data, progress)

        if self.is_first:
            self.ranks.wait()
        return prepared

    def _make_run(
        self, fold: Fold, files: TrainFiles, prepared: Mapping[Area, AreaSamples]
    ) -> TrainRun:
        """Check that a fold can be trained, and get it ready; nothing is changed."""
        request = TrainRequest(self.settings, self.data, fold, self.initial, self.options.command)
        data = fold_data(fold, prepared, self.data, self.settings)

        # one process trains, the other cores draw for it where a device learns faster than they
        on_device, cores = self.device.type != "cpu", number_of_jobs(self.options.jobs)
        return TrainRun(
            files, request, data, self.device, self.ranks, anew=self.options.overwrite,
            workers=max(cores // self.ranks.world - 1, 0) if on_device else 0,
        )  # fmt: skip

    def _train(self, run: TrainRun, interrupt: Interrupt) -> list[TrainRecord]:
        """Train one fold; return its record, in the first process."""
        if run.record is not None:
            path = run.files.path("safetensors")
            notice(f"mcpseg: {path}: nothing to do: trained to the end", quiet=self.quiet)
            return [run.record]

        # what was found
        first = len(run.trainer.curves) + 1
        if run.new_classes:
            new = ", ".join(run.new_classes)
            notice(f"mcpseg: classes that start afresh: {new}", quiet=self.quiet)
        if run.has_resumed:
            notice(f"mcpseg: {run.files.name}: continuing in epoch {first}", quiet=self.quiet)

        with ExitStack() as stack:
            log = None
            if self.options.tensorboard is not None and self.is_first:
                folder = self.options.tensorboard / run.files.name
                log = stack.enter_context(TensorBoardLog(folder, first))
            self._follow(run, log, interrupt)
        if not self.is_first:
            return []
        return [run.write_results(keep_checkpoint=self.options.checkpoint.keep)]

    def _follow(self, run: TrainRun, log: TensorBoardLog | None, interrupt: Interrupt) -> None:
        """Train under a progress bar; a line for every epoch."""
        name, epochs = run.files.name, self.settings.epochs
        per_step = self.settings.batches_per_step * self.ranks.world
        started, before = perf_counter(), run.trainer.num_steps_done
        total = epochs * run.trainer.num_steps

        with progress_bar(f"train {name}", quiet=not self.show_progress) as bar:
            task = bar.add_task("", total=total, completed=before, state="")
            for progress in run.run(self.options.checkpoint.minutes, lambda: interrupt.asked):
                done = (progress.epoch - 1) * progress.num_steps + progress.step
                rate = (done - before) * per_step / (perf_counter() - started)
                state = _state(progress, epochs, rate, run.batch_size)
                bar.update(task, completed=done, state=state)

                if progress.finished is not None:
                    line = _epoch_line(name, progress.finished)
                    notice(line, quiet=self.quiet, console=bar.console)
                    if log is not None:
                        log.add(progress.finished)

    def _say_how_to_continue(self, run: TrainRun) -> None:
        words = [word for word in self.options.command if word not in ("--overwrite", "--resume")]
        again, epochs = shlex.join([*words, "--resume"]), len(run.trainer.curves)
        if self.is_first:
            notice(f"mcpseg: interrupted after {epochs} epochs; continue with: {again}")

    def _print(self, records: Sequence[TrainRecord], folder: Path) -> None:
        """Print the results of all folds."""
        if self.options.as_json:
            documents = [record.model_dump(mode="json") for record in records]
            typer.echo(json.dumps(documents[0] if len(documents) == 1 else documents))
        if self.options.as_json or self.options.quiet:
            return

        for record in records:
            if record.epochs > 0:  # else there are no weights yet
                print_table(_rows(record, folder))
        if len(records) > 1:
            held_out = [record.validation for record in records if record.validation]
            accuracy = _mean([scores.accuracy for scores in held_out])
            miou = _mean([scores.miou for scores in held_out])
            print_table([("mean of folds", f"class accuracy {accuracy}, mIoU {miou}")])


def _state(progress: Progress, epochs: int, rate: float, batch_size: int) -> str:
    """Say where training is, in the width of a line."""
    scores = progress.scores
    parts = [  # the first ones stay on a narrow terminal
        f"epoch {progress.epoch}/{epochs}",
        f"loss {scores.loss:.3f}",
        f"class {scores.accuracy:.1%}",
        *_embedding(scores),
        f"{rate:.1f} batches/s",
        f"{rate * batch_size:,.0f} points/s",
    ]
    return "  ".join(parts)


def _epoch_line(name: str, report: EpochReport) -> str:
    """Sum one epoch up."""
    train, scores = report.train, report.validation
    parts = [f"loss {train.loss:.3f}", f"class {train.accuracy:.1%}", *_embedding(train)]
    line = f"mcpseg: {name}: epoch {report.epoch}: {', '.join(parts)}"

    if scores is not None:
        parts = [f"loss {scores.loss:.3f}", f"class {scores.accuracy:.1%}"]
        parts += [f"mIoU {scores.miou or 0:.1%}", *_embedding(scores)]
        line += f"; held out: {', '.join(parts)}"
    return f"{line}; {report.seconds:.0f} s"


def _embedding(scores: Scores) -> list[str]:
    """Say how good the embedding is, where there is one."""
    accuracy = scores.embedding_accuracy
    return [] if accuracy is None else [f"embedding {accuracy:.1%}"]


def _rows(record: TrainRecord, folder: Path) -> list[tuple[str, str]]:
    """Lay a record out as the rows of a table."""
    rows = [("weights", str(folder / f"{record.name}.safetensors"))]
    rows.append(("epoch", f"{record.best_epoch} of {record.epochs}"))

    # of what was held out, else of what was trained on
    scores = record.validation or record.train
    if scores is not None:
        where = "held out" if record.validation else "training"
        values = {
            "loss": scores.loss,
            "class accuracy": scores.accuracy,
            "mIoU": scores.miou,
            "embedding accuracy": scores.embedding_accuracy,
        }
        known = {label: value for label, value in values.items() if value is not None}
        rows += [(f"{label}, {where}", f"{value:.4f}") for label, value in known.items()]
    return [*rows, ("time", f"{record.seconds} s"), ("sha256", str(record.sha256))]


def _mean(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{sum(known) / len(known):.4f}" if known else "unknown"
