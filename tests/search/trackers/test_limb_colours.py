"""A limb before the body is found by the colours that it had beside it."""

import dataclasses
from functools import partial

import cv2
import numpy as np
import pytest
from drawn_people import drawn_mask, drawn_outlines, ring_of_cameras
from moving_bodies import standing

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends, marker_points
from studio.evidence.distance_maps import silhouettes_by_camera
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.arrays import Array, Bytes
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.trackers.frame_refinement import FrameRefinementSettings, FrameRefiner
from studio.search.trackers.limb_colours import COLOURS, COUNT, LimbColours, code_of
from studio.search.trackers.limbs_elsewhere import Elsewhere, changes_by_camera
from studio.search.trackers.tracker import Estimate, FrameResult, start_of

# Three cameras before the person: from none is an arm before the chest seen beside it.
CAMERAS = tuple(ring_of_cameras(12, 480, 360)[number] for number in (10, 11, 0))
BODY = load_body("human31")
ASIDE = standing(BODY, left_shoulder_rx=0.6, right_shoulder_rx=0.6)
ARM = {"left_shoulder_rx": -0.9, "left_shoulder_ry": -2.4, "left_shoulder_rz": -0.9, "left_elbow_ry": -0.5}
"""Of an arm before the chest."""
SKIN, SHIRT = (120, 150, 210), (150, 90, 60)


def seen_in(pose: Array, *, skin: tuple[int, int, int] = SKIN, frame: int = 0) -> FrameEvidence:
    """Of a person with bare forearms, limbs drawn as hulls, the farthest first; with noise."""
    rng, views = np.random.default_rng(frame), list[ViewEvidence]()
    for camera in CAMERAS:
        mask = drawn_mask(BODY, pose, camera)
        picture = np.full((camera.height, camera.width, 3), 90, np.uint8)
        outlines = drawn_outlines(BODY, pose, camera)
        away = limb_ends(BODY, pose[None])[0].mean(axis=1) @ camera.rotation[2]
        for limb in np.argsort(-away):
            name = BODY.drawn[int(limb)].name
            bare = "lower arm" in name or "forearm" in name or "hand" in name
            cv2.fillConvexPoly(picture, outlines[limb], skin if bare else SHIRT)
        noisy = picture + rng.normal(0.0, 4.0, picture.shape)
        nothing: Bytes = np.zeros_like(mask)
        views.append(ViewEvidence(camera.name, np.clip(noisy, 0, 255).astype(np.uint8), mask, nothing))
    return FrameEvidence(frame, tuple(views))


def learnt(frames: int = 8, **seen: tuple[int, int, int]) -> dict[str, Array]:
    """What is remembered of a person whose arms are held aside."""
    colours, memory = LimbColours(BODY, CAMERAS), dict[str, Array]()
    for frame in range(frames):
        changed = tuple(changes_by_camera(seen_in(ASIDE, frame=frame, **seen)).values())
        memory = colours.learnt(ASIDE, colours.views(ASIDE, changed), {}, memory)
    return memory


def gain_of(pose: Array, evidence: FrameEvidence, memory: dict[str, Array]) -> tuple[float, float]:
    colours = LimbColours(BODY, CAMERAS)
    changed = tuple(changes_by_camera(evidence).values())
    found = colours.gains(pose[None], "left arm", colours.views(pose, changed), colours.known(memory))
    return float(found.gain[0]), float(found.expected[0])


def holding(**arm: float) -> Array:
    """The pose with the left arm's angles."""
    pose, names = ASIDE.copy(), [entry.name for entry in BODY.parameters]
    for name, value in arm.items():
        pose[names.index(name)] = value
    return pose


BEFORE = holding(**ARM)
WRONG = holding(**ARM | {"left_shoulder_rx": -0.5}), holding(**ARM | {"left_shoulder_ry": -2.9})
"""As well within the silhouettes."""


def test_an_arm_gains_where_its_colours_are() -> None:
    evidence, memory = seen_in(BEFORE), learnt()
    right, expected = gain_of(BEFORE, evidence, memory)
    assert right > 0.5 * expected > 25.0
    for pose in WRONG:
        assert gain_of(pose, evidence, memory)[0] < 0.0
    # Beside the body it lies before nothing, and without pictures or before enough was learnt nothing is known.
    assert gain_of(ASIDE, evidence, memory)[0] < 0.1 * right
    assert gain_of(BEFORE, evidence, {}) == (0.0, 0.0)
    blind = [dataclasses.replace(view, picture=np.zeros((0, 0, 3), np.uint8)) for view in evidence.views]
    assert gain_of(BEFORE, dataclasses.replace(evidence, views=tuple(blind)), memory) == (0.0, 0.0)


def test_sleeves_of_the_shirt_s_colour_say_nothing() -> None:
    gain, expected = gain_of(BEFORE, seen_in(BEFORE, skin=SHIRT), learnt(skin=SHIRT))
    assert abs(gain) < 5.0
    assert abs(expected) < 5.0


def test_a_limb_that_does_not_show_by_itself_teaches_nothing() -> None:
    colours, evidence = LimbColours(BODY, CAMERAS), seen_in(ASIDE)
    views = colours.views(ASIDE, tuple(changes_by_camera(evidence).values()))
    arms = {f"{side} arm": Elsewhere(0.2, 0.5, 0.3) for side in ("left", "right")}
    own, others = (colours.learnt(ASIDE, views, known, {})[COLOURS] for known in ({}, arms))
    lacking = own.sum(axis=1) - others.sum(axis=1)
    names = [BODY.drawn[number].name for number in range(len(BODY.drawn))]
    assert (lacking > 0.0).sum() == len(
        {name.split(" ", 1)[1] for name in names if "arm" in name or "hand" in name}
    )
    # The arm's pixels are of one colour, bar noise, and twins share it.
    (arm,) = np.flatnonzero(own[:, int(code_of(np.array(SKIN, np.uint8)[None, None])[0, 0])] > 0.0)[:1]
    assert own[arm].sum() == pytest.approx(lacking[arm])
    assert own.shape[1] == COUNT


def test_an_arm_before_the_chest_is_drawn_where_its_colours_are() -> None:
    evidence, memory, start = seen_in(BEFORE), learnt(), WRONG[0]
    weighting = WEIGHTINGS["edge-silhouette"]
    problem = weighting.prepare(BODY, CAMERAS, weighting.settings_type()).problem(evidence)
    state = dataclasses.replace(start_of(tuple(start.tolist())), memory=memory)
    result = FrameResult(3, Estimate(start, start, start, 0.0), 0, 0, 0, 0.0, state)
    hands = {}
    for on in (False, True):
        found = FrameRefiner(BODY, CAMERAS, 5).refined(
            result,
            partial(silhouettes_by_camera, evidence),
            problem,
            FrameRefinementSettings(limb_colours=on),
            partial(changes_by_camera, evidence),
        )
        points = marker_points(BODY, np.stack([found.estimate.pose, BEFORE]))
        hands[on] = float(np.linalg.norm(points[0] - points[1], axis=1).max())
        assert (found.carried.memory[COLOURS] is memory[COLOURS]) != on
    assert hands[True] < 0.6 * hands[False]
