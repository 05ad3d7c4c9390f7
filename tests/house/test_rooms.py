"""The house from its imports alone: twelve rooms in one column, few arrows, the garden used by two commands."""

import ast
import re
from functools import cache

from test_house_rules import ROOT, SOURCES

COLUMN = (
    "foundations",
    "body",
    "footage",
    "evidence",
    "search",
    "sessions",
    "runs",
    "results",
    "operations",
    "app",
)
ROOMS = (*COLUMN, "garden", "cli")
MOST_ARROWS = 70
BY_NAME = {
    "studio/foundations/first_use.py": "the studio's and the arena's verbs, what packages that add to the studio take",
    "studio/cli/main.py": "the command that was called",
    "studio/search/likelihood/bodytrack.py": "the card's kernels, of the same room",
    "studio/search/likelihood/devices.py": "the card's kernels, of the same room",
    "studio/search/trackers/frame_loop.py": "the card's search, of the same room",
    "studio/garden/benchmarks/devices.py": "what is measured of a card, of the same room",
    "studio/cli/self_check.py": "what the card's kernels need",
}
"""Modules that import a module of the studio by its name."""


def module_of(path) -> str:
    """Dotted name of a source."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def room_of(module: str) -> str:
    """ "" for the package itself."""
    return module.split(".")[1] if "." in module else ""


@cache
def imports() -> dict[str, set[str]]:
    """Every module with the modules of the studio that it imports, inside functions too."""
    modules = {module_of(path): path for path in SOURCES}
    wanted: dict[str, set[str]] = {}
    for module, path in modules.items():
        wanted[module] = set()
        for node in ast.walk(ast.parse(path.read_text())):
            match node:
                case ast.ImportFrom(module=str(origin)) if origin.split(".")[0] == "studio":
                    names = {f"{origin}.{name.name}" for name in node.names}
                    wanted[module] |= {name if name in modules else origin for name in names}
                case ast.Import():
                    wanted[module] |= {one.name for one in node.names if one.name.split(".")[0] == "studio"}
                case _:
                    pass
    return wanted


def test_there_are_twelve_rooms() -> None:
    here = {path.relative_to(ROOT / "studio").parts[0] for path in SOURCES}
    assert here - {"__init__.py", "extending.py", "arena.py"} == set(ROOMS)


def test_arrows_between_rooms_are_few_and_none_leads_up() -> None:
    arrows = {
        (room_of(module), room_of(other))
        for module, others in imports().items()
        for other in others
        if room_of(module) != room_of(other)
    }
    assert len(arrows) <= MOST_ARROWS
    # The guide lists the studio's own verbs, the arena's, and what adding your own takes; their names are loaded on
    # first use.
    public = {"", "extending", "arena"}
    assert {room for room, other in arrows if other in public} == {"app"}
    assert {other for room, other in arrows if room in public} == {"foundations"}
    assert not {("body", "footage"), ("footage", "body")} & arrows
    up = {
        (room, other)
        for room, other in arrows
        if not {room, other} & public and ROOMS.index(other) > ROOMS.index(room)
    }
    assert up == set()


def test_the_garden_is_used_by_two_commands() -> None:
    users = {
        module
        for module, others in imports().items()
        if room_of(module) != "garden" and any(room_of(other) == "garden" for other in others)
    }
    assert users == {"studio.cli.bench_commands", "studio.cli.reproduction_commands"}


def test_hardly_anything_is_loaded_by_name() -> None:
    by_name = {
        path.relative_to(ROOT).as_posix()
        for path in SOURCES
        if re.search(r"import_module\((?!\"(?!studio))", path.read_text())
    }
    assert by_name - {"studio/foundations/extras.py", "studio/foundations/numba_in_threads.py"} == set(
        BY_NAME
    )
