"""How far each limb is off in each frame: mm from the truth where there is one, else the share of its area in which
pose and silhouettes disagree.
"""

import numpy as np

from studio.arrays import Array
from studio.evaluation.errors import lost_mm
from studio.inspection.over_frames import summaries
from studio.inspection.reading import InspectedRun, no_value
from studio.inspection.reference import body_points, by_limb, limb_group, limbs_of_points, true_points
from studio.inspection.tables import Row, Selection
from studio.runs.tracks import RAW, read_track
from studio.trackers.tracker import LIMB_LOST_SHARE


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
    found: dict[int, Array] = {}
    for frame, points in zip(poses, body_points(run.body, np.stack(list(poses.values()))), strict=True):
        truth = true_points(run, frame)
        if truth is not None:
            found[frame] = np.linalg.norm(points - truth, axis=1)
    return found


def disagreements_of(run: InspectedRun) -> dict[int, dict[str, float]]:
    """By frame and limb the disagreeing share, the largest of what is counted as head and trunk; {} for a frame in
    which nothing was compared.
    """
    found: dict[int, dict[str, float]] = {}
    for frame, entry in summaries(run).items():
        own: dict[str, float] = {}
        for name, share in entry.disagreement.items():
            group = limb_group(run.body, name)
            own[group] = max(own.get(group, 0.0), share)
        found[frame] = own
    return found


def limb_rows(run: InspectedRun, selection: Selection) -> dict[str, list[Row]]:
    """The run's table of view `why`. A limb is lost as in an evaluation: one of its markers is too far off."""
    distances = _distances(run, selection.track)
    errors, shares = _means(run, distances), disagreements_of(run)
    table: list[Row] = []
    limit, owners = lost_mm(run.body), np.array(limbs_of_points(run.body))
    for frame in sorted(shares.keys() | errors.keys()):
        off, share = errors.get(frame, {}), shares.get(frame, {})
        too_far = set(owners[distances[frame] > limit]) if frame in distances else set[str]()
        for limb in dict.fromkeys((*off, *share)):
            mm, area = off.get(limb, float("nan")), share.get(limb, float("nan"))
            lost = limb in too_far if np.isfinite(mm) else area > LIMB_LOST_SHARE
            table.append((frame, limb, no_value(mm), no_value(area), bool(lost)))
    return {"limbs": table}
