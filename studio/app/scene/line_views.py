"""Lines in the scene: the truth as a stick figure, and the paths of markers over the frames of a run."""

from collections.abc import Mapping, Sequence

import numpy as np
import viser
from numpy.typing import NDArray

from studio.app.scene import METRES_PER_MM
from studio.body.forward_kinematics import marker_points
from studio.body.model import BodyModel
from studio.foundations.arrays import Array, Bytes
from studio.runs.drawing.colour_tokens import Colour, ColourTokens
from studio.runs.drawing.marker_lines import marker_links, marker_sides


class LinesView:
    """Line segments, as thick on screen wherever they are."""

    def __init__(self, server: viser.ViserServer, name: str, thickness: float) -> None:
        self.handle = server.scene.add_line_segments(
            name,
            np.zeros((1, 2, 3), dtype=np.float32),
            np.zeros((1, 2, 3), dtype=np.uint8),
            thickness=thickness,
            thickness_units="screen",
            visible=False,
        )
        self._colours: Bytes | None = None

    def draw(self, segments: Array, colours: Bytes) -> None:
        """Draw segments (S, 2, 3) in metres in colours (3,) or (S, 2, 3); none hides them."""
        self.handle.visible = len(segments) > 0
        if not len(segments):
            return
        is_longer = self.handle.points.shape != segments.shape
        # A colour array of another length must never meet the old points: a single colour goes in between.
        if is_longer:
            self.handle.colors = np.zeros(3, dtype=np.uint8)
        self.handle.points = segments.astype(np.float32)
        # What only moves keeps its colours: they are not compared again.
        if is_longer or colours is not self._colours:
            self.handle.colors = self._colours = colours


class TruthView(LinesView):
    """The reference motion of a session at one moment. names : of its markers."""

    def __init__(self, server: viser.ViserServer, body: BodyModel, names: Sequence[str]) -> None:
        super().__init__(server, "/truth", 2.5)
        self.links = np.array(marker_links(body, names), dtype=np.int64).reshape(-1, 2)

    def show(self, positions_mm: Array | None, tokens: ColourTokens) -> None:
        """Join the markers (M, 3) mm; None hides them; a marker that is NaN hides its lines."""
        points = np.zeros((0, 3)) if positions_mm is None else positions_mm * METRES_PER_MM
        segments = points[self.links] if len(points) else np.zeros((0, 2, 3))
        seen = segments[np.isfinite(segments).all(axis=(1, 2))]
        self.draw(seen, np.array(tokens["truth"], dtype=np.uint8))


class TrailView(LinesView):
    """The paths of a body's markers through a run's poses."""

    def __init__(self, server: viser.ViserServer, body: BodyModel) -> None:
        super().__init__(server, "/trails", 1.8)
        self._body = body
        self._names = [marker.name for marker in body.markers]
        self._sides = marker_sides(body)
        self.set_poses(np.zeros(0, dtype=np.int64), np.zeros((0, len(body.parameters))))

    def set_poses(self, frames: NDArray[np.int64], poses: Array) -> None:
        """Take a run's poses: frames (K,) ascending, poses (K, D). Only poses that are new are computed."""
        known = len(getattr(self, "_frames", ()))
        if not known or not np.array_equal(self._poses, poses[:known]):
            known, self._points = 0, np.zeros((0, len(self._names), 3))
        if self._names and len(frames) > known:
            fresh = marker_points(self._body, np.ascontiguousarray(poses[known:]))
            self._points = np.concatenate([self._points, fresh])
        self._frames, self._poses = np.asarray(frames, dtype=np.int64), poses

    def show(self, frame: int | None, markers: Sequence[str], reach: int, tokens: ColourTokens) -> None:
        """Draw the paths of `markers` within `reach` frames of `frame` (0: all frames); none hides them."""
        chosen = [name for name in markers if name in self._names]
        if frame is None or len(self._frames) < 2 or not chosen:
            self.handle.visible = False
            return
        span = (frame - reach, frame + reach) if reach else (int(self._frames[0]), int(self._frames[-1]))
        paths = {name: self._points[:, self._names.index(name)] for name in chosen}
        colours = {name: tokens[f"limb-{self._sides[name]}"] for name in chosen}
        self.draw(*trail_segments(self._frames, paths, colours, span))


def trail_segments(
    frames: NDArray[np.int64],
    points: Mapping[str, Array],
    colours: Mapping[str, Colour],
    span: tuple[int, int],
) -> tuple[Array, Bytes]:
    """Segments (S, 2, 3) in metres and colours (S, 2, 3) of markers' paths.

    frames : (K,) ascending. points : marker name to (K, 3) mm. span : first and last frame to draw, both included.
    Frames that are missing in between leave a gap in the path instead of a straight line across it.
    """
    inside = (frames >= span[0]) & (frames <= span[1])
    joined = inside[:-1] & inside[1:] & (np.diff(frames) == 1)
    segments = [np.stack([path[:-1], path[1:]], axis=1)[joined] * METRES_PER_MM for path in points.values()]
    tints = [np.full((joined.sum(), 2, 3), colours[name], dtype=np.uint8) for name in points]
    return np.concatenate(segments), np.concatenate(tints)
