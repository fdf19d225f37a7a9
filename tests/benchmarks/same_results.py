"""Fingerprints of everything mcpseg computes, before and after a change that is to change nothing.

``python -m tests.benchmarks.same_results -o before.json`` records them, ``--compare before.json``
makes them again and names what differs. Results in floating point depend on the processor: record
and compare on one machine.
"""

import argparse
import hashlib
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.areas import write_area

ROOT = Path(__file__).parents[2]
WALK = ROOT / "examples" / "office_walk"
METHODS = (
    "mcpnet",
    "mcpnet-nocontext",
    "pointnet",
    "pointnet2",
    "sgpn",
    "voxnet",
    "region-growing",
)
NUM_STYLES = 7
MAKE_BUILDING = """
import hashlib, sys
from mcpseg_cli.synth import make_building
building = make_building(int(sys.argv[1]), seed=1, num_rooms=5)
arrays = (building.xyz, building.rgb, building.semantic, building.instance, building.room_starts)
digest = hashlib.sha256("\\n".join([*building.rooms, *building.object_names]).encode())
for array in arrays:
    digest.update(f"{array.dtype} {array.shape}".encode() + array.tobytes())
print(digest.hexdigest())
"""


def main() -> int:
    """Record or compare; return 1 where something differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, help="JSON file to write")
    parser.add_argument("--compare", type=Path, help="JSON file written before")
    parts = (segment_walk, make_buildings, train_tiny, raytrace_area)
    names = [part.__name__ for part in parts]
    parser.add_argument("--only", nargs="+", choices=names, default=names, help="parts to make")
    options = parser.parse_args()

    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for part in parts:
            found |= part(Path(folder)) if part.__name__ in options.only else {}
            print(f"{part.__name__}: {len(found)} fingerprints so far", file=sys.stderr)
    if options.output:
        options.output.write_text(json.dumps(found, indent=1) + "\n")
    if not options.compare:
        return 0

    before = json.loads(options.compare.read_text())
    if set(options.only) != set(names):
        before = {name: before.get(name) for name in found}
    different = [
        name for name in sorted(before.keys() | found.keys()) if before.get(name) != found.get(name)
    ]
    for name in different:
        print(f"{name}: {before.get(name)} before, {found.get(name)} now")
    print(f"{len(before) - len(different)} of {len(before)} fingerprints equal")
    return int(bool(different))


def segment_walk(folder: Path) -> dict[str, str]:
    """Label the example walk by every method in fp32; hash outputs, and scores without times."""
    found = {}
    for method in METHODS:
        out = folder / method
        mcpseg(
            "segment",
            WALK / "scans",
            WALK / "poses.csv",
            "-o",
            out,
            "--method",
            method,
            "--precision",
            "fp32",
        )
        for name in ("map.ply", "objects.json"):
            found[f"{method}/{name}"] = hash_files(out / name)
        found[f"{method}/scans"] = hash_files(*sorted((out / "scans").iterdir()))
        scores = json.loads(mcpseg("eval", out, WALK / "gt", "--json"))
        scores.pop("ms_per_scan")
        scores.pop("ece", None)  # newer than the first fingerprints
        text = json.dumps(scores, sort_keys=True).replace(str(folder), "").replace(str(ROOT), "")
        found[f"{method}/eval"] = hashlib.sha256(text.encode()).hexdigest()
    return found


def make_buildings(folder: Path) -> dict[str, str]:
    """Hash a synthetic building of every style."""
    return {
        f"style {style}": python("-c", MAKE_BUILDING, style).strip()
        for style in range(1, NUM_STYLES + 1)
    }


def train_tiny(folder: Path) -> dict[str, object]:
    """Train two networks for an epoch; give the losses."""
    data = folder / "data"
    write_area(data / "Area_1", 6, seed=1)
    write_area(data / "Area_2", 4, seed=2)
    found: dict[str, object] = {}
    for net in ("mcpnet", "sgpn"):
        options = ("--net", net, "--epochs", 1, "--batch-size", 64, "--seed", 3)
        output = ("-o", folder / "trained", "--overwrite", "-q")
        mcpseg("train", data, "--holdout", 2, *options, *output)
        record = json.loads((folder / "trained" / f"{net}-holdout2.json").read_text())
        report = record["curves"][0]
        found[f"train {net}"] = [report["train"]["loss"], report["validation"]["loss"]]
    return found


def raytrace_area(folder: Path) -> dict[str, str]:
    """Scan a small synthetic area; hash scans, truth and poses."""
    area = folder / "b" / "Area_2"
    mcpseg("synth", area, "--seed", 1, "--rooms", 4, "-q")
    found = {"synth": hash_files(*sorted(path for path in area.rglob("*.txt")))}
    out = folder / "scanned"
    mcpseg("raytrace", area, "-o", out, "--step", 0.4, "--noise", 0.004, "-q")
    found["raytrace/poses"] = hash_files(out / "poses.csv")
    for name in ("scans", "gt"):
        found[f"raytrace/{name}"] = hash_files(*sorted((out / name).iterdir()))
    shutil.rmtree(out)
    return found


def mcpseg(*words: object) -> str:
    """Run a command of mcpseg; return what it prints."""
    return python("-m", "mcpseg_cli", *words)


def python(*words: object) -> str:
    """Run Python in the checkout; return what it prints."""
    command = [sys.executable, *map(str, words)]
    return subprocess.run(command, cwd=ROOT, check=True, text=True, stdout=subprocess.PIPE).stdout


def hash_files(*paths: Path) -> str:
    """Hash names and contents."""
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


if __name__ == "__main__":
    sys.exit(main())
