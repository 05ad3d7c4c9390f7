"""Losses that were planted: does the detector name a limb that is not where the pose has it, and only then?

In frames of drawn clips, and of the two clips of others, the true pose is refined on the masks as a run does it. Then
one limb is put elsewhere, and all is refined again; where it stays lost the detector is asked. It has been lost for
long: no jump gives it away.

- *moved*: anywhere within its limits.
- *folded*: of many places the one that the masks deny least, as a search ends in.
- *three cameras*: the same, seen by the first three.
- *mask erased*: the same, and the masks lack that limb in all views.
- *too few evaluations*: nothing is planted; a run searches with 20 evaluations a frame, and loses limbs itself.

In frames with planted losses the network that knows people is asked; a run asks it every five frames.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import marker_points
from studio.body.model import BodyModel
from studio.evidence.distance_maps import SilhouetteDistances, distances_of
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.arrays import Array, Bytes, evenly_spread
from studio.foundations.geometry.camera import Camera
from studio.garden.drawn_recipes import CHOOSING, KINDS, clip_name
from studio.garden.reproduction.experiment import Part, each_seed, listed
from studio.garden.reproduction.open_questions.generalisation import AS_A_RUN, REFINED, set_up_things_in_front
from studio.garden.reproduction.open_questions.other_people import ELSEWHERE, imported
from studio.garden.reproduction.tracking import Candidate
from studio.results.comparison.findings import Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.tracked import Tracked, TrackingTrial, pose_on_truth, track
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.results.drawing_footage.real_data import PREFIX, real_data_folder
from studio.results.evaluation.errors import limb_of_markers, lost_mm
from studio.runs.checking import contradicted_limbs
from studio.runs.setup.person_witness import LimbsByNetwork
from studio.runs.setup.shape_on_the_way import fit_session_shape
from studio.search.settings import DEFAULT_TRACKER, DEFAULT_WEIGHTING, default_settings
from studio.search.trackers.agreement import FAR_MM, Agreement, limb_names
from studio.search.trackers.limb_certainty import CertaintyOfLimbs
from studio.search.trackers.limbs_elsewhere import (
    Change,
    LimbsElsewhere,
    changes_by_camera,
)
from studio.search.trackers.random_numbers import keyed_generator
from studio.search.trackers.refinement import RefinementSettings, Refiner
from studio.search.trackers.reported_limbs import reported_limbs, reported_lost
from studio.search.trackers.tracker import LIMB_LOST_PROBABILITY

BODY = "human35"
FRAMES, QUICK_FRAMES = 8, 2
"""Frames of a clip in which losses are planted."""
MOVED, FOLDED, THREE, ERASED, FEW = "moved", "folded", "three cameras", "mask erased", "too few evaluations"
CAUSES = (MOVED, FOLDED, THREE, ERASED, FEW)
SOUND = "none"
DRAWS = 256
EVALUATIONS, TRACKED_FRAMES = 20, 24
KEY = 0x105E
Counts = NDArray[np.int64]
POINTS = 150
"""Border points of a view, as in a run."""


def trials(scale: Scale) -> tuple[Trial, ...]:
    """Two trials a clip: losses that are planted, and a run with too few evaluations."""
    drawn = [clip_name(CHOOSING, kind) for kind in KINDS]
    others = [PREFIX + place for place in ELSEWHERE.values() if (real_data_folder() / place).is_dir()]
    planned: list[Trial] = []
    for clip in drawn[:1] if scale.quick else [*others, *drawn]:
        frames = QUICK_FRAMES if scale.quick else FRAMES
        planned += each_seed(f"planted in {clip}", scale.seeds, partial(_planted, clip, frames))
        if not scale.quick:
            planned += each_seed(f"{FEW} in {clip}", scale.seeds, partial(_searched, clip))
    return tuple(planned)


def _planted(clip: str, frames: int, seed: int) -> dict[str, Any]:
    return {"clip": clip, "frames": frames, "seed": seed, "attempt": {}}


def _searched(clip: str, seed: int) -> dict[str, Any]:
    knobs = {**REFINED, "redraw_limbs": False}
    candidate = Candidate(FEW, DEFAULT_TRACKER, DEFAULT_WEIGHTING, knobs)
    attempt = candidate.attempt(clip, seed, EVALUATIONS, last=TRACKED_FRAMES, body=BODY, **AS_A_RUN)
    return {"clip": clip, "frames": TRACKED_FRAMES, "seed": seed, "attempt": attempt.plain()}


@kept_as("open_questions.planted_losses.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """By cause: how many frames had a limb lost, in how many of them the run names one and names the lost one, and the
    same of a check; a run's frames are not checked.
    """
    clip, attempt = str(arguments["clip"]), dict(arguments["attempt"])
    if clip.startswith(PREFIX):
        clip = str(imported(clip, cache))
    set_up_things_in_front(cache.session(clip))
    counts = {cause: [0] * 5 for cause in (*CAUSES, SOUND)}
    if attempt:
        tracked = track(TrackingTrial.of_plain({**attempt, "footage": clip}), cache)
        _count_run(counts, tracked)
    else:
        for cause, lost, by_run, by_check in plant(
            clip, int(arguments["frames"]), int(arguments["seed"]), cache
        ):
            tracked = (1, bool(by_run), lost in by_run, bool(by_check), lost in by_check)
            counts[cause] = [before + int(more) for before, more in zip(counts[cause], tracked, strict=True)]
    return counts


def _count_run(counts: dict[str, list[int]], tracked: Tracked) -> None:
    for lost, named in zip(tracked.lost, tracked.named, strict=True):
        cause = counts[FEW if lost else SOUND]
        cause[0] += 1
        cause[1] += bool(named)
        cause[2] += bool(set(lost) & set(named))


def plant(
    clip: str, frames: int, seed: int, cache: FootageCache
) -> Iterator[tuple[str, str, tuple[str, ...], tuple[str, ...]]]:
    """Cause, the limb that is lost, the limbs that a run names, and those that a check names; of a sound frame no limb
    is lost.
    """
    session = cache.session(clip)
    settings = default_settings(DEFAULT_TRACKER, DEFAULT_WEIGHTING)
    cameras, tree = session.cameras(), session.body(BODY)
    body, _, _ = fit_session_shape(session, tree, settings, pose_on_truth(session, tree, 0), 0)
    whole, three = Looking(body, cameras), Looking(body, cameras[:3])
    footage = session.footage()
    for frame in evenly_spread(session.manifest.frame_count, frames):
        evidence = cache.evidence(session, cameras, int(frame), settings.evidence, "proximity")
        changed = tuple(changes_by_camera(evidence).values())
        pictures = {camera.name: footage.picture(camera.name, int(frame)) for camera in cameras}
        seen = _distances(evidence.views)
        truth = pose_on_truth(session, body, int(frame))
        pose = whole.refined(truth, seen)
        if lost_limbs(body, pose, truth):
            continue
        yield SOUND, "", *whole.names(pose, seen, changed, pictures)
        rng = keyed_generator(seed, int(frame), 0, 0, KEY)
        for limb in whole.movable:
            draws = whole.drawn(rng, pose, limb)
            draws = draws[[limb in lost_limbs(body, one, truth) for one in draws]]
            if not len(draws):
                continue
            bare = _distances(whole.erased(evidence, pose, limb))
            few = seen[: len(three.cameras)]
            for cause, looking, masks, start in (
                (MOVED, whole, seen, draws[0]),
                (FOLDED, whole, seen, whole.least_denied(draws, seen)),
                (THREE, three, few, three.least_denied(draws, few)),
                (ERASED, whole, bare, whole.least_denied(draws, bare)),
            ):
                if cause == THREE and len(cameras) < 4:
                    continue
                ended = looking.refined(start, masks)
                if limb in lost_limbs(body, ended, truth):
                    yield cause, limb, *looking.names(ended, masks, changed, pictures)


def _distances(views: Sequence[ViewEvidence]) -> list[SilhouetteDistances]:
    """What a run and a check see of masks, with what is unknown."""
    return [
        distances_of(view.mask, POINTS, unknown=view.unknown, doubted=view.shadow is not None)
        for view in views
    ]


def lost_limbs(body: BodyModel, pose: Array, truth: Array) -> set[str]:
    """Limbs of which a marker lies too far from its place in the true pose; both (D,)."""
    off = np.linalg.norm(np.subtract(*marker_points(body, np.stack([pose, truth]))), axis=1)
    limbs = limb_of_markers(body)
    return {
        limbs[marker.name]
        for marker, apart in zip(body.markers, off, strict=True)
        if apart > lost_mm(body) and marker.name in limbs
    }


class Looking:
    """What refines poses and names lost limbs in some cameras."""

    def __init__(self, body: BodyModel, cameras: tuple[Camera, ...]) -> None:
        self.body, self.cameras = body, cameras
        self._refiner = Refiner(body, cameras, RefinementSettings(refinement_steps=6))
        self._agreement, self._certainty = Agreement(body, cameras), CertaintyOfLimbs(self._refiner)
        self._witness, self._network = LimbsElsewhere(body, cameras), LimbsByNetwork(body, cameras)

    @property
    def movable(self) -> tuple[str, ...]:
        """Limbs with two angles or more of their own, but the trunk."""
        limbs = [entry.limb for n, entry in enumerate(self.body.parameters) if self._refiner.bounded[n]]
        ends = set(limb_of_markers(self.body).values())
        return tuple(limb for limb in dict.fromkeys(limbs) if limbs.count(limb) > 2 and limb in ends)

    def drawn(self, rng: np.random.Generator, pose: Array, limb: str) -> Array:
        """(DRAWS, D) a pose with a limb's angles drawn over their range."""
        own = [
            n
            for n, entry in enumerate(self.body.parameters)
            if entry.limb == limb and self._refiner.bounded[n]
        ]
        poses = np.repeat(pose[None], DRAWS, axis=0)
        lower, upper = self._refiner.lower[own], self._refiner.upper[own]
        poses[:, own] = lower + (upper - lower) * rng.random((DRAWS, len(own)))
        return poses

    def least_denied(self, draws: Array, seen: Sequence[SilhouetteDistances]) -> Array:
        """(D,) of poses (N, D) the one that disagrees least with the masks."""
        return draws[int(np.argmin(self._agreement.of_places(draws, seen)))]

    def refined(self, pose: Array, seen: Sequence[SilhouetteDistances]) -> Array:
        """(D,) a pose refined on the masks."""
        return self._refiner.refine(pose, seen).pose

    def names(
        self,
        pose: Array,
        seen: Sequence[SilhouetteDistances],
        changed: Sequence[Change],
        pictures: Mapping[str, Bytes],
    ) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """The limbs that a run calls lost, of a body that stood still for two frames, in a frame in which it asks the
        network; and those that a check calls contradicted. changed : as in `LimbsElsewhere.of`, of all cameras.
        pictures : of all cameras.
        """
        matrix = self._refiner.loss(pose, seen)[2]
        certainty = self._certainty.of(pose, matrix, {})
        for _ in range(2):
            certainty = self._certainty.of(pose, matrix, certainty.moved)
        off = self._agreement.of(pose, seen)
        elsewhere = self._witness.of(pose, changed[: len(self.cameras)])
        reported = reported_lost(self.body, pose, reported_limbs(self._network, pose, pictures, elsewhere))
        lost = certainty.lost(off, elsewhere, reported)
        by_run = [limb for limb, value in lost.items() if value > LIMB_LOST_PROBABILITY]
        confirmed = self._agreement.confirmed(off, pose, seen)
        return tuple(by_run), tuple(contradicted_limbs(confirmed, elsewhere, reported))

    def erased(self, evidence: FrameEvidence, pose: Array, limb: str) -> list[ViewEvidence]:
        """Each view, its mask without a limb of a pose, where no other limb of it lies."""
        corners = self._agreement.corners(pose)
        erased: list[ViewEvidence] = []
        for view, quads, mm in zip(evidence.views, corners, self._agreement.mm_per_pixel(pose), strict=True):
            own, others = np.zeros_like(view.mask), np.zeros_like(view.mask)
            for name, quad in zip(limb_names(self.body), quads, strict=True):
                if np.isfinite(quad).all():
                    cv2.fillPoly(own if name == limb else others, [np.rint(quad).astype(np.int32)], (255,))
            reach = 2 * round(FAR_MM / mm) + 1
            own = np.asarray(cv2.dilate(own, np.ones((reach, reach), np.uint8)), np.uint8)
            mask = np.where((own > 0) & (others == 0), np.uint8(0), view.mask)
            erased.append(replace(view, mask=mask))
        return erased


