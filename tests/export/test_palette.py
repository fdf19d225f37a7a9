"""Colours of classes are told apart by all, on the panel and in pictures."""

import re
from importlib.resources import files

import numpy as np
import pytest

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.export.colours import UNKNOWN_COLOUR, class_palette
from tests.colour_distance import SIGHTS, contrast, delta_e, distances

PICKED = (255, 255, 255)
HOME = (*S3DIS_CLASSES, *(f"home {number}" for number in range(12)))


def colours_of(classes):
    return class_palette(classes)[: len(classes)]


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [  # of the table of Sharma, Wu and Dalal 2005
        ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
        ((50.0, 2.5, 0.0), (73.0, 25.0, -18.0), 27.1492),
        ((50.0, -1.0, 2.0), (50.0, 0.0, 0.0), 2.3669),
        ((50.0, 2.49, -0.001), (50.0, -2.49, 0.0011), 7.2195),
        ((22.7233, 20.0904, -46.6940), (23.0331, 14.9730, -42.5619), 2.0373),
        ((2.0776, 0.0795, -1.1350), (0.9033, -0.0636, -0.5514), 0.9082),
    ],
)
def test_distances_are_those_of_the_published_table(first, second, expected):
    assert float(delta_e(np.array(first), np.array(second))) == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("sight", SIGHTS)
def test_no_two_classes_are_near_each_other_to_anyone(sight):
    colours = np.concatenate([colours_of(S3DIS_CLASSES), [UNKNOWN_COLOUR, PICKED]])
    apart = distances(colours, sight)
    np.fill_diagonal(apart, np.inf)
    assert apart.min() >= 12


@pytest.mark.parametrize("sight", SIGHTS)
def test_twenty_five_classes_are_still_told_apart(sight):
    apart = distances(np.concatenate([colours_of(HOME), [UNKNOWN_COLOUR]]), sight)
    np.fill_diagonal(apart, np.inf)
    assert apart.min() >= 7


def test_other_names_take_the_colours_that_are_left():
    names = ("pipe", "valve", "floor", "pump")
    colours = colours_of(names).tolist()
    known = class_palette(S3DIS_CLASSES)[:13].tolist()
    assert colours[2] == known[S3DIS_CLASSES.index("floor")]
    assert all(colour in known for colour in colours)
    assert len({tuple(colour) for colour in colours}) == 4


def test_no_two_of_many_classes_have_one_colour():
    colours = colours_of([f"class {number}" for number in range(60)])
    assert len(np.unique(colours, axis=0)) == 60


def test_swatches_stand_out_from_the_panel():
    style = (files("mcpseg_cli.export") / "page" / "page.css").read_text()
    panel = tuple(bytes.fromhex(re.search(r"--panel: #(\w{6})", style)[1]))
    assert contrast(colours_of(HOME), panel).min() >= 3
    assert contrast([UNKNOWN_COLOUR], panel)[0] >= 3
