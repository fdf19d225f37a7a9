"""How much memory this process has needed."""

from __future__ import annotations

import sys


def peak_memory_mb() -> float:
    """Return the peak of this process's memory in MB; NaN where the system does not tell."""
    try:
        import resource
    except ImportError:  # Windows
        return float("nan")
    unit = 1 << 20 if sys.platform == "darwin" else 1 << 10  # bytes there, kilobytes elsewhere
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
