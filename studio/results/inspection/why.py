"""Why a frame failed, in words made of measurements.

Said first is whose fault the error is, where the frame was searched for long (`error_parts`; that is never done while
this is asked), then whether the frame fits, as the timeline and the badge have it (`verdict`), and what is compared
with what.
Then it is asked, in this order; the first that holds is the cause:

1. Is any limb in the wrong place? In mm from the reference pose: the truth, else what a refinement or later track made
   of the frame, else a refinement made now; that, too, where a limb is lost that the later track left where it is.
2. Does one camera contradict the others at the reference pose (`camera_checks`)? Where a shift of the outlines mends
   it, its calibration is wrong, else its masks are.
3. Is the pose the reference with sides exchanged?
4. When did it begin? The frame after the last one in which the limb was right; from there on:
   was the limb wrong from the run's beginning (start pose)? Did it move, in a frame, by more than MOTION deviations of
   the first set (noise)? Did so few particles carry the weight (effective number, Deutscher & Reid 2005, Eq. 11) that a
   layer's choice is luck: with a usual survival rate they would not be as few (survival), or would (particles)?
5. Does the likelihood prefer the wrong pose, both settled nearby? Then which camera and term (`blame`)?
6. Else the stretch is tracked again: a search of few layers with as many evaluations in the usual number of layers (its
   one step from broad to narrow is too long, Deutscher & Reid 2005, section 3), any with other seeds alone (luck), with
   more particles and with more noise. What helps names the cause; where nothing does and the likelihood prefers the
   reference, the search missed it.

Stretches are always tracked again with the remedy, and what became of the limb is said. What these rules cannot tell
apart: a survival rate that is too low and too few particles where both are so; a camera that is moved and one whose
masks are shifted; limbs exchanged by the likelihood and by a search that got lost where both limbs meet; with fewer
than three cameras, any fault of one. Distances in mm are at a person's size (`scale_of`).
"""

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from cachetools import LRUCache

from studio.body.scale import scale_of
from studio.foundations.arrays import Array
from studio.foundations.errors import SettingsError, StudioError
from studio.foundations.knobs import Value, knobs_of
from studio.foundations.words import enumerated
from studio.results.evaluation.errors import lost_mm
from studio.results.inspection.blame import ReferencePose, explained_pose, reference_pose
from studio.results.inspection.camera_checks import CameraFault, fault_of, view_fits
from studio.results.inspection.error_parts import parts_of, split_of, words_of
from studio.results.inspection.likelihoods import FrameEvaluation, evaluation_of, telling_nats
from studio.results.inspection.limbs import limb_rows, limb_shares, limbs_too_far
from studio.results.inspection.long_search import LongSearch, search_of, searches_that_hold
from studio.results.inspection.modes import exchanged_in
from studio.results.inspection.reading import InspectedFrame, InspectedRun, no_value
from studio.results.inspection.reference import body_points, by_limb, refined_pose, true_points
from studio.results.inspection.retracking import Change, Retracking, more_evaluations
from studio.results.inspection.schedule import effective_number
from studio.results.inspection.tables import FrameFinding, Remedy, Row, Selection, View, ViewResult, table
from studio.results.inspection.verdict import STATE_WORDS, Verdict, verdict, verdict_on
from studio.runs.run_footage import filmed_cameras
from studio.runs.tracks import RAW, best_track, track_stamp
from studio.search.settings import RunSettings
from studio.search.trackers.catalogue import TRACKERS, knobs_for_evaluations
from studio.search.trackers.tracker import TRACKED

VIEW = View(
    "why",
    "Why",
    "Why did this frame fail?",
    ("track",),
    (
        table(
            "findings",
            "What was found",
            ("kind", "Kind"),
            ("words", "In words"),
            "limb",
            "layer",
            "camera",
            "term",
        ),
        table(
            "nearest",
            "Distance of the nearest particle from the reference pose",
            "layer",
            "limb",
            ("nearest", "Nearest particle", "mm"),
            ("median", "Median particle", "mm"),
            ("reach", "Noise of the layer", "mm"),
            ("inside", "Reference inside the cloud"),
        ),
        table(
            "limbs",
            "Error or disagreement by frame and limb",
            "frame",
            "limb",
            ("error", "Error", "mm"),
            ("disagreement", "Disagreement with the silhouettes"),
            ("lost", "Lost"),
            ("lost_by", "Lost by"),
            of_run=True,
        ),
        table(
            "parts",
            "Whose fault the error is, of frames that were searched for long",
            "frame",
            ("error", "Error", "mm"),
            ("refinement", "Refinement", "mm"),
            ("search", "Search", "mm"),
            ("likelihood", "Likelihood", "mm"),
            ("body", "Body", "mm"),
            ("known", "Heaviest known outweighs the found by", "nats"),
            ("truth", "Truth outweighs it by", "nats"),
            ("away", "From found to heaviest known", "mm"),
            of_run=True,
        ),
        table(
            "scale",
            "Colours of the map of limbs",
            ("quantity", "Quantity"),
            "unit",
            ("low", "First colour"),
            ("lost", "Lost from"),
            ("high", "Last colour, also beyond"),
            of_run=True,
        ),
    ),
    evaluates=True,
)


