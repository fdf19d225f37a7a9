"""Make the paper's tables I, II and III and its figure 5, from nothing or from S3DIS.

    python examples/reproduce_paper.py -o paper/ --quick    # minutes: small buildings, one epoch
    python examples/reproduce_paper.py -o paper/            # hours: six synthetic areas, fold 6
    python examples/reproduce_paper.py -o paper/ --s3dis Stanford3dDataset_v1.2 --folds all

Every step is an mcpseg command, printed before it runs; its result stays in the output folder, and
a step whose result is there is passed over: run the same command again to continue, with more
--folds or --methods to add to it. The tables are in results.md, table_1.csv to table_3.csv,
figure_5.csv and figure_5.png.

The output folder has data/Area_N (ray-traced), trained/NET-holdoutN.safetensors,
maps/METHOD-holdoutN.ply and results/METHOD-holdoutN.*.json (what segment and eval said); all
trainings have the settings of training.toml. Areas and weights made elsewhere can be put there
under these names.
"""

from __future__ import annotations

import argparse
import json
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from paper_tables import METHODS, write_report

_NETWORKS = [
    method for method in METHODS if method != "region-growing" and not method.endswith("-offline")
]
_ROOT = Path(__file__).parents[1]
_COLUMNS = "examples/complete_clouds.py"
_CONTEXT_POINTS = (0, 5, 10, 25, 50, 100)  # of figure 5
_SMALL_AREAS = 3  # the figure's networks learn from so many, in fewer scans
_SMALL_STEP = 2.5  # ... that are so much farther apart


@dataclass(frozen=True)
class Plan:
    """What to make, and of what.

    Attributes:
        output: Folder for everything.
        s3dis: Folder with S3DIS areas; None: synthetic ones.
        areas: Numbers of the areas.
        folds: Areas to hold out, one after the other.
        methods: Rows of the tables.
        rooms: Rooms of a synthetic area.
        step: Way between two scans, metres.
        noise: Standard deviation of the measured range, metres.
        epochs: Of training.
        batches: Of an epoch at most; None: one of every scan.
        context_points: Of the figure; empty: no figure.
    """

    output: Path
    s3dis: Path | None
    areas: tuple[int, ...]
    folds: tuple[int, ...]
    methods: tuple[str, ...]
    rooms: int
    step: float
    noise: float
    epochs: int
    batches: int | None
    context_points: tuple[int, ...]

    def settings(self) -> dict[str, object]:
        """Give what all results in one folder must have in common."""
        source = str(self.s3dis) if self.s3dis else f"synthetic, seed 1, {self.rooms} rooms"
        return {
            "source": source,
            "areas": list(self.areas),
            "step": self.step,
            "noise": self.noise,
            "epochs": self.epochs,
            "batches": self.batches,
        }

    @property
    def training(self) -> Path:
        """Where the settings are that all trainings have in common."""
        return self.output / "training.toml"


@dataclass(frozen=True)
class Step:
    """A command and how to know that it was done.

    Attributes:
        command: Words of the command line.
        done: Whether its result is there.
        result: File for what it prints on stdout; None: that is passed through.
    """

    command: tuple[str, ...]
    done: Callable[[], bool] = field(compare=False)
    result: Path | None = None

    def run(self) -> None:
        """Run the command, unless it was done."""
        line = shlex.join(self.command)
        if self.done():
            print(f"# done: {line}", flush=True)
            return
        print(line, flush=True)

        # as mcpseg, or a script beside this one
        program, *rest = self.command
        words = (
            ["-m", "mcpseg_cli", *rest]
            if program == "mcpseg"
            else [str(_ROOT / rest[0]), *rest[1:]]
        )
        stdout = subprocess.PIPE if self.result else None
        process = subprocess.run([sys.executable, *words], stdout=stdout, text=True, check=False)
        if process.returncode:
            raise SystemExit(
                f"{line}: exit {process.returncode}; run the same command again to continue"
            )

        # a result is there when it is whole
        if self.result:
            self.result.parent.mkdir(parents=True, exist_ok=True)
            unfinished = self.result.with_suffix(".part")
            unfinished.write_text(process.stdout)
            unfinished.replace(self.result)


def is_complete(record: Path) -> bool:
    """Tell whether a record of ray tracing or training says that it was not cut short."""
    return record.is_file() and bool(json.loads(record.read_text()).get("complete"))


