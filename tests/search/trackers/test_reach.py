"""What limbs can reach: only silhouette there can be a lost limb."""

import itertools
from dataclasses import replace

import cv2
import numpy as np
import pytest
from drawn_people import drawn_mask, ring_of_cameras
from looking_cameras import turned_to

from studio.body.catalogue import load_body
from studio.body.definition import BodyDefinition, JointEntry, LimbEntry, ParameterEntry, StepEntry
from studio.body.forward_kinematics import joint_frames, limb_ends
from studio.body.model import BodyModel
from studio.body.reader import assemble, check_definition
from studio.evidence.distance_maps import SilhouetteDistances, distances_of
from studio.evidence.frame_evidence import ViewEvidence
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.search.trackers.agreement import Agreement, limb_names
from studio.search.trackers.limb_reach import LimbReach, is_reached, is_reached_by_any
from studio.search.trackers.limbs_elsewhere import LimbsElsewhere, change_of
from studio.search.trackers.reach import Reach
from studio.search.trackers.tracker import LIMB_LOST_SHARE

Array = np.ndarray
HAND = load_body("hand25")
NEAR = tuple(
    replace(
        camera,
        rotation=rotation,
        translation=-rotation @ centre,
        matrix=np.array([[600.0, 0, 239.5], [0, 600.0, 179.5], [0, 0, 1]]),
    )
    for camera, centre in zip(
        ring_of_cameras(4, 480, 360),
        np.array([[400.0, 150, 250], [-150, 400, 200], [-400, -150, 300], [150, -400, 200]]),
        strict=True,
    )
    for rotation in [turned_to(centre, (0.0, 0.0, 60.0))]
)


def standing_body(name: str, *limbs: tuple[ParameterEntry | None, LimbEntry]) -> BodyModel:
    """Limbs one upon the other, each with the angle about y that turns it, the first placed by a root of its own."""
    root = [ParameterEntry(f"root_{axis}", "length", 100.0, name) for axis in "xyz"]
    root += [ParameterEntry(f"turn_{axis}", "angle", 100.0, name) for axis in "xyz"]
    steps = [StepEntry(f"root_{axis}", move=axis) for axis in "xyz"]
    steps += [StepEntry(f"turn_{axis}", turn=axis) for axis in "xyz"]
    joints, parameters = [JointEntry(limbs[0][1].joint, "world", "free", tuple(steps))], list(root)
    for (_, below), (swing, limb) in itertools.pairwise(limbs):
        assert swing is not None
        parameters.append(swing)
        at = (StepEntry(below.length, move="z"), StepEntry(swing.name, turn="y"))
        joints.append(JointEntry(limb.joint, below.joint, "hinge", at))
    definition = BodyDefinition(name, tuple(parameters), tuple(joints), tuple(limb for _, limb in limbs))
    check_definition(definition, name)
    return assemble(definition, name, {})


COLUMN = LimbEntry("column", "column", 1000.0, 40.0, 40.0)


def swinging() -> BodyModel:
    """A column of 1000 mm to z = 1000, and on its top a pole of 800 mm that swings by 60 degrees to both sides."""
    swing = ParameterEntry("swing", "angle", 100.0, "pole", lower=-60.0, upper=60.0)
    return standing_body("swinging", (None, COLUMN), (swing, LimbEntry("pole", "pole", 800.0, 40.0, 40.0)))


def facing(centre: Array) -> Camera:
    """A camera that sees a mm as a tenth of a pixel at the world's middle."""
    rotation = turned_to(centre, (0.0, 0.0, 1000.0))
    matrix = np.array([[400.0, 0.0, 239.5], [0.0, 400.0, 179.5], [0.0, 0.0, 1.0]])
    return Camera("facing", 480, 360, matrix, np.zeros(5), rotation, -rotation @ centre)


def everywhere(camera: Camera) -> SilhouetteDistances:
    return distances_of(np.full((camera.height, camera.width), 255, np.uint8), 10)


