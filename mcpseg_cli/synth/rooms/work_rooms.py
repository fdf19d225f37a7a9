"""Rooms people work in: offices, open plan, meeting rooms, copy rooms, storage."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import Points, stand
from mcpseg_cli.synth.geometry.solids import Item
from mcpseg_cli.synth.rooms.dressing import (
    board,
    bookcases,
    dress_desk,
    dress_top,
    floor_clutter,
    put_at,
    seat_at,
    seats_around,
    wall_clutter,
    wall_shelves,
    windows,
)
from mcpseg_cli.synth.rooms.placement import Placed, Placement, about_centre
from mcpseg_cli.synth.things.boards import make_board
from mcpseg_cli.synth.things.chairs import make_chair
from mcpseg_cli.synth.things.clutter import make_clutter
from mcpseg_cli.synth.things.office_equipment import partition_parts
from mcpseg_cli.synth.things.sofas import make_sofa
from mcpseg_cli.synth.things.tables import make_table, meeting_parts

_SWIVEL = ("task", "executive")
_VISITOR = ("four-leg", "four-leg", "cantilever", "folding", "armchair")
_CABINETS_AND_SUCH = (
    "filing cabinet",
    "filing cabinet",
    "filing cabinet",
    "lockers",
    "plant",
    "plant",
    "coat stand",
    "floor lamp",
    "fan",
    "copier",
    "bicycle",
    "partition",
    "partition",
    "fridge",
    "water cooler",
    "tv stand",
    "leaning board",
    "carton pile",
    "trolley",
)
_SHELVES = ("open", "open", "open", "cupboard", "glass", "low", "low", "rack")


def pick_chair(placement: Placement, designs: tuple[str, ...]) -> Item:
    """Make a chair of one of the designs, those in use in the building preferred."""
    usual = tuple(design for design in designs if design in placement.style.chairs)
    choice = usual if usual and placement.chance(0.85) else designs
    return make_chair(
        choice[int(placement.rng.integers(len(choice)))], placement.style, placement.rng
    )


def pick_desk(placement: Placement) -> Item:
    """Make a desk of a design in use in the building."""
    usual = [
        design
        for design in ("desk", "desk", "desk", "corner", "standing", "trestle")
        if design in placement.style.tables
    ]
    return make_table(
        str(placement.rng.choice(np.array(usual or ["desk"]))), placement.style, placement.rng
    )


def work_place(
    placement: Placement, desk: Item, chair: Item, *, wall: bool, visitor: Item | None = None
) -> Placed | None:
    """Place a desk at a wall or somewhere in the room, its chair before it, a visitor's behind, and what lies on it."""
    placed = placement.against_wall(desk, gap=0.2, tries=20) if wall else None
    if placed is None:
        square = float(placement.rng.integers(4)) * np.pi / 2
        placed = placement.freely(desk, yaw=square, margin=0.6, tries=14)
    if placed is None:
        return None
    seat_at(
        placement,
        placed,
        chair,
        placement.rng.normal(0, 0.12) * placed.size[0],
        pull=float(abs(placement.rng.normal(0, 0.2))),
    )
    if visitor is not None:
        seat_at(placement, placed, visitor, placement.rng.normal(0, 0.2), side=-1.0, pull=0.15)
    dress_desk(placement, placed)
    return placed


