"""The training loop on a tiny made-up world: it learns, stops, goes on as if nothing had been."""

import copy
import errno
import os
import threading

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from mcpseg_cli.config import TrainSettings
from mcpseg_cli.errors import StateError, StateInUseError, TrainingError, WeightsError
from mcpseg_cli.networks.description import WeightsInfo
from mcpseg_cli.networks.weights import Weights, build_network
from mcpseg_cli.resumable import exclusive
from mcpseg_cli.train.batches import Batch
from mcpseg_cli.train.checkpoint import read_checkpoint, write_checkpoint
from mcpseg_cli.train.fine_tuning import adopt
from mcpseg_cli.train.objective import TensorBatch
from mcpseg_cli.train.prefetch import ahead
from mcpseg_cli.train.ranks import Ranks
from mcpseg_cli.train.schedule import balance, learning_rate
from mcpseg_cli.train.scores import Outcome, Tally, nearest_is_of_same_object
from mcpseg_cli.train.trainer import Trainer

NUM_CLASSES = 4
CLASSES = tuple("abcd")
ARCHITECTURES = ["mcpnet", "mcpnet-nocontext", "pointnet", "pointnet2", "sgpn", "voxnet"]


class World:
    """Batches of four objects, each of its own class, colour and place."""

    def __init__(self, num_batches=13, num_points=48, with_context=True, seed=0, broken=False):
        self.num_batches, self.num_points, self.seed = num_batches, num_points, seed
        self.with_context, self.broken = with_context, broken

    def __len__(self):
        return self.num_batches

    def epoch(self, number, *, rank=0, world=1, start=0):
        for step in range(start, self.num_batches // world):
            yield self.batch(number, step * world + rank)

    def batch(self, number, position):
        return self.draw(np.random.default_rng((self.seed, number, position)))

    def draw(self, rng):
        instance = rng.integers(1, NUM_CLASSES + 1, self.num_points)
        semantic = np.where(rng.random(self.num_points) < 0.1, 255, instance - 1)
        places = np.random.default_rng(5).normal(size=(NUM_CLASSES + 1, 6))
        centre = places[instance] + rng.normal(0, 0.3, (self.num_points, 6))
        context = rng.normal(0, 0.3, (self.num_points, 6, 6)) if self.with_context else None
        if self.broken:
            centre[0] = np.nan
        return Batch(
            centre.astype(np.float32),
            None if context is None else context.astype(np.float32),
            semantic,
            instance,
        )


def make_trainer(
    world=None, validation=None, num_classes=NUM_CLASSES, ranks=None, class_weights=None, **changes
):
    settings = TrainSettings.model_validate({"epochs": 2, "learning_rate": 3e-3} | changes)
    info = WeightsInfo(architecture=settings.architecture, classes=CLASSES[:num_classes])
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(1)
        network = build_network(info)
    world = world or World(with_context=settings.architecture == "mcpnet")
    return Trainer(
        network, num_classes, settings, world, validation, ranks=ranks, class_weights=class_weights
    )


def finish(trainer: Trainer):
    """Train to the end; return the epochs' reports."""
    return [progress.finished for progress in trainer.run() if progress.finished is not None]


def assert_same_weights(first: Trainer, second: Trainer) -> None:
    for (name, one), other in zip(
        first.network.state_dict().items(), second.network.state_dict().values(), strict=True
    ):
        assert torch.equal(one, other), name


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_every_network_learns(architecture):
    with_context = architecture == "mcpnet"
    world = World(num_points=64, with_context=with_context)
    reports = finish(
        make_trainer(world, World(3, 64, with_context, seed=9), architecture=architecture, epochs=3)
    )
    assert reports[-1].train.loss < reports[0].train.loss
    assert reports[-1].validation.accuracy > 1.5 / NUM_CLASSES
    assert (reports[-1].validation.embedding_accuracy is not None) == (
        architecture in ("mcpnet", "sgpn") or "noc" in architecture
    )


@pytest.mark.parametrize("precision", ["fp32", "bf16"])
def test_both_precisions_learn(precision):
    reports = finish(make_trainer(precision=precision))
    assert reports[-1].train.class_loss < 0.8 * reports[0].train.class_loss


@pytest.mark.parametrize(
    ("architecture", "num_steps"), [("mcpnet", 1), ("mcpnet", 13), ("pointnet", 19), ("sgpn", 12)]
)
def test_an_interrupted_training_goes_on_bit_for_bit(architecture, num_steps, tmp_path):
    with_context = architecture == "mcpnet"
    changes = {
        "architecture": architecture,
        "schedule": "cosine",
        "warm_up": 0.5,
        "max_gradient": 1.0,
    }
    validation = World(2, with_context=with_context, seed=9)
    whole = make_trainer(validation=validation, **changes)
    reports = finish(whole)
    first = make_trainer(validation=validation, **changes)
    for _ in first.run(lambda: first.num_steps_done >= num_steps):
        pass
    assert first.num_steps_done < whole.num_steps_done
    write_checkpoint(tmp_path / "a.checkpoint", first.state(), {})
    second = make_trainer(validation=validation, **changes)
    torch.rand(3)  # whatever the rest of the program draws
    second.restore(read_checkpoint(tmp_path / "a.checkpoint", {}))
    finish(second)
    assert_same_weights(whole, second)
    assert [report.model_copy(update={"seconds": 0}) for report in second.curves] == [
        report.model_copy(update={"seconds": 0}) for report in reports
    ]
    assert all(
        torch.equal(second.best_network()[name], each)
        for name, each in whole.best_network().items()
    )


def test_a_stop_while_validating_leaves_a_state_to_go_on_from():
    whole, first = (
        make_trainer(validation=World(5, seed=9)),
        make_trainer(validation=World(5, seed=9)),
    )
    finish(whole)
    for _ in first.run(lambda: first._step == first.num_steps and not first.network.training):
        pass
    assert first.curves == []
    second = make_trainer(validation=World(5, seed=9))
    second.restore(copy.deepcopy(first.state()))
    finish(second)
    assert_same_weights(whole, second)


def test_training_leaves_the_random_numbers_of_the_program_alone():
    torch.manual_seed(4)
    expected = torch.rand(3)
    torch.manual_seed(4)
    finish(make_trainer(architecture="pointnet", epochs=1))
    assert torch.equal(torch.rand(3), expected)


def test_several_batches_a_step_average_their_gradients():
    world = World(2)
    one = make_trainer(world, batches_per_step=2, epochs=1)
    finish(one)
    other = make_trainer(world, epochs=1)
    other._learn([_tensors(batch) for batch in world.epoch(0)])
    assert one.num_steps == 1
    assert_same_weights(one, other)


def _tensors(batch: Batch) -> TensorBatch:
    return TensorBatch(
        *[
            torch.tensor(getattr(batch, name))
            for name in ("centre", "context", "semantic", "instance")
        ]
    )


def test_the_best_weights_are_kept_and_patience_ends_training():
    class Noise(World):
        def draw(self, rng):
            batch = super().draw(rng)
            return Batch(
                batch.centre,
                batch.context,
                rng.integers(0, NUM_CLASSES, self.num_points),
                batch.instance,
            )

    trainer = make_trainer(
        Noise(), Noise(4, seed=9), epochs=60, patience=2, best_by="loss", learning_rate=0.01
    )
    reports = finish(trainer)
    losses = [report.validation.loss for report in reports]
    assert len(reports) == trainer.best + 2 < 60
    assert losses[trainer.best - 1] == min(losses)
    last = trainer.network.state_dict()
    assert any(
        not torch.equal(tensor, last[name]) for name, tensor in trainer.best_network().items()
    )


def test_without_validation_the_last_weights_are_the_best():
    trainer = make_trainer()
    reports = finish(trainer)
    assert reports[-1].validation is None
    assert all(
        torch.equal(trainer.best_network()[name], each)
        for name, each in trainer.network.state_dict().items()
    )


def test_validation_comes_when_it_is_due_and_after_the_last_epoch():
    reports = finish(make_trainer(World(2), World(1), epochs=5, validate_every=2))
    assert [report.validation is not None for report in reports] == [False, True, False, True, True]


def test_an_epoch_ends_after_the_batches_asked_for():
    trainer = make_trainer(batches_per_epoch=5, epochs=1)
    assert [progress.num_steps for progress in trainer.run()] == [5]


def test_a_loss_that_is_no_number_ends_training_in_one_line():
    with pytest.raises(
        TrainingError, match=r"epoch 1: the loss is nan; expected a number; lower --lr"
    ):
        finish(make_trainer(World(broken=True)))


def test_no_batches_are_refused():
    with pytest.raises(TrainingError, match="1 batches"):
        finish(make_trainer(World(1), batches_per_step=2))


def test_fewer_held_out_batches_than_processes_are_refused():
    with pytest.raises(
        TrainingError, match="fewer held-out batches than the 3 processes; expected one for each"
    ):
        make_trainer(World(6), World(2), ranks=Ranks(0, 3))
    with pytest.raises(TrainingError, match="raise validation_batches"):
        make_trainer(World(6), World(6), ranks=Ranks(0, 3), validation_batches=2)


@pytest.mark.parametrize("part", ["learn", "validate"])
@pytest.mark.parametrize(
    "error", [MemoryError(), torch.cuda.OutOfMemoryError("CUDA out of memory. Tried"), None]
)
def test_a_lack_of_memory_ends_training_in_one_line(error, part, monkeypatch):
    trainer = make_trainer(validation=World(2))

    def evaluate(*_):
        if error is not None:
            raise error
        torch.empty(2**60, dtype=torch.uint8)

    monkeypatch.setattr(trainer._objective, "evaluate", evaluate)
    batches = [_tensors(batch) for batch in World(1).epoch(0)]
    work = {
        "learn": lambda: trainer._learn(batches),
        "validate": lambda: trainer._validate(trainer._validation, bool),
    }[part]
    with pytest.raises(
        TrainingError, match="out of memory; expected room for a batch; lower --batch-size"
    ):
        work()


def test_other_errors_of_torch_stay_what_they_are(monkeypatch):
    trainer = make_trainer()
    monkeypatch.setattr(trainer._objective, "evaluate", lambda *_: torch.ones(2) @ torch.ones(3))
    with pytest.raises(RuntimeError, match="size"):
        finish(trainer)


@given(st.integers(0, 999), st.sampled_from(["constant", "cosine"]), st.floats(0, 5))
def test_the_learning_rate_stays_between_nothing_and_its_peak(step, schedule, warm_up):
    settings = TrainSettings(epochs=100, learning_rate=0.1, schedule=schedule, warm_up=warm_up)
    assert 0 < learning_rate(step, 10, settings) <= 0.1


def test_the_learning_rate_rises_then_falls_along_a_cosine():
    settings = TrainSettings(epochs=10, learning_rate=1.0, schedule="cosine", warm_up=1)
    rates = [learning_rate(step, 10, settings) for step in (0, 4, 9, 10, 55, 99)]
    assert rates == pytest.approx([1 / 11, 5 / 11, 10 / 11, 1.0, 0.5, 0.0], abs=1e-3)
    assert learning_rate(10**6, 10, TrainSettings(learning_rate=0.5)) == 0.5


def test_rare_classes_weigh_more():
    class Two(World):
        def draw(self, rng):
            batch = super().draw(rng)
            semantic = np.where(np.arange(self.num_points) < self.num_points // 4, 0, 1)
            return Batch(batch.centre, batch.context, semantic, batch.instance)

    weights = balance(Two(), 3).tolist()
    assert weights[0] / weights[1] == pytest.approx(3**0.5)
    assert 0.25 * weights[0] + 0.75 * weights[1] == pytest.approx(1)
    assert weights[2] == 1


def test_scores_equal_those_counted_point_by_point():
    rng = np.random.default_rng(0)
    tally = Tally(NUM_CLASSES, torch.device("cpu"))
    true, predicted = rng.integers(0, 3, 200), rng.integers(0, NUM_CLASSES, 200)
    true[::7] = 255
    instance = rng.integers(0, 5, 200)
    embedding = torch.nn.functional.normalize(
        torch.tensor(rng.normal(size=(200, 8)).astype(np.float32)), dim=1
    )
    for part in (slice(0, 120), slice(120, 200)):
        logits = torch.nn.functional.one_hot(torch.tensor(predicted[part]), NUM_CLASSES).float()
        objects = torch.tensor(instance[part])
        has_object = objects > 0
        right = nearest_is_of_same_object(embedding[part][has_object], objects[has_object])
        outcome = Outcome(torch.tensor([1.0, 2.0, 0.0]), logits, right)
        tally.add(outcome, torch.tensor(3.0), torch.tensor(true[part]))
    scores = tally.scores()
    known = true != 255
    iou = [
        (known & (true == c) & (predicted == c)).sum()
        / (known & ((true == c) | (predicted == c))).sum()
        for c in range(3)
    ]
    assert scores.accuracy == pytest.approx((true == predicted)[known].mean())
    assert scores.iou == (*[pytest.approx(value) for value in iou], None)
    assert scores.miou == pytest.approx(np.mean(iou))
    assert (scores.loss, scores.class_loss, scores.instance_loss) == (3, 1, 2)
    assert scores.embedding_accuracy == pytest.approx(
        embedding_accuracy(embedding.numpy(), instance)
    )


def embedding_accuracy(embedding, instance):
    """The slow twin of what a tally counts, for the two batches above."""
    right = []
    for part in (slice(0, 120), slice(120, 200)):
        rows, objects = embedding[part][instance[part] > 0], instance[part][instance[part] > 0]
        for i in range(len(rows)):
            distance = ((rows[i] - rows) ** 2).sum(axis=1)
            distance[i] = np.inf
            right.append(objects[distance.argmin()] == objects[i])
    return np.mean(right)


def test_a_single_point_has_no_neighbour():
    assert len(nearest_is_of_same_object(torch.ones(1, 3), torch.ones(1))) == 0


def test_drawing_ahead_keeps_the_order():
    with ahead(iter(range(50)), 3) as items:
        assert list(items) == list(range(50))


def test_drawing_ahead_hands_errors_on():
    def broken():
        yield 1
        raise ValueError("no more")

    with ahead(broken(), 3) as items:
        assert next(items) == 1
        with pytest.raises(ValueError, match="no more"):
            next(items)


def test_leaving_early_ends_the_thread():
    before = threading.active_count()
    with ahead(iter(range(10**9)), 2) as items:
        assert next(items) == 0
    assert threading.active_count() == before


def test_a_checkpoint_of_other_settings_is_refused_with_their_names(tmp_path):
    path = tmp_path / "a.checkpoint"
    write_checkpoint(
        path,
        make_trainer().state(),
        {"settings": {"learning_rate": 0.1, "seed": 1}, "classes": ["a"]},
    )
    with pytest.raises(
        StateError, match=r"made with --lr 0\.1, now 0\.2; expected the same.*--overwrite"
    ):
        read_checkpoint(path, {"settings": {"learning_rate": 0.2, "seed": 1}, "classes": ["a"]})


def test_settings_without_an_option_are_named_by_their_place_in_the_settings_file(tmp_path):
    path = tmp_path / "a.checkpoint"
    kept = {"settings": {"warm_up": 0.1}, "augmentation": {"grey": 0.5}, "class_table": {"a": "b"}}
    asked = {"settings": {"warm_up": 0}, "augmentation": {"grey": 0}, "class_table": {"a": "c"}}
    write_checkpoint(path, make_trainer().state(), kept)
    with pytest.raises(StateError) as caught:
        read_checkpoint(path, asked)
    assert "[train] warm_up 0.1, now 0, and [augment] grey 0.5, now 0" in str(caught.value)
    assert "and another class table; expected the same" in str(caught.value)


@pytest.mark.parametrize("damage", [b"", b"\x80\x04pickle", None])
def test_a_damaged_checkpoint_is_refused_in_one_line(damage, tmp_path):
    path = tmp_path / "a.checkpoint"
    write_checkpoint(path, make_trainer().state(), {})
    path.write_bytes(path.read_bytes()[:-100] if damage is None else damage)
    with pytest.raises(
        StateError, match=r"a\.checkpoint: not a checkpoint of this version, or damaged; expected"
    ):
        read_checkpoint(path, {})


def test_a_flipped_bit_anywhere_in_a_checkpoint_is_refused(tmp_path):
    path, rng = tmp_path / "a.checkpoint", np.random.default_rng(0)
    write_checkpoint(path, make_trainer().state(), {"classes": ["a"]})
    data = path.read_bytes()
    header = 8 + int.from_bytes(data[:8], "little")
    places = [*rng.integers(8, header, 40), *rng.integers(header, len(data), 40)]
    for place in places:
        changed = bytearray(data)
        changed[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(changed)
        with pytest.raises(StateError):
            read_checkpoint(path, {"classes": ["a"]})


def test_a_full_disk_leaves_the_checkpoint_before(tmp_path, monkeypatch):
    path = tmp_path / "a.checkpoint"
    trainer = make_trainer()
    write_checkpoint(path, trainer.state(), {})
    before = path.read_bytes()

    def full(_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("os.fsync", full)
    finish(trainer)
    with pytest.raises(OSError, match=r"No space left.*a\.checkpoint"):
        write_checkpoint(path, trainer.state(), {})
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["a.checkpoint"]


def test_only_one_process_may_write(tmp_path):
    with exclusive(tmp_path, "a.lock"):
        with (
            pytest.raises(StateInUseError, match="another mcpseg is writing there"),
            exclusive(tmp_path, "a.lock"),
        ):
            pass
        assert (tmp_path / "a.lock").exists()
    assert not (tmp_path / "a.lock").exists()


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_fine_tuning_keeps_what_both_class_tables_name(architecture):
    old = WeightsInfo(architecture=architecture, classes=("wall", "floor", "chair"))
    new = WeightsInfo(architecture=architecture, classes=("floor", "lamp", "wall", "plant"))
    weights, network = Weights(build_network(old), old, "", "old"), build_network(new)
    fresh = copy.deepcopy(network)
    assert adopt(network, new, weights) == ["lamp", "plant"]
    before, after, first = (each.state_dict() for each in (weights.network, network, fresh))
    heads = [name for name in after if after[name].shape != before[name].shape]
    assert len(heads) == 2
    for name in after:
        if name not in heads:
            assert torch.equal(after[name], before[name])
            continue
        assert torch.equal(after[name][[0, 2]], before[name][[1, 0]])
        assert torch.equal(after[name][[1, 3]], first[name][[1, 3]])


def test_weights_of_another_network_are_refused():
    old = WeightsInfo(architecture="voxnet", classes=CLASSES)
    new = WeightsInfo(architecture="mcpnet", classes=CLASSES)
    with pytest.raises(
        WeightsError, match=r"--weights old: voxnet; expected mcpnet; .*--net voxnet"
    ):
        adopt(build_network(new), new, Weights(build_network(old), old, "", "old"))