@pytest.mark.parametrize("aside", [0.0, 300.0])
def test_a_pole_reaches_a_sector_about_its_hinge(aside: float) -> None:
    """Whoever moves the root moves what is reached. Cubes of 100 mm, a radius of 40 mm and 45 mm of clothes blur it."""
    camera, around = facing(np.array([0.0, -4000.0, 1000.0])), np.radians(np.arange(-180, 180, 15))
    reach, pose = Reach(swinging()), np.array([aside, 0.0, 0.0, 0.0, 0.0, 0.0, 0.3])
    for distance in (400.0, 700.0, 1100.0, 1400.0):
        points = np.array([aside, 0.0, 1000.0]) + distance * np.stack(
            [np.sin(around), 0.0 * around, np.cos(around)], axis=1
        )
        pixels = project(camera, points)[0]
        (beyond,) = reach.beyond(pose, (camera,), (everywhere(camera),), (pixels,), (10.0,), 45.0)
        off = np.abs(np.degrees(around))
        apart = distance * np.sin(np.radians(np.clip(off - 60.0, 0.0, 90.0)))
        if distance < 800.0:
            assert not beyond[off <= 60.0].any()
            assert beyond[apart > 300.0].all()
        else:
            assert beyond.all() == (distance > 1050.0)
            assert beyond[apart > 300.0].all()


def test_a_place_counts_that_half_of_the_other_views_show() -> None:
    """The pole's own way up, seen from the front; two others look along x and y, and their masks have it or not."""
    body = swinging()
    cameras = tuple(
        facing(np.array(centre))
        for centre in ([0.0, -4000.0, 1000.0], [4000.0, 0.0, 1000.0], [0.0, 4000.0, 1000.0])
    )
    pixels = project(cameras[0], np.array([[0.0, 0.0, 1600.0]]))[0]
    nothing = np.zeros((0, 2))
    for shown, said in (((True, True), False), ((True, False), False), ((False, False), True)):
        silhouettes = [everywhere(cameras[0])]
        for camera, whole in zip(cameras[1:], shown, strict=True):
            mask = np.full((camera.height, camera.width), 255 if whole else 0, np.uint8)
            # Below the hinge there is something in any case.
            mask[-60:] = 255
            silhouettes.append(distances_of(mask, 10))
        beyond = Reach(body).beyond(
            np.zeros(7), cameras, silhouettes, (pixels, nothing, nothing), (10.0,) * 3, 45.0
        )
        assert beyond[0].tolist() == [said]
        assert [len(own) for own in beyond] == [1, 0, 0]


def test_of_a_body_that_cannot_bend_nothing_is_beyond() -> None:
    stick = standing_body("stick", (None, COLUMN))
    camera = facing(np.array([0.0, -4000.0, 1000.0]))
    pixels = np.array([[1.0, 1.0], [470.0, 350.0]])
    (beyond,) = Reach(stick).beyond(np.zeros(6), (camera,), (everywhere(camera),), (pixels,), (10.0,), 45.0)
    assert not beyond.any()


def masks_with_forearm(pose: Array, length: float) -> list[Array]:
    """Masks of a hand's cones, and of a forearm of some length behind its wrist, which the body has not."""
    frame = joint_frames(HAND, pose)[0, [joint.name for joint in HAND.joints].index("palm")]
    masks = []
    for camera in NEAR:
        mask = drawn_mask(HAND, pose, camera)
        corners = np.array([[x, y, z] for x in (-25, 25) for y in (-16, 16) for z in (-34.0 - length, -20.0)])
        pixels = project(camera, corners @ frame[:, :3].T + frame[:, 3])[0]
        cv2.fillConvexPoly(mask, cv2.convexHull(np.round(pixels).astype(np.int32)), 255)
        masks.append(mask)
    return masks


def seen_with_forearm(pose: Array, length: float) -> list[SilhouetteDistances]:
    return [distances_of(mask, 150) for mask in masks_with_forearm(pose, length)]


def hand(**angles: float) -> Array:
    pose = HAND.neutral.copy()
    names = [entry.name for entry in HAND.parameters]
    for name, value in {"wrist_z": 60.0, "heading": 20.0, **angles}.items():
        pose[names.index(name)] = value if name.startswith("wrist") else np.radians(value)
    return pose


