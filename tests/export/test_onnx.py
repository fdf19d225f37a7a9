"""Networks as ONNX: the same answers in onnxruntime, for any number of points."""

import json

import numpy as np
import pytest
import torch

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.errors import OutputError
from mcpseg_cli.export.onnx import write_onnx
from mcpseg_cli.networks.description import WeightsInfo
from mcpseg_cli.networks.weights import build_network, load_weights, save_weights

onnxruntime = pytest.importorskip("onnxruntime")
pytest.importorskip("onnxscript")


def weights_of(architecture, folder):
    info = WeightsInfo(architecture=architecture, classes=S3DIS_CLASSES)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(5)
        save_weights(folder / "some.safetensors", build_network(info), info)
    return load_weights(folder / "some.safetensors")


@pytest.mark.parametrize("architecture", ["mcpnet", "sgpn", "voxnet"])
def test_onnxruntime_answers_as_pytorch_does(architecture, tmp_path):
    weights = weights_of(architecture, tmp_path)
    assert write_onnx(weights, tmp_path / "model.onnx") < 1e-4
    session = onnxruntime.InferenceSession(tmp_path / "model.onnx")
    names = [item.name for item in session.get_inputs()]
    outputs = [item.name for item in session.get_outputs()]
    assert names == (["centre", "context"] if weights.network.traits.needs_context else ["centre"])

    # batches of sizes it was not traced with
    rng = np.random.default_rng(1)
    for num_points in (3, 300):
        shapes = {"centre": (num_points, 6), "context": (num_points, 50, 6)}
        inputs = {name: rng.normal(0, 0.4, shapes[name]).astype(np.float32) for name in names}
        found = dict(zip(outputs, session.run(None, inputs), strict=True))
        with torch.inference_mode():
            embedding, logits = weights.network(*map(torch.from_numpy, inputs.values()))
        np.testing.assert_allclose(found["logits"], logits.numpy(), atol=1e-4, rtol=1e-4)
        assert ("embedding" in found) == (embedding is not None)
        if embedding is not None:
            np.testing.assert_allclose(found["embedding"], embedding.numpy(), atol=1e-4)


def test_the_model_tells_its_classes_and_that_it_pools_over_a_call(tmp_path):
    write_onnx(weights_of("mcpnet-nocontext", tmp_path), tmp_path / "model.onnx")
    session = onnxruntime.InferenceSession(tmp_path / "model.onnx")
    facts = session.get_modelmeta().custom_metadata_map
    assert json.loads(facts["classes"]) == list(S3DIS_CLASSES)
    assert facts["batch_size"] == "256"
    assert "pools over all N points of a call" in facts["pooling_scope"]

    points = np.random.default_rng(0).normal(0, 1, (40, 6)).astype(np.float32)
    parts = (points, points[:20])
    whole, half = (session.run(["logits"], {"centre": part})[0][:20] for part in parts)
    assert np.abs(whole - half).max() > 1e-3


def test_a_network_that_onnx_cannot_tell_is_refused_in_one_line(tmp_path):
    for network, reason in (("pointnet2", "chooses points in a loop"), ("unet", "is given tables")):
        with pytest.raises(OutputError, match=rf"model.onnx: {network} {reason}"):
            write_onnx(weights_of(network, tmp_path), tmp_path / "model.onnx")


def test_without_onnx_it_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "onnxscript", None)
    with pytest.raises(OutputError, match=r"needs onnxscript.*pip install 'mcpseg\[onnx\]'"):
        write_onnx(weights_of("voxnet", tmp_path), tmp_path / "model.onnx")
