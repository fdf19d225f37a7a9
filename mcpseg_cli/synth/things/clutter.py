"""The catalogue of everything else: class clutter."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mcpseg_cli.synth.geometry.shapes import stand
from mcpseg_cli.synth.geometry.solids import Item, Part
from mcpseg_cli.synth.home_classes import HOME_OF
from mcpseg_cli.synth.models.stand_in import stand_in
from mcpseg_cli.synth.surfaces.styles import Style
from mcpseg_cli.synth.things import beds, plants
from mcpseg_cli.synth.things import boxes_and_bags as loose
from mcpseg_cli.synth.things import desk_things as desk
from mcpseg_cli.synth.things import floor_things as floor
from mcpseg_cli.synth.things import home_fittings as fittings
from mcpseg_cli.synth.things import home_things as home
from mcpseg_cli.synth.things import kitchen_and_washroom as wet
from mcpseg_cli.synth.things import kitchen_units as kitchen
from mcpseg_cli.synth.things import office_equipment as office
from mcpseg_cli.synth.things import wall_things as wall
from mcpseg_cli.synth.things.cabinets import CABINET_KINDS, cabinet_kind

Maker = Callable[[Style, np.random.Generator], list[Part]]


def make_clutter(kind: str, style: Style, rng: np.random.Generator) -> Item:
    """Make a thing of class clutter, its back to y = 0, on z = 0.

    Args:
        kind: One of ``CLUTTER_KINDS``.
        style: Colours and materials of the building.
        rng: Decides sizes, shape and colours.

    Returns:
        The object.

    Raises:
        KeyError: There is no such kind.
    """
    model = stand_in("clutter", kind, style, rng)
    return model or stand("clutter", CLUTTER_KINDS[kind](style, rng), HOME_OF.get(kind, ""))


SMALL_THINGS: dict[str, Maker] = {
    "mug": loose.mug,
    "bottle": loose.bottle,
    "vase": loose.vase,
    "figure": loose.figure,
    "trays": loose.tray,
    "paper": loose.paper_stack,
    "small carton": loose.small_carton,
    "books": loose.books_lying,
    "pen pot": desk.pen_pot,
    "telephone": desk.telephone,
    "small plant": plants.small_plant,
    "desk lamp": desk.desk_lamp,
    "loudspeaker": desk.loudspeaker,
    "printer": desk.printer,
    "laptop": desk.laptop,
    "keyboard": desk.keyboard,
    "monitor": desk.monitor,
    "monitor pair": desk.monitor_pair,
    "projector": desk.projector,
    "microwave": wet.microwave,
    "coffee machine": wet.coffee_machine,
    "table lamp": home.table_lamp,
    "television": home.television,
    "bowl": home.bowl,
    "candles": home.candles,
    "pots": kitchen.pots,
    "dish rack": kitchen.dish_rack,
    "toaster": kitchen.toaster,
}
"""What stands on tables, shelves and sills."""
FLOOR_THINGS: dict[str, Maker] = {
    "carton": loose.carton,
    "carton pile": loose.carton_pile,
    "backpack": loose.backpack,
    "bag": loose.bag,
    "suitcase": loose.suitcase,
    "umbrella stand": loose.umbrella_stand,
    "pc tower": desk.pc_tower,
    "cables": desk.cables,
    "plant": plants.plant,
    "bin": floor.bin_,
    "floor lamp": floor.floor_lamp,
    "coat stand": floor.coat_stand,
    "filing cabinet": office.filing_cabinet,
    "drawer unit": office.drawer_unit,
    "lockers": office.lockers,
    "copier": office.copier,
    "fan": floor.fan,
    "ladder": floor.ladder,
    "trolley": office.trolley,
    "bicycle": floor.bicycle,
    "partition": office.partition,
    "tv stand": office.tv_stand,
    "cushion": floor.loose_cushion,
    "leaning board": floor.side_slab,
    "counter": wet.counter,
    "fridge": wet.fridge,
    "water cooler": wet.water_cooler,
    "vending machine": wet.vending_machine,
    "toilet": wet.toilet,
    "stall wall": wet.stall_wall,
    "standard lamp": home.standard_lamp,
    "toys": home.toys,
    "laundry basket": home.laundry_basket,
    "clothes": home.clothes,
    "bed": home.bed,
    "bath tub": home.bath_tub,
    "washing machine": home.washing_machine,
    "divan": beds.divan,
    "iron bed": beds.iron_bed,
    "bunk bed": beds.bunk_bed,
    "cooker": kitchen.cooker,
    "dishwasher": kitchen.dishwasher,
    "shower": fittings.shower,
    "vanity": fittings.vanity,
    "shoes": fittings.shoes,
    "shoe rack": fittings.shoe_rack,
    "drying rack": fittings.drying_rack,
    "ironing board": fittings.ironing_board,
    "pouffe": fittings.pouffe,
    "pushchair": fittings.pushchair,
    **{kind: cabinet_kind(kind) for kind in CABINET_KINDS},
}
"""What stands on the floor."""
WALL_THINGS: dict[str, Maker] = {
    "picture": wall.picture,
    "clock": wall.clock,
    "wall tv": wall.wall_tv,
    "coat hooks": wall.coat_hooks,
    "wall box": wall.wall_box,
    "cable run": wall.cable_run,
    "mirror": wall.mirror,
    "wall cupboard": wet.wall_cupboard,
    "basin": wet.basin,
    "urinal": wet.urinal,
    "towel box": wet.towel_box,
    "hood": kitchen.hood,
    "mirror cabinet": fittings.mirror_cabinet,
    "towel rail": fittings.towel_rail,
    "towel": fittings.towel,
    "coats": fittings.coats,
    "ceiling projector": wall.ceiling_projector,
}
"""What hangs on walls; the projector hangs from the ceiling."""
CLUTTER_KINDS: dict[str, Maker] = {**SMALL_THINGS, **FLOOR_THINGS, **WALL_THINGS}
"""Everything, by name."""
