"""Conclusions on the third paper's choices of evidence from made-up outcomes, and what they are measured with."""

import numpy as np
import pytest
from made_up_outcomes import concluded

from studio.body.catalogue import load_body
from studio.evidence.volume.blob_model import cone_blobs
from studio.evidence.volume.relative_entropy import DivergenceOfPoses
from studio.garden.reproduction.caillette import hulls_and_blobs as choices
from studio.garden.reproduction.caillette import loss_test
from studio.garden.reproduction.caillette.following import FITTED, PLACED
from studio.results.comparison.findings import Findings
from studio.results.comparison.trials import Scale


def verdict(findings: Findings, start: str) -> str:
    return next(entry.verdict for entry in findings.numbers if entry.name.startswith(start))


def carved(sets: float, pixels: float):
    def made(trial):
        luck = 0.002 * trial.arguments["seed"]
        parts = {choices.SETS: sets + luck, choices.PIXELS: pixels + luck}
        return {
            name: {"overlap": 1.0 - wrong, "missed": wrong / 2, "added": wrong / 2}
            for name, wrong in parts.items()
        }

    return made


def test_sets_of_pixels_must_be_nearer_the_exact_hull() -> None:
    name = "caillette-sets-of-pixels"
    assert concluded(name, carved(0.1, 0.2)).verdict == "reproduced"
    assert concluded(name, carved(0.2, 0.2)).verdict == "not reproduced"
    assert concluded(name, carved(0.3, 0.2)).verdict == "not reproduced"

    def mixed(trial):
        return carved(0.2 + 0.15 * (-1) ** trial.arguments["seed"], 0.2)(trial)

    assert concluded(name, mixed).verdict == "undecided"


def split(gained):
    def made(trial):
        return {
            choices.WHOLE_LIMBS: {"likelihood": [-30.0, -31.0], "blobs": 14},
            choices.SPLIT: {"likelihood": [-30.0 + gained(trial.label), -31.0], "blobs": 20},
            "parts": 14,
        }

    return made


def test_splitting_must_gain_likelihood_in_later_frames() -> None:
    assert concluded("caillette-fig-7", split(lambda clip: 0.5 + 0.01 * len(clip))).verdict == "reproduced"
    assert (
        concluded("caillette-fig-7", split(lambda clip: -0.5 - 0.01 * len(clip))).verdict == "not reproduced"
    )
    first = choices.PERFORMED[:2]
    unclear = concluded(
        "caillette-fig-7", split(lambda clip: -0.5 if clip in first else 0.5 + 0.01 * len(clip))
    )
    assert unclear.verdict == "undecided"


def liked(kept: float):
    def made(trial):
        near = 20.0 + 0.1 * trial.arguments["seed"]
        return {"errors": {choices.NEAREST: near, choices.KEPT: kept * near}, "ranks": 0.9}

    return made


def test_keeping_the_correspondence_must_be_no_worse() -> None:
    name = "caillette-equation-9"
    assert concluded(name, liked(1.0)).verdict == "reproduced"
    assert concluded(name, liked(0.8)).verdict == "better"
    assert concluded(name, liked(1.3)).verdict == "not reproduced"
    assert concluded(name, liked(1.0), Scale((0, 1))).verdict == "undecided"


def test_the_nearest_blob_of_a_posed_body_is_its_own() -> None:
    """Eq. 8 is Eq. 9 where nearest and corresponding blobs are the same, and never more."""
    body = load_body("human25")
    model = cone_blobs(body)
    image = model.mixture(body, body.neutral[None]).at(0)
    rng = np.random.default_rng(0)
    poses = body.neutral + np.concatenate([np.zeros((1, 25)), 0.3 * rng.normal(size=(20, 25))])
    nearest = choices.nearest_divergences(body, model, image, poses)
    kept = DivergenceOfPoses.against(body, model, image)(poses)
    assert nearest[0] == pytest.approx(0.0, abs=1e-6)
    assert kept[0] == pytest.approx(0.0, abs=1e-6)
    assert np.all(nearest <= kept + 1e-9)
    assert np.any(nearest < kept - 1e-3)


