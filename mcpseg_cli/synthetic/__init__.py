"""Procedural office buildings in the S3DIS folder layout: labelled point clouds that anyone may use."""

from mcpseg_cli.synthetic.area import RoomCloud, make_area, make_building
from mcpseg_cli.synthetic.catalogue import STYLES, style_of

__all__ = ["STYLES", "RoomCloud", "make_area", "make_building", "style_of"]
