"""What is different in a run that is tracked live, before it is made.

A live run has no time to lose. Searching a lost body from nothing takes seconds, in which hundreds of frames would be
dropped and the body be elsewhere; so unless asked otherwise a lost body is caught by spreading the particles, as the
paper does (Caillette et al. 2007, section 6.3). A lesson for a behaviour model takes as long and is refused.
"""

import math
from collections.abc import Mapping

from studio.errors import RunError
from studio.sessions.session import Session
from studio.settings import RunSettings
from studio.tracking.recovery_settings import SPREAD


def live_changes(changes: Mapping[str, object]) -> dict[str, object]:
    """The knobs of a live run that differ from the defaults: those asked for, and a quick recovery."""
    return {"recovery": SPREAD, **changes}


def check_live(settings: RunSettings, *, live: bool, to_and_fro: bool) -> None:
    """Raises RunError for what cannot be done live, or only live."""
    if to_and_fro and not live:
        raise RunError(
            "Only a live run goes forth and back through its footage.",
            "Make it a live run, or leave that out.",
        )
    if live and getattr(settings.tracker, "online_learning", False):
        raise RunError(
            "A live run cannot teach its behaviour model: a lesson takes seconds.",
            "Set online_learning to false, or track the footage without the clock.",
        )


def last_of(session: Session, first: int, seconds: float | None, to_and_fro: bool) -> int | None:
    """The frame after the last one of a live run of so many seconds; None: the footage's end. Raises RunError."""
    if seconds is None:
        return None
    if not (math.isfinite(seconds) and seconds > 0.0):
        raise RunError(f"A live run cannot take {seconds:g} seconds.", "Give a number above 0.")
    last = first + max(1, math.ceil(seconds * session.manifest.fps))
    return last if to_and_fro else min(last, session.manifest.frame_count)
