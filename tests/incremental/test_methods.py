"""What every method says of itself to the run that it labels."""

import json

import pytest

from mcpseg_cli.config import RegionGrowingSettings
from mcpseg_cli.errors import WeightsError
from mcpseg_cli.incremental.methods import open_method
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter


def test_a_network_says_its_name_its_weights_and_their_hash():
    weights = open_method("pointnet", None)
    method = IncrementalSegmenter(weights).method
    assert (method.name, method.weights) == ("pointnet", weights)
    assert method.classes == weights.info.classes
    assert method.configuration() == {"weights": weights.sha256}


def test_region_growing_says_its_numbers_and_has_neither_weights_nor_classes():
    growing = RegionGrowingSettings(max_angle_deg=20.0)
    method = IncrementalSegmenter(growing).method
    assert (method.name, method.weights, method.classes) == ("region-growing", None, ())

    record = json.loads(json.dumps(method.configuration()))
    assert RegionGrowingSettings(**record.pop("region_growing")) == growing
    assert record == {"weights": None, "method": "region-growing"}


def test_weights_alone_say_which_method_it_is(weights_path):
    assert IncrementalSegmenter(open_method(None, str(weights_path))).method.name == "mcpnet"


def test_weights_of_another_network_than_the_method_are_refused(weights_path):
    with pytest.raises(WeightsError, match=r"weights of mcpnet; expected weights of sgpn"):
        open_method("sgpn", str(weights_path))


def test_region_growing_takes_no_weights(weights_path):
    with pytest.raises(WeightsError, match="leave -w out"):
        open_method("region-growing", str(weights_path))