def furnish_office(placement: Placement) -> None:
    """Desks at walls and windows, bookcases, a board, chairs for visitors, at times a meeting table or a sofa."""
    rng, area = placement.rng, float(placement.size.prod())
    windows(placement)
    desks = int(np.clip(round(area / rng.uniform(5, 8)), 1, 8))
    chair, desk = (
        pick_chair(placement, _SWIVEL if placement.chance(0.85) else ("four-leg", "cantilever")),
        pick_desk(placement),
    )
    visitor = pick_chair(placement, _VISITOR)
    first = int(rng.integers(1, 4)) if area < 14 else int(rng.integers(2, 6))
    bookcases(placement, first, _SHELVES)
    if area > 12 and placement.chance(0.9):
        meeting_corner(placement, visitor)
    for _ in range(desks):
        if placement.chance(0.3):
            chair = pick_chair(placement, _SWIVEL)
        if placement.chance(0.3):
            desk = pick_desk(placement)
        work_place(placement, desk, chair, wall=placement.chance(0.65), visitor=visitor)
    for _ in range(int(rng.integers(1, 3))):
        placement.against_wall(visitor, turn=0.3, gap=0.1, tries=12)
    if placement.chance(0.85):
        board(placement)
    if area > 20 and placement.chance(0.6):
        meeting_corner(placement, visitor)
    if area > 15 and placement.chance(0.12):
        placement.against_wall(make_sofa(int(rng.integers(1, 4)), placement.style, rng), gap=0.06)
    bookcases(placement, placement.times(1.0 + area / 13), _SHELVES)
    office_clutter(placement, area)


def meeting_corner(placement: Placement, chair: Item) -> None:
    """Place a round or small table with two to four chairs, in large rooms also an oblong one with up to six."""
    rng = placement.rng
    is_long = float(placement.size.prod()) > 17 and placement.chance(0.6)
    if is_long:
        table = stand(
            "table",
            meeting_parts(
                rng.uniform(1.3, 2.0), rng.uniform(0.75, 0.95), 0.74, placement.style, rng
            ),
        )
    else:
        table = make_table(
            str(rng.choice(["round", "round", "round", "pedestal"])), placement.style, rng
        )
    placed = placement.freely(table, margin=0.75, tries=20, yaw=float(rng.integers(4)) * np.pi / 2)
    if placed is not None:
        seats_around(placement, placed, chair, 0.65, round_=not is_long)
        dress_top(placement, placed, ("books", "paper", "mug", "laptop", "bottle"), 2.0)


def office_clutter(placement: Placement, area: float) -> None:
    """Place what stands, lies and hangs about in an office, more in untidy buildings."""
    mess = placement.mess()
    for kind in placement.rng.choice(_CABINETS_AND_SUCH, placement.times((0.12 + 0.2 * mess) * area)):  # fmt: skip
        item = make_clutter(str(kind), placement.style, placement.rng)
        placed = placement.against_wall(item, gap=0.05, turn=0.03)
        if placed is not None and placed.size[2] < 1.5 and kind == "filing cabinet":
            dress_top(placement, placed, mean=1.5)
    wall_shelves(placement, 0.3 + 0.02 * area)
    wall_clutter(placement, 2.5 + 0.2 * area)
    floor_clutter(placement, 1.5 + mess * area / 2.5)


def furnish_open_plan(placement: Placement) -> None:
    """Blocks of desks back to back with screens between them, cupboards along the walls."""
    rng, area = placement.rng, float(placement.size.prod())
    windows(placement)
    bookcases(placement, int(area / 18), ("low", "low", "open", "cupboard"))
    along = 0 if placement.size[0] >= placement.size[1] else 1
    desk = make_table(str(rng.choice(["desk", "desk", "standing"])), placement.style, rng)
    chair = pick_chair(placement, _SWIVEL)
    screen = stand(
        "clutter",
        partition_parts(desk.bounds()[1, 0] * 2, rng.uniform(1.15, 1.5), placement.style, rng),
    )
    wide, deep = float(np.ptp(desk.bounds()[:, 0])) + 0.03, float(desk.bounds()[1, 1])
    step_along, step_across = 2 * wide + rng.uniform(1.0, 1.5), 2 * deep + rng.uniform(1.7, 2.3)
    starts = _spread(0.8 + wide, float(placement.size[along]) - wide - 0.8, step_along)
    rows = _spread(1.0 + deep, float(placement.size[1 - along]) - deep - 1.0, step_across)
    for start in starts:
        for row in rows:
            if placement.chance(0.9):
                _desk_block(placement, (float(start), float(row)), along, (desk, chair, screen))
    if placement.chance(0.7):
        board(placement, ("whiteboard", "whiteboard", "mobile", "flip chart", "pin board"))
    guest = pick_chair(placement, _VISITOR)
    for _ in range(1 + placement.times(area / 22)):
        meeting_corner(placement, guest)
    for _ in range(int(rng.integers(1, 3))):
        placement.against_wall(guest, turn=0.3, gap=0.1)
    office_clutter(placement, area * 0.6)


