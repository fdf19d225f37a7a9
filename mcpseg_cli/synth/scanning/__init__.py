"""From the surfaces of a furnished room to the points and colours of a scan.

``scanner.scan_room`` does it all: it stands tripods in the room, samples points on all surfaces
(``sampling``), keeps those that a tripod sees (``viewing``, over the voxels of ``visibility``),
lets lamps and windows shine on them (``lighting``), takes the photo (``photo``) and adds the
errors of real scanners.
"""
