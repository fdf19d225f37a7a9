"""Ctrl-C and SIGTERM as a wish that long work looks at."""

from __future__ import annotations

import signal
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import FrameType


class Interrupt:
    """Ctrl-C or SIGTERM asks to stop after the step at hand; a second one stops at once.

    Args:
        is_patient: A second one changes nothing: torchrun sends its own beside the terminal's.
    """

    def __init__(self, *, is_patient: bool = False) -> None:
        self.asked = False
        self._is_patient = is_patient

    def __enter__(self) -> Interrupt:
        self._before = {
            number: signal.signal(number, self._ask) for number in (signal.SIGINT, signal.SIGTERM)
        }
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _ask(self, number: int, frame: FrameType | None) -> None:
        if self.asked and not self._is_patient:
            raise KeyboardInterrupt
        self.asked = True
