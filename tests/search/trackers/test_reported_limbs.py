"""A limb is drawn where it is reported, if the silhouettes agree as well; else it is named."""

import dataclasses
from collections.abc import Mapping
from functools import partial

import numpy as np
from moving_bodies import standing
from test_limb_colours import BEFORE, BODY, CAMERAS, WRONG, seen_in

from studio.body.forward_kinematics import marker_points
from studio.evidence.distance_maps import silhouettes_by_camera
from studio.foundations.arrays import Array, Bytes
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.trackers.agreement import limb_names
from studio.search.trackers.frame_refinement import FrameRefinementSettings, FrameRefiner
from studio.search.trackers.limbs_elsewhere import Elsewhere, changes_by_camera
from studio.search.trackers.reported_limbs import (
    REPORTED,
    THERE_MM,
    ReportedLimb,
    is_asked,
    off_from,
    reported_limbs,
    reported_lost,
)
from studio.search.trackers.tracker import Estimate, FrameResult, start_of

LIMBS = np.zeros(len(dict.fromkeys(limb_names(BODY))))
ARM = [row for row, marker in enumerate(BODY.markers) if marker.name in ("LElbow", "LWrist")]
SETTINGS = FrameRefinementSettings(limb_colours=False, ask_network_every=5)
DUE, SOON = {REPORTED: np.array([4.0, *LIMBS])}, {REPORTED: np.array([3.0, *LIMBS])}
"""Memory where it is asked in the next frame, and in the one after that."""


class Source:
    """Reports a left arm that is as in a pose (D,), where it is far from there; counts how often."""

    limbs = ("left arm",)

    def __init__(self, truth: Array) -> None:
        self.places, self.asked = marker_points(BODY, truth[None])[0, ARM], 0

    def elsewhere(self, pose: Array, pictures: Mapping[str, Bytes]) -> dict[str, ReportedLimb]:
        assert set(pictures) == {camera.name for camera in CAMERAS}
        self.asked += 1
        apart = np.linalg.norm(marker_points(BODY, pose[None])[0, ARM] - self.places, axis=1).max()
        return {"left arm": ReportedLimb(ARM, self.places)} if apart > 60.0 else {}


def refined(
    source: Source, memory: Mapping[str, Array] = DUE, start: Array = WRONG[0], **knobs: int
) -> FrameResult:
    """The result of a frame whose search ended with the arm before the chest elsewhere than it is."""
    evidence, weighting = seen_in(BEFORE), WEIGHTINGS["edge-silhouette"]
    state = dataclasses.replace(start_of(tuple(start.tolist())), memory=memory)
    return FrameRefiner(BODY, CAMERAS, 5, source).refined(
        FrameResult(3, Estimate(start, start, start, 0.0), 0, 0, 0, 0.0, state),
        partial(silhouettes_by_camera, evidence),
        weighting.prepare(BODY, CAMERAS, weighting.settings_type()).problem(evidence),
        dataclasses.replace(SETTINGS, **knobs),
        partial(changes_by_camera, evidence),
    )


def arm_off(pose: Array) -> float:
    """mm by which the markers of the left arm are off, at most."""
    points = marker_points(BODY, np.stack([pose, BEFORE]))[:, ARM]
    return float(np.linalg.norm(points[0] - points[1], axis=1).max())


def test_a_limb_is_drawn_where_it_is_reported_in_frames_in_which_that_is_asked() -> None:
    right = Source(BEFORE)
    before, found = refined(right, SOON), refined(right)
    assert right.asked == 1
    assert arm_off(before.estimate.pose) > 120.0 > 60.0 > arm_off(found.estimate.pose)
    assert "left arm" not in found.limbs_lost
    assert not found.carried.memory[REPORTED].any()
    assert before.carried.memory[REPORTED][0] == 4.0


def test_a_limb_that_is_not_drawn_there_is_named_until_it_is_found() -> None:
    raised, memory = Source(standing(BODY, left_shoulder_rx=2.8)), DUE
    for asked in (1, 1, 1, 2):
        found = refined(raised, memory, BEFORE, redraw_limbs=False)
        memory = found.carried.memory
        assert raised.asked == asked
        assert "left arm" in found.limbs_lost
        assert arm_off(found.estimate.pose) < 60.0
    memory = {REPORTED: np.concatenate([[2.0], memory[REPORTED][1:]])}
    assert "left arm" not in refined(Source(BEFORE), memory, BEFORE).limbs_lost


def test_a_limb_is_not_drawn_where_the_silhouettes_deny_it() -> None:
    raised = Source(standing(BODY, left_shoulder_rx=2.8))
    pose = refined(raised, start=BEFORE).estimate.pose
    assert raised.asked == 1
    assert off_from(BODY, pose[None], ReportedLimb(ARM, raised.places))[0] > 2.0 * THERE_MM


def test_it_is_asked_every_few_frames_and_sooner_while_a_limb_is_elsewhere() -> None:
    assert is_asked(10, {})
    assert not is_asked(0, {})
    for elsewhere, first in ((0.0, 9.0), (1.0, 2.0)):
        asked = [since for since in range(12) if is_asked(10, {REPORTED: np.array([since, 0.0, elsewhere])})]
        assert asked[0] == first
        assert not is_asked(0, {REPORTED: np.array([99.0, 0.0, elsewhere])})


def test_the_source_is_not_asked_where_limbs_show_by_themselves() -> None:
    source, pictures = Source(BEFORE), {camera.name: np.zeros((1, 1, 3), np.uint8) for camera in CAMERAS}
    shows, hidden = Elsewhere(0.0, 0.95, 0.5), Elsewhere(0.0, 0.95, 0.1)
    for own, asked in ((shows, 0), (hidden, 1)):
        known = {"left arm": own, "right arm": hidden}
        reported = reported_limbs(source, WRONG[0], pictures, known)
        assert (source.asked, set(reported)) == (asked, {"left arm"} if asked else set())


def test_how_far_a_limb_is_off_is_the_mean_of_its_markers_at_a_person_s_size() -> None:
    places = marker_points(BODY, BEFORE[None])[0, ARM]
    reported = ReportedLimb(ARM, places + np.array([[30.0, 0.0, 0.0], [0.0, 50.0, 0.0]]))
    np.testing.assert_allclose(off_from(BODY, np.stack([BEFORE, BEFORE]), reported), 40.0)


def test_only_what_is_surely_elsewhere_and_not_there_is_lost() -> None:
    places = marker_points(BODY, BEFORE[None])[0, ARM]
    sure, unsure = (ReportedLimb(ARM, places, is_lost=lost) for lost in (True, False))
    assert off_from(BODY, WRONG[0][None], sure)[0] > THERE_MM
    assert reported_lost(BODY, WRONG[0], {"left arm": sure}) == ["left arm"]
    assert reported_lost(BODY, BEFORE, {"left arm": sure}) == []
    assert reported_lost(BODY, WRONG[0], {"left arm": unsure}) == []


def test_nothing_is_remembered_where_the_source_is_never_asked() -> None:
    lost = {REPORTED: np.array([1.0, *np.ones(len(LIMBS))])}
    found = refined(Source(BEFORE), lost, BEFORE, ask_network_every=0)
    assert "left arm" not in found.limbs_lost
    asked = refined(Source(BEFORE), DUE, BEFORE, ask_network_every=5)
    assert REPORTED in asked.carried.memory
