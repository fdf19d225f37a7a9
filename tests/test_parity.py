"""Parity with the MCPNet authors' program: weights, network outputs, results on a building."""

import numpy as np
import pytest
import torch

from mcpseg_cli.evaluate.run import evaluate_run
from mcpseg_cli.networks.tensor_bundle import import_checkpoint
from tests.commands import invoke

_CHECKPOINTS = {
    "mcpnet_1": "mcpnet_model_s3dis_1",
    "mcpnet_5": "mcpnet_model_s3dis_5",
    "mcpnet_simple_5": "mcpnet_simple_model_s3dis_5",
}


@pytest.mark.parametrize("name", _CHECKPOINTS)
def test_network_outputs_equal_the_authors(shared_folder, name):
    answers = np.load(shared_folder / "reference/forward_parity.npz", allow_pickle=False)
    network, _ = import_checkpoint(
        shared_folder / f"reference/checkpoints/{_CHECKPOINTS[name]}.ckpt"
    )
    context = torch.from_numpy(answers["context"]) if network.traits.needs_context else None
    with torch.inference_mode():
        embedding, logits = network(torch.from_numpy(answers["center"]), context)
    np.testing.assert_allclose(embedding.numpy(), answers[f"{name}_embedding"], rtol=0, atol=1e-4)
    np.testing.assert_allclose(logits.numpy(), answers[f"{name}_logits"], rtol=0, atol=1e-4)


def test_voxnet_outputs_equal_the_authors(shared_folder):
    answers = np.load(shared_folder / "reference/forward_parity.npz", allow_pickle=False)
    network, info = import_checkpoint(
        shared_folder / "reference/checkpoints/voxnet_model_s3dis_5.ckpt"
    )
    assert info.architecture == "voxnet"
    with torch.inference_mode():
        _, logits = network(torch.from_numpy(answers["voxnet_points"]))
    np.testing.assert_allclose(logits.numpy(), answers["voxnet_5_logits"], rtol=0, atol=1e-4)


def segment_building(shared_folder, tmp_path, model: str, precision: str) -> None:
    checkpoint = shared_folder / f"reference/checkpoints/{model}.ckpt"
    weights, building = tmp_path / "authors.safetensors", shared_folder / "reference/building"
    scans, poses, out = building / "scans", building / "poses.csv", tmp_path / precision
    options = ["--floor", "scan-min", "--precision", precision, "-q"]
    for words in (
        ["import-weights", checkpoint, "-o", weights, "--overwrite"],
        ["segment", scans, poses, "-o", out, "-w", weights, *options],
    ):
        result = invoke(*words)
        assert result.exit_code == 0, result.stderr


@pytest.mark.parametrize(
    ("model", "accuracy", "nmi", "instances"),
    [
        ("mcpnet_model_s3dis_5", 0.784, 0.862, 1016),
        ("mcpnet_model_s3dis_1", 0.748, 0.874, 793),
        ("voxnet_model_s3dis_5", 0.503, 0.653, 600),
    ],
)
def test_results_on_the_building_are_the_authors(
    shared_folder, tmp_path, model, accuracy, nmi, instances
):
    segment_building(shared_folder, tmp_path, model, "fp32")
    scores = evaluate_run(tmp_path / "fp32", shared_folder / "reference/building/gt").document()
    assert scores["points"] == scores["covered"] == 26754
    assert scores["point_accuracy"] == pytest.approx(accuracy, abs=0.01)
    assert scores["nmi"] == pytest.approx(nmi, abs=0.015)
    assert scores["objects_pred"] == pytest.approx(instances, rel=0.10)


def test_bf16_labels_agree_with_fp32_on_99_voxels_of_100(shared_folder, tmp_path):
    from mcpseg_cli.formats import read_cloud

    segment_building(shared_folder, tmp_path, "mcpnet_model_s3dis_5", "fp32")
    segment_building(shared_folder, tmp_path, "mcpnet_model_s3dis_5", "bf16")
    exact = read_cloud(tmp_path / "fp32/map.ply").label("semantic")
    rough = read_cloud(tmp_path / "bf16/map.ply").label("semantic")
    assert (exact == rough).mean() >= 0.99


def test_the_authors_own_answers_score_what_they_reported(shared_folder, tmp_path):
    from mcpseg_cli.classes import MCPNET_CLASSES
    from mcpseg_cli.formats import Cloud, write_cloud

    answers = np.load(
        shared_folder / "reference/building/authors_mcpnet_5_voxels.npz", allow_pickle=False
    )
    columns = {axis: answers["xyz"][:, column] for column, axis in enumerate("xyz")}
    columns |= {"semantic": answers["semantic"], "instance": answers["instance"]}
    write_cloud(tmp_path / "authors.ply", Cloud(columns, MCPNET_CLASSES))
    scores = evaluate_run(
        tmp_path / "authors.ply", shared_folder / "reference/building/gt"
    ).document()

    # to the digits that they gave
    assert scores["point_accuracy"] == pytest.approx(0.784, abs=0.0005)
    assert scores["nmi"] == pytest.approx(0.862, abs=0.0005)
    assert scores["ami"] == pytest.approx(0.8540152492094166, abs=1e-9)
    assert scores["ari"] == pytest.approx(0.749, abs=0.0005)
    assert scores["miou_present"] == pytest.approx(0.564, abs=0.0005)
    assert (scores["objects_pred"], scores["objects_true"]) == (1016, 51)
