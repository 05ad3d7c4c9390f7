"""Kinds that have many members: the studio's own, and those that other installed packages add.

A package adds a member by an entry point in the registry's group, under the member's name:

    [project.entry-points."studio.trackers"]
    toy = "my_package.toy:TRACKER"

Entry points are read when the members are listed, or one is sought that the studio does not have itself. One that
cannot be loaded, or is not what its group is for, is left out; `problems` says why, and so does asking for it by name.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property
from importlib import metadata
from typing import Any, Generic, Protocol, TypeVar

from studio.foundations.errors import SettingsError, StudioError


class Named(Protocol):
    @property
    def name(self) -> str:
        """Its key in the registry."""
        ...


Member = TypeVar("Member", bound=Named)


class UnknownMemberError(SettingsError, KeyError):
    """There is no member of that name; a KeyError too, as a mapping's should be."""

    __str__ = StudioError.__str__


class PlugInError(UnknownMemberError, code="plug-in"):
    """A member that an installed package promises and does not give."""


class Registry(Mapping[str, Member], Generic[Member]):
    """Members by name, the studio's own first, then those of packages by their names.

    kind : what a member is, in a message ("tracker"). group : of the entry points. member_type : of every member, which
    has a `name`. own : the studio's. check : raises StudioError where what a package adds cannot be used.
    """

    def __init__(
        self,
        kind: str,
        group: str,
        member_type: type,
        own: Iterable[Member],
        check: Callable[[Member], object],
    ) -> None:
        self.kind, self.group, self._type, self._check = kind, group, member_type, check
        self._own = {member.name: member for member in own}

    def __getitem__(self, name: str) -> Member:
        """The member of that name. Raises UnknownMemberError, PlugInError."""
        if name in self._own:
            return self._own[name]
        added, problems = self._added
        if name in added:
            return added[name]
        if name in problems:
            raise problems[name]
        raise UnknownMemberError(
            f"There is no {self.kind} '{name[:64]}'.",
            f"Known: {', '.join(sorted(self))}. If a package of yours adds it, install that.",
        )

    def __iter__(self) -> Iterator[str]:
        return iter((*self._own, *self._added[0]))

    def __len__(self) -> int:
        return len(self._own) + len(self._added[0])

    @property
    def problems(self) -> tuple[str, ...]:
        """What is wrong with members that packages promise, a sentence or two each."""
        return tuple(str(problem) for problem in self._added[1].values())

    @cached_property
    def packages(self) -> tuple[str, ...]:
        """The packages that add members, with their versions."""
        points = metadata.entry_points(group=self.group)
        used = {
            f"{point.dist.name} {point.dist.version}" for point in points if point.dist and point.name in self
        }
        return tuple(sorted(used))

    @cached_property
    def _added(self) -> tuple[dict[str, Member], dict[str, PlugInError]]:
        """The members of packages, and what is wrong with the others, by name."""
        added: dict[str, Member] = {}
        problems: dict[str, PlugInError] = {}
        points = metadata.entry_points(group=self.group)
        for point in sorted(points, key=lambda point: (point.name, _package(point))):
            try:
                if point.name in self._own or point.name in added:
                    raise StudioError(f"there is a {self.kind} of that name already")
                member = point.load()
                if not isinstance(member, self._type):
                    raise StudioError(f"it is no {self._type.__name__} but {member!r:.80}")
                if member.name != point.name:
                    raise StudioError(f"it calls itself '{member.name}'")
                self._check(member)
            except Exception as error:  # whatever a package's code may raise
                why = error.message if isinstance(error, StudioError) else f"{type(error).__name__}: {error}"
                problems.setdefault(
                    point.name,
                    PlugInError(
                        f"Package '{_package(point)}' adds a {self.kind} '{point.name}' that cannot be used:"
                        f" {why.rstrip('.')}.",
                        "Correct or remove the package; the guide says what it needs.",
                    ),
                )
            else:
                added[point.name] = member
        return added, problems


PARTS = "studio.parts"


def plugged_in(name: str) -> Any:  # noqa: ANN401
    """What a room above, or another package, gives under this name in the entry-point group PARTS; loaded at first use.

    Raises PlugInError where nothing gives it, or what gives it cannot be loaded.
    """
    for point in metadata.entry_points(group=PARTS, name=name):
        try:
            return point.load()
        except ImportError as error:
            raise PlugInError(f"'{name}' cannot be loaded: {error}.", "Install the studio again.") from None
    raise PlugInError(f"No installed package gives '{name}'.", "Install the studio again.")


def _package(point: metadata.EntryPoint) -> str:
    return point.dist.name if point.dist else point.value
