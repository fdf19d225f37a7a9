"""``python -m mcpseg_cli``: the same as the ``mcpseg`` command."""

from mcpseg_cli.cli import main

main()
