"""The layers of the package: imports point down only, heavy libraries stay where they belong."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "mcpseg_cli"
LAYERS = [
    {"errors", "scan", "grid", "classes", "config", "columns", "building", "natural_order", "lock"},
    {"formats", "voxel_map", "clustering", "floor", "metrics", "overlaps", "recording", "raytrace", "synthetic"}
    | {"region_growing"},
    {"instance_metrics", "average_precision", "object_scores", "class_scores", "label_columns", "label_stability"},
    {"truth", "room_scores", "score_curve", "run_events", "answer", "figures"},
    {"pairing", "score_plots"},
    {"context", "networks", "losses", "replay", "augmentation"},
    {
        "state",
        "objects",
        "weights",
        "tensor_bundle",
        "evaluation",
        "followed_run",
        "several_runs",
        "sample_cache",
        "samples",
        "device",
        "ranks",
        "folds",
        "fine_tuning",
        "objective",
    },
    {
        "labelling",
        "labelled_map",
        "segmenter",
        "run_folder",
        "checkpoint",
        "prefetch",
        "training",
        "train_data",
        "tensorboard_log",
    },
    {"offline", "methods", "segment_run", "offline_run", "model_card", "train_run", "export"},
    {"cli"},
]
TORCH = {"networks", "losses", "weights", "tensor_bundle", "device", "ranks", "objective", "fine_tuning"}
TORCH |= {"labelling", "export/onnx", "checkpoint", "training", "train_run", "tensorboard_log"}
MODULES = sorted(
    path for path in PACKAGE.rglob("*.py") if path.name != "__main__.py" and path.parent.name != "__pycache__"
)


def layer_of(part: str) -> int:
    return next(number for number, layer in enumerate(LAYERS) if part in layer)


def part_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports_of(path: Path) -> list[str]:
    nodes = list(ast.walk(ast.parse(path.read_text())))
    names = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    return names + [node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.module]


@pytest.mark.parametrize(
    "path", [path for path in MODULES if path.parent != PACKAGE or path.name != "__init__.py"], ids=str
)
def test_imports_point_down_only(path):
    own = part_of(path)
    for name in imports_of(path):
        if name.startswith("mcpseg_cli."):
            assert layer_of(name.split(".")[1]) <= layer_of(own), f"{own} imports {name}"


@pytest.mark.parametrize("path", MODULES, ids=str)
def test_torch_typer_and_rich_stay_where_they_belong(path):
    top = {name.split(".")[0] for name in imports_of(path)}
    module = path.relative_to(PACKAGE).with_suffix("").as_posix()
    assert "torch" not in top or part_of(path) in TORCH or module in TORCH
    assert not top & {"typer", "rich"} or part_of(path) == "cli"
    assert not top & {"pickle", "yaml", "dill", "joblib"}


def test_help_imports_nothing_heavy():
    script = (
        "import sys\nsys.argv = ['mcpseg', '--help']\nfrom mcpseg_cli.cli import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "heavy = ('torch', 'numpy', 'numba', 'pydantic', 'scipy', 'open3d', 'laspy')\n"
        "print([name for name in heavy if name in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "Usage" in result.stdout
    assert result.stdout.splitlines()[-1] == "[]"
