"""Weights files and TensorFlow checkpoints."""

import hashlib
import json
import struct
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from mcpseg_cli.classes import HOME_CLASSES, MCPNET_CLASSES, S3DIS_CLASSES
from mcpseg_cli.errors import WeightsError
from mcpseg_cli.networks.description import WeightsInfo, find_weights
from mcpseg_cli.networks.tensor_bundle import import_checkpoint, read_tensor_bundle
from mcpseg_cli.networks.weights import (
    Architecture,
    StoredAs,
    build_network,
    load_weights,
    rounded_network,
    save_weights,
)

MODELS = Path(__file__).parents[2] / "models"
BUNDLED = sorted(MODELS.glob("*.safetensors"))


@pytest.mark.parametrize("architecture", get_args(Architecture))
def test_weights_come_back_with_everything_they_say(tmp_path, architecture):
    info = WeightsInfo(
        architecture=architecture,
        classes=S3DIS_CLASSES,
        context_window="coarse",
        num_context=20,
        notice="mind",
        training={"epochs": 3, "data": "rooms"},
    )
    network = build_network(info)
    save_weights(tmp_path / "w.safetensors", network, info)

    loaded = load_weights(tmp_path / "w.safetensors")
    assert loaded.info == info
    assert loaded.name == "w"
    assert not loaded.network.training
    for name, tensor in network.state_dict().items():
        torch.testing.assert_close(loaded.network.state_dict()[name], tensor, rtol=0, atol=0)


def test_the_hash_is_that_of_the_file(weights_path):
    expected = hashlib.sha256(weights_path.read_bytes()).hexdigest()
    assert load_weights(weights_path).sha256 == expected


@pytest.mark.parametrize("architecture", get_args(Architecture))
def test_tensors_that_do_not_fit_are_named_in_one_line(tmp_path, architecture):
    info = WeightsInfo(architecture=architecture, classes=S3DIS_CLASSES)
    tensors = build_network(info).state_dict()
    name = list(tensors)[-1]
    tensors[name] = torch.zeros(5)
    save_file(tensors, tmp_path / "w.safetensors", {"mcpseg": info.model_dump_json()})
    with pytest.raises(WeightsError, match=name.replace(".", r"\.")) as error:
        load_weights(tmp_path / "w.safetensors")
    assert "\n" not in str(error.value)


def test_the_tensors_of_another_network_are_refused(tmp_path):
    tensors = build_network(WeightsInfo(architecture="sgpn", classes=S3DIS_CLASSES)).state_dict()
    info = WeightsInfo(architecture="voxnet", classes=S3DIS_CLASSES)
    save_file(tensors, tmp_path / "w.safetensors", {"mcpseg": info.model_dump_json()})
    with pytest.raises(WeightsError, match="the tensors of voxnet"):
        load_weights(tmp_path / "w.safetensors")


@pytest.mark.parametrize("architecture", get_args(Architecture))
def test_weights_files_are_small(tmp_path, architecture):
    most = 6_000_000 if architecture == "unet" else 1_000_000  # bytes
    info = WeightsInfo(architecture=architecture, classes=S3DIS_CLASSES)
    save_weights(tmp_path / "w.safetensors", build_network(info), info)
    assert (tmp_path / "w.safetensors").stat().st_size < most


@pytest.mark.parametrize("architecture", get_args(Architecture))
def test_fp16_halves_a_file_and_is_read_as_the_rounded_network(tmp_path, architecture):
    info = WeightsInfo(architecture=architecture, classes=S3DIS_CLASSES)
    network = build_network(info)
    sizes = {}
    for kind in get_args(StoredAs):
        save_weights(tmp_path / f"{kind}.safetensors", network, info, kind)
        sizes[kind] = (tmp_path / f"{kind}.safetensors").stat().st_size
    assert sizes["fp16"] < 0.6 * sizes["fp32"]

    read = load_weights(tmp_path / "fp16.safetensors").network.state_dict()
    rounded = rounded_network(network, info, "fp16").state_dict()
    assert read.keys() == rounded.keys()
    for name, tensor in network.state_dict().items():
        assert torch.equal(read[name], rounded[name])
        assert torch.allclose(read[name], tensor.to(read[name].dtype), rtol=1e-3, atol=1e-6)


def test_numbers_too_large_for_fp16_are_refused_and_nothing_is_written(tmp_path):
    info = WeightsInfo(architecture="mcpnet", classes=S3DIS_CLASSES)
    network = build_network(info)
    with torch.no_grad():
        network.embed.weight[0, 0] = 1e5
    with pytest.raises(WeightsError, match=r"embed\.weight beyond the numbers of fp16"):
        save_weights(tmp_path / "w.safetensors", network, info, "fp16")
    assert not (tmp_path / "w.safetensors").exists()


