"""Joint trails: where chosen markers went over the frames of a run."""

from collections.abc import Sequence

import numpy as np
import viser
from numpy.typing import NDArray

from studio.body.forward_kinematics import marker_points
from studio.body.model import BodyModel, extremities
from studio.runs.colour_tokens import ColourTokens
from studio.runs.marker_lines import marker_sides
from studio.scene.stick_figure import trail_segments

Array = NDArray[np.float64]


class TrailView:
    """The paths of a body's markers through a run's poses."""

    def __init__(self, server: viser.ViserServer, body: BodyModel) -> None:
        self._body = body
        self._names = [marker.name for marker in body.markers]
        self._sides = marker_sides(body)
        self._extremities = extremity_markers(body)
        self._frames = np.zeros(0, dtype=np.int64)
        self._points = np.zeros((0, len(self._names), 3))
        self.handle = server.scene.add_line_segments(
            "/trails",
            np.zeros((1, 2, 3), dtype=np.float32),
            np.zeros((1, 2, 3), dtype=np.uint8),
            thickness=1.8,
            thickness_units="screen",
            visible=False,
        )

    def clear(self) -> None:
        """Forget all poses."""
        self._frames = np.zeros(0, dtype=np.int64)
        self._points = np.zeros((0, len(self._names), 3))

    def set_poses(self, frames: NDArray[np.int64], poses: Array) -> None:
        """Take a run's poses: frames (K,) ascending, poses (K, D). Only poses that are new are computed."""
        known = len(self._frames)
        grown = known <= len(frames) and np.array_equal(self._frames, frames[:known])
        if not grown or not self._names:
            known, self._points = 0, np.zeros((0, len(self._names), 3))
        if self._names and len(frames) > known:
            fresh = marker_points(self._body, np.ascontiguousarray(poses[known:]))
            self._points = np.concatenate([self._points, fresh])
        self._frames = np.asarray(frames, dtype=np.int64)

    def show(
        self,
        frame: int | None,
        markers: Sequence[str] | None,
        reach: int,
        tokens: ColourTokens,
        visible: bool = True,
    ) -> None:
        """Draw the paths of `markers` (None: the defaults) within `reach` frames of `frame` (0: all
        frames).
        """
        chosen = self._extremities if markers is None else tuple(markers)
        if not visible or frame is None or len(self._frames) < 2 or not self._names:
            self.handle.visible = False
            return
        span = (frame - reach, frame + reach) if reach else (int(self._frames[0]), int(self._frames[-1]))
        paths = {name: self._points[:, self._names.index(name)] for name in chosen if name in self._names}
        colours = {name: tokens[f"limb-{self._sides[name]}"] for name in paths}
        segments, tints = trail_segments(self._frames, paths, colours, span)
        self.handle.visible = len(segments) > 0
        if len(segments):
            if self.handle.points.shape != segments.shape:
                self.handle.colors = np.array(tokens["ghost"], dtype=np.uint8)
            self.handle.points = segments
            self.handle.colors = tints

    def remove(self) -> None:
        """Take the trails out of the scene."""
        self.handle.remove()


def extremity_markers(body: BodyModel) -> tuple[str, ...]:
    """The outermost marker towards each extremity: wrists, ankles, head, tips (hands and feet may carry none)."""
    last = {marker.joint: marker.name for marker in body.markers}
    found: dict[str, None] = {}
    for index in extremities(body):
        joint = body.drawn[index].joint
        while joint >= 0 and joint not in last:
            joint = body.joints[joint].parent
        if joint >= 0:
            found[last[joint]] = None
    return tuple(found)
