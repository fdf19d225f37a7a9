"""The command reference in docs/commands.md."""

from typing import Literal

import pytest

from tests.command_reference import PAGE, choices, reference, with_reference


def test_the_page_lists_every_command_and_option_as_the_code_has_them():
    assert with_reference(PAGE.read_text()) == PAGE.read_text()


def test_the_reference_names_options_as_they_are_typed():
    text = reference()
    assert "`-o, --output PATH`" in text
    assert "`--range METRES`" in text
    assert "`--json`" in text


@pytest.mark.parametrize("kind", [Literal["ply", "laz"], Literal["ply", "laz"] | None])
def test_literals_are_listed_as_choices(kind):
    assert choices(kind) == ["ply", "laz"]
