"""What everything is made of: triangles with a material, put together to objects.

``solids`` has ``Part`` (triangles, material, the box they fit in), ``Item`` (the parts of one
labelled object) and plain solids; ``shapes`` has those of furniture; ``collisions`` tells which
boxes meet.
"""