def make_area(plan: Plan, number: int, folder: Path, step: float) -> list[Step]:
    """Ray-trace an area, of a building that is made first where there is no S3DIS."""
    is_traced = partial(is_complete, folder / "raytrace.json")
    building = (plan.s3dis or plan.output / "buildings") / f"Area_{number}"
    words = ["mcpseg", "raytrace", str(building), "-o", str(folder)]
    words += ["--step", f"{step:g}", "--noise", f"{plan.noise:g}"]
    words += ["--cache", str(plan.output / "cache" / "buildings")]
    steps = [Step(tuple(words), is_traced)]

    # where there is no S3DIS, a building is made first
    if plan.s3dis is None:
        synth = ("mcpseg", "synth", str(building), "--seed", "1", "--rooms", str(plan.rooms))
        steps.insert(0, Step(synth, is_traced))
    return steps


def training_settings(plan: Plan) -> str:
    """Write down what all trainings have in common, as ``mcpseg train --config`` takes it."""
    lines = [
        "[train]",
        f"epochs = {plan.epochs}",
        'schedule = "cosine"',
        "warm_up = 0.1",
        'precision = "bf16"',
        f"validation_batches = {min(300, plan.batches or 300)}",
    ]
    lines += [f"batches_per_epoch = {plan.batches}"] if plan.batches else []
    return "\n".join(lines) + "\n"


def train(
    plan: Plan, data: Path, net: str, fold: int, *options: str, name: str | None = None
) -> Step:
    """Train a network with one area held out."""
    folder = plan.output / "trained"
    weights = folder / f"{name or f'{net}-holdout{fold}'}.safetensors"

    def is_trained() -> bool:
        record = weights.with_suffix(".json")
        return weights.is_file() and (is_complete(record) or not record.exists())

    words = ["mcpseg", "train", str(data), "--holdout", str(fold), "--net", net]
    words += ["--config", str(plan.training), "--augment", "none", "-j", "1"]
    words += ["-o", str(folder), "--resume"]
    words += ["--name", name] if name else []
    return Step((*words, *options), is_trained)


def score(
    plan: Plan, data: Path, fold: int, method: str, weights: str | None, name: str
) -> list[Step]:
    """Label the area that was held out, and compare with the truth."""
    area, run = data / f"Area_{fold}", plan.output / "runs" / name
    segment, evaluation = (
        plan.output / "results" / f"{name}.{kind}.json" for kind in ("segment", "eval")
    )

    def is_labelled() -> bool:
        return segment.is_file() and (evaluation.is_file() or (run / "map.ply").is_file())

    # labelled scan by scan, or all at once
    words = ["mcpseg", "segment", str(area / "scans"), str(area / "poses.csv"), "-o", str(run)]
    words += ["--method", method.removesuffix("-offline")]
    words += ["-w", str(plan.output / "trained" / f"{weights}.safetensors")] if weights else []
    words += ["--offline"] * method.endswith("-offline")

    truth = ("mcpseg", "eval", str(run), str(area / "gt"), "--json")
    return [
        Step((*words, "--json"), is_labelled, segment),
        Step(truth, evaluation.is_file, evaluation),
    ]


def keep_map(plan: Plan, name: str) -> None:
    """Keep the map of a scored run and delete the rest, a copy of all scans among it."""
    run = plan.output / "runs" / name
    if run.is_dir():
        (plan.output / "maps").mkdir(exist_ok=True)
        shutil.copy(run / "map.ply", plan.output / "maps" / f"{name}.ply")
        shutil.rmtree(run)


def table_steps(plan: Plan) -> list[tuple[str | None, list[Step]]]:
    """List the steps to tables I, II and III; a name is that of a run which the steps score."""
    # areas
    data = plan.output / "data"
    steps: list[tuple[str | None, list[Step]]] = [
        (None, make_area(plan, number, data / f"Area_{number}", plan.step)) for number in plan.areas
    ]

    # every method trained on all areas but one, and scored on that
    for fold in plan.folds:
        for method in plan.methods:
            name = f"{method}-holdout{fold}"
            training = list(train_method(plan, method, fold, name))
            weights = name if training else None
            steps.append((name, [*training, *score(plan, data, fold, method, weights, name)]))
    return steps


def train_method(plan: Plan, method: str, fold: int, name: str) -> Iterator[Step]:
    """List the steps to the weights of a method.

    Offline methods learn from the columns of complete clouds.
    """
    net, data = method.removesuffix("-offline"), plan.output / "data"
    if net not in _NETWORKS:
        return
    if net == method:
        yield train(plan, data, net, fold)
        return
    for number in plan.areas:
        area = plan.output / "offline" / f"Area_{number}"
        words = ("python", _COLUMNS, str(data / area.name), "-o", str(area))
        yield Step(words, partial(is_complete, area / "raytrace.json"))
    yield train(plan, plan.output / "offline", net, fold, name=name)


