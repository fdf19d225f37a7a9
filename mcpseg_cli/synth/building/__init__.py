"""Walls, ceilings, doors and windows of synthetic buildings."""
