"""Commands that are killed at random moments until they are done, beside those nobody killed."""

from __future__ import annotations

import random
import subprocess
import time
from dataclasses import dataclass, field
from functools import partial
from math import ceil
from pathlib import Path

from tests.commands import command, num_events, wait_until
from tests.forks import Fork, run_command, run_to_end
from tests.soak_commands import Killable, outputs_in
from tests.soak_report import Report

NEW_INTERPRETERS = 0.1  # of all that are killed; the others are forks
_COMPILING_S = 4.0  # what takes longer compiles kernels, the first time
_FORK_S = 0.4  # to begin with the first scan
_START_S = 2.5  # that a new interpreter needs


@dataclass
class Whole:
    """What a command left that nobody killed, and how long it took."""

    outputs: dict[str, bytes]
    seconds: float


@dataclass
class Kills:
    """Commands, and what they leave when nobody kills them.

    Attributes:
        folder: For what they write.
        commands: Them; a round kills one.
        most: How often.
    """

    folder: Path
    commands: list[Killable]
    most: int
    wholes: dict[str, Whole] = field(default_factory=dict)

    def play(self, seed: int, report: Report, deadline: float, share: float) -> None:
        """Kill a command some times; it starts from new where it was done before."""
        rng, killed = random.Random(seed), self.commands[seed % len(self.commands)]
        left = ceil(self.most * share)
        while left > 0:
            left -= max(1, self.kill(killed, left, rng, report, deadline))
            if time.monotonic() > deadline:
                break

    def kill(
        self, killed: Killable, most: int, rng: random.Random, report: Report, deadline: float
    ) -> int:
        """Kill one command until it is done, or often enough; let it finish, and compare.

        Returns:
            How often it was killed.
        """
        whole, out = self._whole(killed), self.folder / "killed"
        place = f"seed {report.first_seed + report.rounds}: {killed.name}"
        killed.before(out)

        # killed once at least
        words, num_kills = killed.words(out), 0
        while num_kills < most and self._kill_once(killed, words, out, rng, report):
            num_kills += 1
            words = killed.again(out)
            if time.monotonic() > deadline:
                break

        ended = run_to_end(killed.again(out), self.folder)
        if ended.status or ended.fault:
            said = f"status {ended.status}: {ended.said[-400:]!r}"
            report.found(f"{place} cannot go on after {num_kills} kills: {said}")
        elif found := difference(outputs_in(out), whole.outputs, out, killed.num_scans):
            report.found(f"{place} differs after {num_kills} kills: {found}")
        report.finished[killed.name] += 1
        subprocess.run(["rm", "-rf", out], check=True)
        return num_kills

    def _kill_once(
        self, killed: Killable, words: list[object], out: Path, rng: random.Random, report: Report
    ) -> bool:
        """Start a command and kill it at some moment; False where it was done before."""
        is_new, before = rng.random() < NEW_INTERPRETERS, num_events(out)
        said = self.folder / "said"
        process: Fork | subprocess.Popen[str] = (
            begin(words, said) if is_new else Fork(partial(run_command, *words), said)
        )
        if killed.num_scans and rng.random() < 0.8:  # some scans further, or about to end
            wanted = killed.num_scans if rng.random() < 0.1 else before + rng.randrange(1, 6)
            wait_until(lambda: num_events(out) >= wanted, process)
            time.sleep(rng.uniform(0.0, 0.03))
        else:
            seconds = _FORK_S if killed.num_scans else self.wholes[killed.name].seconds
            time.sleep(rng.uniform(0.0, seconds + _START_S * is_new))

        if process.poll() is not None:
            if process.returncode != 0:
                report.found(f"{killed.name}: {process.returncode}: {said.read_text()[-400:]!r}")
            return False
        process.kill()
        process.wait()
        report.kills[killed.name] += 1
        report.kills_of_new_interpreters += is_new
        return True

    def _whole(self, killed: Killable) -> Whole:
        """Give the outputs of a command that nothing stopped; made once."""
        if killed.name not in self.wholes:
            out = self.folder / "whole"
            for _ in range(2):
                subprocess.run(["rm", "-rf", out], check=True)
                killed.before(out)
                ended = run_to_end(killed.words(out), self.folder)
                assert (ended.status, ended.said) == (0, ""), ended
                if ended.seconds < _COMPILING_S:
                    break
            self.wholes[killed.name] = Whole(outputs_in(out), ended.seconds)
            subprocess.run(["rm", "-rf", out], check=True)
        return self.wholes[killed.name]


def begin(words: list[object], said: Path) -> subprocess.Popen[str]:
    """Start a command in a new interpreter."""
    with said.open("w") as file:
        return subprocess.Popen(command(*words), stdout=file, stderr=file, text=True)


def difference(
    found: dict[str, bytes], whole: dict[str, bytes], out: Path, num_scans: int
) -> str | None:
    """Say in which files two folders differ, or that scans were told of twice; None for neither."""
    if num_events(out) != num_scans and num_scans:
        return f"{num_events(out)} events"
    wrong = [name for name in found.keys() | whole.keys() if found.get(name) != whole.get(name)]
    return ", ".join(sorted(wrong)[:8]) or None
