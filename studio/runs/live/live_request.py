"""Checks and defaults of a live run before it is made.

Searching for a lost body without a start pose takes seconds, in which hundreds of frames would be dropped. So by
default a live run recovers by spreading the particles, as in the paper (Caillette et al. 2007, section 6.3). Online
learning of a behaviour model takes as long and is refused.
"""

import math
from collections.abc import Mapping

from studio.foundations.errors import RunError
from studio.search.settings import RunSettings
from studio.search.trackers.recovery_settings import SPREAD
from studio.sessions.session import Session

BEHAVIOUR, BLOBS = "behaviour", "blobs"


def live_changes(changes: Mapping[str, object]) -> dict[str, object]:
    """The knobs of a live run that differ from the defaults: the requested ones, a quick recovery, and no looking for
    thin limbs, which takes long and a background of frames that are still to come.
    """
    return {"recovery": SPREAD, "thin_limbs": False, **changes}


def live_search(tracker: str, weighting: str, model: str) -> tuple[str, str]:
    """The tracker and likelihood of a live run, "" for those of any new run. model : the named behaviour model, "" for
    none: it is followed by the tracker that needs one, on blobs, which are weighed quickly enough.
    """
    tracker = tracker or (BEHAVIOUR if model else "")
    return tracker, weighting or (BLOBS if tracker == BEHAVIOUR else "")


def check_live(settings: RunSettings, *, live: bool, ping_pong: bool) -> None:
    """Raises RunError for what is possible only live, or not live."""
    if ping_pong and not live:
        raise RunError(
            "Only a live run can play its footage forwards and backwards.",
            "Make it a live run, or leave this option out.",
        )
    if live and getattr(settings.tracker, "online_learning", False):
        raise RunError(
            "A live run cannot train its behaviour model: an update takes seconds.",
            "Set online_learning to false, or track the footage without the clock.",
        )


def last_of(session: Session, first: int, seconds: float | None, ping_pong: bool) -> int | None:
    """The frame after the last one of a live run of `seconds`; None: the footage's end. Raises RunError."""
    if seconds is None:
        return None
    if not (math.isfinite(seconds) and seconds > 0.0):
        raise RunError(f"A live run cannot take {seconds:g} seconds.", "Give a number above 0.")
    last = first + max(1, math.ceil(seconds * session.manifest.fps))
    return last if ping_pong else min(last, session.manifest.frame_count)
