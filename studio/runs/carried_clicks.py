"""A run made from landmarks that were clicked in a few frames: the limbs' own look carries their poses to the others.

For subjects that no mask shows, or whose moving limbs lie in front of them. In the clicked frames the pose is fitted to
the clicks; how each limb looks there is kept (`search.likelihood.limb_looks`). In any other frame each group of
parameters (the root, a leg) is searched by itself from the poses known before and after, a few rounds of drawing around
the best. Then every frame is searched again, drawn to its neighbours by how far a limb usually goes between two frames.
A limb counts in the views in which landmarks of its group were clicked: what nobody could click is not to be seen.
"""

import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from studio.body.dragging import root_joint
from studio.body.film_fit import FilmedTree, FrameClicks, fit_poses
from studio.body.forward_kinematics import limb_ends, marker_points
from studio.body.model import BodyModel
from studio.body.writing import body_text
from studio.evidence.look_maps import look_maps
from studio.footage.capture.footage import Footage
from studio.foundations.arrays import Array, Floats, Indices
from studio.foundations.declaring import LARGEST, Body, Seed
from studio.foundations.errors import BodyError, RunError
from studio.foundations.geometry.camera import Camera
from studio.foundations.package import software_version
from studio.foundations.progress import Progress, no_progress
from studio.foundations.words import counted
from studio.runs.search_space import parameter_names, session_sigma
from studio.runs.setup.body_from_film import SeenLandmarks
from studio.runs.setup.session_settings import session_settings
from studio.search.likelihood.limb_looks import kept_looks, look_scores
from studio.search.likelihood.outlines import OutlineProjector
from studio.search.settings import DEFAULT_TRACKER, DEFAULT_WEIGHTING, values
from studio.search.trackers.tracker import Estimate, FilterState, FrameResult, ParticleSet
from studio.sessions.landmark_clicks import LandmarkClick
from studio.sessions.manifest import now
from studio.sessions.results_store import ResultsWriter
from studio.sessions.run_record import OF_CLICKS, RunRecord
from studio.sessions.session import Session, free_run_name, make_numbered_run
from studio.sessions.stored_run import StoredRun

ROUNDS, DRAWN, BEST = 10, 300, 40
"""Rounds of a search; poses drawn in each; how many of them the next one is drawn around."""
WIDEST, NARROWED = 1.2, 0.75
"""Spread of the first round as a share of the largest step to be expected between two frames, by which it shrinks."""
FAR = 3
"""Frames from the nearest clicked one from which the first round does not become wider any more."""
AROUND = 0.6
"""Spread around the best poses, as a share of the round's."""
DRAWN_TO = 0.05
"""Twice what a step of the largest size away from a neighbouring frame costs, in units of `look_scores`."""
SWEEPS = 1
"""Times that every frame is searched again."""
MOVED = 1e-6
MOST_FRAMES = 2000


@dataclass(frozen=True, slots=True)
class CarryRequest:
    """How clicked poses are carried to other frames."""

    body: Body = ""
    held: Annotated[
        bool, Field(description="The body is held: its root is in the same place in all frames.")
    ] = False
    tolerance: Annotated[
        float, Field(gt=0.0, le=200.0, description="Pixels by which a click may miss its landmark.")
    ] = 10.0
    first: Annotated[int | None, Field(ge=0, le=LARGEST, description="Default: the first clicked frame.")] = (
        None
    )
    last: Annotated[
        int | None,
        Field(
            ge=1, le=LARGEST, description="The frame after the last one; default: after the last clicked one."
        ),
    ] = None
    seed: Seed = 0
    name: Annotated[str, Field(description="Of the run (letters, digits, - and _); default: numbered.")] = ""


