"""How many of which things rooms hold: tables in TOML, and the records that check them.

``shared.toml`` says how a table is read; ``work.toml``, ``public.toml`` and ``homes.toml`` have one
for each kind of room. A file is read when the first room that needs it is furnished.
"""
