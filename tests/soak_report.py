"""What the long campaign did and found."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

MOST_S = 10.0  # to read a small file, or to refuse it
MOST_MB = 2000.0  # of memory that one takes


@dataclass
class Report:
    """What was done so far, and what was found; seeds are ``first_seed`` and those that follow."""

    first_seed: int
    rounds: int = 0
    seconds: float = 0.0
    processor_s: Counter[str] = field(default_factory=Counter)
    kills: Counter[str] = field(default_factory=Counter)
    kills_of_new_interpreters: int = 0
    finished: Counter[str] = field(default_factory=Counter)
    bit_flips: Counter[str] = field(default_factory=Counter)
    others: Counter[str] = field(default_factory=Counter)
    read: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)
    slowest_s: float = 0.0
    slowest: str = ""
    most_mb: float = 0.0
    most: str = ""
    failures: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._began = time.monotonic()

    def age(self) -> float:
        """How many seconds it goes on."""
        return time.monotonic() - self._began

    @contextmanager
    def timed(self, part: str) -> Iterator[None]:
        """Add what a part takes of the processor, in this process and in others."""
        before = sum(os.times()[:4])
        yield
        self.processor_s[part] += round(sum(os.times()[:4]) - before, 1)

    def found(self, what: str) -> None:
        """Add something that must not be."""
        self.failures.append(what)

    def as_json(self) -> dict[str, object]:
        """Give all that is known, and the sums first."""
        self.seconds = round(self.age(), 1)
        sums = {
            "kills": self.kills.total(),
            "mutated inputs": self.read.total() + self.refused.total(),
            "readers": len(self.read | self.refused),
            "bit flips": self.bit_flips.total(),
            **self.others,
        }
        return {"sums": sums, **self.as_dict()}

    def add(self, part: Report) -> None:
        """Add what a part of the campaign did and found."""
        self.rounds = max(self.rounds, part.rounds)
        self.kills_of_new_interpreters += part.kills_of_new_interpreters
        self.failures += part.failures
        for name in ("processor_s", "kills", "finished", "bit_flips", "others", "read", "refused"):
            getattr(self, name).update(getattr(part, name))
        if part.slowest_s > self.slowest_s:
            self.slowest_s, self.slowest = part.slowest_s, part.slowest
        if part.most_mb > self.most_mb:
            self.most_mb, self.most = part.most_mb, part.most

    def as_dict(self) -> dict[str, object]:
        """Give what makes one again."""
        return {name: value for name, value in vars(self).items() if name[0] != "_"}

    def line(self) -> str:
        """Say all in one line."""
        kills = ", ".join(f"{name} {count}" for name, count in sorted(self.kills.items()))
        others = ", ".join(f"{count:,} {name}" for name, count in self.others.items())
        files = f"{self.read.total():,} damaged files read, {self.refused.total():,} refused"
        return (
            f"{self.kills.total():,} kills ({kills}); {self.bit_flips.total():,} bit flips; "
            f"{others}; {files}; {len(self.failures):,} found"
        )

    def last_lines(self) -> str:
        """Say all, what was slowest and largest, and what was found."""
        self.as_json()
        seeds = f"seeds {self.first_seed} to {self.first_seed + self.rounds - 1}"
        return "\n".join(
            [
                f"{seeds}, {self.seconds:,.0f} s: {self.line()}",
                f"{self.kills_of_new_interpreters:,} kills were of new interpreters, "
                f"the others of forks",
                f"slowest read {self.slowest_s:.2f} s of {MOST_S:.0f} s ({self.slowest})",
                f"most memory {self.most_mb:,.0f} MB of {MOST_MB:,.0f} MB ({self.most})",
                *self.failures,
                *([] if self.failures else ["nothing found"]),
            ]
        )
