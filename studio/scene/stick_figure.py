"""Lines from marker points: the truth as a stick figure, and the segments of joint trails."""

from collections.abc import Mapping, Sequence

import numpy as np
import viser
from numpy.typing import NDArray

from studio.body.model import BodyModel
from studio.runs.colour_tokens import Colour, ColourTokens
from studio.runs.marker_lines import marker_links
from studio.scene.limb_meshes import METRES_PER_MM

Array = NDArray[np.float64]
Bytes = NDArray[np.uint8]


class TruthView:
    """The reference motion of a session at one moment: lines between its markers."""

    def __init__(
        self, server: viser.ViserServer, body: BodyModel, names: Sequence[str], tokens: ColourTokens
    ) -> None:
        self.links = marker_links(body, names)
        self.handle = server.scene.add_line_segments(
            "/truth",
            np.zeros((max(1, len(self.links)), 2, 3), dtype=np.float32),
            tokens["truth"],
            thickness=2.5,
            thickness_units="screen",
            visible=False,
        )

    def show(self, positions_mm: Array | None) -> None:
        """Draw the markers' positions (M, 3) mm; None hides them; a marker that is NaN takes its lines
        along.
        """
        if positions_mm is None or not self.links:
            self.handle.visible = False
            return
        segments = positions_mm[np.array(self.links)] * METRES_PER_MM
        seen = segments[np.isfinite(segments).all(axis=(1, 2))]
        self.handle.visible = len(seen) > 0
        if len(seen):
            self.handle.points = seen.astype(np.float32)

    def recolour(self, tokens: ColourTokens) -> None:
        """Take the colours of another theme."""
        self.handle.colors = np.array(tokens["truth"], dtype=np.uint8)

    def remove(self) -> None:
        """Take the outline out of the scene."""
        self.handle.remove()


def trail_segments(
    frames: NDArray[np.int64],
    points: Mapping[str, Array],
    colours: Mapping[str, Colour],
    span: tuple[int, int],
) -> tuple[NDArray[np.float32], Bytes]:
    """Segments (S, 2, 3) in metres and colours (S, 2, 3) of markers' paths.

    frames : (K,) ascending. points : marker name to (K, 3) mm. span : first and last frame to draw, both
    included. Frames that are missing in between leave a gap in the path instead of a straight line across
    it.
    """
    inside = (frames >= span[0]) & (frames <= span[1])
    joined = inside[:-1] & inside[1:] & (np.diff(frames) == 1)
    parts, tints = [], []
    for name, path in points.items():
        pairs = np.stack([path[:-1], path[1:]], axis=1)[joined] * METRES_PER_MM
        parts.append(pairs)
        tints.append(np.broadcast_to(np.array(colours[name], dtype=np.uint8), pairs.shape))
    if not parts:
        return np.zeros((0, 2, 3), dtype=np.float32), np.zeros((0, 2, 3), dtype=np.uint8)
    return np.concatenate(parts).astype(np.float32), np.concatenate(tints)
