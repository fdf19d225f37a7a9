"""What stands, lies and hangs in which room, and where.

``furnish.furnish_room`` calls the function of the kind of room, in ``work_rooms``,
``public_rooms``, ``living_rooms`` or ``private_rooms``. They place things through a ``Placement``
(``placement``, ``placed``), which refuses what meets something, floats or takes a robot's way
(``floor_space``). ``desks``, ``seating`` and ``dressing`` have what rooms share; how many of which
things there are is in the tables of ``contents/``.
"""