WRONG_MM, RIGHT_MM, NEAR_MM = 80.0, 45.0, 60.0
"""Mean distance of a limb's points from the reference: from here on it is wrong; below this it was right; nearer than
this a particle was near.
"""
MOTION = 3.0
"""Deviations of the first set that a limb moves in a frame when the motion is beyond the noise. Well tracked limbs of
fast runs have up to 2.3."""
FEW, USUAL_SURVIVAL, LOW_SURVIVAL = 6.0, 0.3, 0.1
"""Effective number below which a choice is luck; the survival rate that a remedy sets; one that counts as low."""
TIMES_PARTICLES, TIMES_NOISE = 8.0, 3.0
FEW_LAYERS, USUAL_LAYERS = 4, 10
"""Layers of a search that hardly anneals, and of one that does: what such a search is tried with."""
HELPS = 0.75
"""Share of the error that is left at most where a change helped."""
LONGEST, LONGEST_AGO = 8, 64
"""Frames that are tracked again, and that are looked back over, at most."""
SEEDS = (101, 202)
SETTLING, DRAWN, KEPT_WITHIN_MM = (1.0, 0.5, 0.25), 96, 40.0
KEPT = 64
REFINED_NOW = "a refinement on the silhouettes"


@dataclass(frozen=True, slots=True)
class Preference:
    """Which of two settled poses the likelihood prefers. nats : log-weight of the pose less that of the reference.
    threshold : what has to be exceeded. camera, term : that speak most for the pose. share : nats of these.
    """

    nats: float
    threshold: float
    camera: str
    term: str
    share: float

    @property
    def is_for_the_pose(self) -> bool:
        """Whether the wrong pose weighs more."""
        return self.nats > self.threshold

    @property
    def is_for_the_reference(self) -> bool:
        """Whether the right pose weighs more."""
        return self.nats < -self.threshold


@dataclass(frozen=True, slots=True)
class Trial:
    """A stretch tracked again. what : in words. left : mean error of the wrong limbs at its end, mm."""

    what: str
    settings: Mapping[str, Value]
    left: float


