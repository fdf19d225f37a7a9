"""The command reference in the README."""

from tests.command_reference import README, reference, with_reference


def test_the_readme_lists_every_command_and_option_as_the_code_has_them():
    assert with_reference(README.read_text()) == README.read_text()


def test_the_reference_names_options_as_they_are_typed():
    text = reference()
    assert "`-o, --output PATH`" in text
    assert "`--range METRES`" in text
    assert "`--json`" in text
