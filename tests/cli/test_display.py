"""What people see while a command works."""

import numpy as np
import pytest
from numba import njit
from rich.console import Console

from mcpseg_cli.cli import compiling, display
from tests.commands import invoke


@pytest.fixture
def on_terminal(monkeypatch):
    """Make stderr a terminal of so many columns."""

    def make(width: int) -> None:
        monkeypatch.setattr(
            display,
            "Console",
            lambda stderr: Console(stderr=stderr, force_terminal=True, width=width),
        )

    return make


@pytest.mark.parametrize("title", ["read out{1}", "train a{b}", "read [bold]"])
def test_names_with_braces_and_brackets_are_shown_as_they_are(title, on_terminal, capsys):
    on_terminal(120)
    with display.progress_bar(title, quiet=False) as bar:
        bar.add_task("", total=3, state="one {two} [three]")
        bar.refresh()
    shown = capsys.readouterr().err
    assert title in shown
    assert "one {two} [three]" in shown


def test_bar_count_and_time_left_stay_at_80_columns(on_terminal, capsys):
    on_terminal(80)
    state = "epoch 12/100  loss 0.123  class 87.6%  embedding 90.1%  12.3 batches/s  9,876 points/s"
    with display.progress_bar("train mcpnet-holdout6", quiet=False) as bar:
        bar.add_task("", total=340_000, completed=123_456, state=state)
        bar.refresh()
    lines = [line for line in capsys.readouterr().err.splitlines() if "train" in line]
    assert "123456/340000" in lines[0]
    assert "-:--:--" in lines[0]  # no time is known yet
    assert "\u2501\u2501" in lines[0]
    assert "epoch 12/100  loss 0.123" in lines[0]
    assert "points/s" not in lines[0]


def test_compiling_is_told_once_while_it_happens_and_only_on_terminals(on_terminal, capsys):
    def compile_two() -> None:
        for offset in (1, 2):
            njit(lambda x, offset=offset: x + offset)(np.zeros(1))

    with compiling.told_of_compiling(quiet=False):
        compile_two()
    assert capsys.readouterr().err == ""
    on_terminal(80)
    with compiling.told_of_compiling(quiet=True):
        compile_two()
    assert capsys.readouterr().err == ""
    with compiling.told_of_compiling(quiet=False):
        compile_two()
    assert capsys.readouterr().err.count("compiling kernels, once") == 1


@pytest.mark.parametrize("option", ["-V", "--version"])
def test_the_version_has_two_names(option):
    assert invoke(option).stdout.startswith("mcpseg ")


def test_completion_can_be_installed():
    assert "--install-completion" in invoke("--help").stdout


def test_a_quiet_run_says_nothing(recording, tmp_path, weights_path):
    result = invoke("segment", *recording, "-o", tmp_path / "out", "-w", weights_path, "-q")
    assert (result.exit_code, result.stdout, result.stderr) == (0, "", "")
    result = invoke("export", tmp_path / "out", "-o", tmp_path / "map.ply", "-q")
    assert (result.exit_code, result.stdout, result.stderr) == (0, "", "")