def test_a_segmentation_is_carved_as_it_is() -> None:
    mask = np.zeros((4, 5), np.uint8)
    mask[1, 2] = 255
    picture, background = choices.as_segmented(mask)
    squared = background.squared_distances(picture)
    assert np.all((squared > 1e6) == (mask > 0))
    assert np.all(squared[mask == 0] == 0.0)


def qualities(lost: float, true_shown: float = 0.0, placed: float = -3.0):
    """True poses about 0 (those of the figures about `true_shown`), moved ones at `lost`, or `placed`."""

    def made(trial):
        shown = trial.arguments["footage"] in loss_test.SHOWN
        rng = np.random.default_rng(trial.arguments["seed"])
        true = (true_shown if shown else 0.0) + np.linspace(-0.5, 0.5, 20)
        chosen_by = -2.0 if not shown else lost
        measured = {"away": {loss_test.TRUE: [0.0] * 20}, FITTED: {loss_test.TRUE: true.tolist()}}
        measured[PLACED] = {loss_test.TRUE: true.tolist()}
        for kind in loss_test.KINDS:
            measured[FITTED][kind] = (chosen_by + rng.normal(0.0, 0.01, 20)).tolist()
            measured[PLACED][kind] = (placed + rng.normal(0.0, 0.01, 20)).tolist()
            measured["away"][kind] = [300.0] * 20
        return measured

    return made


def test_a_threshold_of_other_clips_must_catch_losses_without_false_alarms() -> None:
    name, lost, false = (
        "caillette-loss-test",
        "lost poses that are called lost",
        "true poses that are not called lost",
    )
    good = concluded(name, qualities(-2.0))
    assert good.verdict == "reproduced"
    assert verdict(good, "area under the ROC of lost") == "answered"
    # The loosest cut of the choosing clips that calls no true pose lost.
    assert good.settings["threshold chosen, fitted (nats a voxel)"] == pytest.approx(0.5)
    blind = concluded(name, qualities(-0.3))
    assert verdict(blind, lost) == "not reproduced"
    assert blind.verdict == "not reproduced"
    nervous = concluded(name, qualities(-2.0, true_shown=-1.5))
    assert verdict(nervous, false) == "not reproduced"
    assert nervous.verdict == "not reproduced"

    def half(trial):
        return qualities(-2.0 if trial.arguments["seed"] % 2 else -0.3)(trial)

    assert verdict(concluded(name, half), lost) == "undecided"
    # Placed blobs are ours: no claim rests on them.
    assert concluded(name, qualities(-2.0, placed=0.3)).verdict == "reproduced"
    ours = [entry for entry in good.numbers if entry.name.endswith(loss_test.TESTS[PLACED])]
    assert {entry.verdict for entry in ours} == {"answered"}


def test_the_area_under_the_roc() -> None:
    true, wrong = np.array([0.0, 1.0]), np.array([-1.0, -2.0])
    assert loss_test.area_under(true, wrong) == 1.0
    assert loss_test.area_under(true, true) == 0.5
    assert loss_test.area_under(wrong, true) == 0.0


def test_the_threshold_is_where_the_roc_is_farthest_from_chance() -> None:
    true, wrong = np.array([-1.0, 0.0, 1.0, 2.0]), np.array([-4.0, -3.0, -2.0, 1.5])
    assert loss_test.chosen_threshold(true, wrong) == 1.0


def test_poses_are_moved_by_the_amounts_that_their_names_say() -> None:
    body = load_body("human25")
    truth = np.repeat(body.neutral[None], 30, axis=0)
    truth[:, 0] = np.arange(30)
    moved = loss_test.moved_away(np.random.default_rng(0), body, truth, 20)
    assert set(moved) == set(loss_test.KINDS)
    apart = {kind: pose - truth[20] for kind, pose in moved.items()}
    assert np.hypot(*apart["shifted by 200 mm"][:2]) == pytest.approx(200.0)
    names = [entry.name for entry in body.parameters]
    turned = np.flatnonzero(apart["turned by 90°"])
    assert [names[index] for index in turned] == ["heading"]
    assert abs(apart["turned by 90°"][turned[0]]) == pytest.approx(np.pi / 2)
    assert not apart["joints by 20° at random"][:6].any()
    assert apart["the pose 0.5 s before"][0] == -15
