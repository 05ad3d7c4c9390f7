"""The true pose of every frame of rendered footage: the tracked body fitted to the rendered motion.

The paper annotated twelve body parts by hand, smoothed their paths and took inverse kinematics (7.1). Here the motion
is known, including rotations of head and feet, which markers at the joints do not show; the whole path is fitted at
once, so that twists of straight limbs are steady.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import limb_frames, marker_points
from studio.body.model import BodyModel
from studio.body.motion_files.trc import MarkerMotion, read_trc
from studio.body.person import first_frames, marker_motion
from studio.foundations.arrays import Array, read_archive
from studio.foundations.errors import TruthError
from studio.garden.reproduction.caillette.training_set import made_once
from studio.results.comparison.footage_cache import FootageCache
from studio.results.drawing_footage.recipe_file import read_recipe
from studio.results.drawing_footage.recipes import RECIPE_COPY, recipe_motion, recipe_person
from studio.runs.learning.recordings import fitted_person
from studio.sessions.session import Session

FILE = "truth.npz"
SAME_MM = 0.1
LOST_MM = 150.0
"""A limb is lost when one of its markers is off by more, as in `results.evaluation.errors`."""


@dataclass(frozen=True, slots=True, eq=False)
class TrueMotion:
    """poses : (F, D) of the tracked body. points : (F, M, 3) mm, true markers. markers : (M,) their numbers in the
    body.
    """

    poses: Array
    points: Array
    markers: NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class JointErrors:
    """Of each frame (F,). angle_deg : RMS over the joint angles (all but the root's), wrapped. limb_deg : RMS over the
    limbs of the angle between found and true axis. position_mm : RMS over the markers. mean_mm : their mean.
    centre_mm : the error of the markers' middle; position² - centre² is what is left with the body in its place. lost :
    whether any marker is off by more than LOST_MM.
    """

    angle_deg: Array
    limb_deg: Array
    position_mm: Array
    mean_mm: Array
    centre_mm: Array
    lost: NDArray[np.bool_]


def true_motion(cache: FootageCache, session: Session, last: int) -> TrueMotion:
    """The true motion of the first `last` frames of a recipe's session, for the body that its runs track.

    Raises TruthError for a session without recipe, and for footage rendered by another version.
    """
    recipe_path = session.path / RECIPE_COPY
    if not recipe_path.is_file():
        raise TruthError(f"Session '{session.name}' is not made by a recipe.", "Take one that is.")
    body = session.body()

    def make(folder: Path) -> None:
        recipe = read_recipe(recipe_path)
        skeleton, _ = recipe_person(recipe, recipe_path.parent, np.random.default_rng(recipe.seed))
        motion = first_frames(recipe_motion(recipe, recipe_path.parent, skeleton), last)
        truth = marker_motion(motion)
        _check_rendered(session, truth)
        places = {marker.name: place for place, marker in enumerate(body.markers)}
        common = [index for index, name in enumerate(truth.names) if name in places]
        np.savez(
            folder / FILE,
            poses=fitted_person(motion, body, session.name).poses,
            points=truth.positions[:, common],
            markers=np.array([places[truth.names[index]] for index in common], dtype=np.int64),
        )

    making = {"recipe": recipe_path.read_text(encoding="utf-8"), "body": body.name, "last": last}
    kept = read_archive(made_once(cache, "truth", making, make) / FILE)
    return TrueMotion(kept["poses"], kept["points"], kept["markers"])


def _check_rendered(session: Session, truth: MarkerMotion) -> None:
    """Raise TruthError unless the footage shows this motion."""
    assert session.truth_path is not None
    rendered = read_trc(session.truth_path)
    same = rendered.names == truth.names and len(rendered.positions) >= len(truth.positions)
    if not same or not np.allclose(rendered.positions[: len(truth.positions)], truth.positions, atol=SAME_MM):
        raise TruthError(
            f"The footage '{session.name}' shows another motion than its recipe makes now.",
            "It was rendered by another version of the studio: delete its folder to have it rendered again.",
        )


def joint_errors(body: BodyModel, columns: NDArray[np.int64], poses: Array, truth: TrueMotion) -> JointErrors:
    """Errors of poses (F, D), the first F frames of the truth. columns : (d,) the joint angles in the pose vector."""
    true = truth.poses[: len(poses)]
    away = np.degrees((poses - true + np.pi) % (2.0 * np.pi) - np.pi)[:, columns]
    axes, true_axes = (limb_frames(body, each)[..., 2] for each in (poses, true))
    turned = np.degrees(np.arccos(np.clip((axes * true_axes).sum(axis=2), -1.0, 1.0)))
    points = marker_points(body, poses)[:, truth.markers]
    away_mm = points - truth.points[: len(poses)]
    apart = np.linalg.norm(away_mm, axis=2)
    return JointErrors(
        np.sqrt((away**2).mean(axis=1)),
        np.sqrt((turned**2).mean(axis=1)),
        np.sqrt((apart**2).mean(axis=1)),
        apart.mean(axis=1),
        np.linalg.norm(away_mm.mean(axis=1), axis=1),
        (apart > LOST_MM).any(axis=1),
    )
