"""Errors of tracked poses against true markers.

The measure is that of Balan, Sigal & Black 2005 and HumanEva: the mean Euclidean distance of the markers in
a frame, without any alignment, in mm. Beside it stand the two usual aligned ones: moved to the root marker
(MPJPE), and after the best similarity (PA-MPJPE). A limb is lost in a frame when one of its markers is off
by more than LOST_MM (the threshold of MPI-INF-3DHP's PCK), at a person's size (`scale_of`).
"""

import itertools
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import marker_points
from studio.body.model import BodyModel, limb_moving
from studio.body.motion_files.trc import MarkerMotion
from studio.body.scale import scale_of
from studio.foundations.arrays import Array, Indices
from studio.foundations.errors import TruthError
from studio.runs.drawing.marker_lines import marker_links, marker_sides

FEWEST_POINTS = 3
UNALIGNED, RIGID, SIMILARITY = "none", "rigid", "similarity"
ON_A_LINE = 1e-3
"""Points lie on a line where their second extent is less than this share of the first."""


def moved_to_root(points: Array, truth_points: Array, root: int) -> Array:
    """(M, 3) `points` moved so that point `root` lies where it lies in `truth_points`, (M, 3)."""
    return points + (truth_points[root] - points[root])


def similarity_aligned(points: Array, truth_points: Array) -> Array:
    """(M, 3) `points` turned, scaled and moved to come closest to `truth_points`, (M, 3), in the sum of squares.

    The closed form of Umeyama, "Least-squares estimation of transformation parameters between two point
    patterns", PAMI 13(4), 1991, Eq. 40-43; mirroring is not allowed. Points that all coincide are only moved.
    """
    from_middle, to_middle = points.mean(axis=0), truth_points.mean(axis=0)
    spread, target = points - from_middle, truth_points - to_middle
    size = float(np.sum(spread**2))
    if size == 0.0:
        return np.broadcast_to(to_middle, points.shape).copy()
    turn, stretched = _turn(spread, target)
    return stretched / size * spread @ turn.T + to_middle


def _turn(spread: Array, target: Array) -> tuple[Array, float]:
    """(3, 3) the turn that lays points (M, 3) about the origin on others, and the sum of their products there."""
    left, stretches, right = np.linalg.svd(target.T @ spread)
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(left) * np.linalg.det(right))])
    return (left * signs) @ right, float(np.sum(stretches * signs))


def laid_on(
    truth_points: Array, tracked_points: Array, seen: NDArray[np.bool_], how: str
) -> tuple[Array, str]:
    """True points of another world (K, M, 3) laid on the found ones by one motion for all frames, and what it was.

    seen : (K, M) points that count. how : RIGID, or SIMILARITY, which scales as well. Raises TruthError for fewer than
    three points, or points on a line.
    """
    points, goal = truth_points[seen], tracked_points[seen]
    middle, to = points.mean(axis=0), goal.mean(axis=0)
    extents = np.linalg.svd(points - middle, compute_uv=False)
    if len(points) < FEWEST_POINTS or extents[1] <= ON_A_LINE * extents[0]:
        raise TruthError(
            "The true points that the body has too are fewer than three, or lie on a line: they cannot be aligned.",
            "Name more of the body's markers as the truth does, or give the truth in the session's world.",
        )
    turn, stretched = _turn(points - middle, goal - to)
    scale = stretched / float(np.sum((points - middle) ** 2)) if how == SIMILARITY else 1.0
    scaled = f", scaled by {scale:.4g}" if how == SIMILARITY else ""
    words = f"{how}, one motion for {len(tracked_points)} frames, fitted to {len(points)} points{scaled}"
    return scale * (truth_points - middle) @ turn.T + to, words


