"""``python -m mcpseg_cli``: the same as the ``mcpseg`` command."""

from mcpseg_cli.cli import main

if __name__ == "__main__":  # worker processes import this file too
    main()
