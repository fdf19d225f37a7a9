"""The things themselves: a function for each kind, made of solids in its own frame.

A thing stands on z = 0 with its back at y = 0, its middle at x = 0. Colours come from the style of
the building, sizes and shape from random numbers. ``chairs``, ``tables``, ``sofas``,
``home_sofas``, ``bookcases`` and ``boards`` make the things of those classes; ``clutter`` has the
list of all others by name, which the remaining files make. A new thing is a function and an entry
in such a list; then a table of ``rooms/contents/`` may name it.
"""
