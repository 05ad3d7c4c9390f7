"""Footage of people in random poses, every frame another one: what an initialisation has to find with nothing to go
by but the body's dimensions."""

import dataclasses
from pathlib import Path

import numpy as np

from studio.body.motion_files.trc import write_trc
from studio.body.person import SIDES, PersonMotion, Skeleton, joint_points, marker_motion
from studio.body.subject import Subject, write_subject
from studio.footage.capture.calibration_files import write_calibration
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.rotations import axis_turn
from studio.results.drawing_footage.gait import add_arm, trunk
from studio.results.drawing_footage.person import yaw_pitch_roll
from studio.results.drawing_footage.person_footage import render_person
from studio.results.drawing_footage.recipe_file import Recipe
from studio.sessions.importers.importing import ImportOptions, import_source
from studio.sessions.session import Session

FPS = 60.0
"""A sole may be this many ankle heights above the floor: the lower foot stands."""


def random_people(
    skeleton: Skeleton,
    count: int,
    rng: np.random.Generator,
    middle: tuple[float, float] = (0.0, 0.0),
    reach: float = 400.0,
) -> PersonMotion:
    """`count` poses as the frames of a motion: any heading, standing anywhere within `reach` mm of the `middle`, on one
    foot or both; arms anywhere in front, beside or over the head, knees bent or not; trunk bent and twisted.
    """

    def between(low: float, high: float) -> np.ndarray:
        return np.radians(rng.uniform(low, high, count))

    heading = between(-180.0, 180.0)
    turns = trunk(heading, between(-5.0, 30.0), between(-25.0, 25.0), between(-8.0, 8.0))
    turns["head"] = turns["thorax"] @ yaw_pitch_roll(
        between(-40.0, 40.0), between(-10.0, 20.0), between(-8.0, 8.0)
    )
    for side in SIDES:
        add_arm(turns, side, between(-35.0, 130.0), between(3.0, 85.0), between(5.0, 110.0))
        _add_leg(
            turns, side, between(-15.0, 65.0), between(0.0, 25.0), between(0.0, 80.0), between(-15.0, 15.0)
        )
    root = np.zeros((count, 3))
    root[:, :2] = np.array(middle) + rng.uniform(-reach, reach, (count, 2))
    motion = PersonMotion(skeleton, FPS, root, turns)
    points = joint_points(motion)
    lowest = np.min([points[f"{side}_{part}"][:, 2] for side in SIDES for part in ("foot", "toes")], axis=0)
    feet = np.min([points[f"{side}_foot"][:, 2] for side in SIDES], axis=0)
    root[:, 2] = np.maximum(skeleton.ankle_height - feet, 10.0 - lowest)
    return dataclasses.replace(motion, root=root)


def random_moments(
    motions: list[PersonMotion],
    count: int,
    rng: np.random.Generator,
    middle: tuple[float, float] = (0.0, 0.0),
    reach: float = 400.0,
) -> PersonMotion:
    """`count` random moments of motions in turn, each turned to a random heading and put anywhere within `reach` mm of
    the `middle`, as the frames of one motion. All motions are of one skeleton.
    """
    roots, turns = [], []
    for number in range(count):
        motion = motions[number % len(motions)]
        moment = int(rng.integers(motion.frame_count))
        turn = axis_turn(2, np.array(rng.uniform(-np.pi, np.pi)))
        place = np.array(middle) + rng.uniform(-reach, reach, 2)
        roots.append([*place, motion.root[moment, 2]])
        turns.append({name: turn @ frames[moment] for name, frames in motion.turns.items()})
    together = {name: np.stack([one[name] for one in turns]) for name in turns[0]}
    return PersonMotion(motions[0].skeleton, FPS, np.array(roots), together)


def _add_leg(
    turns: dict[str, np.ndarray],
    side: str,
    swing: np.ndarray,
    out: np.ndarray,
    knee: np.ndarray,
    twist: np.ndarray,
) -> None:
    sign = 1.0 if side == "left" else -1.0
    thigh = turns["pelvis"] @ axis_turn(1, -swing) @ axis_turn(0, sign * out) @ axis_turn(2, sign * twist)
    shin = thigh @ axis_turn(1, knee)
    turns |= {f"{side}_thigh": thigh, f"{side}_shin": shin, f"{side}_foot": shin}


def people_session(
    folder: Path, motion: PersonMotion, subject: Subject, cameras: tuple[Camera, ...], recipe: Recipe
) -> Session:
    """A session whose frame k is the motion's pose k; it has a subject and a truth, but no start pose."""
    source = folder.with_name(folder.name + "-source")
    source.mkdir(parents=True)
    render_person(recipe, motion, cameras, source)
    (source / "calibration").mkdir()
    write_calibration(cameras, source / "calibration" / "rendered.toml")
    (source / "truth").mkdir()
    write_trc(source / "truth" / "people.trc", marker_motion(motion))
    write_subject(subject, source / "subject.toml")
    import_source(source, folder, ImportOptions(fps=FPS))
    return Session(folder)
