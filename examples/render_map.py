"""Draw a labelled map in its colours, by class and by object, from above and aslant, on one sheet.

``python examples/render_map.py out/ -o map.png``, after ``mcpseg segment … -o out/``. Single
pictures: ``mcpseg export out/ -o map.png``. Needs Pillow (``pip install 'mcpseg[plot]'``); no
display, no graphics card.
"""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from mcpseg_cli.choices import ColourBy, View
from mcpseg_cli.export.picture import write_picture
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.export.views import PictureSettings
from mcpseg_cli.segment.labelled_run import LabelledRun

VIEWS: tuple[View, ...] = ("top", "cut")
COLOURS: tuple[ColourBy, ...] = ("rgb", "class", "instance")
WIDTH = 640  # pixels of one picture on the sheet


def draw_sheet(folder: Path, sheet: Path) -> None:
    """Draw a row for each view, a column for each colouring."""
    # one picture after another, made as narrow as its column
    with LabelledRun(folder) as run, TemporaryDirectory() as scratch:
        rows = []
        for view in VIEWS:
            pictures = []
            for colour_by in COLOURS:
                path = Path(scratch) / f"{view}_{colour_by}.png"
                write_picture(run, path, Selection(), PictureSettings(view, colour_by))
                with Image.open(path) as picture:
                    height = round(WIDTH * picture.height / picture.width)
                    pictures.append(picture.resize((WIDTH, height)))
            rows.append(pictures)

    # all on one sheet
    heights = [max(part.height for part in row) for row in rows]
    whole = Image.new("RGB", (WIDTH * len(COLOURS), sum(heights)), "white")
    for number, row in enumerate(rows):
        for column, part in enumerate(row):
            whole.paste(part, (column * WIDTH, sum(heights[:number])))
    whole.quantize(256).save(sheet, optimize=True)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path, help="the folder of a run")
    parser.add_argument("-o", "--output", type=Path, default=Path("map.png"))
    arguments = parser.parse_args()
    draw_sheet(arguments.run, arguments.output)
    print(arguments.output)


if __name__ == "__main__":
    main()
