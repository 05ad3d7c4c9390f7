"""Boxes in front of the body are learnt, lost limbs are not taken for hidden ones, and the state is passed on."""

import dataclasses
from functools import partial

import numpy as np
import pytest
from drawn_people import drawn_evidence, ring_of_cameras
from moving_bodies import standing

from studio.body.model import BodyModel
from studio.evidence.distance_maps import silhouettes_by_camera
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.trackers.frame_refinement import FrameRefinementSettings, FrameRefiner
from studio.search.trackers.hidden_areas import FRAMES
from studio.search.trackers.tracker import (
    HIDDEN,
    LIMB_LOST_SHARE,
    Estimate,
    FilterState,
    FrameResult,
    ParticleSet,
)
from studio.sessions.results_codec import pack_result, unpack_result

CAMERAS = ring_of_cameras(4, 480, 360)


@pytest.fixture(scope="module")
def truth(body: BodyModel) -> np.ndarray:
    return standing(body, left_shoulder_rx=0.5, right_shoulder_rx=0.5)


def behind_a_box(evidence: FrameEvidence, views: int) -> FrameEvidence:
    """Evidence with the lower part of some views' masks removed, as if a box stood there."""
    cut = []
    for number, view in enumerate(evidence.views):
        mask = view.mask.copy()
        if number < views:
            rows = np.flatnonzero((mask > 127).any(axis=1))
            mask[rows[0] + (rows[-1] - rows[0]) * 6 // 10 :] = 0
        cut.append(dataclasses.replace(view, mask=mask))
    return dataclasses.replace(evidence, views=tuple(cut))


def followed(body: BodyModel, evidence: FrameEvidence, pose: np.ndarray, frames: int) -> FrameResult:
    """The last of some frames in which the search ends at `pose` and refinement changes little."""
    weighting = WEIGHTINGS["edge-silhouette"]
    problem = weighting.prepare(body, CAMERAS, weighting.settings_type()).problem(evidence)
    refiner = FrameRefiner(body, CAMERAS, 7)
    settings = FrameRefinementSettings(refine_frame_steps=1, redraw_limbs=False)
    carried = FilterState(ParticleSet(pose[None], np.zeros(1)), pose)
    result = None
    for frame in range(frames):
        start = FrameResult(frame, Estimate(pose, pose, pose, -1.0), 1, 5, 1, 1.0, carried)
        result = refiner.refined(start, partial(silhouettes_by_camera, evidence), problem, settings)
        carried = unpack_result(pack_result(result)).carried if frame % 2 else result.carried
    assert result is not None
    return result


def hidden_in(result: FrameResult) -> dict[str, Array]:
    """The hidden areas' counts in a result's memory."""
    return {name: values for name, values in result.carried.memory.items() if name.startswith(HIDDEN)}


def test_legs_behind_a_box_disagree_at_first_are_then_known_to_be_hidden_and_never_lost(
    body: BodyModel, truth: np.ndarray
) -> None:
    evidence = behind_a_box(drawn_evidence(body, truth, CAMERAS), views=2)
    first = followed(body, evidence, truth, 1)
    denied = {limb for limb, share in first.disagreement.items() if share > LIMB_LOST_SHARE}
    assert denied == {"left leg", "right leg"}
    assert first.limbs_lost == ()
    known = followed(body, evidence, truth, int(FRAMES) + 1)
    assert known.limbs_lost == ()
    hidden = {name for name, counts in hidden_in(known).items() if (counts >= FRAMES).any()}
    assert hidden == {HIDDEN + camera.name for camera in CAMERAS[:2]}


def test_a_lost_arm_is_not_taken_for_a_hidden_one(body: BodyModel, truth: np.ndarray) -> None:
    names = [entry.name for entry in body.parameters]
    pose = truth.copy()
    pose[names.index("left_shoulder_rx")] += 1.5
    lost = followed(body, drawn_evidence(body, truth, CAMERAS), pose, 3 * int(FRAMES))
    assert "left arm" in lost.limbs_lost
    assert not any((counts >= FRAMES).any() for counts in hidden_in(lost).values())


def test_areas_seen_again_are_no_longer_hidden(body: BodyModel, truth: np.ndarray) -> None:
    clear = drawn_evidence(body, truth, CAMERAS)
    hidden = followed(body, behind_a_box(clear, views=2), truth, int(FRAMES) + 1)
    weighting = WEIGHTINGS["edge-silhouette"]
    problem = weighting.prepare(body, CAMERAS, weighting.settings_type()).problem(clear)
    shown = FrameRefiner(body, CAMERAS, 7).refined(
        dataclasses.replace(hidden, frame=99),
        partial(silhouettes_by_camera, clear),
        problem,
        FrameRefinementSettings(),
    )
    legs = sum(int((counts >= FRAMES).sum()) for counts in hidden_in(shown).values())
    before = sum(int((counts >= FRAMES).sum()) for counts in hidden_in(hidden).values())
    assert before > 20
    assert legs < 0.2 * before