LOST_MM = 150.0
TRUNK = "head and trunk"


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Errors of a run against a truth, mm; without alignment unless noted.

    frames : the frames that were measured (those that the truth has a row for).
    mean_mm, std_mm, worst_mm : mean and standard deviation over frames of the frames' means, and the worst frame's
        mean.
    lost_frames, lost_frame_numbers : how many frames have any limb lost, and which.
    lost_limbs, lost_by_frame : limbs lost in any frame, and in each of `frames`.
    lost_threshold_mm : distance from which a marker's limb is lost.
    per_marker_mm : by marker, its mean error.
    per_frame_mm : in the order of `frames`.
    root_aligned_mm : with the root marker laid on the true one.
    procrustes_mm : after the best turn, scale and move of each frame; None where no frame has three markers.
    without_offsets_mm : with each marker's constant offset removed, which comes from two definitions of a joint or from
        a shifted calibration.
    offsets_mm, common_offset_mm : by marker the length of its constant offset, and the length of their mean.
    unmatched_markers : names that only the body or only the truth has.
    angles_deg : by joint, the error of the angle between the two limbs that meet there: mean over frames of the
        absolute difference.
    directions_deg : by limb, the mean angle between its direction and the true one. Both use the straight lines between
        markers, so a limb's twist about its axis shows in neither.
    mean_angle_deg, mean_direction_deg : over joints, over limbs; None without any.
    alignment : of the truth as a whole, in words.
    parts_mm, parts_frames : of what the search found: means of the search's, the likelihood's and the body's part of
        its error (`inspection.error_parts`), and over how many frames, those that were searched for long. Empty and 0
        before that, and against another truth than the session's.
    """

    frames: tuple[int, ...]
    mean_mm: float
    std_mm: float
    worst_mm: float
    lost_frames: int
    lost_frame_numbers: tuple[int, ...]
    lost_limbs: tuple[str, ...]
    lost_by_frame: tuple[tuple[str, ...], ...]
    per_marker_mm: dict[str, float]
    per_frame_mm: tuple[float, ...]
    root_aligned_mm: float
    procrustes_mm: float | None
    unmatched_markers: tuple[str, ...]
    angles_deg: dict[str, float] = field(default_factory=dict[str, float])
    mean_angle_deg: float | None = None
    directions_deg: dict[str, float] = field(default_factory=dict[str, float])
    mean_direction_deg: float | None = None
    without_offsets_mm: float | None = None
    common_offset_mm: float | None = None
    offsets_mm: dict[str, float] = field(default_factory=dict[str, float])
    lost_threshold_mm: float = LOST_MM
    alignment: str = UNALIGNED
    parts_mm: dict[str, float] = field(default_factory=dict[str, float])
    parts_frames: int = 0


def lost_mm(body: BodyModel) -> float:
    """Distance of a marker from the true one from which its limb counts as lost, mm."""
    return LOST_MM * scale_of(body)


def evaluate(
    poses: Array, frames: Indices, body: BodyModel, truth: MarkerMotion, fps: float, align: str = UNALIGNED
) -> Evaluation:
    """The errors of poses (K, D) of the given frames (K,) of a body against true markers.

    The truth's rows belong to the frames nearest to Time × fps. align : RIGID or SIMILARITY lays a truth of another
    world on the run first, by one motion for all frames. Raises TruthError when no marker or no frame is common to
    both.
    """
    names, of_body, of_truth, unmatched = _common_markers(body, truth)
    numbers, kept, truth_points = _common_frames(np.asarray(frames), truth, of_truth, fps)
    tracked_points = marker_points(body, np.asarray(poses, dtype=float)[kept])[:, of_body]
    seen = np.asarray(np.isfinite(truth_points).all(axis=2))
    words = UNALIGNED
    if align != UNALIGNED:
        truth_points, words = laid_on(truth_points, tracked_points, seen, align)
    distances = np.where(seen, np.linalg.norm(tracked_points - truth_points, axis=2), np.nan)
    per_frame = np.nanmean(distances, axis=1)
    threshold = lost_mm(body)
    lost = np.nan_to_num(distances) > threshold
    in_frame = np.asarray(lost.any(axis=1))
    limbs = limb_of_markers(body)
    return Evaluation(
        frames=tuple(int(frame) for frame in numbers),
        mean_mm=float(per_frame.mean()),
        std_mm=float(per_frame.std()),
        worst_mm=float(per_frame.max()),
        lost_frames=int(in_frame.sum()),
        lost_frame_numbers=tuple(int(frame) for frame in numbers[in_frame]),
        lost_limbs=tuple(sorted({limbs[names[index]] for index in np.nonzero(lost)[1]})),
        lost_by_frame=tuple(
            tuple(sorted({limbs[names[index]] for index in np.flatnonzero(row)})) for row in lost
        ),
        per_marker_mm={
            name: float(np.nanmean(distances[:, index]))
            for index, name in enumerate(names)
            if np.isfinite(distances[:, index]).any()
        },
        per_frame_mm=tuple(float(value) for value in per_frame),
        root_aligned_mm=_root_aligned(tracked_points, truth_points, seen),
        procrustes_mm=_procrustes(tracked_points, truth_points, seen),
        unmatched_markers=unmatched,
        lost_threshold_mm=threshold,
        alignment=words,
        **_degrees_off(tracked_points, truth_points, marker_links(body, names), names),
        **_constant_part(tracked_points - truth_points, names),
    )


MUCH_NEARER = 0.25
"""A truth means other axes if those leave less than this share of the distance."""
NEAR = 0.05
"""Nor is anything wrong with the axes of a truth that lies nearer than this share of the markers' spread."""
OTHER_UNITS = (1.0, 10.0, 100.0, 1000.0, 0.1, 0.01, 0.001)


