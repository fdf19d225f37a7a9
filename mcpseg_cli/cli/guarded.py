"""A command of mcpseg that ends with whoever started it, as if killed: checkpoints survive that.

    python -m mcpseg_cli.cli.guarded THREADS WORD...

Standard input must be a pipe that the starter holds open as long as it lives and wants the result.
"""

import os
import sys
import threading


def _end_with_starter() -> None:
    os.read(0, 1)  # returns when nobody holds the other end any more
    os._exit(137)


def main() -> None:
    """Run the command."""
    threads, *words = sys.argv[1:]
    os.environ["OMP_NUM_THREADS"] = os.environ["NUMBA_NUM_THREADS"] = threads
    threading.Thread(target=_end_with_starter, daemon=True).start()

    from mcpseg_cli.cli import main as run

    sys.argv = ["mcpseg", *words]
    run()


if __name__ == "__main__":
    main()
