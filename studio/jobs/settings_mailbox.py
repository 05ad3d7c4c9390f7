"""The newest settings of the open run: frozen, versioned, swapped as one reference, read before each
layer."""

import threading
from collections.abc import Callable, Mapping

from studio.errors import SettingsError
from studio.settings import RunSettings, all_knobs, changed_settings, values


class SettingsMailbox:
    """Latest wins: whoever reads gets the newest settings, however many changes came since it last looked.

    check : raises SettingsError for settings that the run cannot have.
    """

    def __init__(
        self,
        version: int,
        settings: RunSettings,
        check: Callable[[RunSettings], None] = lambda settings: None,
    ) -> None:
        self._lock = threading.Lock()
        self._check = check
        self._latest = (version, settings)

    def latest(self) -> tuple[int, RunSettings]:
        """The newest version and settings."""
        return self._latest

    def reset(self, version: int, settings: RunSettings) -> None:
        """Put back earlier settings, dropping those that were swapped in since."""
        with self._lock:
            self._latest = (version, settings)

    def change(self, changes: Mapping[str, object]) -> tuple[str, ...]:
        """Change knobs by name and return the names of those that moved; without any, the version stays.

        All or nothing. Raises SettingsError for an unknown name, a value that is not allowed, a knob that only a
        new run can change, or what the run cannot do.
        """
        with self._lock:
            version, settings = self._latest
            following = changed_settings(settings, changes)
            before, after = values(settings), values(following)
            moved = tuple(name for name, value in after.items() if before[name] != value)
            fixed = {entry.name for entry in all_knobs(settings) if entry.takes_effect == "new run"}
            for name in moved:
                if name in fixed:
                    raise SettingsError(
                        f"Setting '{name}' cannot change inside a run.",
                        "Start a new run with the value wanted.",
                    )
            if moved:
                self._check(following)
                self._latest = (version + 1, following)
            return moved
