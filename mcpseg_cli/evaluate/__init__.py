"""Scores of labelled maps (IV-A, IV-B)."""
