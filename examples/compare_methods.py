"""What methods, looks and ranges are worth on labelled recordings: a row each, a column a set.

    python examples/compare_methods.py -o compare/ --set rooms=real/room_1,real/room_2 \
        --set office=data/Area_9 --method mcpnet --method mcpnet:fused --method unet --range 2.5

A recording is a folder with scans/, poses.csv and gt/, as ``mcpseg raytrace`` writes it; those of a
set are pooled. Cells are point accuracy / mIoU of the classes present / objects predicted of true.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

MCPSEG = [sys.executable, "-m", "mcpseg_cli"]


def label(recording: Path, method: str, options: list[str], out: Path) -> None:
    """Label a recording, unless that is done: METHOD, a weights file, or either with ``:first``."""
    name, _, labelling = method.partition(":")
    is_file = name.endswith(".safetensors")
    chosen = ["-w", name] if is_file else ["--method", name]
    chosen += ["--labelling", labelling] if labelling else []
    scans = [str(recording / "scans"), str(recording / "poses.csv")]
    command = [*MCPSEG, "segment", *scans, "-o", str(out), "-q", *chosen, *options]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def score(pairs: list[tuple[Path, Path]]) -> str:
    """Score labelled recordings together."""
    paths = [str(path) for pair in pairs for path in pair]
    command = [*MCPSEG, "eval", *paths, "--json", "-q"]
    answer = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    scores = json.loads(answer)
    scores = scores.get("pooled", scores)
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
                cells.append(score(pairs))
            row = f"{Path(method).name}{f', {reach} m' if reach else ''}"
            print("|", row, "|", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