def figure_steps(plan: Plan) -> list[tuple[str | None, list[Step]]]:
    """List the steps to figure 5: MCPNet trained with more and more context points.

    On a smaller dataset, as in IV-A.
    """
    if not plan.context_points:
        return []

    # fewer areas, with fewer scans
    data, fold = plan.output / "small", plan.folds[-1]
    used = [number for number in plan.areas if number != fold][:_SMALL_AREAS]
    steps: list[tuple[str | None, list[Step]]] = [
        (None, make_area(plan, number, data / f"Area_{number}", plan.step * _SMALL_STEP))
        for number in [*used, fold]
    ]

    for count in plan.context_points:
        net, name = "mcpnet" if count else "mcpnet-nocontext", f"context{count}-holdout{fold}"
        options = ["--context", str(count)] if count else []
        options += ["--cache", str(plan.output / "cache" / f"context{count}")]
        training = train(plan, data, net, fold, *options, name=name)
        steps.append((name, [training, *score(plan, data, fold, net, name, name)]))
    return steps


def check_settings(plan: Plan) -> None:
    """Refuse a folder whose results were made of other data or in other ways; write how."""
    path = plan.output / "settings.json"
    if path.is_file() and json.loads(path.read_text()) != plan.settings():
        raise SystemExit(
            f"{path}: made with other settings; expected {plan.settings()}; choose another -o"
        )
    plan.output.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(plan.settings(), indent=1) + "\n")
    plan.training.write_text(training_settings(plan))


def run(plan: Plan) -> None:
    """Do all steps and write the report."""
    check_settings(plan)
    steps = [*table_steps(plan), *figure_steps(plan)]
    for name, parts in steps:
        for step in parts:
            step.run()
        if name:
            keep_map(plan, name)

    # tables and figure, with the commands they come from
    commands = list(dict.fromkeys(shlex.join(step.command) for _, parts in steps for step in parts))
    report = write_report(
        plan.output, plan.methods, plan.folds, plan.context_points, plan.settings(), commands
    )
    print(report)


def numbers(text: str) -> tuple[int, ...]:
    """Read numbers with commas between them."""
    return tuple(int(part) for part in text.split(",") if part.strip())


def read_plan(words: list[str] | None = None) -> Plan:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("-o", "--output", type=Path, default=Path("paper"), help="folder for everything")
    add("--s3dis", type=Path, help="folder with Area_1 to Area_6; default: synthetic areas")
    add("--quick", action="store_true", help="small buildings, short training: poor scores")
    add("--areas", type=numbers, default=(1, 2, 3, 4, 5, 6), help="default: 1,2,3,4,5,6")
    add("--folds", default="6", help="areas to hold out, with commas, or all; default: 6")
    add("--methods", default=",".join(METHODS), help=f"default: {','.join(METHODS)}")
    add("--rooms", type=int, help="of a synthetic area; default: 16")
    add("--epochs", type=int, help="of training; default: 6")
    add("--batches", type=int, help="of an epoch at most; default: one of every scan")
    add("--context-points", type=numbers, help="of figure 5; default: 0,5,10,25,50,100; '': none")
    given = parser.parse_args(words)

    # what cannot work
    methods, unknown = tuple(given.methods.split(",")), set(given.methods.split(",")) - set(METHODS)
    if unknown:
        parser.error(
            f"--methods: {', '.join(sorted(unknown))}; expected some of {', '.join(METHODS)}"
        )
    folds = given.areas if given.folds == "all" else numbers(given.folds)
    if not set(folds) <= set(given.areas) or len(given.areas) < 2:
        parser.error("--folds: expected some of --areas, of which there are two or more")

    # a few minutes, or all there is to see
    step, rooms, epochs, batches, points = (
        (1.0, 4, 1, 300, (0, 10, 50)) if given.quick else (0.4, 16, 6, None, _CONTEXT_POINTS)
    )
    if given.s3dis:
        step = 1.0 if given.quick else 0.2  # metres; the latter is the paper's (III-A)
    return Plan(
        output=given.output,
        s3dis=given.s3dis,
        areas=given.areas,
        folds=folds,
        methods=methods,
        rooms=given.rooms or rooms,
        step=step,
        noise=0.0 if given.s3dis else 0.004,
        epochs=given.epochs or epochs,
        batches=given.batches or batches,
        context_points=points if given.context_points is None else given.context_points,
    )


def main() -> None:
    """Run the command line."""
    try:
        run(read_plan())
    except KeyboardInterrupt:
        raise SystemExit(130) from None


if __name__ == "__main__":
    main()
