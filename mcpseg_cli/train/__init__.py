"""Training (III-D)."""
