"""Which tests of a room look at a module."""

import ast
import functools
from collections import deque
from collections.abc import Iterator
from pathlib import Path

ROOMS = ("search/trackers", "search/likelihood", "search/behaviour", "evidence", "body")
CHOICES = ("settings.py", "paper_presets.py", "shared_knobs.py", "catalogue.py", "__init__.py")
"""Files (by the ends of their names) that declare what can be chosen and compute nothing."""


class Room:
    """A room's modules and its own tests. root : of the checkout."""

    def __init__(self, root: Path, name: str, package: str = "studio") -> None:
        self.name = name
        self._root = root
        self._modules = sorted((root / package / name).rglob("*.py"))
        self._tests = sorted((root / "tests" / name).rglob("test_*.py"))
        beside = (root / "tests" / name).rglob("*.py")
        self._helpers = {*(root / "tests").glob("*.py"), *beside} - {*self._tests}

    def sources(self) -> list[str]:
        """The files that can be changed, relative to the root."""
        return [
            f"{file.relative_to(self._root)}" for file in self._modules if not file.name.endswith(CHOICES)
        ]

    def tests_of(self, source: str, whole: bool = False) -> list[str]:
        """The room's test files that import a module, or those that come nearest to it by imports within the room, the
        nearest first. whole : all that reach it.
        """
        wanted = self._root / source
        near: dict[Path, int] = {}
        waiting = deque([(wanted, 0)])
        while waiting:
            at, steps = waiting.popleft()
            if at in near:
                continue
            near[at] = steps
            for user in self._users.get(at, ()):
                # A builder of tests is a part of the test.
                if at in self._helpers:
                    waiting.appendleft((user, steps))
                else:
                    waiting.append((user, steps + 1))
        own = f"test_{wanted.name}"
        found = [file for file in self._tests if file in near or file.name == own]
        least = min((near[file] for file in found if file in near), default=0)
        kept = [file for file in found if whole or file.name == own or near[file] == least]
        kept.sort(key=lambda file: (file.name != own, near.get(file, 0), file))
        return [f"{file.relative_to(self._root)}" for file in kept]

    @functools.cached_property
    def _users(self) -> dict[Path, list[Path]]:
        """Of each module of the room, and of each builder of tests, the files that import it."""
        users: dict[Path, list[Path]] = {}
        for file in (*self._modules, *self._helpers, *self._tests):
            for used in self._imports(file):
                users.setdefault(used, []).append(file)
        return users

    def _imports(self, file: Path) -> Iterator[Path]:
        for name in _named(ast.parse(file.read_text())):
            path = Path(*name.split("."))
            for folder in (self._root, self._root / "tests", file.parent):
                for other in (folder / path.with_suffix(".py"), folder / path / "__init__.py"):
                    if other.is_file():
                        yield other


def _named(tree: ast.AST) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names
