"""Half widths of exported points: how far a true point may be from the written one in 95 of 100 frames."""

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.errors import SessionError
from studio.results.export.naming import Points
from studio.results.export.task import ExportTask
from studio.results.inspection.reading import InspectedRun
from studio.results.uncertainty.conformal import LEVELS
from studio.results.uncertainty.half_widths import kept_uncertainty

LEVEL, WITHIN = 0.95, "within 95 %"
MEANS = (
    "In 95 % of frames a true point is no farther from the written one than its half width; a calibration that is off"
    " and things in front of the body are not in it."
)


def half_widths_of(task: ExportTask, points: Points) -> tuple[Array | None, tuple[str, ...]]:
    """(K, M) half widths of the points, mm, NaN in gaps and where none is known; and notes for the file's readers.

    None where the run has none: they were not measured, cannot be read, no longer hold, or are of another track.
    """
    try:
        kept = kept_uncertainty(InspectedRun(task.session, task.run))
    except SessionError as problem:
        return None, (str(problem),)
    if kept.of is None:
        return None, ()
    if kept.stale:
        return None, kept.words
    if kept.of.track != task.options.track:
        return None, (f"Half widths are known of track '{kept.of.track}', not of '{task.options.track}'.",)
    at = LEVELS.index(LEVEL)
    known = {one.point: one.half_widths_mm[at] for one in kept.of.points}
    if not any(width is not None for width in known.values()):
        return None, tuple(words for words in kept.words if "cannot be promised" in words)
    widths = np.array([_width(task, points, place, known) for place in range(len(points.names))])
    return np.where(task.motion.known[:, None], widths, np.nan), (MEANS,)


def _width(task: ExportTask, points: Points, place: int, known: dict[str, float | None]) -> float:
    """The half width of the body's own point that an exported one is, whatever it is called."""
    for marker in task.motion.body.markers:
        same = marker.joint == points.joints[place] and np.allclose(marker.offset, points.offsets[place])
        if same and (width := known.get(marker.name)) is not None:
            return width
    return float("nan")
