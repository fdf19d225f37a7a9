"""The rooms of the package: what each folder may import, and where heavy libraries may be."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import mcpseg_cli

PACKAGE = Path(__file__).parents[1] / "mcpseg_cli"
GROUND = {
    "choices", "errors", "config", "classes", "grid", "scan", "building", "reliability",
    "resumable",
}  # fmt: skip
MAY_IMPORT = {
    **dict.fromkeys(GROUND, GROUND),
    "networks": GROUND,
    "incremental": GROUND | {"networks"},
    "formats": GROUND,
    "examine": GROUND | {"formats"},
    "raytrace": GROUND | {"formats"},
    "synth": GROUND | {"formats"},
    "segment": GROUND | {"incremental", "networks", "formats"},
    "merge": GROUND | {"segment", "incremental", "formats"},
    "train": GROUND | {"incremental", "networks", "formats"},
    "evaluate": GROUND | {"segment", "incremental", "formats"},
    "export": GROUND | {"segment", "incremental", "networks", "formats"},
}
MAY_IMPORT["cli"] = set(MAY_IMPORT)
TORCH = {"networks", "incremental", "train", "export/onnx"}
MOST_EDGES = 100  # imports between rooms; 276 before each command had its folder


def modules() -> list[Path]:
    return sorted(
        path for path in PACKAGE.rglob("*.py") if path.parent != PACKAGE or path.name[:2] != "__"
    )


def room_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports_of(path: Path) -> list[str]:
    """Names of all imported modules, those inside functions among them."""
    nodes = list(ast.walk(ast.parse(path.read_text())))
    names = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    return names + [
        node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.module
    ]


def rooms_imported(path: Path) -> set[str]:
    inner = {name.split(".")[1] for name in imports_of(path) if name.startswith("mcpseg_cli.")}
    return inner - {room_of(path)}


def test_every_room_imports_only_what_it_may():
    edges = {(room_of(path), room) for path in modules() for room in rooms_imported(path)}
    print(f"\n{len(edges)} imports between {len(MAY_IMPORT)} rooms of mcpseg_cli")
    assert sorted((room, other) for room, other in edges if other not in MAY_IMPORT[room]) == []
    assert len(edges) <= MOST_EDGES


def test_the_text_of_the_architecture_names_every_room_and_what_it_imports():
    ground, folders = (mcpseg_cli.__doc__ or "").split("A folder imports")
    assert set(re.findall(r"^    (\w+)  ", ground, re.MULTILINE)) == GROUND

    stated = {}
    for room, about in re.findall(r"^    (\w+)/ +((?:.+\n)(?:     .+\n)*)", folders, re.MULTILINE):
        named = re.search(r"imports ([\w, ]+)", " ".join(about.split()))
        stated[room] = GROUND | set(named[1].split(", ") if named else [])
    stated["cli"] = MAY_IMPORT["cli"]  # imports all
    assert stated == {room: MAY_IMPORT[room] for room in set(MAY_IMPORT) - GROUND}


def test_torch_typer_and_rich_stay_where_they_belong():
    wrong = []
    for path in modules():
        top = {name.split(".")[0] for name in imports_of(path)}
        module = path.relative_to(PACKAGE).with_suffix("").as_posix()
        if "torch" in top and not {room_of(path), module} & TORCH:
            wrong.append(f"{module} imports torch")
        if top & {"typer", "rich"} and room_of(path) != "cli":
            wrong.append(f"{module} imports typer or rich")
        if top & {"pickle", "yaml", "dill", "joblib"}:
            wrong.append(f"{module} reads what can be executed")
    assert wrong == []


def test_help_imports_nothing_heavy():
    script = (
        "import sys\nsys.argv = ['mcpseg', '--help']\nfrom mcpseg_cli.cli import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "heavy = ('torch', 'numpy', 'numba', 'pydantic', 'scipy', 'open3d', 'laspy')\n"
        "print([name for name in heavy if name in sys.modules])"
    )
    result = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert "Usage" in result.stdout
    assert result.stdout.splitlines()[-1] == "[]"
