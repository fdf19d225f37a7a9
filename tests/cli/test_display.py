"""What people see while a command works."""

import pytest
from rich.console import Console

from mcpseg_cli.cli import display


@pytest.mark.parametrize("title", ["read out{1}", "train a{b}", "read [bold]"])
def test_names_with_braces_and_brackets_are_shown_as_they_are(title, monkeypatch, capsys):
    monkeypatch.setattr(
        display, "Console", lambda stderr: Console(stderr=stderr, force_terminal=True, width=120)
    )
    with display.progress_bar(title, quiet=False) as bar:
        bar.add_task("", total=3, state="one {two} [three]")
        bar.refresh()
    shown = capsys.readouterr().err
    assert title in shown
    assert "one {two} [three]" in shown
