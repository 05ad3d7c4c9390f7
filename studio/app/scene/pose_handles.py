"""The handles of a pose in the scene: a ball on every limb's end, a gizmo on the chosen one and on the root."""

from dataclasses import replace

import numpy as np
import viser
from viser.transforms import SO3

from studio.app.scene import METRES_PER_MM
from studio.app.scene.controls import Post
from studio.app.scene.model import Model, edit_pose
from studio.app.scene.pose_edit import PoseEdit, dragged
from studio.body.dragging import Dragger
from studio.foundations.arrays import Array
from studio.runs.drawing.colour_tokens import ColourTokens

RADIUS = 0.032
GRIP_SCALE, ROOT_SCALE = 0.28, 0.5


class PoseHandles:
    """The handles of one body. Drags and clicks are posted as they come."""

    def __init__(self, server: viser.ViserServer, dragger: Dragger, post: Post) -> None:
        self._dragger = dragger
        self._names = [grip.name for grip in dragger.grips]
        self.balls = [
            server.scene.add_icosphere(
                f"/grips/{at}", RADIUS, subdivisions=2, visible=False, cast_shadow=False, receive_shadow=False
            )
            for at in range(len(self._names))
        ]
        for ball, name in zip(self.balls, self._names, strict=True):
            ball.on_click(lambda _, name=name: post(take_hold, name))
        self.gizmo = server.scene.add_transform_controls(
            "/grip", GRIP_SCALE, line_width=3.0, disable_rotations=True, depth_test=False, visible=False
        )
        self.root = server.scene.add_transform_controls(
            "/root", ROOT_SCALE, line_width=2.0, depth_test=False, opacity=0.8, visible=False
        )

        self._grip = ""
        self._shown: tuple[PoseEdit, str] | None = None

        async def limb_dragged(event: viser.TransformControlsEvent) -> None:
            post(drag, self._grip, *_dragged_to(event))

        async def root_dragged(event: viser.TransformControlsEvent) -> None:
            post(drag, "", *_dragged_to(event))

        self.gizmo.on_update(limb_dragged)
        self.root.on_update(root_dragged)

    def show(self, edit: PoseEdit, tokens: ColourTokens) -> None:
        """Move the handles to the body, or hide them while it is not edited."""
        if self._shown == (edit, tokens.name):
            return
        self._shown = edit, tokens.name
        self._grip = edit.grip
        points = self._dragger.points(edit.pose) * METRES_PER_MM
        root = self._dragger.root_frame(edit.pose)
        for ball, point, grip in zip(self.balls, points, self._dragger.grips, strict=True):
            ball.visible = edit.active and grip.name != edit.grip
            ball.position, ball.color = point, tokens[f"limb-{grip.side}"]
        self.gizmo.visible = edit.active and edit.grip in self._names
        # A handle being dragged is not moved, because that would pull it away from the cursor.
        if edit.grip in self._names and edit.held != edit.grip:
            self.gizmo.position = points[self._names.index(edit.grip)]
        self.root.visible = edit.active and root is not None
        if root is not None and edit.held != "":
            self.root.position = root[:, 3] * METRES_PER_MM
            self.root.wxyz = SO3.from_matrix(root[:, :3]).wxyz


def take_hold(model: Model, grip: str) -> Model:
    """Put the gizmo on a limb's end; "" on none."""
    return edit_pose(model, lambda edit: replace(edit, grip=grip))


def drag(model: Model, grip: str, place: Array, wxyz: Array, is_last: bool) -> Model:
    """A limb's end, or ("") the root, was dragged to a place (3,) mm and an attitude. is_last : and released there."""
    if model.subject is None:
        return model
    dragger = model.subject.dragger
    return edit_pose(model, lambda edit: dragged(edit, dragger, grip, place, wxyz, is_last=is_last))


def _dragged_to(event: viser.TransformControlsEvent) -> tuple[Array, Array, bool]:
    place = np.array(event.target.position, dtype=np.float64) / METRES_PER_MM
    return place, np.array(event.target.wxyz, dtype=np.float64), event.phase == "end"