WHO = {"a run": 1, "a check": 3}
"""Who names limbs, and where its counts begin."""


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """Of each cause, and of frames without a lost limb, how many were named, by a run and by a check; clip by clip."""
    counts: dict[str, dict[str, Counts]] = {}
    for outcome in outcomes:
        own = counts.setdefault(
            str(outcome.trial.arguments["clip"]), {cause: np.zeros(5, np.int64) for cause in (*CAUSES, SOUND)}
        )
        for cause, values in outcome.measured.items():
            own[cause] += values
    total = {cause: np.sum([own[cause] for own in counts.values()], axis=0) for cause in (*CAUSES, SOUND)}
    for who, column in WHO.items():
        causes = [cause for cause in CAUSES if total[cause][0] and (cause != FEW or who == "a run")]
        for cause in causes:
            share = 100.0 * total[cause][column] / total[cause][0]
            yield number(f"named by {who}, {cause}", [float(share)], "%", better="higher")
        whole = np.sum([total[cause] for cause in causes], axis=0)
        if causes:
            share = 100.0 * whole[column] / whole[0]
            yield number(f"named by {who}, all causes", [float(share)], "%", better="higher")
        sound = 100.0 * total[SOUND][column] / max(total[SOUND][0], 1)
        yield number(f"named by {who}, no limb lost", [float(sound)], "%", better="lower")
        yield Table(
            f"frames in which {who} names a limb / names the lost one / of all",
            ("clip", *CAUSES, "no limb lost"),
            tuple(
                (name, *(_words(own[cause], column) for cause in (*CAUSES, SOUND)))
                for name, own in (*counts.items(), ("all clips", total))
            ),
        )
    yield {"frames a clip": FRAMES, "body": BODY, "evaluations of the run that loses": EVALUATIONS}


def _words(counts: Counts, column: int) -> str:
    return f"{counts[column]} / {counts[column + 1]} / {counts[0]}" if counts[0] else "–"


EXPERIMENTS = (
    listed(
        "planted-losses",
        trials,
        measure,
        shown,
        footage=tuple(clip_name(CHOOSING, kind) for kind in KINDS),
    ),
)
