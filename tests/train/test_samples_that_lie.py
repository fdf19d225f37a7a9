"""Prepared samples whose tables claim more rows than they have."""

import h5py
import pytest

from mcpseg_cli.config import SampleSettings
from mcpseg_cli.errors import InputError
from mcpseg_cli.train.samples import AreaSamples, prepare_samples
from tests.areas import write_area

SETTINGS = SampleSettings(seen_again=40)


def test_samples_that_claim_far_more_rows_than_they_have_are_made_anew(tmp_path):
    area = write_area(tmp_path / "area")
    path = prepare_samples(area, SETTINGS).path
    sound = path.read_bytes()
    with h5py.File(path, "r+") as file:
        file["context"].resize(10**12, axis=0)

    with pytest.raises(InputError, match=r"context promises [\d,]+ bytes"):
        AreaSamples(path)
    assert prepare_samples(area, SETTINGS).path.read_bytes() == sound
