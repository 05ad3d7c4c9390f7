"""Whether a poor likelihood of the fitted blobs tells that the body is lost (section 6.3), which the paper asserts.

Blobs are learnt from true poses, then fitted in later frames from the true pose and from poses that are moved away by
known amounts. The paper prints no threshold. Here it is chosen on two clips that no figure shows, where their ROC is
farthest from chance, and tried on the two exercises of Figs. 11 and 12. Beside the printed
test stands ours, by the blobs where the pose puts them, before they are fitted.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from studio.body.forward_kinematics import marker_points
from studio.body.model import BodyModel
from studio.foundations.arrays import Array
from studio.garden.reproduction.caillette.following import (
    FITTED,
    PLACED,
    placed_quality,
    problems,
    taught_blobs,
)
from studio.garden.reproduction.caillette.setting import (
    AS_PRINTED,
    BLOBS,
    GUIDED,
    LOST_BELOW,
    TEST,
    TEST_2,
    last_frame,
)
from studio.garden.reproduction.caillette.true_motion import true_motion
from studio.garden.reproduction.claims import HALF, HIGHER, beyond, percent
from studio.garden.reproduction.drawing import floats, line_chart
from studio.garden.reproduction.experiment import Part, each_seed, listed
from studio.results.comparison.findings import Series, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.search.likelihood.problem import FittedToPoses, QualityMeasured
from studio.search.settings import changed_settings, default_settings

CHOOSING, SHOWN = ("dance-choosing-1", "dance-choosing-2"), (TEST, TEST_2)
FRAMES, EVERY = 150, 6
LOST_MM = 150.0
"""RMS over the markers beyond which a pose is lost, as in Fig. 11."""
QUIET = 95.0
"""Least share of true poses, per cent, that are not called lost on clips that the threshold was not chosen by."""
TRUE = "true"
JOINTS = {f"joints by {size}° at random": float(size) for size in (10, 20, 40, 80)}
SHIFTS = {f"shifted by {size} mm": float(size) for size in (100, 200, 400)}
TURNS = {f"turned by {size}°": float(size) for size in (45, 90, 180)}
LATER = {f"the pose {frames / 30:g} s before": frames for frames in (8, 15)}
KINDS = (*JOINTS, *SHIFTS, *TURNS, *LATER)


def trials(scale: Scale) -> tuple[Trial, ...]:
    """One a clip and seed, the seed of the movements."""

    def arguments(clip: str, seed: int) -> dict[str, Any]:
        return {"footage": clip, "seed": seed, "last": last_frame(clip, scale.quick, FRAMES)}

    return tuple(
        trial
        for clip in (*CHOOSING, *SHOWN)
        for trial in each_seed(clip, scale.seeds, partial(arguments, clip))
    )


def moved_away(
    rng: np.random.Generator, body: BodyModel, true_poses: Array, frame: int
) -> Mapping[str, Array]:
    """By KINDS, the pose (D,) of a frame, moved away. true_poses : (F, D)."""
    pose = true_poses[frame]
    limits = np.array([(entry.lower, entry.upper) for entry in body.parameters])
    names = [entry.name for entry in body.parameters]
    joints = np.isfinite(limits).all(axis=1)
    heading, place = names.index("heading"), [names.index("pelvis_x"), names.index("pelvis_y")]
    moved: dict[str, Array] = {}
    for kind, degrees in JOINTS.items():
        noise = rng.normal(0.0, np.radians(degrees), len(pose)) * joints
        moved[kind] = np.clip(pose + noise, limits[:, 0], limits[:, 1])
    for kind, size in SHIFTS.items():
        angle, moved[kind] = rng.uniform(0.0, 2.0 * np.pi), pose.copy()
        moved[kind][place] += size * np.array([np.cos(angle), np.sin(angle)])
    for kind, degrees in TURNS.items():
        moved[kind] = pose.copy()
        moved[kind][heading] += np.radians(degrees) * rng.choice([-1.0, 1.0])
    for kind, frames in LATER.items():
        moved[kind] = true_poses[frame - frames]
    return moved


TESTS = {
    FITTED: "of the fitted blobs, as printed",
    PLACED: "of the blobs where the pose puts them, not fitted (ours)",
}
"""Two likelihoods that may be poor."""


@kept_as("caillette.loss_test.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Of the true and the moved poses, by kind and frame: for each of TESTS the likelihood of the voxels less that of a
    body like the blobs (nats a voxel), and `away`, RMS over the markers (mm).
    """
    settings = changed_settings(default_settings(GUIDED, BLOBS), AS_PRINTED)
    session, last = cache.session(arguments["footage"]), int(arguments["last"])
    body, truth = session.body(), true_motion(cache, session, last)
    problem_of = problems(cache, session, settings, last)
    memory = taught_blobs(problem_of, truth.poses, settings)
    rng = np.random.default_rng((int(arguments["seed"]), 6))
    measured: dict[str, dict[str, list[float]]] = {
        name: {kind: [] for kind in (TRUE, *KINDS)} for name in (*TESTS, "away")
    }
    for frame in range(settings.weighting.blob_learning, last, EVERY):
        problem = problem_of(frame)
        assert isinstance(problem, FittedToPoses)
        poses = {TRUE: truth.poses[frame], **moved_away(rng, body, truth.poses, frame)}
        points = marker_points(body, np.array(list(poses.values())))
        apart = np.sqrt(((points - points[0]) ** 2).sum(axis=2).mean(axis=1))
        for (kind, pose), distance in zip(poses.items(), apart, strict=True):
            fitted = problem.expecting(pose[None], memory)
            assert isinstance(fitted, QualityMeasured)
            measured[FITTED][kind].append(round(float(fitted.quality), 4))
            measured[PLACED][kind].append(round(placed_quality(problem, pose, memory), 4))
            measured["away"][kind].append(round(float(distance), 1))
    return measured


