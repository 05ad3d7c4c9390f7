"""The particle clouds: every layer's own particles through forward kinematics, as points at chosen limb ends.

Layers are coloured from cool (first) to warm (last), or particles by their weight within what is shown; one handle a
layer, so that showing one layer alone is a matter of visibility.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import viser

from studio.app.scene import METRES_PER_MM
from studio.app.scene.layer_journey import FAR_END, glow
from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.foundations.arrays import Array, Bytes
from studio.runs.drawing.colour_tokens import ColourTokens
from studio.search.trackers.tracker import LayerRecord

_DIMMEST, _BRIGHTEST = 0.6, 1.55
"""Between the background 0, the layer's colour 1 and the truth's 2: the lightest and the heaviest particle."""
MOST_DRAWN = 4000
"""Particles drawn of a layer; of larger sets every second, third, … (the store keeps 2000 by default)."""


@dataclass(frozen=True, slots=True)
class CloudStyle:
    """limbs : indices into the body's drawn limbs whose far ends are shown. colour_by : "layer" or "weight".
    layer : the only layer to show, None for all. layer_count : layers of a frame (colours). point_size :
    metres. glows : the layer's own colour is the brighter the more a particle weighs.
    """

    limbs: tuple[int, ...]
    colour_by: str
    layer: int | None
    layer_count: int
    point_size: float
    glows: bool = False


class ParticleView:
    """The clouds of one frame."""

    def __init__(self, server: viser.ViserServer, body: BodyModel) -> None:
        self._server, self._body = server, body
        self.handles: list[viser.PointCloudHandle] = []
        self._drawn: dict[int, tuple[LayerRecord, tuple[object, ...]]] = {}
        self._away = set[int]()
        keep_programs(server)

    def show(self, records: Sequence[LayerRecord], style: CloudStyle, tokens: ColourTokens) -> None:
        """Draw the layers' clouds; layers that are not in `records` vanish."""
        by_layer = {record.layer: record for record in records if len(record.poses)}
        weights = _weight_range(list(by_layer.values()), style.layer) if style.colour_by == "weight" else None
        look = (style.limbs, style.layer_count, style.point_size, tokens.name, weights, style.glows)
        for layer in range(len(self.handles), max(by_layer, default=-1) + 1):
            self.handles.append(self._add_cloud(layer))
        for layer, handle in enumerate(self.handles):
            record = by_layer.get(layer)
            is_shown = record is not None and style.layer in (None, layer) and bool(style.limbs)
            if handle.visible != is_shown:
                handle.visible = is_shown
            if record is None or not is_shown:
                continue
            # While a frame is searched every redraw shows all of its layers, and only the newest one is new.
            before = self._drawn.get(layer)
            is_known = before is not None and before[0] is record and before[1] == look
            if not is_known or (layer in self._away and not style.glows):
                self._away.discard(layer)
                self._drawn[layer] = (record, look)
                self._draw(handle, record, style, tokens, weights)

    def move(self, record: LayerRecord, points: Array) -> None:
        """Move a layer's points, (N * limbs, 3) metres, particle by particle: the cloud must be shown."""
        if record.layer >= len(self.handles) or not self.handles[record.layer].visible:
            return
        handle, stride = self.handles[record.layer], -(-len(record.poses) // MOST_DRAWN)
        if stride > 1:
            points = points.reshape(len(record.poses), -1, 3)[::stride].reshape(-1, 3)
        moved = points.astype(np.float32)
        if handle.points.shape == moved.shape and not np.array_equal(handle.points, moved):
            handle.points = moved
            self._away.add(record.layer)

    def _add_cloud(self, layer: int) -> viser.PointCloudHandle:
        return add_cloud(self._server, f"/particles/layer {layer}")

    def _draw(
        self,
        handle: viser.PointCloudHandle,
        record: LayerRecord,
        style: CloudStyle,
        tokens: ColourTokens,
        weights: tuple[float, float] | None,
    ) -> None:
        stride = -(-len(record.poses) // MOST_DRAWN)
        points = cloud_points(self._body, record.poses[::stride], style.limbs)
        if style.glows and style.colour_by == "layer":
            shades = glowing(tokens, record.layer, style.layer_count, glow(record)[::stride])
            colours = np.repeat(shades, len(style.limbs), axis=0)
        elif weights is None:
            colours = np.array(tokens.layer(record.layer, style.layer_count), dtype=np.uint8)
        else:
            shares = weight_shares(record.log_weights[::stride], *weights)
            colours = np.repeat(tokens.ramp(shares), len(style.limbs), axis=0)
        # A colour array of another length must never meet the old points: a single colour goes in between.
        if handle.points.shape != points.shape:
            handle.colors = np.array(tokens["ghost"], dtype=np.uint8)
        handle.points, handle.colors = points.astype(np.float32), colours
        handle.point_size = style.point_size


def add_cloud(server: viser.ViserServer, name: str) -> viser.PointCloudHandle:
    """A cloud that is not seen at first: all clouds are made alike, so that one program draws them."""
    return server.scene.add_point_cloud(
        name,
        np.zeros((1, 3), dtype=np.float32),
        (255, 255, 255),
        precision="float32",
        point_shape="circle",
        point_shading="flat",
        visible=False,
    )


def keep_programs(server: viser.ViserServer) -> None:
    """Two points under the floor that never change, in one colour and in one each.

    viser makes a new material whenever a cloud's points change. What draws it is compiled again then, unless another
    cloud is drawn by the same: for a browser without a card that takes longer than the picture.
    """
    hidden = np.array([[0.0, 0.0, -0.01]] * 2, dtype=np.float32)
    for name, shape in (("one", (3,)), ("each", (2, 3))):
        handle = add_cloud(server, f"/particles/kept {name}")
        handle.points, handle.colors, handle.point_size = hidden, np.zeros(shape, dtype=np.uint8), 1e-6
        handle.visible = True


def cloud_points(body: BodyModel, poses: Array, limbs: Sequence[int]) -> Array:
    """(N, D) poses to (N * len(limbs), 3) metres: the far end of each chosen limb, particle by particle."""
    ends = limb_ends(body, np.ascontiguousarray(poses, dtype=np.float64))[:, list(limbs), FAR_END]
    return ends.reshape(-1, 3) * METRES_PER_MM


def glowing(tokens: ColourTokens, layer: int, count: int, shares: Array) -> Bytes:
    """(N, 3) colours of particles that count for 0..1: from a dim shade of their layer's over it to the truth's."""
    stops = np.array(
        [tokens["scene-background"], tokens.layer(layer, count), tokens["truth"]], dtype=np.float64
    )
    place = _DIMMEST + (_BRIGHTEST - _DIMMEST) * shares
    channels = [np.interp(place, (0.0, 1.0, 2.0), stops[:, channel]) for channel in range(3)]
    return np.round(np.stack(channels, axis=-1)).astype(np.uint8)


def weight_shares(log_weights: Array, low: float, high: float) -> Array:
    """(N,) log-weights to 0..1 between the lowest and the highest shown; 1 where all are equal."""
    spread = high - low
    return np.ones_like(log_weights) if spread <= 0.0 else np.clip((log_weights - low) / spread, 0.0, 1.0)


def _weight_range(records: Sequence[LayerRecord], layer: int | None) -> tuple[float, float]:
    """The lowest and highest finite log-weight that is shown; 0 and 0 without any."""
    shown = [record.log_weights for record in records if layer in (None, record.layer)]
    finite = np.concatenate([np.zeros(0), *(values[np.isfinite(values)] for values in shown)])
    return (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
