"""models/fetch_furniture.py on an archive of our own: rows, classes, credits, kept edits."""

import csv
import importlib
import sys
import zipfile
from pathlib import Path

import pytest

from mcpseg_cli.synth.models.library import read_models

SCRIPT = Path(__file__).parents[2] / "models" / "fetch_furniture.py"
CATALOGUE = """
id=ours
id#1=ours#chair
name#1=Chair
category#1=Living room
model#1=/ours/chair/chair.obj
width#1=50
depth#1=55.5
height#1=90
creator#1=Ann
modelRotation#1=1 0 0 0 1 0 0 0 1
id#2=ours#truck
name#2=Truck
category#2=Vehicles
model#2=/ours/truck/truck.obj
width#2=250
depth#2=340
height#2=240
creator#2=Bob
"""
MESH = "v 0 0 0\nv 1 0 0\nv 1 1 1\nf 1 2 3\n"


@pytest.fixture(scope="module")
def script():
    sys.path.insert(0, str(SCRIPT.parent))
    yield importlib.import_module("fetch_furniture")
    sys.path.remove(str(SCRIPT.parent))


@pytest.fixture
def folder(tmp_path, script, monkeypatch):
    archives = tmp_path / "archives"
    archives.mkdir()
    with zipfile.ZipFile(archives / "Scopia.sh3f", "w") as packed:
        packed.writestr("PluginFurnitureCatalog.properties", CATALOGUE)
        packed.writestr("ours/chair/chair.obj", MESH)
        packed.writestr("ours/truck/truck.obj", MESH)
    monkeypatch.setattr(sys, "argv", ["fetch_furniture.py", str(tmp_path)])
    assert script.main() == 0
    return tmp_path


def rows_in(folder):
    with (folder / "models.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_chair_is_a_chair_in_metres_and_a_truck_is_not_used(folder):
    chair, truck = rows_in(folder)
    assert (chair["class"], chair["placed"]) == ("chair", "floor")
    assert (chair["width"], chair["depth"], chair["height"]) == ("0.5", "0.555", "0.9")
    assert (chair["creator"], chair["licence"]) == ("Ann", "CC-BY 3.0")
    assert truck["class"] == ""


def test_the_folder_can_be_furnished_with(folder):
    (model,) = read_models(folder, "all").models
    assert (model.class_name, len(model.rotation)) == ("chair", 9)


def test_the_credits_name_who_made_what_is_used(folder):
    credit = (folder / "CREDITS.md").read_text()
    assert "CC-BY 3.0: Ann (1)" in credit
    assert "Bob" not in credit


def test_a_table_that_was_edited_is_kept(folder, script):
    edited = (folder / "models.csv").read_text().replace(",chair,", ",sofa,")
    (folder / "models.csv").write_text(edited)
    script.main()
    assert rows_in(folder)[0]["class"] == "sofa"


@pytest.mark.parametrize(
    ("name", "kinds", "said", "home"),
    [
        ("clutter", "washing machine", "Washbasin", "sanitary"),
        ("clutter", "washing machine", "Clothes washing machine", "appliance"),
        ("clutter", "picture;clock", "Frame", "picture"),
        ("clutter", "picture;clock", "Cuckoo clock", ""),
        ("bookcase", "low", "Dresser with drawers", "cabinet"),
        ("bookcase", "low", "Shelves", ""),
        ("table", "side", "Bedside table", ""),
    ],
)
def test_the_finer_class_goes_by_the_name_before_what_it_stands_for(
    script, name, kinds, said, home
):
    entry = {"model": "/a/b.obj", "category": "Home", "name": said}
    assert script.home_of(name, kinds, entry) == home


def test_about_a_fifth_is_kept_from_training(script):
    entry = {"name": "Chair", "category": "Office", "creator": "Ann"}
    entry |= {"width": "50", "depth": "50", "height": "90"}
    rows = [script.row_of("ours", entry | {"model": f"/{number}.obj"}) for number in range(500)]
    assert 60 < sum(row["part"] == "kept" for row in rows) < 140
