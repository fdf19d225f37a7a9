"""What methods, looks and ranges are worth on labelled recordings: a row each, a column a set.

    python examples/compare_methods.py -o compare/ --set rooms=real/room_1,real/room_2 \
        --set office=data/Area_9 --method mcpnet --method mcpnet:fused --method unet --range 2.5

A recording is a folder with scans/, poses.csv and gt/, as ``mcpseg raytrace`` writes it; those of a
set are pooled. Cells are point accuracy / mIoU of the classes present / objects predicted of true;
with --objects, object accuracy / precision at IoU 0.5 / PQ / AP50 / NMI / ARI, the last two as
means over the recordings. After a method's name, ``:first`` or ``:fused`` say which looks count,
``:paper`` or ``:graph`` what makes objects.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

MCPSEG = [sys.executable, "-m", "mcpseg_cli"]


def label(recording: Path, method: str, options: list[str], out: Path) -> None:
    """Label a recording by METHOD or a weights file, with ``:first``, ``:graph`` and the like."""
    name, *how = method.split(":")
    is_file = name.endswith(".safetensors")
    chosen = ["-w", name] if is_file else ["--method", name]
    for word in how:
        chosen += ["--labelling" if word in ("first", "fused") else "--clustering", word]
    scans = [str(recording / "scans"), str(recording / "poses.csv")]
    command = [*MCPSEG, "segment", *scans, "-o", str(out), "-q", *chosen, *options]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def score(pairs: list[tuple[Path, Path]], *, of_objects: bool) -> str:
    """Score labelled recordings together."""
    paths = [str(path) for pair in pairs for path in pair]
    command = [*MCPSEG, "eval", *paths, "--json", "-q"]
    answer = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    scores = json.loads(answer)
    means = scores.get("mean", scores)
    scores = scores.get("pooled", scores)
    if of_objects:
        names = ("object_accuracy", "precision_50", "pq", "ap50")
        cells = [f"{100 * scores[name]:.1f}" for name in names]
        return " / ".join([*cells, *(f"{100 * means[name]:.1f}" for name in ("nmi", "ari"))])
    accuracy, miou = 100 * scores["point_accuracy"], 100 * scores["miou_present"]
    return f"{accuracy:.1f} / {miou:.1f} / {scores['objects_pred']} of {scores['objects_true']}"


def main() -> None:
    """Label, score, print a table in Markdown."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--set", action="append", required=True, metavar="NAME=FOLDER,FOLDER")
    parser.add_argument("--method", action="append", required=True)
    parser.add_argument("--objects", action="store_true", help="tell how whole objects are")
    parser.add_argument("--range", action="append", default=[], help="of networks that see rooms")
    options = parser.parse_args()

    sets = dict(each.split("=", 1) for each in options.set)
    print("|", "method", "|", " | ".join(sets), "|")
    print("|---" * (len(sets) + 1) + "|")
    for method in options.method:
        is_unet = "unet" in method
        for reach in (options.range or [None]) if is_unet else [None]:
            cells = []
            for name, folders in sets.items():
                pairs = []
                for recording in map(Path, folders.split(",")):
                    tag = Path(method.replace(":", "-")).name.removesuffix(".safetensors")
                    out = options.output / f"{tag}-{reach}" / name / recording.name
                    if not (out / "objects.json").exists():
                        extra = ["--range", reach] if reach else []
                        label(recording, method, extra, out)
                    pairs.append((out, recording / "gt"))
                cells.append(score(pairs, of_objects=options.objects))
            row = f"{Path(method).name}{f', {reach} m' if reach else ''}"
            print("|", row, "|", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