@pytest.mark.parametrize("fist", [0.0, 70.0])
def test_a_forearm_behind_the_wrist_is_no_lost_limb(fist: float) -> None:
    """A hand's body ends at the wrist; its limbs cannot get where the forearm is."""
    bent = {f"{finger}_mcp": fist for finger in ("index", "middle", "ring", "little")}
    pose = hand(**bent)
    shares = Agreement(HAND, NEAR).of(pose, seen_with_forearm(pose, 60.0)).shares()
    assert max(shares.values()) < 0.5 * LIMB_LOST_SHARE


@pytest.mark.parametrize("fist", [0.0, 70.0])
def test_a_forearm_that_changed_in_all_pictures_is_no_thumb_that_is_elsewhere(fist: float) -> None:
    """It lies within the thumb's length of the thumb's root, but no joint lets it get there."""
    bent = {f"{finger}_mcp": fist for finger in ("index", "middle", "ring", "little")}
    witness = LimbsElsewhere(HAND, NEAR)

    def unexplained(truth: Array, pose: Array) -> dict[str, float]:
        changed = [
            change_of(ViewEvidence(camera.name, mask, mask, mask))
            for camera, mask in zip(NEAR, masks_with_forearm(truth, 60.0), strict=True)
        ]
        return {limb: one.unexplained for limb, one in witness.of(pose, changed).items()}

    # Above what may be a shadow on the floor: 0 to 60 mm here.
    high = hand(**bent, wrist_z=150.0)
    assert max(unexplained(high, high).values()) < 0.1
    assert unexplained(hand(**bent), hand(**{**bent, "index_mcp": 80.0, "index_pip": 90.0}))["index"] > 0.3


def test_arms_that_all_hang_from_the_world_may_lie_anywhere() -> None:
    arms = load_body("branched_arms6")
    placed = LimbReach(arms, limb_names(arms)).placed(arms.neutral)
    assert not placed.halves.any()
    assert is_reached_by_any(*placed, 1e4, 0.0, 0.0)
    assert not is_reached_by_any(*LimbReach(HAND, limb_names(HAND)).placed(hand()), 1e4, 0.0, 0.0)


def test_beside_a_forearm_a_finger_that_is_elsewhere_is_found() -> None:
    truth = hand()
    found = Agreement(HAND, NEAR).of(hand(index_mcp=80.0, index_pip=90.0), seen_with_forearm(truth, 60.0))
    alone = Agreement(HAND, NEAR).of(hand(index_mcp=80.0, index_pip=90.0), seen_with_forearm(truth, -14.0))
    index = np.array(found.limbs) == "index"
    assert found.bare[:, index].sum() == alone.bare[:, index].sum() > 0.0
    assert found.shares()["index"] > LIMB_LOST_SHARE


def lies_there(
    body: BodyModel, pose: Array, cameras: list[Camera], silhouettes: list, pixels: Array
) -> Array:
    """(K, G) of the first camera's pixels, at 10 mm a pixel, which limbs may lie there."""
    nothing = [np.zeros((0, 2))] * (len(cameras) - 1)
    reach = LimbReach(body, limb_names(body))
    return reach.limbs_there(pose, cameras, silhouettes, [pixels, *nothing], [10.0] * len(cameras))[0]


@pytest.mark.parametrize("aside", [0.0, 300.0])
def test_a_pole_itself_reaches_a_sector_about_its_hinge(aside: float) -> None:
    """Whoever moves the root moves what is reached; the column, which is the root's, reaches what the pole does. Cubes
    of 70 mm and the pole's radius of 40 mm blur it.
    """
    camera, around = facing(np.array([0.0, -4000.0, 1000.0])), np.radians(np.arange(-180, 180, 15))
    pose = np.array([aside, 0.0, 0.0, 0.0, 0.0, 0.0, 0.3])
    for distance in (400.0, 700.0, 1100.0, 1400.0):
        points = np.array([aside, 0.0, 1000.0]) + distance * np.stack(
            [np.sin(around), 0.0 * around, np.cos(around)], axis=1
        )
        pixels = project(camera, points)[0]
        column, pole = lies_there(swinging(), pose, [camera], [everywhere(camera)], pixels).T
        assert (column == pole).all()
        off = np.abs(np.degrees(around))
        apart = distance * np.sin(np.radians(np.clip(off - 60.0, 0.0, 90.0)))
        assert not pole[apart > 200.0].any()
        if distance < 800.0:
            assert pole[off <= 60.0].all()
        else:
            assert not pole.any() or distance < 1000.0


