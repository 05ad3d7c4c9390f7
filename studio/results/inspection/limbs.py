"""How far each limb is off in each frame: mm from the truth where there is one, else the share of its area in which
pose and silhouettes disagree.
"""

from collections.abc import Mapping

import numpy as np

from studio.body.model import BodyModel
from studio.foundations.arrays import Array
from studio.results.evaluation.errors import lost_mm
from studio.results.inspection.over_frames import summaries
from studio.results.inspection.reading import InspectedRun, no_value
from studio.results.inspection.reference import body_points, by_limb, limb_group, limbs_of_points, true_points
from studio.results.inspection.tables import Row, Selection
from studio.results.inspection.verdict import Verdict, verdicts
from studio.runs.tracks import RAW, read_track
from studio.search.trackers.tracker import LIMB_LOST_SHARE, TRACKED

TIMES_LOST = 2.0
"""Times the limit of a lost limb: where the colours of the map of limbs end."""


def errors_of(run: InspectedRun, track: str = "") -> dict[int, dict[str, float]]:
    """By frame and limb the mean distance of a track's markers from the true ones, mm; {} without a truth."""
    return _means(run, _distances(run, track))


def _means(run: InspectedRun, distances: dict[int, Array]) -> dict[int, dict[str, float]]:
    return {
        frame: {limb: float(mm) for limb, mm in by_limb(run.body, away).items()}
        for frame, away in distances.items()
    }


def _distances(run: InspectedRun, track: str) -> dict[int, Array]:
    """By frame the distances (M,) of a track's markers from the true ones, mm, NaN where unknown."""
    if run.session.truth_path is None or not run.body.markers:
        return {}
    chosen = read_track(run.run, track or RAW)
    if not len(chosen.frames):
        return {}
    poses = dict(zip(chosen.frames.tolist(), chosen.poses, strict=True))
    if run.tried is not None:
        poses[run.tried.number] = run.tried.result.estimate.pose
    by_frame: dict[int, Array] = {}
    for frame, points in zip(poses, body_points(run.body, np.stack(list(poses.values()))), strict=True):
        truth = true_points(run, frame)
        if truth is not None:
            by_frame[frame] = np.linalg.norm(points - truth, axis=1)
    return by_frame


def limbs_too_far(body: BodyModel, distances: Array) -> tuple[str, ...]:
    """The limbs lost by the truth. distances : (M,) of a frame's markers from the true ones, mm, NaN unknown."""
    owners = np.array(limbs_of_points(body))
    return tuple(sorted(set(owners[distances > lost_mm(body)].tolist())))


def limb_shares(body: BodyModel, disagreement: Mapping[str, float]) -> dict[str, float]:
    """By limb the disagreeing share, the largest of what is counted as head and trunk."""
    own: dict[str, float] = {}
    for name, share in disagreement.items():
        group = limb_group(body, name)
        own[group] = max(own.get(group, 0.0), share)
    return own


def disagreements_of(run: InspectedRun) -> dict[int, dict[str, float]]:
    """By frame and limb the disagreeing share; {} for a frame in which nothing was compared."""
    return {frame: limb_shares(run.body, entry.disagreement) for frame, entry in summaries(run).items()}


def verdicts_on(run: InspectedRun, track: str = "") -> dict[int, Verdict]:
    """By frame the verdict on a run, in a track by the truth."""
    return _verdicts(run, _distances(run, track))


def _verdicts(run: InspectedRun, distances: dict[int, Array]) -> dict[int, Verdict]:
    by_truth = {frame: limbs_too_far(run.body, away) for frame, away in distances.items()}
    with run.run.results() as results:
        return verdicts(results, run.run.folder, results.timeline(), by_truth, run.body)


def limb_rows(run: InspectedRun, selection: Selection) -> dict[str, list[Row]]:
    """The run's tables of view `why`: the map of limbs, and its colours, the same for all bodies of that size."""
    distances = _distances(run, selection.track)
    errors, shares, verdicts = _means(run, distances), disagreements_of(run), _verdicts(run, distances)
    table: list[Row] = []
    for frame in sorted(shares.keys() | errors.keys()):
        off, share, own = errors.get(frame, {}), shares.get(frame, {}), verdicts.get(frame, UNKNOWN)
        for limb in dict.fromkeys((*off, *share)):
            mm, area = off.get(limb, float("nan")), share.get(limb, float("nan"))
            table.append((frame, limb, no_value(mm), no_value(area), limb in own.lost, own.lost_by(limb)))
    limits = (("error", "mm", lost_mm(run.body)), ("disagreement", "", LIMB_LOST_SHARE))
    return {
        "limbs": table,
        "scale": [(name, unit, 0.0, lost, TIMES_LOST * lost) for name, unit, lost in limits],
    }


UNKNOWN = Verdict(TRACKED)
"""Of a frame that only a derived track has."""
