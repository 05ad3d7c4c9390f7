"""A tail that masks lack is found by the lines in the pictures."""

import dataclasses
from collections.abc import Mapping
from functools import partial
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from drawn_mice import SMALL, rearing_mouse
from drawn_people import drawn_evidence, drawn_outlines

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import marker_points
from studio.evidence.distance_maps import silhouettes_by_camera
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array
from studio.runs.checking import contradicted_limbs
from studio.runs.live.live_request import live_changes
from studio.runs.refined_frames import _Work
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.settings import default_settings, settings_from_values
from studio.search.trackers import limb_resampling
from studio.search.trackers.agreement import Agreement
from studio.search.trackers.frame_refinement import FrameRefinementSettings, FrameRefiner
from studio.search.trackers.limb_resampling import Hypothesis, chains_of, thin_limbs_of
from studio.search.trackers.limbs_elsewhere import Change, changes_by_camera
from studio.search.trackers.refinement import RefinementSettings, Refiner
from studio.search.trackers.thin_limbs import HALF_PLAIN, ThinLimb, lines_along
from studio.search.trackers.tracker import Estimate, FrameResult, start_of

MOUSE = load_body("mouse31")
TRUTH = rearing_mouse(tail_2_wag=0.3, tail_3_wag=0.3)
ASTRAY = rearing_mouse(tail_lift=0.4, tail_wag=-0.9, tail_2_wag=-0.6)
TAIL = [number for number, limb in enumerate(MOUSE.drawn) if limb.name.startswith("tail")]
TIP = [marker.name for marker in MOUSE.markers].index("TailTip")
ON_FLOOR = thin_limbs_of(MOUSE, SMALL, on_floor=True)


def seen(pose: Array = TRUTH, *, tail: bool = True, empty: bool = True) -> FrameEvidence:
    """A dark mouse whose masks lack the tail. empty : whether it is known what is seen without it."""
    rng, views = np.random.default_rng(0), []
    for camera, view in zip(SMALL, drawn_evidence(MOUSE, pose, SMALL).views, strict=True):
        room = np.full((camera.height, camera.width, 3), 120, np.uint8)
        picture, mask = room.copy(), np.zeros_like(view.mask)
        for number, outline in enumerate(drawn_outlines(MOUSE, pose, camera)):
            if number not in TAIL:
                cv2.fillConvexPoly(mask, outline, (255,))
            if tail or number not in TAIL:
                cv2.fillConvexPoly(picture, outline, (40, 40, 40) if number not in TAIL else (90, 90, 90))
        noisy = np.clip(picture + rng.normal(0.0, 2.0, picture.shape), 0, 255).astype(np.uint8)
        views.append(
            dataclasses.replace(view, picture=noisy, mask=mask, edges=mask, empty=room if empty else None)
        )
    return FrameEvidence(0, tuple(views))


def tip_off(pose: Array) -> float:
    """mm."""
    return float(np.linalg.norm(np.subtract(*marker_points(MOUSE, np.stack([pose, TRUTH]))[:, TIP])))


def refined(evidence: FrameEvidence, **knobs: bool) -> FrameResult:
    weighting = WEIGHTINGS["edge-region-silhouette"]
    return FrameRefiner(MOUSE, SMALL, 5).refined(
        FrameResult(3, Estimate(ASTRAY, ASTRAY, ASTRAY, 0.0), 0, 0, 0, 0.0, start_of(tuple(ASTRAY.tolist()))),
        partial(silhouettes_by_camera, evidence),
        weighting.prepare(MOUSE, SMALL, weighting.settings_type()).problem(evidence),
        dataclasses.replace(FrameRefinementSettings(), **knobs),
        partial(changes_by_camera, evidence),
    )


def along(pose: Array, evidence: FrameEvidence) -> dict[str, float]:
    return along_in(ON_FLOOR, pose, changes_by_camera(evidence), Agreement(MOUSE, SMALL).corners(pose))


def along_in(
    thin: Mapping[str, ThinLimb], pose: Array, changes: Mapping[str, Change], corners: Array
) -> dict[str, float]:
    """How plainly lines run along limbs, seen around outlines (V, L, 4, 2)."""
    return lines_along(thin, pose, {limb: one.lines(pose, changes, corners) for limb, one in thin.items()})


def test_a_tail_is_found_that_no_mask_shows() -> None:
    found, without = refined(seen()), refined(seen(), thin_limbs=False)
    assert tip_off(without.estimate.pose) > 25.0
    assert tip_off(found.estimate.pose) < 5.0
    assert "tail" not in found.limbs_lost
    assert np.array_equal(refined(seen()).estimate.pose, found.estimate.pose)


def test_a_tail_along_no_line_is_lost() -> None:
    found = refined(seen(tail=False))
    assert "tail" in found.limbs_lost
    named = refined(seen(), redraw_limbs=False)
    assert "tail" in named.limbs_lost
    assert tip_off(named.estimate.pose) > 25.0


def test_lines_are_plain_along_a_tail_that_is_right() -> None:
    assert along(TRUTH, seen())["tail"] > 0.5
    assert along(ASTRAY, seen())["tail"] < HALF_PLAIN


def test_nothing_is_said_without_an_empty_view_and_a_tail_hidden_from_all_is_lost() -> None:
    assert along(TRUTH, seen(empty=False)) == {}
    everywhere = np.stack([[[0.0, 0.0], [640.0, 0.0], [640.0, 480.0], [0.0, 480.0]]] * len(MOUSE.drawn))
    changes = changes_by_camera(seen())
    assert along_in(ON_FLOOR, TRUTH, changes, np.stack([everywhere] * len(SMALL))) == {"tail": 0.0}


