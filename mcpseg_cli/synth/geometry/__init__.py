"""Solids, shapes and collisions."""