class Case:
    """A frame and what is measured of it."""

    def __init__(self, frame: InspectedFrame, track: str) -> None:
        self.frame, self.run, self.track = frame, frame.of, track
        self.evaluation: FrameEvaluation = evaluation_of(frame)
        self._made: dict[int, Array] = {}
        self._tried: dict[str, Trial] = {}
        self.size = scale_of(frame.of.body)
        self.pose = explained_pose(frame, track)
        self.verdict = self._verdict()
        self.reference = self._reference()
        self.errors, self.wrong = self._compare()
        if not self.wrong and not self.verdict.fits and self.reference.kind not in ("truth", REFINED_NOW):
            # The later track has the same fault; a search of its own may know a better place.
            self.reference = ReferencePose(REFINED_NOW, self._refined_now(frame.number))
            self.errors, self.wrong = self._compare()

    def _compare(self) -> tuple[dict[str, float], list[str]]:
        """mm by limb from the reference, and the limbs that are off."""
        errors = self.all_errors(self.pose)
        return errors, [limb for limb, mm in errors.items() if mm > WRONG_MM * self.size]

    @property
    def drifting(self) -> list[str]:
        """The limbs that are not right any more, farthest first."""
        off = [limb for limb, mm in self.errors.items() if mm > RIGHT_MM * self.size]
        return sorted(off, key=lambda limb: -self.errors[limb])

    def _verdict(self) -> Verdict:
        """What the page says of the frame, in the track that it shows."""
        truth, lost = true_points(self.run, self.frame.number), tuple[str, ...]()
        if truth is not None:
            shown = body_points(self.run.body, self.frame.estimate(self.track)[None])[0]
            lost = limbs_too_far(self.run.body, np.linalg.norm(shown - truth, axis=1))
        result = self.frame.result
        return verdict(TRACKED, (), lost) if result is None else verdict_on(result, lost, self.run.body)

    def _reference(self) -> ReferencePose:
        reference = reference_pose(self.frame, self.track)
        if reference.kind != "best particle":
            return reference
        return ReferencePose(REFINED_NOW, self._refined_now(self.frame.number))

    def _refined_now(self, number: int) -> Array:
        """(D,) a frame's pose, refined on its silhouettes."""
        if number not in self._made:
            frame = self.run.frame(number)
            evidence, pose = evaluation_of(frame).evidence, explained_pose(frame, self.track)
            self._made[number] = refined_pose(self.run, evidence, number, pose, self._made.get(number + 1))
        return self._made[number]

    def all_errors(self, pose: Array) -> dict[str, float]:
        """mm by limb from the reference of this frame: its own markers where it is the truth."""
        points = true_points(self.run, self.frame.number) if self.reference.kind == "truth" else None
        goal = body_points(self.run.body, self.reference.pose[None])[0] if points is None else points
        away = by_limb(
            self.run.body, np.linalg.norm(body_points(self.run.body, pose[None])[0] - goal, axis=1)
        )
        return {limb: float(mm) for limb, mm in away.items() if np.isfinite(mm)}

    def error(self, pose: Array, limbs: Sequence[str]) -> float:
        """Mean error of some limbs, mm."""
        errors = self.all_errors(pose)
        return float(np.mean([errors[limb] for limb in limbs]))

    @cached_property
    def settings(self) -> RunSettings:
        return self.frame.settings

    @cached_property
    def camera_fault(self) -> CameraFault | None:
        """The camera that contradicts the others at the reference pose."""
        return fault_of(
            view_fits(
                self.run.body,
                filmed_cameras(self.run.session, self.run.run.cameras()),
                self.evaluation.evidence,
                self.reference.pose,
            )
        )

    @cached_property
    def exchanged(self) -> str:
        """What is exchanged against the reference, "" for nothing: in this frame, or in two others of the stretch, as
        exchanged limbs that meet differ little.
        """
        if not self.wrong:
            return ""
        exchange = exchanged_in(self.run.body, self.reference.pose, self.pose)
        began = self.stretch[0]
        others = sorted({began, (began + self.frame.number) // 2} - {self.frame.number})
        if exchange or len(others) < 2:
            return exchange
        exchanges = {self._exchanged_in_frame(number) for number in others}
        return exchanges.pop() if len(exchanges) == 1 else ""

    def _exchanged_in_frame(self, number: int) -> str:
        """The same for another frame, with the run's own pose."""
        frame = self.run.frame(number)
        reference = reference_pose(frame, self.track)
        pose = self._refined_now(number) if self.reference.kind == REFINED_NOW else reference.pose
        return exchanged_in(self.run.body, pose, explained_pose(frame, self.track))

    @cached_property
    def stretch(self) -> tuple[int, int]:
        """First frame of the failure, and of what is tracked again; the same unless it began long ago."""
        began, tracked = self.frame.number, set(self.run.frames())
        earliest = self.frame.number - (LONGEST if self.reference.kind == REFINED_NOW else LONGEST_AGO)
        for number in range(self.frame.number - 1, max(earliest, self.run.run.record.first) - 1, -1):
            place = self._place(number) if number in tracked else None
            if place is None:
                break
            if max(self._off(number, place).values()) <= RIGHT_MM * self.size:
                break
            began = number
        return began, max(began, self.frame.number - LONGEST + 1)

    def _off(self, number: int, place: Array) -> dict[str, float]:
        """mm by limb that is wrong, from where the body was in another frame."""
        away = np.linalg.norm(
            body_points(self.run.body, self._pose_of_frame(number)[None])[0] - place, axis=1
        )
        errors = by_limb(self.run.body, away)
        return {limb: float(errors[limb]) for limb in self.wrong}

    @cached_property
    def beginning(self) -> tuple[str, float]:
        """The limb that was farthest off where the failure began, and how far, mm."""
        place = self._place(self.stretch[0])
        off = self._off(self.stretch[0], place) if place is not None else self.errors
        limb = max(off, key=lambda name: off[name])
        return limb, off[limb]

    def _pose_of_frame(self, number: int) -> Array:
        """(D,) the pose that is asked about, of another frame."""
        return explained_pose(self.run.frame(number), self.track)

    @cached_property
    def motion(self) -> tuple[float, float, float, int]:
        """How far a wrong limb moved in a frame: in deviations of the first set, mm, those deviations in mm, and the
        frame. Where it began, or the median over the stretch if that is more; (0, 0, 0, -1) where it cannot be known.
        """
        motions: list[tuple[float, float, float, int]] = []
        began, first = self.stretch
        for number in sorted({began, *range(first, self.frame.number + 1)}):
            if number <= self.run.run.record.first:
                continue
            before, now = self._place(number - 1), self._place(number)
            if before is None or now is None:
                continue
            points = body_points(self.run.body, self.run.frame(number).layers[0].poses)
            spread = np.sqrt(np.mean(np.sum((points - points.mean(axis=0)) ** 2, axis=2), axis=0))
            moved = by_limb(self.run.body, np.linalg.norm(now - before, axis=1))
            reach = by_limb(self.run.body, spread)
            moves = [
                (float(moved[limb] / reach[limb]), float(moved[limb]), float(reach[limb]), number)
                for limb in self.wrong
                if reach[limb] > 0.0
            ]
            motions += [max(moves)] if moves else []
        if not motions:
            return 0.0, 0.0, 0.0, -1
        usual = sorted(motions)[(len(motions) - 1) // 2]
        return max(usual, *(one for one in motions if one[3] == began), usual)

    def _place(self, number: int) -> Array | None:
        """(M, 3) where the body was in a frame, None where that is not known."""
        if self.reference.kind == "truth":
            return true_points(self.run, number)
        try:
            if self.reference.kind == REFINED_NOW:
                pose = self._refined_now(number)
            else:
                pose = self.run.frame(number).estimate(
                    "" if self.reference.kind == "refined" else self.reference.kind
                )
        except StudioError:
            return None
        return body_points(self.run.body, pose[None])[0]

    @cached_property
    def effective(self) -> float:
        """Median effective number over the layers of the stretch, inf for trackers without weights."""
        numbers: list[float] = []
        for number in range(self.stretch[1], self.frame.number + 1):
            frame = self.run.frame(number)
            if frame.is_weighted:
                numbers += [effective_number(frame.log_weights(layer)) for layer in range(len(frame.layers))]
        return float(np.median(numbers)) if numbers else float("inf")

    @cached_property
    def preference(self) -> Preference:
        """Which of pose and reference the likelihood prefers, both settled nearby."""
        ours, theirs = (self._settle(pose) for pose in (self.pose, self.reference.pose))
        shares = self.evaluation.shares(np.stack([ours, theirs]))
        off = shares.values[0] - shares.values[1]
        view, term = np.unravel_index(int(np.argmax(off)), off.shape)
        return Preference(
            float(off.sum()),
            telling_nats(self.settings),
            shares.cameras[view],
            shares.terms[term],
            float(off[view, term]),
        )

    def _settle(self, pose: Array) -> Array:
        """The best of poses drawn about a pose, none of whose limbs goes farther than KEPT_WITHIN_MM."""
        rng, sigma = np.random.default_rng(0), np.array(self.run.run.record.sigma)
        goal, best = body_points(self.run.body, pose[None])[0], pose
        weight = float(self.evaluation.log_weights(best[None])[0])
        for scale in SETTLING:
            drawn = best + scale * sigma * rng.standard_normal((DRAWN, len(pose)))
            away = np.linalg.norm(body_points(self.run.body, drawn) - goal, axis=2)
            near = (
                np.stack(list(by_limb(self.run.body, away).values())).max(axis=0)
                <= KEPT_WITHIN_MM * self.size
            )
            drawn = drawn[near & self.run.priors.hold(drawn)]
            if not len(drawn):
                continue
            values = self.evaluation.log_weights(drawn)
            if values.max() > weight:
                best, weight = drawn[int(np.argmax(values))], float(values.max())
        return best

    @cached_property
    def clouds(self) -> list[Row]:
        goal = body_points(self.run.body, self.reference.pose[None])[0]
        table: list[Row] = []
        for layer, record in enumerate(self.frame.layers):
            points = body_points(self.run.body, record.poses)
            away = by_limb(self.run.body, np.linalg.norm(points - goal, axis=2))
            spread = by_limb(
                self.run.body, np.sqrt(np.mean(np.sum((points - points.mean(axis=0)) ** 2, axis=2), axis=0))
            )
            table += [
                (
                    layer,
                    limb,
                    no_value(float(mm.min())),
                    no_value(float(np.median(mm))),
                    no_value(float(spread[limb])),
                    bool(mm.min() <= NEAR_MM * self.size),
                )
                for limb, mm in away.items()
            ]
        return table

    def layer_left(self, limb: str) -> tuple[int | None, float]:
        """The first layer without a particle near the reference's limb after which none came near again, and the
        nearest distance in any layer, mm. None where the last layer has one.
        """
        own = [(int(str(row[0])), float(str(row[2])), bool(row[5])) for row in self.clouds if row[1] == limb]
        nearest = min(mm for _, mm, _ in own)
        if own[-1][2]:
            return None, nearest
        last_near = max((layer for layer, _, near in own if near), default=-1)
        return last_near + 1, nearest

    def trials(self, wanted: Sequence[tuple[str, Mapping[str, Value]]]) -> list[Trial]:
        """The stretch tracked again with other seeds and each of these changes."""
        for what, settings in wanted:
            if what not in self._tried:
                ends = [self._retracking.poses(Change(settings, seed))[-1] for seed in SEEDS]
                left = float(np.mean([self.error(pose, self.wrong) for pose in ends]))
                self._tried[what] = Trial(what, settings, left)
        return [self._tried[what] for what, _ in wanted]

    @cached_property
    def _retracking(self) -> Retracking:
        return Retracking(self.run, self.stretch[1], self.frame.number)


def more_noise(settings: RunSettings) -> dict[str, Value]:
    """The knob of the noise, some times as large; {} where the tracker has none."""
    limits = {entry.name: entry for entry in knobs_of(settings.tracker)}
    if "diffusion_scale" not in limits:
        return {}
    wanted, high = TIMES_NOISE * settings.tracker.diffusion_scale, limits["diffusion_scale"].high
    return {"diffusion_scale": wanted if high is None else min(wanted, float(high))}


def usual_layers(settings: RunSettings) -> dict[str, Value]:
    """Knobs with which a search of few layers has the usual number of them and as many evaluations; {} for a search
    that has enough, or whose tracker has no layers to choose.
    """
    tracker = TRACKERS[settings.tracker_name]
    has_layers = "layers" in {entry.name for entry in knobs_of(settings.tracker)}
    if not has_layers or tracker.layer_count(settings.tracker) >= FEW_LAYERS:
        return {}
    try:
        evaluations = tracker.evaluations(settings.tracker)
        return dict(knobs_for_evaluations(settings.tracker_name, evaluations, USUAL_LAYERS))
    except SettingsError:  # Too few for so many layers.
        return {}


def usual_survival(settings: RunSettings) -> dict[str, Value]:
    """The usual survival rate in all layers; {} where the tracker has none."""
    names = {entry.name for entry in knobs_of(settings.tracker)}
    if "survival" not in names:
        return {}
    return {"survival": USUAL_SURVIVAL} | (
        {"survival_per_layer": ""} if "survival_per_layer" in names else {}
    )


def rows(frame: InspectedFrame, selection: Selection) -> ViewResult:
    """The tables, findings and remedies of view `why`; kept for the frames that were asked for last."""
    track = selection.track if selection.track != RAW else ""
    search = None if track else search_of(frame, searches_that_hold(frame.of))
    key = (frame.of.run.folder, frame.number, track, search, *_stamps(frame))
    with _lock:
        if key in _known:
            return _known[key]
    explained = _explain(Case(frame, track), search)
    with _lock:
        _known[key] = explained
    return explained


def _stamps(frame: InspectedFrame) -> tuple[object, ...]:
    """What the answer depends on: the frame, the track and the truth that it is compared with."""
    result, run = frame.result, frame.of.run
    own = None if result is None else (result.milliseconds, result.estimate.log_weight)
    best, truth = best_track(run).name, frame.of.session.truth_path
    return own, best, track_stamp(run, best), None if truth is None else truth.stat().st_mtime_ns


_lock = threading.Lock()
_known = LRUCache[tuple[object, ...], ViewResult](KEPT)


def run_rows(run: InspectedRun, selection: Selection) -> ViewResult:
    """The tables of the whole run: limbs over frames, and whose fault the errors of long searched frames are."""
    split = split_of(run)
    parts: list[Row] = [
        (one.frame, one.error_mm, one.refinement_mm, one.search_mm, one.likelihood_mm, one.body_mm, one.known_nats,
         one.truth_nats, one.away_mm)
        for one in split.frames
    ]  # fmt: skip
    notes = (split.words,) if parts else ()
    return ViewResult({**limb_rows(run, selection), "parts": parts}, notes)


def _explain(case: Case, search: LongSearch | None) -> ViewResult:
    findings, remedies = [_first_finding(case)], list[Remedy]()
    fault = case.camera_fault
    if fault is not None:
        _add_camera(case, fault, findings, remedies)
    if case.wrong:
        limb = max(case.wrong, key=lambda name: case.errors[name])
        _add_search(case, limb, findings, remedies, cause_known=fault is not None)
    elif case.drifting and case.verdict.fits:
        findings += [_layer_finding(case, case.drifting[0]), _preference_finding(case)]
    if case.wrong and case.stretch[1] < case.frame.number:
        # With knobs the whole stretch is tracked again: in its last frame alone they mend little.
        remedies = [replace(one, frame=case.stretch[1]) if one.settings else one for one in remedies]
    if not case.verdict.fits and not remedies:
        remedies.append(BY_HAND)
    if search is not None:
        parts = parts_of(case.frame, search)
        findings.insert(
            0, FrameFinding(f"part of {parts.chief or 'others'}", words_of(parts), numbers=parts.numbers)
        )
    table: list[Row] = [(one.kind, one.words, one.limb, one.layer, one.camera, one.term) for one in findings]
    return ViewResult(
        {"findings": table, "nearest": case.clouds}, (_compared_with(case),), tuple(findings), tuple(remedies)
    )


BY_HAND = Remedy(
    "Correct the frame by hand",
    "Put the limb where it belongs: the run is tracked again from there, as a new one.",
    {},
    "correct",
)


def _compared_with(case: Case) -> str:
    ours = {"": "the pose that the search found"}.get(case.track, f"track '{case.track}'")
    result = case.frame.result
    if not case.track and result is not None and result.estimate.searched is not None:
        ours += ", before it was refined"
    theirs = {
        "truth": "the truth",
        "refined": "what the refinement made of it",
        REFINED_NOW: f"{REFINED_NOW} made just now",
    }.get(case.reference.kind, f"track '{case.reference.kind}'")
    return f"Compared here: {ours}, with {theirs}."


def _first_finding(case: Case) -> FrameFinding:
    """Whether the frame fits, in the words of timeline and badge, and how far the limbs are off."""
    numbers, reference = dict(case.errors), _of(case.reference.kind)
    sentences, mended = _verdict_sentences(case), _refinement_note(case)
    worst = max(case.errors, key=lambda name: case.errors[name])
    if case.wrong:
        named = sorted(case.wrong, key=lambda name: -case.errors[name])
        parts = [f"the {limb} by {_mm(case.errors[limb])}" for limb in named]
        words = f"Off from {reference}: {enumerated(parts)}.{mended}"
        if case.verdict.fits and not mended:
            words += f" No limb counts as lost: that begins at a marker {_mm(lost_mm(case.run.body))} off."
        kind = "mended" if mended and case.verdict.fits else "wrong limb"
        return FrameFinding(kind, " ".join([*sentences, words]), named[0], numbers=numbers)
    farthest = _mm(case.errors[worst])
    if case.verdict.fits and case.drifting:
        parts = [f"the {limb} by {_mm(case.errors[limb])}" for limb in case.drifting]
        words = f"No limb is lost. Off from {reference}: {enumerated(parts)}.{mended}"
        return FrameFinding("drifting", words, worst, numbers=numbers)
    if case.verdict.fits:
        words = f"The frame fits: no limb is farther than {farthest} from {reference}."
        return FrameFinding("fits", words, worst, numbers=numbers)
    if case.reference.kind == "truth":
        sentences.append(f"On average no limb's points are farther than {farthest} from the truth.")
    elif case.verdict.lost:
        sentences.append(f"No better place is known: {reference} is nowhere farther than {farthest} away.")
    limb = case.verdict.lost[0] if case.verdict.lost else worst
    return FrameFinding("lost", " ".join(sentences), limb, numbers=numbers)


def _verdict_sentences(case: Case) -> list[str]:
    """Why the page marks the frame as lost; [] where it does not."""
    verdict, result = case.verdict, case.frame.result
    sentences = [STATE_WORDS[verdict.tracking]] if verdict.tracking in STATE_WORDS else []
    if verdict.by_truth:
        sentences.append(
            f"Against the truth this is lost: the {enumerated(verdict.by_truth)}, with a marker more than"
            f" {_mm(lost_mm(case.run.body))} off."
        )
    if verdict.by_silhouettes:
        shares = {} if result is None else limb_shares(case.run.body, result.disagreement)
        limbs = [f"the {limb}{_share(shares.get(limb))}" for limb in verdict.by_silhouettes]
        sentences.append(f"Lost by the silhouettes: {enumerated(limbs)}.")
    return sentences


def _share(share: float | None) -> str:
    return (
        "" if share is None else f" (body and silhouettes disagree about {100.0 * share:.3g} % of its area)"
    )


def _refinement_note(case: Case) -> str:
    """That the refinement after the search put it right, where it did; "" else."""
    result = case.frame.result
    if case.track or case.reference.kind == "refined" or result is None or result.estimate.searched is None:
        return ""
    worst = max(case.all_errors(result.estimate.pose).values())
    if worst > WRONG_MM * case.size:
        return ""
    return f" The refinement after the search put it right: no limb is farther off than {_mm(worst)} now."


def _add_camera(case: Case, fault: CameraFault, findings: list[FrameFinding], remedies: list[Remedy]) -> None:
    fit, name = fault.fit, fault.fit.camera
    numbers = {"overlap": fit.overlap, "usual": fault.usual, "shifted": fit.best, "shift_px": fit.distance}
    seen = (
        f"With the body as in {_of(case.reference.kind)}, body and silhouette overlap by {_percent(fit.overlap)} in"
        f" camera {name} and by {_percent(fault.usual)} in the others"
    )
    if fault.kind == "calibration":
        words = (
            f"The calibration of camera {name} is wrong. {seen}; shifted by {fit.distance:.0f} px they overlap by"
            f" {_percent(fit.best)}: the camera shows the right shape in the wrong place."
        )
        remedies.append(
            Remedy(f"Calibrate camera {name}", "Calibrate it again, or align the cameras by their silhouettes.", {},
                   "calibrate")
        )  # fmt: skip
    else:
        words = (
            f"The masks of camera {name} are bad. {seen}, and no shift helps ({_percent(fit.best)} at best):"
            f" {_percent(fit.covered)} of the mask is body, {_percent(fit.inside)} of the body is in the mask."
        )
        remedies.append(
            Remedy(f"Look at the masks of camera {name}", "Give it another background, or other masks.", {},
                   "masks")
        )  # fmt: skip
    findings.append(FrameFinding(fault.kind, words, camera=name, numbers=numbers, is_cause=True))


def _add_search(
    case: Case, limb: str, findings: list[FrameFinding], remedies: list[Remedy], *, cause_known: bool
) -> None:
    # Refining earlier frames on bad evidence takes long and shows nothing.
    known = case.reference.kind != REFINED_NOW or not cause_known
    began = case.stretch[0] if known else case.frame.number
    if began < case.frame.number:
        first, mm = case.beginning
        words = f"It began in frame {began}, where the {first} was {_mm(mm)} off."
        findings.append(FrameFinding("began", words, first, numbers={"frame": began, "off": mm}, frame=began))
    cause = None if cause_known else _cause(case, limb, remedies)
    if cause is not None:
        findings.append(cause)
    findings.append(_layer_finding(case, limb))
    if cause is None or cause.kind not in ("likelihood", "missed"):
        findings.append(_preference_finding(case))
    if cause is None or cause.kind not in TRIED:
        return
    remedy = remedies[-1]
    before = case.error(case.pose, case.wrong)
    trials = case.trials([SAME, (remedy.title, remedy.settings)])
    for trial in trials:
        words = (
            f"Tracked again from frame {case.stretch[1]} with {_lower_first(trial.what)}: the error of what is off goes"
            f" from {_mm(before)} to {_mm(trial.left)}."
        )
        findings.append(FrameFinding("trial", words, limb, numbers={"before": before, "after": trial.left}))


TRIED = ("noise", "survival", "particles", "layers", "luck")
"""Causes with a remedy of knobs, which is tried."""
SAME = ("the same settings and other seeds", dict[str, Value]())


def _cause(case: Case, limb: str, remedies: list[Remedy]) -> FrameFinding | None:
    """The main cause, by the rules in the order of the module's docstring."""
    if case.exchanged:
        remedies.append(
            Remedy(
                "Correct the sides",
                "A run that is tracked to its end has them put right over all frames, in track 'sides'.",
                {},
                "correct sides",
            )
        )
        words = f"{case.exchanged.capitalize()}: with the sides put back the pose is right."
        if case.stretch[0] <= case.run.run.record.first:
            words += " It was so from the run's first frame on: look at the start pose."
            remedies.append(
                Remedy(
                    "Set the start pose",
                    "Begin with left and right as the pictures show them.",
                    {},
                    "start pose",
                )
            )
        return FrameFinding("exchange", words, limb, is_cause=True)
    began, settings = case.stretch[0], case.settings
    record = case.run.run.record
    deviations, moved, reach, number = case.motion
    # A handful of particles shows little of how far their noise reaches.
    beyond = MOTION if case.effective >= FEW else 2.0 * MOTION
    if deviations > beyond and more_noise(settings):
        remedies.append(
            Remedy(f"{TIMES_NOISE:g} times the noise", "Then the first layer's particles reach as far as the motion.",
                   more_noise(settings))
        )  # fmt: skip
        words = (
            f"The motion is beyond the noise: into frame {number} the {limb} moved {_mm(moved)}, {deviations:.1f} times"
            f" the {_mm(reach)} over which the first layer's particles spread."
        )
        return FrameFinding("noise", words, limb, numbers={"moved": moved, "reach": reach}, is_cause=True)
    if began <= record.first and case.frame.number - began < LONGEST:
        remedies.append(Remedy("Set the start pose", "Begin the run where the body is.", {}, "start pose"))
        words = f"The start pose was wrong: the {limb} was off from the run's first frame on."
        return FrameFinding("start", words, limb, is_cause=True)
    if case.effective < FEW:
        return _few(case, limb, remedies)
    preference = case.preference
    if preference.is_for_the_pose:
        remedies.append(_against(case, preference))
        return FrameFinding(
            "likelihood", _preference_words(case), limb, camera=preference.camera, term=preference.term,
            numbers={"nats": preference.nats, "share": preference.share}, is_cause=True,
        )  # fmt: skip
    return _by_trial(case, limb, remedies)


def _few(case: Case, limb: str, remedies: list[Remedy]) -> FrameFinding:
    """Too few particles carry the weight: by the survival rate, or because there are few."""
    settings, count = case.settings, max(case.frame.size(0), 1)
    wanted = case.frame.layers[0].alpha_wanted
    numbers = {"effective": case.effective, "particles": count, "survival": wanted}
    if np.isfinite(wanted) and wanted < LOW_SURVIVAL and USUAL_SURVIVAL * count >= FEW:
        remedies.append(
            Remedy(f"A survival rate of {USUAL_SURVIVAL:g}", "More particles survive each layer, at no cost.",
                   usual_survival(settings))
        )  # fmt: skip
        words = (
            f"The survival rate is too low: {wanted:g} of {count} particles survive a layer, whose weight rests on"
            f" {case.effective:.1f} of them, and the cloud collapses onto the first good pose."
        )
        return FrameFinding("survival", words, limb, numbers=numbers, is_cause=True)
    remedies.append(_more_particles(settings))
    words = (
        f"There are too few particles: of {count} a layer {case.effective:.1f} carry the weight, which is too few to"
        " look everywhere."
    )
    return FrameFinding("particles", words, limb, numbers=numbers, is_cause=True)


def _by_trial(case: Case, limb: str, remedies: list[Remedy]) -> FrameFinding:
    """The cause as what helps: more particles, or more noise."""
    more, noise, layers = (
        _more_particles(case.settings),
        more_noise(case.settings),
        usual_layers(case.settings),
    )
    before = case.error(case.pose, case.wrong)
    spread = Remedy(
        f"{USUAL_LAYERS} layers of as many evaluations",
        "The cloud is led to the peak in small steps, at no cost.",
        layers,
    )
    if layers:
        [trial] = case.trials([(spread.title, layers)])
        if trial.left <= HELPS * before:
            remedies.append(spread)
            return FrameFinding("layers", _few_layers_words(case, before, trial), limb, is_cause=True)
    [again] = case.trials([SAME])
    if again.left <= HELPS * before:
        words = (
            f"The search had no luck: with {again.what} the error of what is off goes from {_mm(before)} to"
            f" {_mm(again.left)}. More particles depend less on it."
        )
        remedies.append(more)
        return FrameFinding(
            "luck", words, limb, numbers={"before": before, "after": again.left}, is_cause=True
        )
    wanted = [(more.title, more.settings)]
    if noise:
        wanted.append((f"{TIMES_NOISE:g} times the noise", noise))
    best = min(case.trials(wanted), key=lambda trial: trial.left)
    errors = f"the error of what is off goes from {_mm(before)} to {_mm(best.left)}"
    numbers = {"before": before, "after": best.left}
    if best.left > HELPS * before:
        titles = [*([spread.title] if layers else []), *(title for title, _ in wanted)]
        tried = (
            f"Tracked again with {' or '.join(_lower_first(title) for title in titles)}, {errors} at best."
        )
        if case.preference.is_for_the_reference:
            words = f"{_preference_words(case)} Why it does is unknown. {tried}"
            return FrameFinding("missed", words, limb, numbers=numbers, is_cause=True)
        return FrameFinding("unknown", f"The cause is unknown. {tried}", limb, numbers=numbers, is_cause=True)
    if best.what == more.title:
        remedies.append(more)
        words = f"There are too few particles for this frame: with {_lower_first(more.title)} {errors}."
        return FrameFinding("particles", words, limb, is_cause=True)
    remedies.append(Remedy(best.what, "The first layer's particles reach farther then.", best.settings))
    words = f"The search did not look far enough: with {_lower_first(best.what)} {errors}."
    return FrameFinding("noise", words, limb, is_cause=True)


def _few_layers_words(case: Case, before: float, trial: Trial) -> str:
    """That a search in few layers does not anneal."""
    count = TRACKERS[case.settings.tracker_name].layer_count(case.settings.tracker)
    layers = "One layer is" if count == 1 else f"{count} layers are"
    return (
        f"{layers} too few: one step leads from the broad cloud to the narrow peak, and most of the particles miss it."
        f" With {_lower_first(trial.what)} the error of what is off goes from {_mm(before)} to {_mm(trial.left)}."
    )


def _more_particles(settings: RunSettings) -> Remedy:
    title = f"{TIMES_PARTICLES:g} times the particles"
    return Remedy(title, "The search looks in more places.", more_evaluations(settings, TIMES_PARTICLES))


def _against(case: Case, preference: Preference) -> Remedy:
    """Half the weight for the term that speaks for the wrong pose, where that term has a knob; else to look there."""
    knob = f"{preference.term}_weight"
    now = getattr(case.settings.weighting, knob, None)
    if isinstance(now, float) and now > 0.0:
        return Remedy(
            f"Half the weight of the {preference.term} term",
            "This term prefers the wrong pose.",
            {knob: 0.5 * now},
        )
    return Remedy(f"Look at camera {preference.camera}", "Its pictures prefer the wrong pose.", {}, "look")


def _layer_finding(case: Case, limb: str) -> FrameFinding:
    """Where the reference left the cloud."""
    layer, nearest = case.layer_left(limb)
    numbers = {"nearest": nearest}
    place = f"where {_of(case.reference.kind)} has the {limb}"
    near = _mm(NEAR_MM * case.size)
    if len(case.frame.layers) == 1 and layer is None:
        words = (
            f"There was a particle near {place}: the nearest {_mm(nearest)} away. There was no second layer to continue"
            " from it."
        )
        return FrameFinding("near to the end", words, limb, numbers=numbers)
    if layer is None:
        words = f"Down to the last layer particles were near {place}: the nearest {_mm(nearest)} away."
        return FrameFinding("near to the end", words, limb, numbers=numbers)
    if layer == 0:
        words = (
            f"The search never looked there: no particle of any layer came within {near} of {place}, the nearest to"
            f" {_mm(nearest)}."
        )
        return FrameFinding("never near", words, limb, 0, numbers=numbers)
    first = case.frame.layer_in_words(layer)
    words = f"From {first} on no particle was within {near} of {place}; before, there was one."
    return FrameFinding("left the cloud", words, limb, layer, numbers=numbers)


def _preference_finding(case: Case) -> FrameFinding:
    preference = case.preference
    numbers = {"nats": preference.nats, "share": preference.share}
    words = _preference_words(case)
    return FrameFinding("preference", words, camera=preference.camera, term=preference.term, numbers=numbers)


def _preference_words(case: Case) -> str:
    """Which pose the likelihood prefers. The views compare the poses themselves: their nats are others."""
    preference, reference = case.preference, _of(case.reference.kind)
    settled = f"each at its best within {_mm(KEPT_WITHIN_MM * case.size)}"
    if preference.is_for_the_pose:
        return (
            f"The likelihood prefers the wrong pose, by {preference.nats:.3g} nats, {settled}; most of all camera"
            f" {preference.camera} by its {preference.term} term ({preference.share:+.3g})."
        )
    if preference.is_for_the_reference:
        return f"The search missed it: the likelihood prefers {reference}, by {-preference.nats:.3g} nats, {settled}."
    return f"The likelihood hardly tells the pose from {reference} ({preference.nats:+.3g} nats, {settled})."


def _of(kind: str) -> str:
    """A reference in a sentence."""
    known = {"truth": "the truth", "refined": "its refinement", REFINED_NOW: REFINED_NOW}
    return known.get(kind, f"track '{kind}'")


def _mm(value: float) -> str:
    """A distance to the millimetre; of small bodies finer."""
    return f"{value:.0f} mm" if value >= 10.0 else f"{value:.2g} mm"


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"


def _lower_first(text: str) -> str:
    return text[:1].lower() + text[1:]
