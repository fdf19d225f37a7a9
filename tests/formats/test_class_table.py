"""Tables of two columns that users write: read, or refused in one line."""

import pytest

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.class_table import read_class_table


@pytest.mark.parametrize(
    ("name", "text"),
    [
        (
            "t.csv",
            "label,class\n# comment\narmchair, chair\nsofa,chair\nlaminate,floor\nperson,unknown\n",
        ),
        ("t.json", '{"armchair": "chair", "sofa": "chair", "laminate": "floor", "person": ""}'),
    ],
)
def test_class_tables_are_read(name, text, tmp_path):
    (tmp_path / name).write_text(text)
    table = read_class_table(tmp_path / name)
    assert table == {"armchair": "chair", "sofa": "chair", "laminate": "floor"}


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("t.csv", "a,b,c\n", "3 columns in 'a,b,c'"),
        ("t.csv", "a,b\na,c\n", "label 'a' twice"),
        ("t.csv", "a,b\n", "1 classes; expected two or more"),
        ("t.json", "[1]", "values that are not texts"),
        ("t.json", '{"a": 1}', "values that are not texts"),
        ("t.json", "{", "Expecting property name"),
        (
            "t.csv",
            'a,"desk, low"\nb,c\n',
            "a class named 'desk, low'; expected up to 254 names without commas",
        ),
        ("t.json", '{"a": "b\\nc", "d": "e"}', r"a class named 'b\\nc'; expected"),
        ("t.csv", "".join(f"{n},c{n}\n" for n in range(255)), "255 classes; expected up to 254"),
        ("t.csv", 'a,b\nc,"d' + "e" * 140_000, "field larger than field limit"),
    ],
)
def test_bad_class_tables_are_refused_in_one_line(name, text, words, tmp_path):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        read_class_table(tmp_path / name)
    assert len(str(caught.value).splitlines()) == 1
