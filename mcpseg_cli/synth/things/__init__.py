"""Furniture: what stands in the rooms of a synthetic building, made of solids."""