def meant_axes(poses: Array, frames: Indices, body: BodyModel, truth: MarkerMotion, fps: float) -> str:
    """Which quarter turns (and unit) of a truth, "FILE", lay it on the run where it lies far off without: a sentence
    with the remedy; "" where none does.
    """
    _, of_body, of_truth, _ = _common_markers(body, truth)
    _, kept, goal = _common_frames(np.asarray(frames), truth, of_truth, fps)
    tracked_points = marker_points(body, np.asarray(poses, dtype=float)[kept])[:, of_body]
    seen = np.asarray(np.isfinite(goal).all(axis=2))
    tracked_points, goal = tracked_points[seen], goal[seen]
    off = float(np.linalg.norm(tracked_points - goal, axis=1).mean())
    if off < NEAR * float(np.linalg.norm(tracked_points - tracked_points.mean(axis=0), axis=1).mean()):
        return ""
    tries = {
        (unit, number): float(np.linalg.norm(tracked_points - unit * goal @ turn.T, axis=1).mean())
        for unit in OTHER_UNITS
        for number, turn in enumerate(QUARTER_TURNS)
    }
    unit, number = min(tries, key=lambda key: tries[key])
    if tries[unit, number] > MUCH_NEARER * off:
        return ""
    turn = QUARTER_TURNS[number]
    words = [
        *(["turned by quarter turns"] if not np.array_equal(turn, np.eye(3)) else []),
        *([f"with its lengths times {unit:g} (another unit)"] if unit != 1.0 else []),
    ]
    remedy = "--align similarity" if unit != 1.0 else "--align rigid, or its vertical with --truth-up"
    return (
        f"FILE lies {off:.0f} mm off as it is, and {tries[unit, number]:.1f} mm {' and '.join(words)}: its axes or unit"
        f" differ from the session's ({remedy})."
    )


def _quarter_turns() -> tuple[Array, ...]:
    """All 24 rotations that lay axes on axes."""
    turns: list[Array] = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            turn = np.zeros((3, 3))
            turn[range(3), order] = signs
            if np.linalg.det(turn) > 0.0:
                turns.append(turn)
    return tuple(turns)


QUARTER_TURNS = _quarter_turns()


def _constant_part(off: Array, names: tuple[str, ...]) -> dict[str, Any]:
    """The fields of `Evaluation` about constant offsets. off : (K, M, 3), NaN where the truth has none."""
    known = np.isfinite(off[..., 0]).any(axis=0)
    off = off[:, known]
    offsets: Array = np.nanmean(off, axis=0)
    lengths = np.linalg.norm(offsets, axis=1)
    rest: Array = np.linalg.norm(off - offsets, axis=2)
    return {
        "without_offsets_mm": float(np.nanmean(rest)),
        "common_offset_mm": float(np.linalg.norm(offsets.mean(axis=0))),
        "offsets_mm": {
            name: float(length) for name, length in zip(np.array(names)[known].tolist(), lengths, strict=True)
        },
    }


def _degrees_off(
    tracked_points: Array, truth_points: Array, links: list[tuple[int, int]], names: tuple[str, ...]
) -> dict[str, Any]:
    """The fields in degrees of `Evaluation`. found, truth_points : (K, M, 3), NaN where missing. links : (upper, lower)
    pairs of markers, a limb each; joints lie where two of them meet.
    """
    directions: dict[str, float] = {}
    angles: dict[str, float] = {}
    for upper, lower in links:
        off = _between(
            tracked_points[:, lower] - tracked_points[:, upper],
            truth_points[:, lower] - truth_points[:, upper],
        )
        _keep_mean(directions, f"{names[upper]}_{names[lower]}", off)
        onward = [other for start, other in links if start == lower]
        for other in onward:
            bent = [
                _between(points[:, lower] - points[:, upper], points[:, other] - points[:, lower])
                for points in (tracked_points, truth_points)
            ]
            joint = names[lower] if len(onward) == 1 else f"{names[lower]} to {names[other]}"
            _keep_mean(angles, joint, np.abs(bent[0] - bent[1]))
    return {
        "angles_deg": angles,
        "mean_angle_deg": float(np.mean(list(angles.values()))) if angles else None,
        "directions_deg": directions,
        "mean_direction_deg": float(np.mean(list(directions.values()))) if directions else None,
    }


def _between(one: Array, other: Array) -> Array:
    """(K,) degrees between vectors (K, 3)."""
    across = np.linalg.norm(np.cross(one, other), axis=1)
    return np.degrees(np.arctan2(across, np.einsum("ij,ij->i", one, other)))


def _keep_mean(means: dict[str, float], name: str, values: Array) -> None:
    seen = np.isfinite(values)
    if seen.any():
        means[name] = float(values[seen].mean())