def _spread(first: float, last: float, step: float) -> Points:
    """Return places from first to last, at least a step apart; the middle if there is no room."""
    if last <= first:
        return np.array([(first + last) / 2])
    return np.linspace(first, last, 1 + int((last - first) / step))


def _desk_block(
    placement: Placement, spot: tuple[float, float], along: int, pieces: tuple[Item, Item, Item]
) -> None:
    """Place four desks, two by two, back to back about a spot given from the room's corner."""
    desk, chair, screen = pieces
    turn = 0.0 if along == 0 else np.pi / 2
    middle = placement.room.low + (np.array(spot) if along == 0 else np.array(spot)[::-1])
    cosine, sine = np.cos(turn), np.sin(turn)
    wide = float(np.ptp(desk.bounds()[:, 0])) + placement.rng.uniform(0.005, 0.03)
    if placement.chance(0.75):
        placement.put(screen, about_centre(screen, float(middle[0]), float(middle[1]), turn))
    gap = placement.rng.uniform(0.15, 0.19)
    for side in (1, -1):
        for number in (-0.5, 0.5):
            x, y = number * wide, side * gap
            pose = (
                float(middle[0] + cosine * x - sine * y),
                float(middle[1] + sine * x + cosine * y),
                0.0,
                turn + (0.0 if side > 0 else np.pi),
            )
            placed = placement.put(desk, pose)
            if placed is None:
                continue
            seat_at(
                placement,
                placed,
                chair,
                placement.rng.normal(0, 0.1),
                pull=float(abs(placement.rng.normal(0, 0.2))),
            )
            dress_desk(placement, placed, computer=0.9)


def furnish_meeting_room(placement: Placement) -> None:
    """A long table with chairs all round, a board or screen, a television, a side board."""
    rng, size = placement.rng, placement.size
    windows(placement)
    along = int(np.argmax(size))
    length = float(np.clip(size[along] - rng.uniform(2.2, 2.9), 1.4, 6.5))
    depth = float(np.clip(size[1 - along] - rng.uniform(2.5, 3.1), 0.8, 1.6))
    table = stand(
        "table", meeting_parts(length, depth, rng.uniform(0.71, 0.76), placement.style, rng)
    )
    middle = (placement.room.low + placement.room.high) / 2
    turn = 0.0 if along == 0 else np.pi / 2
    poses = []
    for play in (0.05, 0.15, 0.3, 0.3):
        x, y = (middle + rng.normal(0, play, 2)).tolist()
        poses.append(about_centre(table, x, y, turn + rng.normal(0, 0.02)))
    placed = placement.try_poses(table, poses)
    if placement.chance(0.85):
        board(placement, ("whiteboard", "whiteboard", "projection screen", "chalkboard"))
    if placement.chance(0.5):
        placement.hang(
            make_clutter("wall tv", placement.style, rng), rng.uniform(0.9, 1.2), tries=12
        )
    chair = pick_chair(placement, ("task", "cantilever", "executive", "four-leg", "armchair"))
    if placed is not None:
        seats_around(placement, placed, chair, rng.uniform(0.58, 0.7))
        dress_top(
            placement,
            placed,
            ("laptop", "paper", "mug", "bottle", "telephone", "books", "projector"),
            2 + 2.0 * length * placement.mess(),
        )
        _projector(placement, middle)
    bookcases(placement, placement.times(1.7), ("low", "low", "cupboard", "open"))
    if placement.chance(0.4):
        placement.against_wall(
            make_board(str(rng.choice(["flip chart", "mobile"])), placement.style, rng),
            gap=0.3,
            turn=0.4,
        )
    for _ in range(placement.times(5.0)):
        placement.against_wall(chair, turn=0.2, gap=0.1)
    wall_clutter(
        placement, 1.5 + 0.05 * float(size.prod()), ("picture", "picture", "clock", "cable run")
    )
    floor_clutter(
        placement,
        1.0 + 2 * placement.mess(),
        (
            "bin",
            "plant",
            "plant",
            "coat stand",
            "tv stand",
            "carton",
            "backpack",
            "trolley",
            "cables",
        ),
    )