@pytest.mark.parametrize(
    ("shown", "is_there"),
    [
        ((True, True, True), True),
        ((True, True, False), True),
        ((True, False, False), False),
        ((True, True), True),
        ((True, False), False),
    ],
)
def test_a_place_counts_that_two_of_three_other_views_show(shown: tuple[bool, ...], is_there: bool) -> None:
    """The pole's own way up, seen from the front; the others look along x and y, and their masks have it or not."""
    places = [[0.0, -4000.0, 1000.0], [4000.0, 0.0, 1000.0], [0.0, 4000.0, 1000.0], [-4000.0, 0.0, 1000.0]]
    cameras = [facing(np.array(centre)) for centre in places[: 1 + len(shown)]]
    pixels = project(cameras[0], np.array([[0.0, 0.0, 1600.0]]))[0]
    silhouettes = [everywhere(cameras[0])]
    for camera, whole in zip(cameras[1:], shown, strict=True):
        mask = np.full((camera.height, camera.width), 255 if whole else 0, np.uint8)
        # Below the hinge there is something in any case.
        mask[-60:] = 255
        silhouettes.append(distances_of(mask, 10))
    found = lies_there(swinging(), np.zeros(7), cameras, silhouettes, pixels)
    assert (found == is_there).all()


def test_a_view_without_any_silhouette_denies_nothing() -> None:
    """A camera that failed."""
    cameras = [facing(np.array(centre)) for centre in ([0.0, -4000.0, 1000.0], [4000.0, 0.0, 1000.0])]
    pixels = project(cameras[0], np.array([[0.0, 0.0, 1600.0]]))[0]
    empty = distances_of(np.zeros((cameras[1].height, cameras[1].width), np.uint8), 10)
    assert lies_there(swinging(), np.zeros(7), cameras, [everywhere(cameras[0]), empty], pixels).all()


def test_of_a_body_that_cannot_bend_all_that_is_bare_counts() -> None:
    stick = standing_body("stick", (None, COLUMN))
    cameras = tuple(facing(np.array(centre)) for centre in ([0.0, -4000.0, 1000.0], [4000.0, 0.0, 1000.0]))
    agreement, seen = Agreement(stick, cameras), [everywhere(camera) for camera in cameras]
    shown = agreement.confirmed(agreement.of(np.zeros(6), seen), np.zeros(6), seen)
    assert shown.bare.sum() > shown.area.sum()


def test_a_haunch_reaches_the_floor_and_not_over_the_back() -> None:
    """Above the haunch, nearer than it is long, an arched back is bare."""
    mouse = load_body("mouse31")
    reach = LimbReach(mouse, limb_names(mouse))
    haunch, pose = reach.limbs.index("left haunch"), mouse.neutral
    hip, knee = limb_ends(mouse, pose)[0, [limb.name for limb in mouse.drawn].index("left haunch")]
    length = 36.0  # of haunch and foot, mm

    def reaches(place: Array) -> bool:
        return bool(is_reached(*reach.placed(pose), haunch, *place))

    assert reaches(hip)
    assert reaches(knee)
    assert reaches(hip - np.array([0.0, 0.0, 0.8 * length]))
    assert not reaches(hip + np.array([0.0, 0.0, 0.8 * length]))
    # Whoever turns the body turns what is reached.
    turned = pose.copy()
    turned[[entry.name for entry in mouse.parameters].index("pitch")] = np.pi
    assert is_reached(*reach.placed(turned), haunch, *(hip + np.array([0.0, 0.0, 0.8 * length])))
