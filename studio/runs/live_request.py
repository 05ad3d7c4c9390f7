"""Checks and defaults of a live run before it is made.

Searching for a lost body without a start pose takes seconds, in which hundreds of frames would be dropped. So by
default a live run recovers by spreading the particles, as in the paper (Caillette et al. 2007, section 6.3). Online
learning of a behaviour model takes as long and is refused.
"""

import math
from collections.abc import Mapping

from studio.errors import RunError
from studio.sessions.session import Session
from studio.settings import RunSettings
from studio.trackers.recovery_settings import SPREAD


def live_changes(changes: Mapping[str, object]) -> dict[str, object]:
    """The knobs of a live run that differ from the defaults: the requested ones, a quick recovery, and the shadow test
    by its tolerances alone: the footage from which the colours of shadows are learnt is not there yet.
    """
    return {"recovery": SPREAD, "mask_shadow_learnt": False, **changes}


TOLERANCES_ALONE = (
    "Live, the colours of shadows are not learnt, for the footage is not there yet: the two tolerances of the shadow"
    " test decide alone."
)


def check_live(settings: RunSettings, *, live: bool, ping_pong: bool) -> None:
    """Raises RunError for what is possible only live, or not live."""
    if ping_pong and not live:
        raise RunError(
            "Only a live run can play its footage forwards and backwards.",
            "Make it a live run, or leave this option out.",
        )
    if live and settings.evidence.mask_shadow_learnt:
        raise RunError(
            "A live run cannot learn the colours of shadows: its footage is not there yet.",
            "Set mask_shadow_learnt to false, or track the footage without the clock.",
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
