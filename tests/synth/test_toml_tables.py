"""Tables of numbers: complete, in range, read at first use; errors name file and key."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import mcpseg_cli
from mcpseg_cli.errors import InputError
from mcpseg_cli.synth.rooms.contents.homes import Homes
from mcpseg_cli.synth.rooms.contents.public import PublicRooms
from mcpseg_cli.synth.rooms.contents.records import Amount
from mcpseg_cli.synth.rooms.contents.shared import Shared
from mcpseg_cli.synth.rooms.contents.work import WorkRooms
from mcpseg_cli.synth.surfaces import catalogue
from mcpseg_cli.synth.surfaces.catalogue import numbered_styles, styles
from mcpseg_cli.synth.surfaces.styles import Style
from mcpseg_cli.synth.things.chairs import CHAIR_DESIGNS
from mcpseg_cli.synth.things.tables import TABLE_DESIGNS
from mcpseg_cli.synth.toml_tables import read_table

PACKAGE = Path(mcpseg_cli.__file__).parent
CONTENTS = PACKAGE / "synth" / "rooms" / "contents"
MODERN = PACKAGE / "synth" / "styles" / "1_modern.toml"


def test_there_are_six_styles_of_offices_then_homes_then_styles_of_higher_numbers():
    numbered = numbered_styles()
    assert list(numbered) == [*range(1, 8), 16, 17, 27, 37]
    assert [n for n, style in numbered.items() if not style.is_public] == [7, 17, 27]
    assert {f"{number}_{style.name}" for number, style in numbered.items()} == {
        path.stem for path in MODERN.parent.iterdir()
    }


def test_designs_of_the_styles_are_in_the_catalogues():
    for style in styles():
        assert set(style.chairs) <= set(CHAIR_DESIGNS)
        assert set(style.tables) <= set(TABLE_DESIGNS)


def refusal(original, model, folder, before, after):
    """What is said when a table is read with a part of it replaced."""
    text = original.read_text()
    assert before in text
    path = folder / original.name
    path.write_text(text.replace(before, after, 1))
    with pytest.raises(InputError) as caught:
        read_table(path, model)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)
    return str(caught.value)


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
def test_an_error_in_a_style_names_file_and_key(tmp_path, before, after, message):
    assert message in refusal(MODERN, Style, tmp_path, before, after)


@pytest.mark.parametrize(
    ("file", "model", "before", "after", "message"),
    [
        ("work", WorkRooms, '"pin board", "chalkboard"', '"easel"', "office.board.of.2 = 'easel'"),
        ("work", WorkRooms, '"task", "executive"', '"throne"', "office.swivel_chairs.0 = 'throne'"),
        ("work", WorkRooms, '"paper", "trays"', '"sand"', "copy_room.on_table.of.0 = 'sand'"),
        ("work", WorkRooms, '["desk", "trestle"]', '["dais"]', "storage.table.of.0 = 'dais'"),
        (
            "work",
            WorkRooms,
            '["open", "rack", ',
            '["crate", ',
            "copy_room.bookcases.of.0 = 'crate'",
        ),
        ("work", WorkRooms, "copiers = [1, 3]", "copiers = [1, 2.5]", "copy_room.copiers.1 = 2.5"),
        ("work", WorkRooms, "block = 0.9", "block = -1", "open_plan.block = -1; expected greater"),
        (
            "public",
            PublicRooms,
            '"wall box", "cable run"',
            '"bin"',
            "hallway.on_walls.of.3 = 'bin'",
        ),
        (
            "homes",
            Homes,
            "one_in = 30",
            "one_for = 30",
            "unknown key living_room.bookcases.one_for",
        ),
        ("shared", Shared, "of = [", "off = [", "no key desk.on_top.of"),
    ],
)
def test_an_error_in_what_rooms_hold_names_file_and_key(
    tmp_path, file, model, before, after, message
):
    assert message in refusal(CONTENTS / f"{file}.toml", model, tmp_path, before, after)


def test_means_add_up_with_the_room_and_the_mess():
    amount = Amount(mean=2, per_metre=0.1, one_in=20, untidy=3, untidy_per_metre=0.2)
    assert amount.on_average(10, 0.5) == pytest.approx(2 + 1 + 0.5 + 1.5 + 1)
    assert Amount().on_average(10, 1.0) == 0


def test_a_damaged_style_stops_the_building(tmp_path, monkeypatch):
    shutil.copytree(MODERN.parent, tmp_path / "styles")
    (tmp_path / "styles" / "7_homes.toml").write_text("")
    monkeypatch.setattr(catalogue, "_STYLES", tmp_path / "styles")
    styles.cache_clear()
    numbered_styles.cache_clear()
    with pytest.raises(InputError, match=r"7_homes.toml: no key name"):
        styles()
    monkeypatch.undo()
    styles.cache_clear()
    numbered_styles.cache_clear()


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
    assert times == files == 11 + 5  # styles, and what rooms hold
