"""README, docs/ and CONTRIBUTING: links point somewhere, commands parse, Python runs."""

import inspect
import re
import shlex
from itertools import count, groupby
from pathlib import Path
from urllib.parse import unquote

import pytest
from typer.main import get_command

import mcpseg_cli
from mcpseg_cli.cli import app
from mcpseg_cli.formats.recording import open_recording, read_scan
from tests.test_architecture import GROUND, MAY_IMPORT

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
CONTRIBUTING = ROOT / ".github" / "CONTRIBUTING.md"
GUIDES = [README, CONTRIBUTING, *sorted(ROOT.glob("docs/*.md"))]
PAGES = [*GUIDES, *sorted(ROOT.glob("models/*.md")), *sorted(ROOT.glob("examples/*/*.md"))]
COMMANDS = get_command(app).commands
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
USAGE = (  # other programs and people rely on these forms
    "mcpseg raytrace s3dis/Area_1 --step 0.2",
    "mcpseg train --holdout 6",
    "mcpseg segment scans/ poses.csv -o out/",
    "mcpseg eval out/ gt/",
)


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


every_guide = pytest.mark.parametrize("page", GUIDES, ids=name)


def blocks(page: Path, language: str) -> list[str]:
    return [text for kind, text in FENCE.findall(page.read_text()) if kind == language]


def prose(page: Path) -> str:
    return FENCE.sub("", page.read_text())


# --- links ---


def anchors(page: Path) -> set[str]:
    """The anchors that GitHub gives to headings."""
    found: set[str] = set()
    for heading in re.findall(r"^#+ (.+)$", prose(page), re.MULTILINE):
        slug = re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")
        numbered = (f"{slug}-{number}" for number in count(1))
        found.add(slug if slug not in found else next(one for one in numbered if one not in found))
    return found


def is_broken(page: Path, link: str) -> bool:
    path, _, anchor = unquote(link).partition("#")
    target = (page.parent / path).resolve() if path else page
    if not target.exists() or not target.is_relative_to(ROOT):
        return True
    return bool(anchor) and anchor not in anchors(target)


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_point_at_something(page):
    links = re.findall(r"\]\(([^()\s]+)\)", prose(page))
    relative = [link for link in links if not re.match(r"https?://", link)]
    assert [link for link in relative if is_broken(page, link)] == []


def test_every_page_of_docs_is_linked_from_the_readme():
    pages = [name(page) for page in ROOT.glob("docs/*.md")]
    assert [page for page in pages if f"({page}" not in README.read_text()] == []


def test_anchors_are_those_of_github(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# Fast, `--range` & co\n\n## Same\n\n## Same\n\n```sh\n# no heading\n```\n")
    assert anchors(page) == {"fast---range--co", "same", "same-1"}


# --- commands ---


def simple_commands(page: Path) -> list[list[str]]:
    """The words of every simple command in the shell lines of a page, without redirections."""
    commands = []
    for line in "".join(blocks(page, "sh")).splitlines():
        lexer = shlex.shlex(line, posix=True, punctuation_chars=True)
        lexer.whitespace_split = True
        for ends, words in groupby(lexer, lambda word: set(word) <= set(";|&")):
            command = [word for word in words if word not in ("do", "done")]
            if command and not ends:
                commands.append(command[: [*command, ">"].index(">")])
    return commands


def parse(command: str, *words: str) -> None:
    """Parse words as the command line would, without running anything; raises what it says."""
    with COMMANDS[command].make_context(command, list(words)):
        pass


@every_guide
def test_command_lines_parse(page):
    complaints = []
    for words in simple_commands(page):
        try:
            if words[0] == "mcpseg":
                parse(*words[1:])
        except Exception as error:  # of click, wherever typer keeps it
            complaints.append(f"{shlex.join(words)}: {error}")
    assert complaints == []


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("segment -o out/", "Missing"),
        ("eval out/ gt/ --cvs", "No such option"),
        ("train --net mcpnett", "mcpnett"),
    ],
)
def test_what_does_not_parse_is_noticed(line, complaint):
    with pytest.raises(Exception, match=complaint):
        parse(*line.split())


