"""Procedural buildings: labelled point clouds, in the layout of S3DIS, that anyone may use.

``area.py`` makes an area room by room in five steps, each a folder here: ``building/`` plans the
floor and builds the shell of each room, ``rooms/`` places what ``things/`` makes, ``surfaces/``
says what everything looks like, ``scanning/`` turns it into the points and colours a scanner would
have recorded; ``geometry/`` is what all of them build with. ``run.py`` writes areas to disk.

Numbers to edit are TOML: ``styles/`` has a file for each style of building, ``rooms/contents/``
says which things stand in which room. They are read and checked when first used.
"""

from mcpseg_cli.synth.area import RoomCloud, make_area, make_building
from mcpseg_cli.synth.surfaces.catalogue import style_of, styles

__all__ = ["RoomCloud", "make_area", "make_building", "style_of", "styles"]