def _projector(placement: Placement, middle: Points) -> None:
    """Hang a projector from the ceiling over the table."""
    if placement.chance(0.45):
        item = make_clutter("ceiling projector", placement.style, placement.rng)
        z = placement.room.ceiling - float(item.bounds()[1, 2])
        x, y = (middle + placement.rng.normal(0, 0.5, 2)).tolist()
        placement.put(item, (x, y, z, float(placement.rng.integers(4)) * np.pi / 2))


def furnish_copy_room(placement: Placement) -> None:
    """Copiers, shelves with paper, a table, boxes."""
    windows(placement)
    for _ in range(int(placement.rng.integers(1, 4))):
        placement.against_wall(make_clutter("copier", placement.style, placement.rng), gap=0.08)
    table = placement.against_wall(make_table("desk", placement.style, placement.rng))
    if table is not None:
        put_at(placement, table, "printer", 0.2, 0.35)
        dress_top(placement, table, ("paper", "trays", "books", "carton", "pen pot"), 5)
    bookcases(placement, placement.times(2.0), ("open", "rack", "cupboard", "low"))
    if placement.chance(0.4):
        board(placement, ("pin board", "whiteboard"))
    wall_clutter(placement, 2.0)
    floor_clutter(
        placement,
        3 + 4 * placement.mess(),
        ("carton", "carton pile", "bin", "trolley", "filing cabinet", "carton pile"),
    )


def furnish_storage(placement: Placement) -> None:
    """Racks along the walls, boxes, ladders, trolleys, stacked chairs, things put away."""
    rng, area = placement.rng, float(placement.size.prod())
    if placement.chance(0.5):
        placed = placement.against_wall(
            make_table(str(rng.choice(["desk", "trestle"])), placement.style, rng)
        )
        if placed is not None:
            dress_top(
                placement,
                placed,
                ("carton", "books", "printer", "monitor", "trays", "paper", "bottle"),
                5,
            )
    for _ in range(placement.times(1.2)):
        stack(placement, make_chair("four-leg", placement.style, rng))
    bookcases(placement, int(1 + area / 5), ("rack", "rack", "rack", "open", "cupboard"))
    kinds = (
        "carton pile",
        "carton",
        "carton pile",
        "ladder",
        "trolley",
        "lockers",
        "filing cabinet",
        "leaning board",
        "fan",
        "suitcase",
        "partition",
        "bicycle",
        "pc tower",
        "copier",
        "bin",
    )
    floor_clutter(placement, 3 + area * (0.3 + 0.5 * placement.mess()), kinds)
    wall_shelves(placement, 0.6)
    wall_clutter(placement, 1.0, ("cable run", "wall box", "wall box"))


def stack(placement: Placement, chair: Item) -> None:
    """Stack two to five chairs, each a little higher and further forward than the one below."""
    items = [
        chair.moved(y=0.035 * row, z=0.085 * row)
        for row in range(int(placement.rng.integers(2, 6)))
    ]
    placement.against_wall(
        [Item("chair", tuple(part for item in items for part in item.parts))], gap=0.1, turn=0.2
    )