def test_weights_with_nan_are_refused(tmp_path):
    info = WeightsInfo(architecture="mcpnet", classes=S3DIS_CLASSES)
    network = build_network(info)
    with torch.no_grad():
        network.embed.bias[3] = float("nan")
    save_file(network.state_dict(), tmp_path / "w.safetensors", {"mcpseg": info.model_dump_json()})
    with pytest.raises(WeightsError, match="NaN"):
        load_weights(tmp_path / "w.safetensors")


def test_safetensors_of_another_program_are_refused(tmp_path):
    save_file({"a": torch.zeros(1)}, tmp_path / "w.safetensors")
    with pytest.raises(WeightsError, match="no mcpseg description"):
        load_weights(tmp_path / "w.safetensors")


def test_an_unknown_architecture_is_named(tmp_path):
    description = {"architecture": "transformer", "classes": ["a", "b"]}
    save_file(
        {"a": torch.zeros(1)}, tmp_path / "w.safetensors", {"mcpseg": json.dumps(description)}
    )
    with pytest.raises(WeightsError, match="architecture"):
        load_weights(tmp_path / "w.safetensors")


@pytest.mark.parametrize("name", ["a,b", "a\nb", "a\x00"])
def test_class_names_that_break_headers_of_clouds_are_refused(name, tmp_path):
    description = {"architecture": "voxnet", "classes": [name, "c"]}
    save_file(
        {"a": torch.zeros(1)}, tmp_path / "w.safetensors", {"mcpseg": json.dumps(description)}
    )
    with pytest.raises(
        WeightsError, match=r"classes: .*a class named 'a.*expected up to 254 names"
    ) as error:
        load_weights(tmp_path / "w.safetensors")
    assert "\n" not in str(error.value)


def test_bundled_weights_are_found_by_name_and_unknown_names_list_them():
    assert find_weights("mcpnet").name == "mcpnet.safetensors"
    with pytest.raises(WeightsError, match="mcpnet"):
        find_weights("no-such-weights")


@pytest.mark.parametrize("path", BUNDLED, ids=lambda path: path.stem)
def test_bundled_weights_load_and_the_table_of_weights_tells_their_hash(path):
    weights = load_weights(path)
    named = HOME_CLASSES if path.stem == "unet-home" else S3DIS_CLASSES
    assert weights.info.classes == named
    row = next(
        line for line in (MODELS / "README.md").read_text().splitlines() if f"`{path.name}`" in line
    )
    assert weights.sha256 in row
    assert weights.sha256 in path.with_suffix(".md").read_text()


def varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])


def table_block(pairs: list[tuple[bytes, bytes]]) -> bytes:
    body = b"".join(
        varint(0) + varint(len(key)) + varint(len(value)) + key + value for key, value in pairs
    )
    return body + struct.pack("<II", 0, 1)


def write_bundle(prefix, tensors: dict[str, np.ndarray]) -> None:
    """Write a TensorBundle as TensorFlow lays it out: data file, and a one-block table as index."""
    data, entries = b"", [(b"", b"\x08\x01")]
    for name in sorted(tensors):
        array = tensors[name].astype("<f4")
        dimensions = b"".join(
            b"\x12" + varint(len(varint(size)) + 1) + b"\x08" + varint(size) for size in array.shape
        )
        value = b"\x08\x01" + b"\x12" + varint(len(dimensions)) + dimensions
        value += b"\x20" + varint(len(data)) + b"\x28" + varint(array.nbytes)
        entries.append((name.encode(), value))
        data += array.tobytes()

    # the table of entries, the table of tables, the footer
    block = table_block(entries)
    handle = varint(0) + varint(len(block))
    index = table_block([(b"z", handle)])
    trailer = b"\0" + b"\0" * 4
    footer = (varint(0) + varint(0) + varint(len(block) + 5) + varint(len(index))).ljust(40, b"\0")
    prefix.with_name(prefix.name + ".index").write_bytes(
        block + trailer + index + trailer + footer + struct.pack("<Q", 0xDB4775248B80FB57)
    )
    prefix.with_name(prefix.name + ".data-00000-of-00001").write_bytes(data)


def mcpnet_tensors(*, context: bool) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    shapes = {
        1: (1, 6, 200),
        2: (1, 200, 200),
        3: (206 if context else 6, 200),
        4: (200, 50),
        5: (250, 200),
        6: (200, 13),
    }
    tensors = {f"kernel{number}": rng.normal(size=shape) for number, shape in shapes.items()}
    tensors |= {f"bias{number}": rng.normal(size=shape[-1]) for number, shape in shapes.items()}
    return tensors | {"kernel1/Adam": np.zeros((1, 6, 200)), "beta1_power": np.zeros(())}


