"""Half widths of a run's joints, kept with the run, and why a run has none.

A half width of 95 % is a distance: in 95 of 100 frames the true joint is no farther from where the run reports it.
It is made of the errors of the run's twin (`twin.py`, `conformal.py`), whose bias and scatter are told apart as well:
the bias is the mean error in the axes of the joint that carries the point, the scatter is how far points are from where
they would be expected with that bias.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from studio.body.model import BodyModel
from studio.evidence.backgrounds import Backgrounds
from studio.evidence.pipeline import EvidenceMaker
from studio.foundations.arrays import Array
from studio.foundations.progress import Progress
from studio.foundations.words import counted, enumerated
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.reference import body_points, limbs_of_points, true_points
from studio.results.uncertainty.conformal import (
    LEVELS,
    blocks_for,
    blocks_of,
    found_coverage,
    frames_alike,
    half_widths,
    without_bias,
)
from studio.results.uncertainty.mask_faults import FaultShares
from studio.results.uncertainty.twin import (
    TwinErrors,
    carriers_of,
    not_promised,
    points_of,
    reported,
    stamp_of,
    track_twin,
)
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.trackers.tracker import LOST, NO_EVIDENCE
from studio.sessions.record_files import RecordFile
from studio.sessions.stored_run import StoredRun
from studio.sessions.work_under_way import one_at_a_time

FILE_NAME = "uncertainty.json"
FEWEST_FRAMES = 8
UNSEEN = (LOST, NO_EVIDENCE)
WIDER = (1.31, 1.39, 1.39)
"""By what a twin's half widths of LEVELS are multiplied: its motion is one that the tracker finds, and its person is
built as drawn people are. Of the twelve clips of the choosing half that are promised anything (one seed) each weighs a
thirteenth, as blocks do (`conformal.py`), and the clip that is not known the last, which no factor covers: with these
factors 54 and 87 % of their frames are within what is promised for 50 and 80 %. For 95 % that would take 19 clips: the
factor of 80 % is taken. Divided by how much silhouettes disagree in each frame, half widths are as wide and hold as
often (turns, dance), so a joint has the same in all frames.
"""
STALE = "the run's poses, its masks or its cameras have changed"
NOT_IN_IT = (
    "Not in it: a calibration that is off, cameras out of step, things in front of the body, and a body or clothes of"
    " another build than the drawn one's."
)


class PointUncertainty(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How far off a point of the body may be. Of each level in LEVELS, null where so few frames allow none:

    half_widths_mm : distance from where the run reports it. scatter_mm : the same once the bias is taken off.
    found : share of the twin's frames within the half width that the other frames give, before it is made WIDER.

    bias_mm : (3,) mean error in the axes of joint `carrier`.
    """

    point: str
    limb: str
    half_widths_mm: tuple[float | None, ...]
    scatter_mm: tuple[float | None, ...]
    found: tuple[float | None, ...]
    carrier: str
    bias_mm: tuple[float, float, float]

    @property
    def bias(self) -> float:
        """Length of the mean error, mm."""
        return math.hypot(*self.bias_mm)


