"""The rooms that footage can be made in, by name."""

from collections.abc import Callable

from studio.synthesis.drawn_room import DRAWN, drawn_room
from studio.synthesis.hall import hall
from studio.synthesis.office import office
from studio.synthesis.room import Room, furnished_room

ROOMS: dict[str, Callable[[float], Room]] = {"furnished": furnished_room, "office": office, "hall": hall}


def is_room(name: str) -> bool:
    """Whether a room is called that: one of ROOMS, or "drawn-" and a whole number."""
    return name in ROOMS or (name.startswith(DRAWN) and name.removeprefix(DRAWN).isdecimal())


def room_called(name: str, obstacle_height: float = 0.0) -> Room:
    """The room of that name; with a box of the given height (mm) at the origin where one is stepped over."""
    if name in ROOMS:
        return ROOMS[name](obstacle_height)
    return drawn_room(int(name.removeprefix(DRAWN)), obstacle_height)
