"""The rooms that footage can be made in, by name."""

from collections.abc import Callable

from studio.synthesis.hall import hall
from studio.synthesis.office import office
from studio.synthesis.room import Room, furnished_room

ROOMS: dict[str, Callable[[float], Room]] = {"furnished": furnished_room, "office": office, "hall": hall}