class Uncertainty(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The half widths of a run.

    stamp : changes with the run's poses, footage, calibration and masks. track : whose poses are meant. frames : how
    many the twin had. alike : how many neighbours count as one. blocks : so many that do not resemble one another.
    """

    stamp: str
    track: str
    frames: int
    alike: int
    blocks: int
    levels: tuple[float, ...]
    points: tuple[PointUncertainty, ...]
    faults: tuple[FaultShares, ...]
    schema: int = 1


_RECORD = RecordFile(
    Uncertainty,
    "an uncertainty",
    "Move the file away: the run is unchanged without it.",
    ("The uncertainty of run '{name}' has not been measured.", "Measure it with 'studio uncertainty'."),
)


@dataclass(frozen=True, slots=True)
class RunUncertainty:
    """How far off a run's joints may be.

    of : the half widths; None where they have not been measured.
    stale : why they no longer hold, a clause; "" if they do.
    words : what they say and do not, in sentences.
    """

    of: Uncertainty | None
    stale: str
    words: tuple[str, ...]


def kept_uncertainty(run: InspectedRun) -> RunUncertainty:
    """A run's half widths as they were kept. Raises SessionError where they cannot be read."""
    path = _path(run.run)
    if not path.exists():
        return RunUncertainty(None, "", ("How far off joints may be has not been measured: start that job.",))
    kept = _RECORD.read(path)
    if kept.stamp == stamp_of(run):
        return RunUncertainty(kept, "", words_of(kept))
    words = f"The half widths no longer hold, since {STALE}: measure them again."
    return RunUncertainty(kept, STALE, (words,))


def measure_uncertainty(run: InspectedRun, progress: Progress, *, again: bool = False) -> RunUncertainty:
    """Draw and track the run's twin, and keep its half widths; kept ones that hold are only made `again` on request.

    What a progress raises ends it, and nothing is kept. Raises RunError for a run of which a twin would promise too
    much.
    """
    frames, stamp, kept = frames_of_twin(run), stamp_of(run), kept_uncertainty(run)
    if again or kept.of is None or kept.stale:
        known = uncertainty_of(run.body, track_twin(run, frames, progress), reported(run.run).name, stamp)
        with one_at_a_time(run.run.folder.parent.parent):
            _RECORD.write(_path(run.run), known)
    return kept_uncertainty(run)


def uncertainty_of(body: BodyModel, twin: TwinErrors, track: str, stamp: str) -> Uncertainty:
    """The half widths that a twin's errors give."""
    off: Array = np.linalg.norm(twin.errors, axis=2)
    alike = frames_alike(off)
    blocks = blocks_of(len(off), alike)
    local = twin.in_carriers
    apart = blocks_of(len(off), frames_alike(local.reshape(len(off), -1)))
    scatter: Array = np.linalg.norm(without_bias(local, apart), axis=2)
    wider = np.array(WIDER)[:, None]
    widths, scatters = wider * half_widths(off, blocks), wider * half_widths(scatter, apart)
    shares, bias = found_coverage(off, blocks), local.mean(axis=0)
    points = tuple(
        PointUncertainty(
            point,
            limb,
            _known(widths[:, at]),
            _known(scatters[:, at]),
            _known(shares[:, at]),
            body.joints[carrier].name,
            (float(bias[at, 0]), float(bias[at, 1]), float(bias[at, 2])),
        )
        for at, (point, limb, carrier) in enumerate(
            zip(points_of(body), limbs_of_points(body), carriers_of(body), strict=True)
        )
    )
    return Uncertainty(stamp, track, len(off), alike, len(blocks), LEVELS, points, twin.faults)


def words_of(known: Uncertainty) -> tuple[str, ...]:
    """What the half widths say and do not, in sentences."""
    most = max(len([one for one in point.half_widths_mm if one is not None]) for point in known.points)
    sentences = [
        f"Measured on {counted(known.frames, 'frame')} of the run drawn again, of which {known.alike} count as one:"
        f" {counted(known.blocks, 'block')}."
    ]
    if most:
        level = known.levels[most - 1]
        widths = sorted(
            (width, point.point)
            for point in known.points
            if (width := point.half_widths_mm[most - 1]) is not None
        )
        sentences.append(
            f"In {100 * level:.0f} % of frames joints are no farther off than {widths[0][0]:.0f} mm"
            f" ({widths[0][1]}) to {widths[-1][0]:.0f} mm ({widths[-1][1]})."
        )
    if most < len(known.levels):
        level = known.levels[most]
        sentences.append(
            f"{100 * level:.0f} % cannot be promised: that takes {blocks_for(level)} blocks that do not resemble one"
            " another. Track a longer stretch."
        )
    return (*sentences, NOT_IN_IT)


def true_coverage(run: InspectedRun, known: Uncertainty) -> dict[str, tuple[float | None, ...]]:
    """By point, the share of frames whose true point is within each half width; {} without a truth."""
    off = true_errors(run, known)
    if not len(off):
        return {}
    shares: dict[str, tuple[float | None, ...]] = {}
    for at, point in enumerate(known.points):
        measured: Array = off[np.isfinite(off[:, at]), at]
        shares[point.point] = tuple(
            float(np.mean(np.less_equal(measured, width))) if width is not None and len(measured) else None
            for width in point.half_widths_mm
        )
    return shares


def true_errors(run: InspectedRun, known: Uncertainty) -> Array:
    """(F, M) how far points are from the truth, mm, in the frames that have one; NaN of a point that has none."""
    track = reported(run.run)
    truth = {at: true_points(run, frame) for at, frame in enumerate(track.frames.tolist())}
    known_points = {at: points for at, points in truth.items() if points is not None}
    if not known_points:
        return np.empty((0, len(known.points)))
    reports = body_points(run.body, track.poses[[*known_points]])
    off: Array = np.linalg.norm(reports - np.stack([*known_points.values()]), axis=2)
    return off


def frames_of_twin(run: InspectedRun) -> range:
    """The frames of which a run's twin is made. Raises RunError where it would promise too much, and says why."""
    record, track = run.run.record, reported(run.run)
    frames = range(record.first, record.first + len(track.frames))
    if why := _why_none(run, frames, track.frames.tolist(), track.states):
        raise not_promised(run.run, why)
    return frames


def _why_none(run: InspectedRun, frames: range, tracked: Sequence[int], states: Sequence[str]) -> str:
    """Why a twin would promise too much, a clause; "" where it does not."""
    record, cameras = run.run.record, [camera.name for camera in run.run.cameras()]
    filmed = {source.name for source in run.session.manifest.footage.cameras}
    if record.live or record.ping_pong:
        return "its frames came on a clock, and a twin drops none"
    if record.corrected is not None:
        return "it was corrected by hand, which no twin repeats"
    if len(tracked) < FEWEST_FRAMES:
        return f"it has {counted(len(tracked), 'finished frame')}, and {FEWEST_FRAMES} are needed"
    if list(tracked) != list(frames):
        return "some of its frames are missing or damaged, and a twin has them all"
    if run.body.meshes:
        return "its body has meshes, and twins are drawn of cones"
    if gone := sorted(set(cameras) - filmed):
        return f"the footage of {enumerated(gone)} has been taken away since, and the twin's faults would lack theirs"
    if unseen := sum(state in UNSEEN for state in states):
        return (
            f"its body is lost or not in view in {counted(unseen, 'frame')}, where its place cannot be drawn"
        )
    return _why_not_drawn(run, frames, cameras)


def _why_not_drawn(run: InspectedRun, frames: range, cameras: Sequence[str]) -> str:
    """The same of what the footage shows."""
    settings = run.settings(frames.start)
    if WEIGHTINGS[settings.weighting_name].reads_pictures:
        return f"its likelihood '{settings.weighting_name}' reads colours, and a twin wears other clothes"
    footage = run.session.footage()
    try:
        missing = {camera for frame in frames for camera in footage.absent(frame)} & set(cameras)
        if missing:
            return f"{enumerated(sorted(missing))} stopped on the way, and a twin's cameras do not"
        if any(footage.hidden(camera, frames.start) is not None for camera in cameras):
            return "others stand in front of its body, and a twin is alone"
        kind = WEIGHTINGS[settings.weighting_name].edge_kind
        maker = EvidenceMaker(run.run.cameras(), footage, Backgrounds(footage), settings.evidence, kind)
        if maker.hull_of_pixels:
            return "its hull is carved from colours without masks, whose faults would be measured"
    finally:
        footage.close()
    return ""


def _known(values: Array) -> tuple[float | None, ...]:
    return tuple(float(value) if np.isfinite(value) else None for value in values)


def _path(run: StoredRun) -> Path:
    return run.folder / FILE_NAME