def area_under(true: Array, wrong: Array) -> float:
    """Probability that a wrong pose's quality is below a true one's, ties half: the area under the ROC."""
    below = (wrong[:, None] < true[None]).mean() + 0.5 * (wrong[:, None] == true[None]).mean()
    return float(below)


def chosen_threshold(true: Array, wrong: Array) -> float:
    """Nats a voxel below which a frame counts as lost: where the share of the wrong poses called lost exceeds that of
    the true ones by most (Youden's index of the ROC).
    """
    cuts = np.unique(np.concatenate([true, wrong]))
    excess = [(wrong < cut).mean() - (true < cut).mean() for cut in cuts]
    return -float(cuts[int(np.argmax(excess))])


def _wrong(outcome: Outcome, test: str) -> Array:
    """Qualities of the poses that are lost by LOST_MM."""
    kinds = [np.array([outcome.measured[name][kind] for kind in KINDS]) for name in (test, "away")]
    return kinds[0][kinds[1] > LOST_MM]


def _of(outcome: Outcome, test: str, kind: str) -> Array:
    return np.array(outcome.measured[test][kind])


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """The thresholds of the choosing clips, tried on the shown ones."""
    by_clip = {
        clip: [outcome for outcome in outcomes if outcome.trial.arguments["footage"] == clip]
        for clip in (*CHOOSING, *SHOWN)
    }
    runs = [outcome for clip in SHOWN for outcome in by_clip[clip]]
    for test, words in TESTS.items():
        # A clip's true frames are the same with every seed.
        known = np.concatenate([_of(by_clip[clip][0], test, TRUE) for clip in CHOOSING])
        wrong = np.concatenate([_wrong(outcome, test) for clip in CHOOSING for outcome in by_clip[clip]])
        threshold = chosen_threshold(known, wrong)
        caught = [float((_wrong(outcome, test) < -threshold).mean()) for outcome in runs]
        silent = np.concatenate([_of(by_clip[clip][0], test, TRUE) for clip in SHOWN]) >= -threshold
        lost = number(f"lost poses that are called lost, by the likelihood {words}", caught, "of 1")
        judged = test == FITTED
        yield beyond(lost, HALF, HIGHER) if judged else lost
        name = f"true poses that are not called lost, by the likelihood {words}"
        yield percent(name, silent, QUIET if judged else None)
        areas = [area_under(_of(outcome, test, TRUE), _wrong(outcome, test)) for outcome in runs]
        yield number(f"area under the ROC of lost poses, by the likelihood {words}", areas, "of 1")
        yield _table(f"By the likelihood {words}", test, threshold, runs)
        yield line_chart(
            f"ROC of the loss test, by the likelihood {words}",
            "true poses called lost",
            "lost poses called lost",
            [_roc(clip, test, own) for clip, own in by_clip.items()],
        )
        yield {f"threshold chosen, {test} (nats a voxel)": round(threshold, 3)}
    yield (
        f"Lost: more than {LOST_MM:g} mm off, RMS over the markers. A threshold is in nats a voxel below a body like "
        "the learnt blobs, where the choosing clips' ROC is farthest from chance (Youden's index); Fig. 11 runs with "
        f"{LOST_BELOW[FITTED]:g} and {LOST_BELOW[PLACED]:g}. Fitting moves blobs to where the voxels are, so that a "
        "good fit says little of where it began."
    )
    yield {
        "choosing clips": ", ".join(CHOOSING),
        "clips of the figures": ", ".join(SHOWN),
        "weighting": BLOBS,
    }


def _table(title: str, test: str, threshold: float, runs: Sequence[Outcome]) -> Table:
    """A line a kind of pose."""
    rows: list[tuple[Any, ...]] = []
    for kind in (TRUE, *KINDS):
        under = [area_under(_of(outcome, test, TRUE), _of(outcome, test, kind)) for outcome in runs]
        named = [float((_of(outcome, test, kind) < -threshold).mean()) for outcome in runs]
        quality = [float(_of(outcome, test, kind).mean()) for outcome in runs]
        distance = [float(_of(outcome, "away", kind).mean()) for outcome in runs]
        rows.append(
            (
                kind,
                round(float(np.mean(distance))),
                round(float(np.mean(quality)), 2),
                round(float(np.mean(under)), 3),
                round(float(np.mean(named)), 3),
            )
        )
    heads = ("pose", "away, RMS (mm)", "quality (nats a voxel)", "area under the ROC", "called lost")
    return Table(title, heads, tuple(rows))


def _roc(clip: str, test: str, own: Sequence[Outcome]) -> Series:
    truth = np.concatenate([_of(outcome, test, TRUE) for outcome in own])
    wrong = np.concatenate([_wrong(outcome, test) for outcome in own])
    cuts = np.quantile(np.concatenate([truth, wrong]), np.linspace(0.0, 1.0, 60))
    false, right = ([float((values <= cut).mean()) for cut in cuts] for values in (truth, wrong))
    return Series(clip, floats(false), floats(right), group=clip)


EXPERIMENTS = (listed("caillette-loss-test", trials, measure, shown, footage=(*CHOOSING, *SHOWN)),)