def test_a_tail_under_the_floor_shows_nowhere() -> None:
    below = rearing_mouse(tail_lift=0.5, tail_2_wag=0.0, pelvis_z=20.0)
    evidence = seen(below)
    corners, changes = Agreement(MOUSE, SMALL).corners(below), changes_by_camera(evidence)
    flying = thin_limbs_of(MOUSE, SMALL, on_floor=False)
    lowest = marker_points(MOUSE, below[None])[0, TIP, 2]
    assert lowest < -10.0
    on_floor, free = (along_in(thin, below, changes, corners)["tail"] for thin in (ON_FLOOR, flying))
    assert on_floor < 0.0 < free


def test_a_tail_that_is_broad_in_the_pictures_is_left_to_the_masks() -> None:
    near = tuple(dataclasses.replace(camera, translation=camera.translation / 4.0) for camera in SMALL)
    tail, corners = thin_limbs_of(MOUSE, near, True)["tail"], Agreement(MOUSE, near).corners(TRUTH)
    assert tail.lines(TRUTH, changes_by_camera(seen()), corners) == [None, None, None]


@pytest.mark.parametrize("body", ["human35", "dog", "planar_arm4"])
def test_only_a_tail_of_many_joints_is_thin(body: str) -> None:
    assert chains_of(MOUSE) == ["tail"]
    assert chains_of(load_body(body)) == []


def test_pictures_of_another_size_than_the_empty_one_say_nothing() -> None:
    changes = {
        name: Change(one.kinds, one.size, one.picture, one.empty[:-2] if one.empty is not None else None)
        for name, one in changes_by_camera(seen()).items()
    }
    corners = Agreement(MOUSE, SMALL).corners(TRUTH)
    assert along_in(ON_FLOOR, TRUTH, changes, corners) == {}


def test_a_check_asks_the_lines_alone_of_a_tail() -> None:
    agreement, silhouettes = Agreement(MOUSE, SMALL), tuple(silhouettes_by_camera(seen()).values())
    off = agreement.of(ASTRAY, silhouettes)
    assert "tail" in contradicted_limbs(off, {}, ())
    assert "tail" not in contradicted_limbs(off, {}, (), {"tail": HALF_PLAIN + 0.1})
    share, by_pictures = contradicted_limbs(off, {}, (), {"tail": HALF_PLAIN - 0.1})["tail"]
    assert (round(off.shares()["tail"], 3), True) == (share, by_pictures)


def test_older_runs_and_live_ones_do_not_follow_lines() -> None:
    names = "annealed", "edge-region-silhouette"
    assert default_settings(*names).refinement.thin_limbs
    assert not settings_from_values(*names, {}).refinement.thin_limbs
    assert not live_changes({})["thin_limbs"]
    assert live_changes({"thin_limbs": True})["thin_limbs"]


def test_refining_a_clip_leaves_limbs_as_they_were_tracked_along_lines_where_a_camera_is_missing_too() -> (
    None
):
    work = object.__new__(_Work)
    work._cameras, work._knobs, work._still = SMALL, RefinementSettings(), [7]
    work._refiner = Refiner(MOUSE, SMALL, work._knobs, work._still)
    fewer = work._refiner_of(tuple(camera.name for camera in SMALL[:2]))
    assert len(fewer.cameras) == 2
    assert np.flatnonzero(fewer.still).tolist() == [7]


@pytest.mark.parametrize(
    ("gains", "losses", "turned"),
    [
        ((0.5, 0.9, 0.1), (1.0, 0.9, 1.0), 0),
        ((0.5, 0.9, 0.1), (1.0, 1.0, 0.5), None),
        ((0.5, 0.7, 0.8), (1.0, 0.9, 0.9), 1),
        ((0.5, 0.55, 0.5), (1.0, 0.5, 0.5), None),
    ],
)
def test_a_round_animal_is_turned_where_its_tail_and_the_silhouettes_say_more_for_it(
    monkeypatch: pytest.MonkeyPatch, gains: tuple[float, ...], losses: tuple[float, ...], turned: int | None
) -> None:
    """Of the pose as found and of both turns what lines gain, and the losses."""
    poses: list[Array] = []

    def hypothesis(pose: Array) -> Hypothesis:
        if not any(np.array_equal(pose, known) for known in poses):
            poses.append(pose)
        return Hypothesis(pose, losses[number_of(pose)], None)

    def number_of(pose: Array) -> int:
        return next(n for n, known in enumerate(poses) if np.array_equal(pose, known))

    def gain_of(posed: Array, lines: object) -> Array:
        return np.array([gains[number_of(posed[0])]])

    frame = SimpleNamespace(
        refiner=SimpleNamespace(body=MOUSE, refine=lambda pose, seen: SimpleNamespace(pose=pose)),
        silhouettes=(),
        hypothesis=hypothesis,
    )
    monkeypatch.setattr(limb_resampling, "drawn_along_lines", lambda rng, found, *others: (found, 7))
    began = hypothesis(TRUTH)
    found, weighed = limb_resampling.turned_along_lines(
        np.random.default_rng(0), began, frame, SimpleNamespace(gains=gain_of), [], lambda pose: []
    )
    assert weighed == 14
    assert number_of(found.pose) == (0 if turned is None else turned + 1)
    heading = [entry.name for entry in MOUSE.parameters].index("heading")
    assert (found.pose[heading] - TRUTH[heading]) == pytest.approx(
        (0.0, 0.7, -0.7)[number_of(found.pose)], abs=0.1
    )
