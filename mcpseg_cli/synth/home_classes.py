"""Finer classes of synthetic things, for areas that are named for homes."""

from __future__ import annotations

_KINDS: dict[str, tuple[str, ...]] = {
    "bed": ("bed", "divan", "iron bed", "bunk bed"),
    "cabinet": (
        "wardrobe", "tall cabinet", "chest", "sideboard", "low unit", "shoe cabinet",
        "bedside cabinet", "base cabinet", "filing cabinet", "drawer unit", "lockers",
        "mirror cabinet",
    ),
    "kitchen": ("counter", "wall cupboard"),
    "appliance": (
        "fridge", "washing machine", "dishwasher", "cooker", "hood", "microwave", "coffee machine",
        "toaster", "water cooler", "vending machine",
    ),
    "sanitary": ("toilet", "urinal", "basin", "bath tub", "shower", "vanity"),
    "screen": ("monitor", "monitor pair", "television", "wall tv", "tv stand"),
    "lamp": ("desk lamp", "table lamp", "floor lamp", "standard lamp"),
    "plant": ("plant", "small plant"),
    "picture": ("picture",),
    "box": ("carton", "carton pile", "small carton", "backpack", "bag", "suitcase"),
}  # fmt: skip
HOME_OF = {kind: home for home, kinds in _KINDS.items() for kind in kinds}
"""Finer class of the things of class clutter, by name; those that are not here stay clutter."""
