"""What raises the standard deviation of a limb, and the probability that it is lost."""

from collections.abc import Mapping

from drawn_people import drawn_evidence, ring_of_cameras
from moving_bodies import standing

from studio.body.model import BodyModel
from studio.evidence.distance_maps import silhouette_distances
from studio.foundations.arrays import Array
from studio.search.trackers.agreement import Agreement
from studio.search.trackers.limb_certainty import Certainty, CertaintyOfLimbs
from studio.search.trackers.limbs_elsewhere import Elsewhere
from studio.search.trackers.refinement import RefinementSettings, Refiner
from studio.search.trackers.tracker import LIMB_LOST_PROBABILITY

CAMERAS = ring_of_cameras(4, 480, 360)
ASIDE = {"left_shoulder_rx": 0.5, "right_shoulder_rx": 0.5}


def certainty_and_lost(
    body: BodyModel, pose: Array, truth: Array, memory: Mapping[str, Array] | None = None
) -> tuple[Certainty, dict[str, float]]:
    """The certainty of a pose on the silhouettes of another, and the probabilities."""
    refiner = Refiner(body, CAMERAS, RefinementSettings())
    seen = silhouette_distances(drawn_evidence(body, truth, CAMERAS), 150)
    found = CertaintyOfLimbs(refiner).of(pose, refiner.loss(pose, seen)[2], memory or {})
    return found, found.lost(Agreement(body, CAMERAS).of(pose, seen))


def test_a_limb_before_the_trunk_is_less_certain_than_one_held_aside(body: BodyModel) -> None:
    aside = standing(body, **ASIDE)
    before = standing(body, **{**ASIDE, "left_shoulder_rx": -0.35, "left_elbow_ry": -1.6})
    deviations = [certainty_and_lost(body, pose, pose)[0] for pose in (aside, before)]
    arm = deviations[0].limbs.index("left arm")
    assert deviations[1].deviation[arm] > 1.3 * deviations[0].deviation[arm]


def test_an_arm_inside_the_trunk_in_every_view_is_lost_only_if_it_jumped_there(body: BodyModel) -> None:
    aside, inside = standing(body, **ASIDE), standing(body, left_shoulder_rx=0.5, right_shoulder_rx=-0.5)
    found, lost = certainty_and_lost(body, inside, inside)
    assert found.deviation[found.limbs.index("right arm")] > 150.0
    assert max(lost.values()) < LIMB_LOST_PROBABILITY
    memory: Mapping[str, Array] = {}
    for _ in range(3):
        memory = certainty_and_lost(body, aside, aside, memory)[0].moved
    jumped = certainty_and_lost(body, inside, inside, memory)[1]
    assert [limb for limb, value in jumped.items() if value > LIMB_LOST_PROBABILITY] == ["right arm"]


def test_no_limb_of_the_true_pose_is_lost_and_a_misplaced_one_is(body: BodyModel) -> None:
    truth = standing(body, **ASIDE)
    assert max(certainty_and_lost(body, truth, truth)[1].values()) < LIMB_LOST_PROBABILITY
    wrong = standing(body, **{**ASIDE, "left_shoulder_rx": 1.6})
    assert certainty_and_lost(body, wrong, truth)[1]["left arm"] > 0.9


def test_a_limb_that_jumped_is_doubted_for_some_frames_though_the_silhouettes_agree(body: BodyModel) -> None:
    steady, jumped = standing(body, **ASIDE), standing(body, **{**ASIDE, "left_shoulder_rx": 1.6})
    memory: Mapping[str, Array] = {}
    for _ in range(3):
        memory = certainty_and_lost(body, steady, steady, memory)[0].moved
    calm = certainty_and_lost(body, steady, steady, memory)[1]["left arm"]
    after: list[dict[str, float]] = []
    for _ in range(20):
        found, lost = certainty_and_lost(body, jumped, jumped, memory)
        memory = found.moved
        after.append(lost)
    known = certainty_and_lost(body, jumped, jumped)[1]["left arm"]
    assert after[0]["left arm"] > 5.0 * max(calm, known)
    assert after[0]["left arm"] > 5.0 * after[0]["right leg"]
    assert after[2]["left arm"] > 2.0 * known
    assert after[-1]["left arm"] < 2.0 * known


def test_a_jump_to_where_the_pictures_show_the_limb_is_none(body: BodyModel) -> None:
    steady, jumped = standing(body, **ASIDE), standing(body, **{**ASIDE, "left_shoulder_rx": 1.6})
    memory: Mapping[str, Array] = {}
    for _ in range(3):
        memory = certainty_and_lost(body, steady, steady, memory)[0].moved
    off = Agreement(body, CAMERAS).of(
        jumped, silhouette_distances(drawn_evidence(body, jumped, CAMERAS), 150)
    )
    leapt, calm = (certainty_and_lost(body, jumped, jumped, known)[0] for known in (memory, {}))
    for seen, counts in (
        (Elsewhere(0.05, 0.85, 0.5), False),
        # It lies on others, or beside what changed; another place may be the limb's.
        (Elsewhere(0.0, 1.0, 0.2), True),
        (Elsewhere(0.0, 0.7, 0.5), True),
        (Elsewhere(0.3, 1.0, 0.5), True),
    ):
        jumps, still = (one.lost(off, {"left arm": seen})["left arm"] for one in (leapt, calm))
        assert (jumps > 2.0 * still) is counts
        assert counts or jumps == still


def test_the_pictures_have_a_say_in_what_is_lost(body: BodyModel) -> None:
    aside, inside = standing(body, **ASIDE), standing(body, left_shoulder_rx=0.5, right_shoulder_rx=-0.2)
    off = Agreement(body, CAMERAS).of(inside, silhouette_distances(drawn_evidence(body, aside, CAMERAS), 150))
    found = certainty_and_lost(body, inside, inside)[0]
    sure, unsure = Elsewhere(0.0, 1.0, 0.6), Elsewhere(0.0, 0.8, 0.6)
    assert found.lost(off)["right arm"] == 1.0
    assert found.lost(off, {"right arm": sure, "left arm": unsure})["right arm"] < 1.0
    assert found.lost(off, {"right arm": unsure, "left arm": sure})["right arm"] == 1.0
    sound = Agreement(body, CAMERAS).of(
        aside, silhouette_distances(drawn_evidence(body, aside, CAMERAS), 150)
    )
    calm, left = certainty_and_lost(body, aside, aside)[0], {"left arm": Elsewhere(0.5, 0.5, 0.5)}
    assert calm.lost(sound)["left arm"] < LIMB_LOST_PROBABILITY < calm.lost(sound, left)["left arm"]
    assert calm.lost(sound, left)["right arm"] == calm.lost(sound)["right arm"]
