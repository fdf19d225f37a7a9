"""How long the stages of a scan take."""

from time import perf_counter


class Stopwatch:
    """Milliseconds between laps, by name.

    Attributes:
        ms: Milliseconds of each lap so far, in order.
    """

    def __init__(self) -> None:
        self.ms: dict[str, float] = {}
        self._last = perf_counter()

    def lap(self, name: str) -> None:
        """End a lap, one more of this name perhaps; the next begins."""
        now = perf_counter()
        self.ms[name] = self.ms.get(name, 0.0) + 1e3 * (now - self._last)
        self._last = now
