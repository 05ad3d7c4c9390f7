"""Whose fault an error is: the search's, the likelihood's, or the body's.

e(x) is the mean distance of the body's points in pose x from the truth's, over the points that the truth has, in mm.
Of a frame these poses are known: r, which is reported; s, which the search found before it was refined (r where nothing
is refined); t, the body laid on the truth's points by inverse kinematics; and b, the heaviest that a long search met
(`long_search`, which climbs from t as well), or s itself where b outweighs it by no more than `threshold_nats`. Then

- refinement = e(r) - e(s), what the refinement after the search added; mostly below zero;
- search     = e(s) - e(b), what a search that misses nothing would take away;
- likelihood = e(b) - e(t), how much farther off than need be the pose is that the likelihood prefers;
- body       = e(t), what is left with this body's bones whatever its pose.

The four add up to e(r) exactly, in each frame and in means over frames, as each is a difference of two distances. A
part may be below zero: the search's where stopping short of the heaviest pose was luck. What does not add up: parts of
limbs' errors, of medians, of errors after an alignment. b is the heaviest that is known: a still longer search may move
some of the likelihood's part to the search's, or back. t is nearest in the mean square, so that the likelihood's part
may fall a little below zero.

Without a truth there are no such distances. Known is then by how much b outweighs s, and how far its points are from
those of s: where b does not outweigh it, no error is the search's as far as is known.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.words import counted
from studio.results.inspection.likelihoods import telling_nats
from studio.results.inspection.long_search import LongSearch, points_apart, search_of, searches_that_hold
from studio.results.inspection.reading import InspectedFrame, InspectedRun
from studio.results.inspection.reference import body_points, true_pose

SEARCH, LIKELIHOOD, BODY = "search", "likelihood", "body"
PARTS = (SEARCH, LIKELIHOOD, BODY)
ADVICE = {
    SEARCH: "More evaluations or more noise help; other weights do not.",
    LIKELIHOOD: "A longer search does not help; better masks, other terms or other weights of them may.",
    BODY: "Neither a longer search nor other weights help; fitted lengths of the body do.",
}


@dataclass(frozen=True, slots=True)
class ErrorParts:
    """Whose fault the error of a frame is.

    frame : its number.
    error_mm : mean distance of the reported pose's points from the truth's. This and the four parts, which add up to
        it, are None without a truth.
    refinement_mm : what the refinement after the search added.
    search_mm : what a search that misses nothing would take away.
    likelihood_mm : how much farther off than need be the heaviest known pose is.
    body_mm : what is left with this body's bones whatever its pose.
    known_nats : by how much the heaviest known pose outweighs what the search found.
    truth_nats : the same of the truth's pose; below zero where the truth weighs less. None without a truth.
    threshold_nats : what has to be exceeded for one pose to be preferred.
    away_mm : mean distance of the body's points between the heaviest known pose and what the search found.
    evaluations : of each climb of the long search.
    chief : whose part is the largest: "search", "likelihood" or "body"; without a truth "search" or "" for another's.
    """

    frame: int
    error_mm: float | None
    refinement_mm: float | None
    search_mm: float | None
    likelihood_mm: float | None
    body_mm: float | None
    known_nats: float
    truth_nats: float | None
    threshold_nats: float
    away_mm: float
    evaluations: int
    chief: str

    @property
    def is_heavier_known(self) -> bool:
        """Whether a pose is known that outweighs what the search found."""
        return self.known_nats > self.threshold_nats

    @property
    def numbers(self) -> dict[str, float]:
        """All that are known, by name."""
        return {
            name: float(value)
            for name, value in asdict(self).items()
            if value is not None and name not in ("frame", "chief")
        }


@dataclass(frozen=True, slots=True)
class ErrorSplit:
    """Whose fault the errors of a run are.

    frames : those that were searched for long, each with its parts.
    mean : means over these frames, by the names of the parts in mm; empty without a truth.
    words : the same in plain words.
    """

    frames: tuple[ErrorParts, ...]
    mean: dict[str, float]
    words: str

    @property
    def parts_mm(self) -> dict[str, float]:
        """The mean parts of search, likelihood and body; {} without a truth."""
        return {name: self.mean[f"{name}_mm"] for name in PARTS} if self.mean else {}


def parts_of(frame: InspectedFrame, search: LongSearch) -> ErrorParts:
    """Whose fault the error of a finished frame is, by its long search."""
    run, result = frame.of, frame.result
    assert result is not None
    threshold = telling_nats(frame.settings)
    nats, heaviest, found = search.best - search.found, np.array(search.pose), frame.searched()
    preferred = heaviest if nats > threshold else found
    truth = true_pose(run, frame.number)
    error = refinement = of_search = likelihood = body = truth_nats = None
    chief = SEARCH if nats > threshold else ""
    if truth is not None:

        def off(pose: Array) -> float:
            away: Array = np.linalg.norm(body_points(run.body, pose[None])[0] - truth.points, axis=1)
            return float(np.nanmean(away))

        error, before, at_best, body = (
            off(one) for one in (result.estimate.pose, found, preferred, truth.pose)
        )
        refinement, of_search, likelihood = error - before, before - at_best, at_best - body
        chief = _largest((of_search, likelihood, body))
        truth_nats = None if search.truth is None else search.truth - search.found
    return ErrorParts(
        frame.number, error, refinement, of_search, likelihood, body, nats, truth_nats, threshold,
        points_apart(run, heaviest, found), search.evaluations, chief,
    )  # fmt: skip


def _largest(parts: Sequence[float]) -> str:
    return PARTS[int(np.argmax(parts))]


def split_of(run: InspectedRun) -> ErrorSplit:
    """Whose fault the errors are, over the frames of a run that were searched for long."""
    kept = searches_that_hold(run)
    parts: list[ErrorParts] = []
    if kept:
        with run.run.results() as results:
            stored = set(results.frames())
            for number in sorted(stored & kept.keys()):
                frame = run.frame(number, results)
                search = search_of(frame, kept)
                parts += [] if search is None else [parts_of(frame, search)]
    mean = _means(parts)
    return ErrorSplit(tuple(parts), mean, _words_of_all(parts, mean))


def _means(parts: Sequence[ErrorParts]) -> dict[str, float]:
    known = [one for one in parts if one.error_mm is not None]
    names = [one.name for one in fields(ErrorParts) if one.name.endswith("_mm") and one.name != "away_mm"]
    return {name: float(np.mean([getattr(one, name) for one in known])) for name in names} if known else {}


def _words_of_all(parts: Sequence[ErrorParts], mean: dict[str, float]) -> str:
    if not parts:
        return "No frame has been searched for long: split the error of some."
    frames = counted(len(parts), "frame")
    if not mean:
        heavier = [one for one in parts if one.is_heavier_known]
        if not heavier:
            return (
                f"Not the search: in {frames} no pose is known that clearly outweighs what it found. Where the body is"
                " off, it is the likelihood's part or the body's."
            )
        away = _mm(float(np.mean([one.away_mm for one in heavier])))
        return (
            f"In {len(heavier)} of {frames} a pose is known that outweighs what the search found, {away} away in the"
            " mean: the search's part. How near that pose is to the body, only a truth shows."
        )
    chief = _largest([mean[f"{name}_mm"] for name in PARTS])
    before = _mm(mean["error_mm"] - mean["refinement_mm"])
    listed = ", ".join(f"{name} {_mm(mean[f'{name}_mm'])}" for name in PARTS)
    then = f" The refinement makes it {_mm(mean['error_mm'])}." if mean["refinement_mm"] else ""
    return f"Mostly the {chief}: over {frames} what the search found is {before} off; {listed}.{then} {ADVICE[chief]}"


def words_of(parts: ErrorParts) -> str:
    """Whose fault the error of a frame is, as a sentence."""
    if parts.error_mm is None:
        if parts.is_heavier_known:
            return (
                f"The search's part: a pose is known that weighs {parts.known_nats:.2g} nats more than what the search"
                f" found, {_mm(parts.away_mm)} away in the mean."
            )
        return (
            f"Not the search, as far as is known: climbs of {parts.evaluations} evaluations met no pose that clearly"
            f" outweighs what it found (by {parts.known_nats:.2g} nats at most)."
        )
    assert parts.refinement_mm is not None
    assert parts.search_mm is not None
    assert parts.likelihood_mm is not None
    assert parts.body_mm is not None
    if not parts.is_heavier_known:
        heavier = "no pose is known that clearly outweighs it"
    elif parts.search_mm < 0.0:
        heavier = f"the pose that weighs {parts.known_nats:.2g} nats more is farther off"
    else:
        heavier = f"a pose is known that weighs {parts.known_nats:.2g} nats more"
    before, of_search, of_likelihood, of_body = (
        _mm(value)
        for value in (
            parts.error_mm - parts.refinement_mm,
            parts.search_mm,
            parts.likelihood_mm,
            parts.body_mm,
        )
    )
    return (
        f"Mostly the {parts.chief}: of the {before} that the pose of the search is off in the mean, {of_search} are the"
        f" search's ({heavier}), {of_likelihood} the likelihood's (so much farther off than need be is the pose that it"
        f" prefers) and {of_body} the body's (no pose of it comes nearer)."
    )


def _mm(value: float) -> str:
    """A signed distance; of small ones a decimal."""
    return f"{value:.0f} mm" if abs(value) >= 10.0 else f"{round(value, 1) + 0.0:.1f} mm"
