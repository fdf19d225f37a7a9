"""Tables of numbers: complete, within range, read at first use, in the package; errors name file and key."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import mcpseg_cli
from mcpseg_cli.errors import InputError
from mcpseg_cli.synth.surfaces import catalogue
from mcpseg_cli.synth.surfaces.catalogue import styles
from mcpseg_cli.synth.surfaces.styles import Style
from mcpseg_cli.synth.things.chairs import CHAIR_DESIGNS
from mcpseg_cli.synth.things.tables import TABLE_DESIGNS
from mcpseg_cli.synth.toml_tables import read_table

PACKAGE = Path(mcpseg_cli.__file__).parent
MODERN = PACKAGE / "synth" / "styles" / "1_modern.toml"


def test_there_are_six_styles_of_offices_and_then_homes():
    assert [style.is_public for style in styles()] == [True] * 6 + [False]
    assert [f"{number}_{style.name}" for number, style in enumerate(styles(), 1)] == sorted(
        path.stem for path in MODERN.parent.iterdir()
    )


def test_designs_of_the_styles_are_in_the_catalogues():
    for style in styles():
        assert set(style.chairs) <= set(CHAIR_DESIGNS)
        assert set(style.tables) <= set(TABLE_DESIGNS)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("tidiness = 0.55", "tidiness = 1.5", "tidiness = 1.5; expected less than or equal to 1;"),
        ("beams = 0.3", "beems = 0.3", "no key beams; expected every key"),
        ("beams = 0.3", "beams = 0.3\nbeems = 0.3", "unknown key beems; expected no other keys"),
        ("base = [84, 92, 104]", "base = [84, 92, 300]", "floors.1.base.2 = 300; expected less"),
        ("accent = [60, 64, 76]", "akzent = [60, 64, 76]", "no key floors.1.accent; expected"),
        ("scale = 0.6 },", "scale = 0.6, glitter = 1 },", "unknown key floors.1.glitter; expected"),
        ("none = 0.35", "none = 0.45", "shares that add up to 1"),
        ("height = [2.6, 3.0]", "height = [3.0, 2.6]", "the lowest first, then the highest"),
        ("WC = 1", "cellar = 1", "kinds.cellar"),
        ("beams = 0.3", "beams 0.3", "no TOML"),
    ],
)
def test_an_error_in_a_table_names_file_and_key(tmp_path, before, after, message):
    text = MODERN.read_text()
    assert before in text
    path = tmp_path / "1_modern.toml"
    path.write_text(text.replace(before, after, 1))
    with pytest.raises(InputError) as caught:
        read_table(path, Style)
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_damaged_style_stops_the_building(tmp_path, monkeypatch):
    shutil.copytree(MODERN.parent, tmp_path / "styles")
    (tmp_path / "styles" / "7_homes.toml").write_text("")
    monkeypatch.setattr(catalogue, "_STYLES", tmp_path / "styles")
    styles.cache_clear()
    with pytest.raises(InputError, match=r"7_homes.toml: no key name"):
        styles()
    monkeypatch.undo()
    styles.cache_clear()


def test_tables_are_read_at_first_use_and_once():
    script = (
        "import sys, tomllib\nread = []\nloads = tomllib.loads\n"
        "tomllib.loads = lambda text: read.append(text) or loads(text)\n"
        "import mcpseg_cli.synth as synth\nat_import = len(read)\n"
        "synth.styles()\nsynth.make_building(1, 1, num_rooms=2, spacing=0.2)\n"
        "print(at_import, len(read), len(set(read)))"
    )
    result = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    at_import, times, files = map(int, result.stdout.split())
    assert at_import == 0
    assert times == files
