"""Many recordings segmented, each for itself, and merged; on one machine or on many."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from mcpseg_cli.choices import Engine

if TYPE_CHECKING:
    from mcpseg_cli.merge.engines import Outcome, Words


def words_of(context: typer.Context, without: Collection[str]) -> list[str]:
    """Spell the options that were given on the command line, as they are given again.

    Args:
        context: Of the command; files are named so that they are found from other folders.
        without: Parameters that are left out, by name.
    """
    words: list[str] = []
    for parameter in context.command.params:
        name = parameter.name or ""
        source = context.get_parameter_source(name)
        if name in without or source is None or source.name != "COMMANDLINE":
            continue
        if parameter.param_type_name != "option":
            continue
        value = context.params[name]
        if isinstance(value, bool):
            words.append(parameter.opts[0] if value else parameter.secondary_opts[0])
        else:
            is_file = isinstance(value, str | Path) and Path(value).is_file()
            words += [parameter.opts[0], str(Path(value).resolve() if is_file else value)]
    return words


def run_all(
    commands: Sequence[Words],
    title: str,
    engine: Engine,
    scheduler: str | None,
    *,
    jobs: int,
    quiet: bool,
) -> list[Outcome]:
    """Run commands under a progress bar; all of them, also when one fails.

    Raises:
        McpsegError: What the first that failed said.

    Returns:
        What became of them, in the order of the commands.
    """
    from mcpseg_cli.cli.display import notice, progress_bar
    from mcpseg_cli.cli.options import number_of_jobs
    from mcpseg_cli.errors import McpsegError
    from mcpseg_cli.merge.engines import run_here, run_on_dask

    outcomes: list[Outcome] = []
    with progress_bar(title, quiet=quiet) as bar:
        task = bar.add_task("", total=len(commands), state="")
        running: Iterator[Outcome]
        if engine == "dask":
            assert scheduler is not None
            running = run_on_dask(
                commands, scheduler, lambda line: notice(f"mcpseg: {line}", quiet=quiet)
            )
        else:
            running = run_here(commands, jobs, max(1, number_of_jobs(None) // jobs))
        for outcome in running:
            outcomes.append(outcome)
            bar.update(task, advance=1)
            if outcome.status:
                notice(f"mcpseg: {outcome.error}", quiet=quiet, console=bar.console)
    if failed := [outcome for outcome in outcomes if outcome.status]:
        count = f"{len(failed):,} of {len(commands):,} failed"
        raise McpsegError(
            f"{title}: {count}, first: {failed[0].error}; mend it and run the same command again, "
            "what is done is kept"
        )
    return sorted(outcomes, key=lambda outcome: commands.index(outcome.words))


def segment_recordings(
    table: Path,
    output: Path,
    options: Sequence[str],
    engine: Engine,
    scheduler: str | None,
    *,
    jobs: int | None,
    overwrite: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Segment the recordings of a table, then merge their maps.

    Args:
        table: CSV, see ``merge.recordings``.
        output: Folder of the merged run; the recordings' own are in its recordings/.
        options: Of ``mcpseg segment``, for all of them.
        engine: What runs them.
        scheduler: Address of the Dask scheduler.
        jobs: Processes at a time on this machine.
        overwrite: Start again.
        as_json: Print one JSON document.
        quiet: Say nothing.
    """
    from mcpseg_cli.cli.options import number_of_jobs
    from mcpseg_cli.merge.recordings import read_recordings

    if (engine == "dask") != (scheduler is not None):
        raise typer.BadParameter("--engine dask and --scheduler ADDRESS go together")
    recordings = read_recordings(table)
    folder = output.resolve() / "recordings"
    again = ["--overwrite"] if overwrite else []
    commands = [
        (
            "segment", *map(str, each.inputs), "-o", str(folder / each.name), "--json", "--quiet",
            *options, *each.settings, *again,
        )
        for each in recordings
    ]  # fmt: skip
    jobs = min(jobs or number_of_jobs(None), len(commands))
    run_all(commands, "segment", engine, scheduler, jobs=jobs, quiet=quiet or as_json)

    # their maps
    merge = [
        "merge",
        *(str(folder / each.name) for each in recordings),
        "-o",
        str(output.resolve()),
    ]
    for each in recordings:
        if each.transform is not None:
            merge += ["--transform", f"{folder / each.name}={each.transform}"]
    if overwrite or _is_only_merged(output):
        merge.append("--overwrite")
    words = (*merge, "--json", "--quiet")
    (merged,) = run_all([words], "merge", engine, scheduler, jobs=1, quiet=quiet or as_json)
    if as_json or not quiet:
        _print(json.loads(merged.stdout), as_json=as_json)


def _is_only_merged(output: Path) -> bool:
    """Tell whether a folder has a merge to which no scan was added: it can be made again."""
    from mcpseg_cli.segment.folder import kept_state

    with kept_state(output) as state:
        scans = [] if state is None else state.scans()
    return bool(scans) and all(scan.is_merged for scan in scans)


def _print(merged: dict[str, object], *, as_json: bool) -> None:
    from mcpseg_cli.cli.display import print_table

    if as_json:
        typer.echo(json.dumps(merged))
        return
    names = ("scans", "voxels", "objects")
    parts = merged["parts"]
    assert isinstance(parts, list)
    print_table(
        [
            ("recordings", f"{len(parts):,}"),
            *((name, f"{merged[name]:,}") for name in names),
            ("map", f"{merged['output']}/map.ply"),
        ]
    )
