"""Options that become settings: what cannot be is named as it was typed."""

import pytest
import typer

from mcpseg_cli.cli.settings import settings_of
from mcpseg_cli.config import RaytraceSettings, SegmentSettings


def test_what_is_not_given_has_its_default_or_comes_from_before():
    given = {"voxel_size": 0.2, "local_range": None, "seed": None}
    settings = settings_of(SegmentSettings, given, before={"local_range": 3.0, "seed": 4})
    assert settings == SegmentSettings(voxel_size=0.2, local_range=3.0, seed=4)
    assert settings_of(SegmentSettings, {"floor": "0.25"}).floor == 0.25


def test_what_is_given_wins():
    assert settings_of(SegmentSettings, {"seed": 5}, before={"seed": 4}).seed == 5


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"local_range": -1.0}, "--range: Input should be greater than 0"),
        ({"voxel_size": 0.0}, "--voxel-size: Input should be greater than or equal to 0.01"),
        ({"floor": "cellar"}, "--floor: Input should be 'map' or 'scan-min'"),
        ({"similarity": float("nan")}, "--similarity: Input should be a finite number"),
    ],
)
def test_a_value_that_cannot_be_is_named_by_its_option(given, said):
    with pytest.raises(typer.BadParameter, match="^" + said):
        settings_of(SegmentSettings, given)


def test_options_that_contradict_each_other_are_both_named():
    given = {"lowest_deg": 50.0, "highest_deg": 20.0}
    with pytest.raises(typer.BadParameter, match=r"^--v-min must be below --v-max$"):
        settings_of(RaytraceSettings, given)