@pytest.mark.parametrize("context", [True, False])
def test_a_tensorflow_checkpoint_becomes_mcpnet_with_the_authors_classes_and_context(
    tmp_path, context
):
    tensors = mcpnet_tensors(context=context)
    write_bundle(tmp_path / "model.ckpt", tensors)
    network, info = import_checkpoint(tmp_path / "model.ckpt")
    assert (info.classes, info.context_window) == (MCPNET_CLASSES, "coarse")
    assert info.architecture == ("mcpnet" if context else "mcpnet-nocontext")
    np.testing.assert_allclose(
        network.embed.weight.detach().numpy(), tensors["kernel4"].T.astype(np.float32)
    )
    np.testing.assert_allclose(
        network.classify.bias.detach().numpy(), tensors["bias6"].astype(np.float32)
    )


def voxnet_tensors() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    shapes = {1: (5, 5, 5, 1, 32), 2: (3, 3, 3, 32, 32), 3: (38, 128), 4: (128, 13)}
    tensors = {f"kernel{number}": rng.normal(size=shape) for number, shape in shapes.items()}
    return tensors | {
        f"bias{number}": rng.normal(size=shape[-1]) for number, shape in shapes.items()
    }


def test_a_voxnet_checkpoint_becomes_voxnet(tmp_path):
    tensors = voxnet_tensors()
    write_bundle(tmp_path / "model.ckpt", tensors)
    network, info = import_checkpoint(tmp_path / "model.ckpt")
    assert (info.architecture, info.classes) == ("voxnet", MCPNET_CLASSES)
    kernel = network.convolve_2.weight.detach().numpy()  # (outputs, inputs, x, y, z)
    np.testing.assert_allclose(kernel[7, 3, 0, 1, 2], tensors["kernel2"][0, 1, 2, 3, 7], rtol=1e-6)
    np.testing.assert_allclose(
        network.hidden.weight.detach().numpy(), tensors["kernel3"].T.astype(np.float32)
    )


def test_a_voxnet_checkpoint_with_a_layer_missing_is_refused(tmp_path):
    tensors = voxnet_tensors()
    del tensors["kernel3"]
    write_bundle(tmp_path / "model.ckpt", tensors)
    with pytest.raises(WeightsError, match=r"kernel3 missing.*as VoxNet has"):
        import_checkpoint(tmp_path / "model.ckpt")


def test_optimizer_slots_are_passed_over(tmp_path):
    write_bundle(tmp_path / "model.ckpt", mcpnet_tensors(context=True))
    assert not any("/" in name for name in read_tensor_bundle(tmp_path / "model.ckpt"))


def test_a_checkpoint_of_another_network_is_refused(tmp_path):
    write_bundle(tmp_path / "model.ckpt", {"kernel1": np.zeros((64, 64)), "bias1": np.zeros(64)})
    with pytest.raises(WeightsError, match="as MCPNet has"):
        import_checkpoint(tmp_path / "model.ckpt")


@pytest.mark.parametrize("ending", [".index", ".data-00000-of-00001"])
def test_a_missing_half_of_a_checkpoint_is_named(tmp_path, ending):
    write_bundle(tmp_path / "model.ckpt", mcpnet_tensors(context=True))
    (tmp_path / f"model.ckpt{ending}").unlink()
    with pytest.raises(WeightsError, match=r"model\.ckpt"):
        import_checkpoint(tmp_path / "model.ckpt")


@pytest.mark.parametrize("ending", [".index", ".data-00000-of-00001"])
@pytest.mark.parametrize("keep", [0, 7, 100, 0.5, 0.99])
def test_a_cut_checkpoint_is_one_error_not_a_crash(tmp_path, ending, keep):
    write_bundle(tmp_path / "model.ckpt", mcpnet_tensors(context=True))
    path = tmp_path / f"model.ckpt{ending}"
    data = path.read_bytes()
    path.write_bytes(data[: int(keep * len(data)) if isinstance(keep, float) else keep])
    with pytest.raises(WeightsError):
        import_checkpoint(tmp_path / "model.ckpt")


def test_any_damaged_byte_of_the_index_is_an_error_or_harmless(tmp_path):
    write_bundle(tmp_path / "model.ckpt", mcpnet_tensors(context=True))
    path = tmp_path / "model.ckpt.index"
    data = path.read_bytes()
    refused = 0
    for position in range(len(data)):
        path.write_bytes(data[:position] + bytes([data[position] ^ 0x81]) + data[position + 1 :])
        try:
            import_checkpoint(tmp_path / "model.ckpt")
        except WeightsError:
            refused += 1
    assert refused > len(data) // 4
