"""Options of the command line become settings."""

import pytest
import typer

from mcpseg_cli.cli.options import settings_of
from mcpseg_cli.config import RaytraceSettings, SegmentSettings


def test_options_that_were_not_given_keep_their_default():
    settings = settings_of(SegmentSettings, {"voxel_size": 0.2, "similarity": None})
    assert settings == SegmentSettings(voxel_size=0.2)
    assert settings.model_fields_set == {"voxel_size"}


@pytest.mark.parametrize(
    ("model", "given", "said"),
    [
        (SegmentSettings, {"local_range": -1.0}, "--range: Input should be greater than 0"),
        (SegmentSettings, {"voxel_size": 0.0}, "--voxel-size: Input should be greater than"),
        (SegmentSettings, {"floor": "cellar"}, "--floor: Input should be 'map' or 'scan-min'"),
        (RaytraceSettings, {"lowest_deg": 5, "highest_deg": 0}, "--v-min must be below --v-max"),
    ],
)
def test_a_value_that_cannot_be_is_told_with_its_option(model, given, said):
    with pytest.raises(typer.BadParameter) as error:
        settings_of(model, given)
    assert error.value.message.startswith(said)
