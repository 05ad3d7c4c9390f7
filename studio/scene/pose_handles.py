"""What a person takes hold of in the scene: a ball on every limb's end, a gizmo on the chosen one and on the root.

The viewers' drags arrive in viser's own thread; only the newest place of each is kept, until the scene's thread asks
for it.
"""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import viser
from numpy.typing import NDArray
from viser.transforms import SO3

from studio.body.dragging import Grip
from studio.runs.colour_tokens import ColourTokens
from studio.scene.limb_meshes import METRES_PER_MM

Array = NDArray[np.float64]

RADIUS, CHOSEN_RADIUS = 0.032, 0.045
GRIP_SCALE, ROOT_SCALE = 0.28, 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Pull:
    """A drag's newest place. grip : a limb's name, "" the root. place : (3,) mm. wxyz : the root's attitude. ended :
    whether the hand has let go.
    """

    grip: str
    place: Array
    wxyz: Array
    ended: bool


class PoseHandles:
    """chosen : called with a limb's name when its ball is clicked. pulled : called when `take` has something new; both
    in viser's thread, returning at once. All else in the scene's thread.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        grips: Sequence[Grip],
        tokens: ColourTokens,
        *,
        rooted: bool,
        chosen: Callable[[str], None],
        pulled: Callable[[], None],
    ) -> None:
        self._pulled = pulled
        self._lock = threading.Lock()
        self._newest: Pull | None = None
        self._held: str | None = None
        self._rooted = rooted
        self.chosen = ""
        self._names = [grip.name for grip in grips]
        self.balls = [
            server.scene.add_icosphere(
                f"/grips/{at}",
                RADIUS,
                tokens[f"limb-{grip.side}"],
                subdivisions=2,
                visible=False,
                cast_shadow=False,
                receive_shadow=False,
            )
            for at, grip in enumerate(grips)
        ]
        for ball, grip in zip(self.balls, grips, strict=True):
            ball.on_click(lambda _, name=grip.name: chosen(name))
        self.gizmo = server.scene.add_transform_controls(
            "/grip", GRIP_SCALE, line_width=3.0, disable_rotations=True, depth_test=False, visible=False
        )
        self.root = server.scene.add_transform_controls(
            "/root", ROOT_SCALE, line_width=2.0, depth_test=False, opacity=0.8, visible=False
        )
        self.gizmo.on_update(self._limb_dragged)
        self.root.on_update(self._root_dragged)

    def show(self, points: Array, root: Array | None) -> None:
        """Put everything where the body is. points : (G, 3) mm of the grips. root : (3, 4) its frame, mm."""
        for ball, point, name in zip(self.balls, points, self._names, strict=True):
            ball.position = point * METRES_PER_MM
            ball.visible = name != self.chosen
        # What is being dragged is where the hand is; to move it would pull it out of the hand.
        if self.chosen in self._names and self._held != self.chosen:
            self.gizmo.position = points[self._names.index(self.chosen)] * METRES_PER_MM
        self.gizmo.visible = self.chosen in self._names
        if root is not None and self._held != "":
            self.root.position = root[:, 3] * METRES_PER_MM
            self.root.wxyz = SO3.from_matrix(root[:, :3]).wxyz
        self.root.visible = self._rooted and root is not None

    def hide(self) -> None:
        """Take them out of sight."""
        self._held = None
        for handle in (*self.balls, self.gizmo, self.root):
            handle.visible = False

    def take(self) -> Pull | None:
        """The newest drag, once."""
        with self._lock:
            newest, self._newest = self._newest, None
        if newest is not None:
            self._held = None if newest.ended else newest.grip
        return newest

    def remove(self) -> None:
        """Take them out of the scene."""
        for handle in (*self.balls, self.gizmo, self.root):
            handle.remove()

    async def _limb_dragged(self, event: viser.TransformControlsEvent) -> None:
        self._keep(self.chosen, event)

    async def _root_dragged(self, event: viser.TransformControlsEvent) -> None:
        self._keep("", event)

    def _keep(self, grip: str, event: viser.TransformControlsEvent) -> None:
        place = np.array(event.target.position, dtype=np.float64) / METRES_PER_MM
        wxyz = np.array(event.target.wxyz, dtype=np.float64)
        with self._lock:
            self._newest = Pull(grip, place, wxyz, event.phase == "end")
        self._pulled()
