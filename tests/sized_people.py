"""People with limb lengths drawn around the usual ones, seen by four cameras in a few different postures."""

from dataclasses import dataclass, replace

import numpy as np

from studio.body.catalogue import load_body
from studio.body.inverse_kinematics import pose_from_markers
from studio.body.model import BodyModel
from studio.body.person import PersonMotion, Skeleton, marker_motion
from studio.body.subject import Subject, fit_subject
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.results.drawing_footage.cameras import RIGS
from studio.results.drawing_footage.motions import make_motion
from studio.results.drawing_footage.person import marker_lengths, skeleton_of_height
from studio.results.drawing_footage.renderer import Renderer
from studio.results.drawing_footage.rooms import ROOMS
from studio.results.drawing_footage.wardrobes import WARDROBES

SIZE = (640, 480)
POSTURES = (("run", 12), ("handstand", 24), ("box", 96), ("run", 26), ("box", 70))
"""Motions and frames of them at 60 Hz."""
MEASURED = {
    "thigh_length": "RHip_RKnee",
    "shin_length": "RKnee_RAnkle",
    "upper_arm_length": "RShoulder_RElbow",
    "forearm_length": "RElbow_RWrist",
}
"""The limbs whose length the body's dimensions and the markers mean alike."""


@dataclass(frozen=True, slots=True, eq=False)
class DrawnPerson:
    """body : of the height as it was told. lengths : true mm by group. poses : (F, D) of that body, near the truth."""

    skeleton: Skeleton
    told_height: float
    body: BodyModel
    cameras: tuple[Camera, ...]
    frames: tuple[FrameEvidence, ...]
    lengths: dict[str, float]
    poses: Array


def drawn_skeleton(rng: np.random.Generator) -> Skeleton:
    """Lengths ± 10 %, each its own; the height follows from them."""
    usual = skeleton_of_height(float(rng.uniform(1600.0, 1900.0)), rng)

    def drawn() -> float:
        return float(rng.uniform(0.9, 1.1))

    def both(value: tuple[float, float]) -> tuple[float, float]:
        factor = drawn()
        return value[0] * factor, value[1] * factor

    found = replace(
        usual,
        thigh=both(usual.thigh),
        shin=both(usual.shin),
        upper_arm=both(usual.upper_arm),
        forearm=both(usual.forearm),
        trunk=usual.trunk * drawn(),
    )
    return replace(found, height=found.standing_hip_height + found.trunk + found.head)


def drawn_and_seen(rng: np.random.Generator) -> tuple[Skeleton, float, tuple[Camera, ...]]:
    """A person, the height as it is told (± 3 cm), mm, and four cameras around."""
    skeleton = drawn_skeleton(rng)
    measured = skeleton.height + float(rng.uniform(-30.0, 30.0))
    return skeleton, measured, RIGS["corners"](SIZE, rng)


def renderer_of(cameras: tuple[Camera, ...], motion: PersonMotion, seed: int, noise: float) -> Renderer:
    """The person in stripes, in a furnished room. noise : of the pictures, grey levels."""
    room, wardrobe = ROOMS["furnished"], WARDROBES["striped"]
    return Renderer(room, cameras, motion, noise=noise, samples=1, seed=seed, wardrobe=wardrobe)


def drawn_person(
    seed: int, body_name: str = "human31", *, jitter: float = 0.05, postures: int = len(POSTURES)
) -> DrawnPerson:
    """The person of a seed. jitter : radians by which the angles of `poses` are off."""
    rng = np.random.default_rng(np.random.SeedSequence((seed, 0xD2A)))
    skeleton, measured, cameras = drawn_and_seen(rng)
    body, _ = fit_subject(load_body(body_name), Subject(body=body_name, height_mm=measured))
    frames, poses, lengths = [], [], {}
    for number, (motion_name, at) in enumerate(POSTURES[:postures]):
        motion = make_motion(motion_name, skeleton, at + 2, 60.0, {})
        lengths = marker_lengths(motion)
        renderer = renderer_of(cameras, motion, seed, noise=0.0)
        shadow = renderer.shadow(at)
        views = []
        for index, camera in enumerate(cameras):
            picture, mask = renderer.picture(index, at, shadow)
            views.append(ViewEvidence(camera.name, picture, mask, np.zeros_like(mask)))
        frames.append(FrameEvidence(number, tuple(views)))
        markers = marker_motion(motion)
        pose, _ = pose_from_markers(body, markers.names, markers.positions[at], body.neutral)
        angles = np.array([entry.kind == "angle" for entry in body.parameters])
        poses.append(pose + angles * rng.normal(0.0, jitter, len(pose)))
    true = {group: lengths[pair] for group, pair in MEASURED.items()}
    return DrawnPerson(skeleton, measured, body, cameras, tuple(frames), true, np.array(poses))