def test_commands_are_found_in_loops_and_pipes(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("```sh\nfor n in 1; do a $n; b > c; done  # it's so\na -x 'y z' | b\n```\n")
    found = [shlex.join(words) for words in simple_commands(page)]
    assert found == ["for n in 1", "a '$n'", "b", "a -x 'y z'", "b"]


@pytest.mark.parametrize("command", app.registered_commands, ids=lambda command: command.name)
def test_examples_in_the_help_parse(command):
    text = inspect.getdoc(command.callback)
    assert set(re.findall(r"^.*\x08.*$", text, re.MULTILINE)) <= {"\b"}
    examples = re.findall(r"^Examples:\n((?:  .+\n?)+)", text, re.MULTILINE)
    for line in "".join(examples).splitlines():
        program, *words = re.split("[|>]", line)[0].split()
        if program == "mcpseg":
            parse(*words)
        else:
            assert program == "torchrun"


def test_the_readme_has_the_usual_forms():
    lines = [shlex.join(words) for words in simple_commands(README)]
    assert [usage for usage in USAGE if usage not in lines] == []


def options_of(*commands: str) -> set[str]:
    parameters = [parameter for command in commands for parameter in COMMANDS[command].params]
    return {option for parameter in parameters for option in parameter.opts} | {"--help"}


def options_of_scripts() -> set[str]:
    folders = ("examples", "models", "tests/benchmarks")
    scripts = [path for folder in folders for path in ROOT.glob(f"{folder}/*.py")]
    texts = [path.read_text() for path in scripts]
    return {option for text in texts for option in re.findall(r'"(--?[a-z][a-z0-9-]*)"', text)}


@every_guide
def test_options_named_in_the_text_are_there(page):
    unknown = []
    for code in re.findall(r"`([^`]+)`", prose(page)):
        words = code.split()
        if words[0] == "mcpseg" and words[1:] and words[1].startswith("-"):
            known = {"--version", "-V", "--install-completion", "--show-completion", "--help"}
        elif words[0] == "mcpseg" and words[1:2] != ["COMMAND"]:
            known = options_of(*words[1:2])
        elif words[0].startswith("-"):
            known = options_of(*COMMANDS) | options_of_scripts()
        else:
            continue
        named = [re.match(r"--?[a-z][a-z0-9-]*", word) for word in words]
        unknown += [
            f"{option[0]} in {code}" for option in named if option and option[0] not in known
        ]
    assert unknown == []


# --- Python ---


@pytest.fixture
def desk(labelled_run, tmp_path, monkeypatch) -> Path:
    """The folder that examples run in: a recording, its labelled run, its ground truth."""
    (tmp_path / "scans").symlink_to(labelled_run.scans)
    (tmp_path / "poses.csv").symlink_to(labelled_run.scans.parent / "poses.csv")
    (tmp_path / "out").symlink_to(labelled_run.out)
    (tmp_path / "gt").symlink_to(labelled_run.out / "scans")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("page", [page for page in GUIDES if blocks(page, "python")], ids=name)
def test_python_runs_from_top_to_bottom(page, desk):
    recording = open_recording(desk / "scans", desk / "poses.csv")
    scans = [read_scan(source, "map", 0.1)[0] for source in recording]
    names = {"driver": [(scan.xyz, scan.rgb, scan.pose) for scan in scans]}
    for code in blocks(page, "python"):
        exec(compile(code, name(page), "exec"), names)  # our own text
    assert names["segmenter"].num_scans == len(scans)
    in_objects = (names["segmenter"].clusters.instance > 0).sum()
    assert sum(item.num_points for item in names["objects"]) == in_objects > 0


# --- what is named ---


@every_guide
def test_files_and_modules_that_are_named_are_there(page):
    text = page.read_text()
    paths = re.findall(r"(?<![\w/.])[\w/]+/[a-z_0-9]+\.(?:py|toml)\b", text)
    dotted = re.findall(r"(?<=python -m )tests[\w.]+|mcpseg_cli\.\w[\w.]+\w", text)
    modules = [module.replace(".", "/") for module in dotted]
    assert [path for path in paths if not is_in_project(path)] == []
    assert [module for module in modules if not is_in_project(module, f"{module}.py")] == []


def is_in_project(*paths: str) -> bool:
    return any((folder / path).exists() for folder in (ROOT, ROOT / "mcpseg_cli") for path in paths)


def test_contributing_tells_what_each_room_may_import():
    text = CONTRIBUTING.read_text()
    ground = re.search(r"^The ground, .*?;", text, re.MULTILINE | re.DOTALL).group()
    assert set(re.findall(r"`(\w+)\.py`", ground)) == GROUND
    rows = re.findall(r"^\| `(\w+)/` \| .* \| (.*) \|$", text, re.MULTILINE)
    told = {room: set(re.findall(r"`(\w+)`", others)) for room, others in rows}
    assert told.pop("cli") == set()  # "all of them"
    rooms = set(MAY_IMPORT) - GROUND - {"cli"}
    assert told == {room: MAY_IMPORT[room] - GROUND for room in rooms}


# --- versions ---


def test_changelog_citation_and_package_agree_on_versions():
    headings = re.findall(r"^## (.+)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    parsed = [re.fullmatch(r"([\d.]+) \((\d{4}-\d\d-\d\d|unreleased)\)", one) for one in headings]
    assert all(parsed)
    versions = [match.groups() for match in parsed]
    dated = [version for version in versions if version[1] != "unreleased"]
    assert versions[1:] == dated[-len(versions[1:]) :]  # only the newest may have no date
    citation = (ROOT / "CITATION.cff").read_text()
    cited = re.findall(r"^(?:version|date-released): (.+)$", citation, re.MULTILINE)
    assert tuple(cited) == dated[0]
    assert mcpseg_cli.__version__ in (versions[0][0], dated[0][0])