@dataclass(frozen=True, slots=True, eq=False)
class CarriedClicks:
    """A run that was made from clicks. clicked : its frames with clicks. frames : how many it has. off : pixels between
    clicks and the body's landmarks in the clicked frames, median. unclicked : groups of parameters of which nothing was
    clicked, so that their pose is between those of the clicked frames. notes : sentences.
    """

    run: StoredRun
    clicked: tuple[int, ...]
    frames: int
    off: float
    unclicked: tuple[str, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class LimbGroup:
    """Parameters that are searched together. columns : in the pose. limbs : drawn ones that nothing behind them in the
    tree moves. views : places of the cameras. shares : (L,) of the limbs' lengths.
    """

    name: str
    columns: Indices
    limbs: Indices
    views: tuple[int, ...]
    shares: Array


def run_of_clicks(
    session: Session,
    clicks: Sequence[LandmarkClick],
    request: CarryRequest,
    progress: Progress = no_progress,
) -> CarriedClicks:
    """The finished run. Raises BodyError for clicks that do not fit the body or say too little, RunError."""
    started = time.monotonic()
    body, cameras = session.body(request.body or None), session.cameras()
    if body.meshes:
        raise BodyError(
            f"Limbs of '{body.name}' are meshes, of which no strips are read.", "Use a body of round limbs."
        )
    names = tuple(dict.fromkeys(click.landmark for click in clicks))
    tree, seen = FilmedTree(body, names), SeenLandmarks(names, cameras, clicks, request.tolerance)
    usable = seen.usable()
    clicked = tuple(usable)
    first, last = session.checked_frames(
        clicked[0] if request.first is None else request.first,
        clicked[-1] + 1 if request.last is None else request.last,
    )
    if last - first > MOST_FRAMES:
        raise RunError(
            f"{last - first} frames are too many to carry clicks to.", f"Choose {MOST_FRAMES} at most."
        )
    progress("fitting the clicked frames", 0, 1)
    fit = fit_poses(tree, cameras, [usable[frame] for frame in clicked], body, (), held=request.held)
    groups = limb_groups(body, tree, {view: _seen_in(usable.values(), view) for view in range(len(cameras))})
    free = [
        group
        for group in groups
        if group.views and len(group.limbs) and not (request.held and _is_root(body, group))
    ]
    unclicked = tuple(group.name for group in groups if not group.views and len(group.limbs))
    with closing(session.footage()) as footage:
        work = _Carrying(
            session, footage, body, cameras, free, dict(zip(clicked, fit.poses, strict=True)), request.seed
        )
        poses, scores = work.carried(range(first, last), progress)
    off = float(np.median(np.concatenate([np.linalg.norm(one, axis=1) for one in fit.off])))
    within = [frame for frame in clicked if first <= frame < last]
    notes = [
        f"Poses of {counted(len(clicked), 'frame')} fitted to clicked landmarks, carried to"
        f" {counted(last - first - len(within), 'other')} by the limbs' look; no tracker searched them.",
        *seen.notes(),
    ]
    if unclicked:
        notes.append(
            f"Nothing was clicked of {', '.join(unclicked)}: there poses lie between the clicked ones."
        )
    run = _stored(session, body, request, (first, last), poses, scores, notes, time.monotonic() - started)
    return CarriedClicks(run, clicked, last - first, off, unclicked, tuple(notes))


def limb_groups(body: BodyModel, tree: FilmedTree, clicked: Mapping[int, Sequence[int]]) -> list[LimbGroup]:
    """The groups in the body's order. clicked : landmarks (places in `tree.names`) by view."""
    rng = np.random.default_rng(0)
    pose = body.neutral + 0.2 * rng.standard_normal(len(body.parameters)) * body.angles
    steps = pose + np.concatenate([np.zeros((1, len(pose))), 0.1 * np.eye(len(pose))])
    ends, points = limb_ends(body, steps), marker_points(tree.body, steps)
    lengths = np.linalg.norm(ends[0, :, 1] - ends[0, :, 0], axis=1)
    by_limb = np.abs(ends[1:] - ends[0]).max(axis=(2, 3)) > MOVED
    by_point = np.abs(points[1:] - points[0]).max(axis=2) > MOVED
    of_group = dict[str, list[int]]()
    for place, entry in enumerate(body.parameters):
        of_group.setdefault(entry.limb, []).append(place)
    limb_owner, point_owner = np.full(len(lengths), -1), np.full(len(tree.names), -1)
    for number, columns in enumerate(of_group.values()):
        limb_owner[by_limb[columns].any(axis=0)] = number
        point_owner[by_point[columns].any(axis=0)] = number
    groups: list[LimbGroup] = []
    for number, (name, columns) in enumerate(of_group.items()):
        limbs = np.flatnonzero(limb_owner == number)
        own = set(np.flatnonzero(point_owner == number).tolist())
        views = tuple(view for view, landmarks in clicked.items() if own & set(landmarks))
        share = lengths[limbs] / max(lengths[limbs].sum(), 1e-9)
        groups.append(LimbGroup(name, np.array(columns), limbs, views, share))
    return groups


def _seen_in(frames: Iterable[FrameClicks], view: int) -> list[int]:
    return sorted({int(one) for clicks in frames for one in clicks.landmark[clicks.camera == view]})


def _is_root(body: BodyModel, group: LimbGroup) -> bool:
    root = root_joint(body)
    return root >= 0 and bool(np.isin(group.columns, body.joints[root].parameters).all())


class _Carrying:
    """The search. known : poses (D,) by frame."""

    def __init__(
        self,
        session: Session,
        footage: Footage,
        body: BodyModel,
        cameras: Sequence[Camera],
        groups: Sequence[LimbGroup],
        known: Mapping[int, Array],
        seed: int,
    ) -> None:
        self._footage, self._cameras, self._groups, self._known, self._seed = (
            footage,
            cameras,
            groups,
            known,
            seed,
        )
        self._lower, self._upper = body.lower, body.upper
        self._step = 2.0 * session_sigma(session, body, session.manifest.fps)
        self._views = sorted({view for group in groups for view in group.views})
        self._projectors = {view: OutlineProjector.of_body(body, (cameras[view],)) for view in self._views}
        self._looks = dict[int, list[Floats]]()

    def carried(self, frames: range, progress: Progress) -> tuple[Array, Array]:
        """Poses (F, D) and scores (F,)."""
        order = sorted((frame for frame in frames if frame not in self._known), key=self._away)
        total, done = len(order) * (1 + SWEEPS), 0
        for view in self._views:
            self._looks[view] = [
                kept_looks(self._maps(frame, (view,))[view], self._corners(view, pose[None])[0])
                for frame, pose in self._known.items()
            ]
        poses = {frame: self._between(frame) for frame in {*frames, *self._known}}
        scores = dict.fromkeys(poses, float(sum(len(group.views) for group in self._groups)))
        settled = set(self._known)
        for sweep in range(1 + SWEEPS):
            for frame in order:
                progress("carrying poses to other frames", done, total)
                done += 1
                beside = [poses[other] for other in (frame - 1, frame + 1) if other in settled]
                poses[frame], scores[frame] = self._searched(frame, sweep, poses[frame], beside)
                settled.add(frame)
        return np.stack([poses[frame] for frame in frames]), np.array([scores[frame] for frame in frames])

    def _away(self, frame: int) -> tuple[int, int]:
        return min(abs(frame - other) for other in self._known), frame

    def _between(self, frame: int) -> Array:
        """The pose between the known ones before and after."""
        frames = sorted(self._known)
        poses = np.stack([self._known[one] for one in frames])
        return np.stack([np.interp(frame, frames, poses[:, place]) for place in range(poses.shape[1])])

    def _searched(
        self, frame: int, sweep: int, now_at: Array, beside: Sequence[Array]
    ) -> tuple[Array, float]:
        """The pose of a frame, group by group, and its score. beside : poses of neighbouring frames."""
        maps, pose, score = self._maps(frame, self._views), now_at.copy(), 0.0
        before = [self._known[other] for other in self._known if other < frame][-1:]
        after = [self._known[other] for other in self._known if other > frame][:1]
        starts = np.stack([now_at, self._between(frame), *before, *after, *beside])
        wide = WIDEST * (np.sqrt(min(self._away(frame)[0], FAR)) if sweep == 0 else 1.0)
        for number, group in enumerate(self._groups):
            rng = np.random.default_rng(np.random.SeedSequence((self._seed, frame, number, sweep, 0xCA44)))
            columns, step = group.columns, self._step[group.columns]
            low, high = self._lower[columns], self._upper[columns]
            centres, spread = starts[:, columns], wide
            best, best_score = pose[columns].copy(), -np.inf
            for turn in range(ROUNDS):
                noise = (
                    spread
                    * (1.0 if turn == 0 else AROUND)
                    * step
                    * rng.standard_normal((DRAWN, len(columns)))
                )
                drawn = centres[rng.integers(len(centres), size=DRAWN)] + noise
                if turn == 0:
                    drawn[: len(centres)] = centres
                drawn = np.clip(drawn, low, high)
                scores = self._scores(maps, group, pose, drawn)
                scores -= self._cost(drawn, [other[columns] for other in beside], step)
                ranked = np.argsort(-scores, kind="stable")
                if scores[ranked[0]] > best_score:
                    best, best_score = drawn[ranked[0]], float(scores[ranked[0]])
                centres, spread = drawn[ranked[:BEST]], spread * NARROWED
            pose[columns] = best
            score += best_score
        return pose, score

    @staticmethod
    def _cost(drawn: Array, beside: Sequence[Array], step: Array) -> Array:
        return DRAWN_TO * sum(
            (0.5 * (((drawn - other) / step) ** 2).sum(axis=1) for other in beside), np.zeros(len(drawn))
        )

    def _scores(self, maps: Mapping[int, Floats], group: LimbGroup, pose: Array, drawn: Array) -> Array:
        poses = np.repeat(pose[None], len(drawn), axis=0)
        poses[:, group.columns] = drawn
        total = np.zeros(len(drawn))
        for view in group.views:
            corners = self._corners(view, poses)[:, group.limbs]
            looks = [look[group.limbs] for look in self._looks[view]]
            total += look_scores(maps[view], corners, looks) @ group.shares
        return total

    def _corners(self, view: int, poses: Array) -> Array:
        return self._projectors[view].corners(poses)[0][:, 0]

    def _maps(self, frame: int, views: Sequence[int]) -> dict[int, Floats]:
        absent = self._footage.absent(frame)
        names = {view: self._cameras[view].name for view in views}
        missing = [name for name in names.values() if name in absent]
        if missing:
            raise RunError(f"Frame {frame} has no picture of {missing[0]}.", "Choose other frames.")
        return {view: look_maps(self._footage.picture(name, frame)) for view, name in names.items()}


def _stored(
    session: Session,
    body: BodyModel,
    request: CarryRequest,
    frames: tuple[int, int],
    poses: Array,
    scores: Array,
    notes: Sequence[str],
    seconds: float,
) -> StoredRun:
    settings = session_settings(session)
    record = RunRecord(
        name=request.name or free_run_name(session),
        session=session.name,
        created=now(),
        tracker=DEFAULT_TRACKER,
        weighting=DEFAULT_WEIGHTING,
        body=body.name,
        dimensions=dict(body.dimensions),
        parameters=parameter_names(body),
        seed=request.seed,
        first=frames[0],
        last=frames[1],
        fps=session.manifest.fps,
        settings=dict(values(settings)),
        sigma=tuple(session_sigma(session, body, session.manifest.fps).tolist()),
        start_pose=tuple(poses[0].tolist()),
        start_source=OF_CLICKS,
        software=software_version(),
        notes=tuple(notes),
    )
    run = make_numbered_run(session, record, request.name, lambda one: session.new_run(one, body_text(body)))
    each = 1000.0 * seconds / len(poses)
    with ResultsWriter(run.folder) as writer:
        writer.write_settings(1, frames[0], 0, values(settings))
        for place, (pose, score) in enumerate(zip(poses, scores, strict=True)):
            carried = FilterState(
                ParticleSet(pose[None], np.zeros(1)), pose, poses[place - 1] if place else None
            )
            writer.write_frame(
                FrameResult(
                    frame=frames[0] + place,
                    estimate=Estimate(pose, pose, pose, float(score)),
                    layers=0,
                    evaluations=ROUNDS * DRAWN * (1 + SWEEPS),
                    settings_version=1,
                    milliseconds=each,
                    carried=carried,
                ),
                (),
            )
    return run