def rows_of_frames(truth: MarkerMotion, fps: float) -> dict[int, int]:
    """Frame to the truth's row that is nearest to it in time; frames without a row within half a frame are absent."""
    at = truth.times * fps
    rows: dict[int, int] = {}
    for row, place in enumerate(at):
        frame = round(float(place))
        if frame not in rows or abs(place - frame) < abs(at[rows[frame]] - frame):
            rows[frame] = row
    return rows


def limb_of_markers(body: BodyModel) -> dict[str, str]:
    """Marker to the limb it is counted with: all that is neither left nor right is one limb, head and
    trunk; the others are grouped as the body's parameters are (a person has five limbs). A body without sides, such as
    a robot's arm, has no trunk: all its limbs are so grouped.
    """
    owned, sides = _limb_of_joints(body), marker_sides(body)
    middle = "middle" if has_sides(body) else ""
    return {
        marker.name: TRUNK if sides[marker.name] == middle else owned[marker.joint] for marker in body.markers
    }


def has_sides(body: BodyModel) -> bool:
    """Whether any of a body's limbs is a left or a right one."""
    return any(limb.side != "middle" for limb in body.drawn)


def limb_of_drawn(body: BodyModel) -> dict[str, str]:
    """Drawn limb to the limb that its markers are counted with; in a body without markers each is its own."""
    if not body.markers:
        return {limb.name: limb.name for limb in body.drawn}
    owned, middle = _limb_of_joints(body), "middle" if has_sides(body) else ""
    return {limb.name: TRUNK if limb.side == middle else owned[limb.joint] for limb in body.drawn}


def _limb_of_joints(body: BodyModel) -> dict[int, str]:
    """The limb of the parameters that move each joint, or the one above it."""
    still = TRUNK if has_sides(body) else body.parameters[0].limb
    return {joint: limb_moving(body, joint) or still for joint in range(len(body.joints))}


def _common_markers(
    body: BodyModel, truth: MarkerMotion
) -> tuple[tuple[str, ...], list[int], list[int], tuple[str, ...]]:
    """Names in the body's order, their places in the body and in the truth, and the names of only one of both."""
    known = [marker.name for marker in body.markers]
    names = tuple(name for name in known if name in truth.names)
    if not names:
        raise TruthError(
            f"The truth's markers ({', '.join(truth.names[:6])} …) are none of body '{body.name}'.",
            f"Name them as the body does: {', '.join(known) or 'it has no markers'}.",
        )
    unmatched = tuple(sorted(set(known) ^ set(truth.names)))
    return (
        names,
        [known.index(name) for name in names],
        [truth.names.index(name) for name in names],
        unmatched,
    )


def _common_frames(
    frames: Indices, truth: MarkerMotion, of_truth: list[int], fps: float
) -> tuple[Indices, Indices, Array]:
    """Frames (K',) in which the truth has any of the markers, their places in `frames`, and the true
    positions (K', M, 3) mm of the markers in the truth's columns `of_truth`, NaN where missing.
    """
    rows = rows_of_frames(truth, fps)
    places = [place for place, frame in enumerate(frames) if int(frame) in rows]
    truth_points = truth.positions[[rows[int(frames[place])] for place in places]][:, of_truth]
    seen = np.asarray(np.isfinite(truth_points).all(axis=2))
    some = np.flatnonzero(seen.any(axis=1))
    if not len(frames):
        raise TruthError("The run has no finished frame to measure.", "Track the session first.")
    if not some.size:
        raise TruthError(
            f"No frame of the run has a row in the truth, whose rows are frames {min(rows)} to {max(rows)}.",
            "Check that the truth belongs to this session; its times count from the footage's frame 0.",
        )
    kept = np.array(places, dtype=np.int64)[some]
    return frames[kept], kept, truth_points[some]


def _root_aligned(tracked_points: Array, truth_points: Array, seen: NDArray[np.bool_]) -> float:
    """Mean over frames of the markers' mean distance, mm, with the root (first seen marker) on the true one."""
    means: list[float] = []
    for points, goal, present in zip(tracked_points, truth_points, seen, strict=True):
        laid = moved_to_root(points[present], goal[present], 0)
        means.append(float(np.linalg.norm(laid - goal[present], axis=1).mean()))
    return float(np.mean(means))


def _procrustes(tracked_points: Array, truth_points: Array, seen: NDArray[np.bool_]) -> float | None:
    """Mean over frames of the markers' mean distance, mm, after the best similarity of each frame."""
    means: list[float] = []
    for points, goal, present in zip(tracked_points, truth_points, seen, strict=True):
        if present.sum() >= FEWEST_POINTS:
            laid = similarity_aligned(points[present], goal[present])
            means.append(float(np.linalg.norm(laid - goal[present], axis=1).mean()))
    return float(np.mean(means)) if means else None
