"""Fit the temperature of weights that were trained before ``mcpseg train`` did so by itself.

    python examples/calibrate.py unet.safetensors data/ --holdout 9 -o calibrated.safetensors

The areas held out must be those that the weights have not seen; with the settings written beside
the weights (``--config``) windows are as they were in training.
"""

import argparse
import sys
from pathlib import Path

import torch

from mcpseg_cli.config import WINDOW_SAMPLES, SampleSettings
from mcpseg_cli.errors import InputError, McpsegError
from mcpseg_cli.networks.description import find_weights
from mcpseg_cli.networks.device import find_device
from mcpseg_cli.networks.weights import load_weights, save_weights
from mcpseg_cli.train.calibration import Calibration, calibrate
from mcpseg_cli.train.fold_data import DataSettings, prepare
from mcpseg_cli.train.folds import find_areas, make_folds
from mcpseg_cli.train.settings_file import SettingsFile, read_settings
from mcpseg_cli.train.windows import WindowSource


def calibrate_file(arguments: argparse.Namespace, device: torch.device) -> Calibration:
    """Write weights with their temperature.

    Raises:
        McpsegError: They see no windows, the data is damaged, or no voxel of it has a class.
    """
    weights = load_weights(find_weights(arguments.weights))
    if not weights.network.traits.sees_windows:
        expected = "a network that sees windows"
        raise InputError(arguments.weights, weights.info.architecture, expected, "leave it")
    file = read_settings(arguments.config) if arguments.config else SettingsFile()
    given = file.samples.model_dump(exclude_unset=True)
    samples = SampleSettings.model_validate(WINDOW_SAMPLES | given)
    data = DataSettings(samples, file.augment, file.windows, file.classes, arguments.cache)

    # windows of what is held out, as validation draws them
    (fold,) = make_folds(find_areas(arguments.data), str(arguments.holdout), arguments.data)
    prepared = prepare(fold.validation, data, lambda *_: None)
    size = file.train.batch_size or weights.network.traits.batch_size
    held_out = WindowSource(
        list(prepared.values()), weights.info.classes, data.mapping,
        windows_per_batch=size, settings=data.windows, augmentation=None, seed=file.train.seed,
    )  # fmt: skip

    found_out = calibrate(weights.network.to(device), held_out, device)
    if found_out is None:
        raise InputError(arguments.data, "no voxel of known class", "labelled areas", "check it")
    info = weights.info.model_copy(update={"temperature": found_out.temperature})
    save_weights(arguments.output, weights.network, info)
    return found_out


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("weights", help="a .safetensors file, or the name of bundled weights")
    parser.add_argument("data", type=Path, help="ray-traced areas, as for mcpseg train")
    parser.add_argument("--holdout", type=int, required=True, help="number of the held-out areas")
    parser.add_argument("--config", type=Path, help="settings that the weights were trained with")
    parser.add_argument("--cache", type=Path, help="folder of prepared samples")
    parser.add_argument("-o", "--output", type=Path, required=True, help="weights to write")
    parser.add_argument("--device", default="cpu")

    arguments = parser.parse_args()
    try:
        made = calibrate_file(arguments, find_device(arguments.device))
    except McpsegError as error:
        sys.exit(f"calibrate: {error}")
    errors = f"calibration error {made.error_before:.4f} before, {made.error:.4f} after"
    print(f"{arguments.output}: temperature {made.temperature:g}, {errors}")


if __name__ == "__main__":
    main()
