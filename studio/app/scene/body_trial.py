"""A body that is being made, drawn in place of a session's own or alone."""

import numpy as np
import viser

from studio.app.scene.body_view import BodyView
from studio.app.scene.model import Trial
from studio.app.scene.opened_run import OpenedRun
from studio.body.dragging import root_joint
from studio.body.model import BodyModel
from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError
from studio.foundations.geometry.camera import Camera
from studio.runs.drawing.colour_tokens import ColourTokens


class TrialView:
    """The meshes of one trial: another body needs others."""

    def __init__(self, server: viser.ViserServer, trial: Trial) -> None:
        self.trial = trial
        self._view = BodyView(server, trial.body, name="/trial")

    def show(self, tokens: ColourTokens, visible: bool) -> None:
        self._view.show(self.trial.pose if visible else None, tokens)

    def remove(self) -> None:
        """Take it out of the scene."""
        for handle in self._view.handles:
            handle.remove()


def trial_pose(body: BodyModel, opened: OpenedRun | None) -> Array:
    """(D,) where an edited body stands: the session's start pose if it fits, else the rest pose before cameras."""
    rest = body.neutral
    if opened is None:
        return rest
    try:
        stored = opened.session.start_pose(body)
    except StudioError:
        stored = None
    if stored is not None:
        return stored
    middle = looked_at(opened.cameras)
    joint = root_joint(body)
    for step in body.joints[joint].steps if joint >= 0 else ():
        entry = body.parameters[step.parameter] if step.parameter >= 0 else None
        if entry is not None and entry.kind == "length" and step.axis < 2:
            rest[step.parameter] = np.clip(step.value * middle[step.axis], entry.lower, entry.upper)
    return rest


def looked_at(cameras: tuple[Camera, ...]) -> Array:
    """(3,) mm: the point nearest to where all cameras look; the world's origin for one camera."""
    if len(cameras) < 2:
        return np.zeros(3)
    ahead = np.array([camera.rotation[2] for camera in cameras])
    across = np.eye(3) - ahead[:, :, None] * ahead[:, None, :]
    centres = np.array([camera.centre for camera in cameras])
    sums: Array = across.sum(axis=0)
    wanted: Array = (across @ centres[:, :, None]).sum(axis=0)[:, 0]
    return np.asarray(np.linalg.pinv(sums)) @ wanted
