"""HDF5 clouds: one compressed dataset for every attribute, among them ``xyz``, ``rgb`` (N, 3)."""

from __future__ import annotations

import h5py

from mcpseg_cli.formats.npz import joined_columns
from mcpseg_cli.formats.parts import CloudParts
from mcpseg_cli.formats.steady import SteadyFile

_CHUNK_ROWS = 1 << 16
_FORMAT = "mcpseg cloud 1"


def write_cloud_h5(file: SteadyFile, parts: CloudParts) -> None:
    """Write a cloud as HDF5; the class table becomes the attribute ``classes`` of the file.

    Args:
        file: Where to write.
        parts: The points.

    Raises:
        OSError: The disk is full.
    """
    start = 0
    with h5py.File(file, "w") as target:
        target.attrs["format"] = _FORMAT
        for cloud in parts:
            # datasets for all points, once the first are there
            if start == 0:
                target.attrs["classes"] = list(cloud.classes)
                for name, column in joined_columns(cloud).items():
                    shape = (len(parts), *column.shape[1:])
                    chunks = (min(_CHUNK_ROWS, len(parts)), *column.shape[1:])
                    target.create_dataset(
                        name, shape, column.dtype, chunks=chunks, compression="lzf", shuffle=True
                    )

            # the rows of this part
            for name, column in joined_columns(cloud).items():
                target[name][start : start + len(cloud)] = column
            start += len(cloud)
            file.check()
