"""``mcpseg import-weights``: the MCPNet authors' TensorFlow weights as safetensors."""

from pathlib import Path
from typing import Annotated

import typer

from mcpseg_cli.cli.options import OutputFile, Overwrite


def import_weights(
    checkpoint: Annotated[
        Path,
        typer.Argument(
            metavar="CHECKPOINT", help="TensorFlow checkpoint, e.g. mcpnet_model_s3dis_5.ckpt."
        ),
    ],
    output: OutputFile,
    overwrite: Overwrite = False,
) -> None:
    """Convert weights of the MCPNet authors.

    Reads a TensorFlow checkpoint of theirs, of MCPNet (with or without context) or VoxNet;
    TensorFlow is not needed.

    Example:
      mcpseg import-weights mcpnet_model_s3dis_5.ckpt -o area5.safetensors
    """
    from mcpseg_cli.errors import OutputError
    from mcpseg_cli.networks.tensor_bundle import import_checkpoint
    from mcpseg_cli.networks.weights import save_weights

    if output.suffix != ".safetensors":
        raise typer.BadParameter(f"{output}: weights files end in .safetensors")
    if output.exists() and not overwrite:
        raise OutputError(
            f"{output}: exists; expected a new file; choose another -o or give --overwrite"
        )

    # TensorFlow names a checkpoint without the ending of its files
    prefix = checkpoint.with_suffix("") if checkpoint.suffix == ".index" else checkpoint
    network, info = import_checkpoint(prefix)
    save_weights(output, network, info)
    typer.echo(f"{output}: {info.architecture}, {len(info.classes)} classes")
