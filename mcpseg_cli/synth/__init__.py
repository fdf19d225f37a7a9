"""Procedural office buildings in the S3DIS folder layout: labelled point clouds that anyone may use."""

from mcpseg_cli.synth.area import RoomCloud, make_area, make_building
from mcpseg_cli.synth.surfaces.catalogue import style_of, styles

__all__ = ["RoomCloud", "make_area", "make_building", "style_of", "styles"]
