"""How well what was tracked fits its pictures."""

from studio.notebook.opening import RunName, open_run, session_of
from studio.notebook.progress import Told, told
from studio.runs.checking import EVERY, RunCheck, check_run
from studio.runs.tracks import BEST


def check(run: RunName, track: str = BEST, *, every: int = EVERY, progress: Told = None) -> RunCheck:
    """Compare a track with the masks in every so-many-th frame, look for frames that were lost, in which the body turns
    round or a limb leaps; kept beside the run.

    track : default the best (smoothed, refined, raw), as in an export. The answer: .good, .inside_mean, .poor, .lost,
    .turned, .jumps (frame, limb, mm), .jitter_mm, .in_words().
    """
    stored = open_run(run)
    opened = session_of(stored)
    with told(progress, f"{opened.name} / {stored.name}: checking") as report:
        return check_run(opened, stored, track, every, progress=report)
