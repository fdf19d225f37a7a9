"""How far apart the colours of classes are, to whoever looks (CIEDE2000), and on the panel.

    python -m tests.benchmarks.palette [--classes NAME …] [--matrix]

Without names, the classes of S3DIS. The colour of no class and white, which marks what is picked,
are among them.
"""

import argparse

import numpy as np

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.export.colours import UNKNOWN_COLOUR, class_palette
from tests.colour_distance import SIGHTS, contrast, distances

PANEL = (20, 24, 30)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--classes", nargs="+", default=list(S3DIS_CLASSES))
    parser.add_argument("--matrix", action="store_true", help="every pair")
    arguments = parser.parse_args()

    # classes, none, picked
    names = [*arguments.classes, "(none)", "(picked)"]
    colours = class_palette(arguments.classes)[: len(names) - 2]
    picked = (255, 255, 255)
    colours = np.concatenate([colours, np.array([UNKNOWN_COLOUR, picked], np.uint8)])
    apart = {sight: distances(colours, sight) for sight in SIGHTS}
    print(f"| class | colour | contrast | {' | '.join(SIGHTS)} |")
    print("|---|---|---|" + "---|" * len(SIGHTS))
    for row, name in enumerate(names):
        cells = []
        for table in apart.values():
            others = np.delete(table[row], row)
            nearest = int(others.argmin())
            cells.append(f"{others.min():.1f} ({np.delete(names, row)[nearest]})")
        colour, stands_out = bytes(colours[row]).hex(), contrast(colours[row : row + 1], PANEL)[0]
        print(f"| {name} | #{colour} | {stands_out:.1f} | {' | '.join(cells)} |")

    for sight, table in apart.items():
        least = table[np.triu_indices(len(names), 1)].min()
        print(f"{sight}: no two nearer than {least:.1f}")
        if arguments.matrix:
            print(np.array2string(table.round(1), max_line_width=200))


if __name__ == "__main__":
    main()
