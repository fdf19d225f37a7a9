"""The plan of a floor and the shells of its rooms: everything but the furniture.

``layout.plan_area`` draws the plan: ``corridors``, rooms along them (``spaces``), then what
``fittings`` adds: windows and ``fixtures``. ``shell.build_shell`` builds a planned room as it is
seen from inside: floor, ``ceilings`` with lamps, ``doors``, ``windows``, ``installations``,
``switches_and_signs``. ``walls`` knows where walls run and what is free along them; ``rugs`` are
laid last, with the furniture.
"""
