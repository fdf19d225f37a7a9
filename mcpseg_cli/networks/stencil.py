"""The voxels around a voxel, by number."""

NUM_NEIGHBOURS = 27
"""A voxel and the 26 around it, by their offsets of -1 to 1, x slowest."""
NUM_FORWARD = 13
"""Neighbours of which each pair of voxels has one: the last of them."""
