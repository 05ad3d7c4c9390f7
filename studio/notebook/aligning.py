"""Whether a session's cameras agree on the silhouettes, and turning them until they do."""

from collections.abc import Sequence
from dataclasses import dataclass

from studio.notebook.opening import SessionName, open_session
from studio.notebook.progress import Told, told
from studio.runs.aligning import align_cameras
from studio.runs.turned_cameras import alignment_words, remember_alignment, turn_back, turn_cameras
from studio.sessions.session import Session


@dataclass(frozen=True, slots=True)
class Alignment:
    """What the silhouettes say of the cameras, by name.

    before, after : pixels by which the silhouettes miss (median; NaN for a camera that nothing tells of), as the
    cameras were and turned. turns : degrees. needed : whether the misses matter; better : whether turning explains
    them; changed : whether the session uses the turned cameras now. notes : what that means for what is there.
    """

    session: Session
    before: dict[str, float]
    after: dict[str, float]
    turns: dict[str, float]
    needed: bool
    better: bool
    changed: bool
    words: str
    notes: tuple[str, ...] = ()


def align(
    session: SessionName, frames: Sequence[int] = (), *, keep: bool = True, progress: Told = None
) -> Alignment:
    """Turn a session's cameras a little so that the silhouettes of all views agree; needs masks of a whole person.

    For a calibration that is nearly right: a camera that was touched after it. keep : let the session use the turned
    cameras where that is needed and explains the misses (`unalign` undoes it). frames : default sixteen, evenly spread.
    Raises CalibrationError for one camera, or too few whole silhouettes.
    """
    opened = open_session(session)
    with told(progress, f"{opened.name}: cameras") as report:
        found = align_cameras(opened, frames, progress=report)
    remember_alignment(opened, found)
    words, notes = alignment_words(found), ()
    changed = keep and found.needed and found.better
    if changed:
        change = turn_cameras(opened, found)
        opened, notes = change.session, change.notes
    each = found.found

    def named(values: Sequence[float]) -> dict[str, float]:
        return {name: float(value) for name, value in zip(found.names, values, strict=True)}

    return Alignment(
        session=opened,
        before=named(each.before.tolist()),
        after=named(each.after.tolist()),
        turns=named(each.turns.tolist()),
        needed=found.needed,
        better=found.better,
        changed=changed,
        words=words,
        notes=notes,
    )


def unalign(session: SessionName) -> Session:
    """Use the calibration again that a session's cameras were turned from. Raises NotFoundError where they were not."""
    return turn_back(open_session(session)).session
