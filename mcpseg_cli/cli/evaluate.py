"""``mcpseg eval``: score a labelled map against ground truth."""

from pathlib import Path
from typing import Annotated

import typer

from mcpseg_cli.cli.options import Json


def evaluate(
    output: Annotated[
        Path, typer.Argument(metavar="OUT", help="Folder that 'mcpseg segment' wrote, or one labelled cloud.")
    ],
    truth: Annotated[Path, typer.Argument(metavar="GT", help="Folder of labelled clouds, or one labelled cloud.")],
    as_json: Json = False,
) -> None:
    """Score a labelled map against ground truth.

    Every point of the map, one a voxel, is compared with the nearest true point within half a voxel. Clusters and
    objects are scored over the whole map, on points of true objects. Panoptic quality takes every class for things;
    the figures "with stuff" take ceiling, floor and wall for stuff. AP is the ScanNet evaluator's: IoU 0.50 to 0.90,
    objects of 100 points and more, ranked by mean confidence.

    Examples:
      mcpseg eval out/ gt/

      mcpseg eval out/ gt/ --json | jq .point_accuracy
    """
    import json

    from mcpseg_cli.cli.display import print_table
    from mcpseg_cli.evaluation import evaluate_run

    scores = evaluate_run(output, truth)
    if as_json:
        typer.echo(json.dumps(scores.document()))
    else:
        print_table(scores.table())
