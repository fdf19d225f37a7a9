"""A run of ``mcpseg segment`` on disk."""
