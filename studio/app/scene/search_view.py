"""What is drawn about the layer that is looked at: the layers before it, the dead, the heaviest, the ways they came.

Each is one object of the browser's, so that while layers are played nothing but places is sent: the cloud's own, the
stick figures', and four shades of the dead.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import viser
from numpy.typing import NDArray

from studio.app.scene.layer_journey import FAR_END, Journey, Journeys, glow, lines_back, travelled
from studio.app.scene.line_views import LinesView
from studio.app.scene.particle_view import ParticleView, add_cloud
from studio.app.scene.viewpoint import Eye, on_screen
from studio.body.model import BodyModel
from studio.foundations.arrays import Array, Bytes, Indices
from studio.runs.drawing.colour_tokens import ColourTokens
from studio.search.trackers.tracker import NO_PARENT, LayerRecord

HEAVIEST = 20
"""Particles that are drawn as stick figures."""
MOST_SHELL, MOST_LINES = 60, 150
"""Particles drawn of each earlier layer, and those whose ways are."""
SHELL_SIZE, DEAD_SIZE = 0.5, 0.5
"""Widths of points beside the shown layer's."""
FADES = 4
_SKELETON, _WAYS, _LINEAGE = 1.0, 1.0, 3.0
"""Pixels."""
GHOSTLY = 0.65
"""How much of its layer's colour a stick figure keeps beside the background: many lie over each other."""
_FAINT = 0.25
"""How much of its own colour the lightest particle's way keeps beside the background."""


@dataclass(frozen=True, slots=True)
class SearchLook:
    """What is to be drawn. limbs : indices of the drawn limbs whose far ends carry particles. count : layers of the
    frame. size : metres. particle : a row of the layer's cloud whose line is drawn. limb : indices of the limbs whose
    particles' ways are drawn.
    """

    limbs: tuple[int, ...]
    count: int
    size: float
    shells: bool
    skeletons: bool
    particle: int | None
    limb: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Pointed:
    """A particle of the layer that is looked at.

    particle : its row in the layer's cloud.
    particles : of the layer.
    log_weight : raw.
    weight : its share of all weights at the layer's β.
    line : rows in each layer's cloud that it comes from by first parents, from the first layer of its search to itself.
    """

    layer: int
    particle: int
    particles: int
    log_weight: float
    weight: float
    line: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Drawing:
    """What is drawn of a layer, made once while its frame is looked at.

    key : what it was made from. heaviest : (K,) rows of the stick figures; colours : (K * limbs, 2, 3) theirs.
    shells, shades : points (P, 3) and colours (P, 3) of the earlier layers.
    """

    key: tuple[object, ...]
    record: LayerRecord
    journey: Journey
    look: SearchLook
    tokens: ColourTokens
    heaviest: Indices
    colours: Bytes
    shells: NDArray[np.float32]
    shades: Bytes


class SearchView:
    """Beside the cloud of one layer, all else about it. cloud : draws the layer's own points."""

    def __init__(self, server: viser.ViserServer, body: BodyModel, cloud: ParticleView) -> None:
        self._cloud, self._journeys = cloud, Journeys(body)
        self.shells = add_cloud(server, "/search/shells")
        self.dead = add_cloud(server, "/search/dead")
        self.skeletons = LinesView(server, "/search/heaviest", _SKELETON)
        self.ways = LinesView(server, "/search/ways", _WAYS)
        self.lineage = LinesView(server, "/search/lineage", _LINEAGE)
        self._shown: _Drawing | None = None
        self._made: dict[int, _Drawing] = {}
        self._fade: tuple[object, ...] = ()
        self._upto: Sequence[LayerRecord] = ()
        self._phase = 1.0

    def show(
        self,
        records: Sequence[LayerRecord],
        layer: int | None,
        look: SearchLook,
        tokens: ColourTokens,
        phase: float = 1.0,
    ) -> None:
        """Draw what belongs to a layer of a frame's (None, or one that is not there: nothing)."""
        upto = [
            record for record in records if len(record.poses) and layer is not None and record.layer <= layer
        ]
        if not upto or upto[-1].layer != layer:
            self.hide()
            return
        record = upto[-1]
        key = (record, len(upto), upto[0], look, tokens.name)
        made = self._made.get(record.layer)
        if made is None or made.key != key:
            made = self._made[record.layer] = self._drawing(key, upto, look, tokens)
        if made is not self._shown:
            self._shown, self._upto = made, upto
            self._draw_shells(made)
            self._draw_ways(upto, look, tokens)
            self._fade = ()
        self.travel(phase)

    def _drawing(
        self, key: tuple[object, ...], upto: Sequence[LayerRecord], look: SearchLook, tokens: ColourTokens
    ) -> _Drawing:
        record = upto[-1]
        journey = self._journeys.to(record, upto[-2] if len(upto) > 1 else None)
        heaviest = np.argsort(-glow(record), kind="stable")[:HEAVIEST]
        ghostly = np.array(
            mixed(tokens.layer(record.layer, look.count), tokens["scene-background"], GHOSTLY), dtype=np.uint8
        )
        colours = np.tile(ghostly, (len(heaviest) * journey.end.shape[1], 2, 1))
        shells = self._shells(upto[:-1] if look.shells and look.limbs else [], look, tokens)
        return _Drawing(key, record, journey, look, tokens, heaviest, colours, *shells)

    def hide(self) -> None:
        self._shown = None
        self._made.clear()
        for view in (self.skeletons, self.ways, self.lineage):
            view.handle.visible = False
        self.shells.visible = self.dead.visible = False

    def travel(self, phase: float) -> None:
        """Move the particles to where they are after a share of the layer's time."""
        if self._shown is None:
            return
        shown, look = self._shown, self._shown.look
        self._phase = phase
        places = shown.journey.at(travelled(phase))
        self._cloud.move(shown.record, places[:, list(look.limbs), FAR_END].reshape(-1, 3))
        self._draw_dead(shown.record.layer, shown.journey, look, shown.tokens, phase)
        if look.skeletons:
            self.skeletons.draw(places[shown.heaviest].reshape(-1, 2, 3), shown.colours)
        else:
            self.skeletons.handle.visible = False

    def pointed(
        self, at: tuple[float, float], eye: Eye, lens: tuple[float, float], reach: float
    ) -> Pointed | None:
        """The particle whose drawn point is nearest to `at` (shares of the view) within `reach` (of its height), None
        where there is none. lens : field of view and width over height.
        """
        if self._shown is None or not self._shown.look.limbs:
            return None
        record, look = self._shown.record, self._shown.look
        places = self._shown.journey.at(travelled(self._phase))[:, list(look.limbs), FAR_END]
        seen = on_screen(places.reshape(-1, 3), eye, *lens)
        away = np.hypot((seen[:, 0] - at[0]) * lens[1], seen[:, 1] - at[1])
        away[seen[:, 2] <= 0.0] = np.inf
        nearest = int(np.argmin(away))
        if not away[nearest] <= reach:
            return None
        row, weights = nearest // len(look.limbs), glow(record)
        line = tuple(int(rows[row]) for rows in lines_back(self._upto))
        return Pointed(
            record.layer,
            row,
            len(record.poses),
            float(record.log_weights[row]),
            float(weights[row] / max(float(weights.sum()), 1e-300)),
            line[max((at + 1 for at, one in enumerate(line) if one == NO_PARENT), default=0) :],
        )

    def _draw_dead(
        self, layer: int, journey: Journey, look: SearchLook, tokens: ColourTokens, phase: float
    ) -> None:
        """Those of the layer before that left nothing fade from its colour over grey into the background."""
        self.dead.visible = phase < 1.0 and len(journey.dead) > 0 and bool(look.limbs)
        step = int(phase * FADES)
        if not self.dead.visible or self._fade == (journey, step):
            return
        if not self._fade or self._fade[0] is not journey:
            self.dead.points = _far_ends(journey.dead, look.limbs)
            self.dead.point_size = look.size * DEAD_SIZE
        share, own = step / FADES, tokens.layer(layer - 1, look.count)
        grey, back = tokens["ghost"], tokens["scene-background"]
        colour = mixed(grey, own, 2.0 * share) if share < 0.5 else mixed(back, grey, 0.3 + share - 0.5)
        self.dead.colors = np.array(colour, dtype=np.uint8)
        self._fade = journey, step

    def _shells(
        self, earlier: Sequence[LayerRecord], look: SearchLook, tokens: ColourTokens
    ) -> tuple[NDArray[np.float32], Bytes]:
        """The clouds of earlier layers, thinned, each in its layer's colour."""
        points, shades = [np.zeros((0, 3), np.float32)], [np.zeros((0, 3), np.uint8)]
        for record in earlier:
            stride = -(-len(record.poses) // MOST_SHELL)
            ends = _far_ends(self._journeys.places(record)[::stride], look.limbs)
            colour = mixed(tokens.layer(record.layer, look.count), tokens["scene-background"], 0.75)
            points.append(ends)
            shades.append(np.tile(np.array(colour, dtype=np.uint8), (len(ends), 1)))
        return np.concatenate(points), np.concatenate(shades)

    def _draw_shells(self, made: _Drawing) -> None:
        self.shells.visible = len(made.shells) > 0
        if self.shells.visible:
            _place_points(self.shells, made.shells, made.shades, made.tokens)
            self.shells.point_size = made.look.size * SHELL_SIZE

    def _draw_ways(self, upto: Sequence[LayerRecord], look: SearchLook, tokens: ColourTokens) -> None:
        """The ways of one limb's particles, and the line of one particle at all limbs that carry particles."""
        lines = lines_back(upto)
        stride = -(-len(upto[-1].poses) // MOST_LINES)
        rows = np.arange(0, len(upto[-1].poses), stride)
        strength = _FAINT + (1.0 - _FAINT) * glow(upto[-1])
        self._draw_lines(
            self.ways, upto, [line[rows] for line in lines], look.limb, look, tokens, strength[rows]
        )
        chosen = look.particle
        has = chosen is not None and chosen < len(upto[-1].poses)
        row = np.array([chosen] if has else [], dtype=np.int64)
        self._draw_lines(self.lineage, upto, [line[row] for line in lines], look.limbs, look, tokens, None)

    def _draw_lines(
        self,
        view: LinesView,
        upto: Sequence[LayerRecord],
        lines: Sequence[Indices],
        limbs: tuple[int, ...],
        look: SearchLook,
        tokens: ColourTokens,
        strength: Array | None,
    ) -> None:
        """Join the places of lines of particles layer by layer, in the colour of the layer that each part leads to;
        strength : (K,) 0..1 how clearly each is drawn, None: fully, and from the truth's colour on.
        """
        segments, colours = list[Array](), list[Bytes]()
        for at in range(1, len(upto) if limbs and len(lines[0]) else 0):
            known = (lines[at - 1] != NO_PARENT) & (lines[at] != NO_PARENT)
            ends = [
                self._journeys.places(upto[on])[lines[on][known]][:, list(limbs), FAR_END]
                for on in (at - 1, at)
            ]
            segments.append(np.stack(ends, axis=2).reshape(-1, 2, 3))
            own = np.array(
                [tokens.layer(upto[on].layer, look.count) for on in (at - 1, at)], dtype=np.float64
            )
            if strength is None:
                own = 0.5 * own + 0.5 * np.array(tokens["truth"], dtype=np.float64)
                shades = np.broadcast_to(own, (len(segments[-1]), 2, 3))
            else:
                clear = np.repeat(strength[known], len(limbs))[:, None, None]
                shades = clear * own + (1.0 - clear) * np.array(tokens["scene-background"], dtype=np.float64)
            colours.append(np.round(shades).astype(np.uint8))
        if segments:
            view.draw(np.concatenate(segments), np.concatenate(colours))
        else:
            view.handle.visible = False


def mixed(colour: tuple[int, int, int], other: tuple[int, int, int], share: float) -> tuple[int, int, int]:
    """A share of one colour and the rest of another."""
    red, green, blue = (
        round(share * one + (1.0 - share) * two) for one, two in zip(colour, other, strict=True)
    )
    return red, green, blue


def _far_ends(places: Array, limbs: tuple[int, ...]) -> NDArray[np.float32]:
    return places[:, list(limbs), FAR_END].reshape(-1, 3).astype(np.float32)


def _place_points(
    handle: viser.PointCloudHandle, points: NDArray[np.float32], colours: Bytes, tokens: ColourTokens
) -> None:
    # A colour array of another length must never meet the old points: a single colour goes in between.
    if handle.points.shape != points.shape:
        handle.colors = np.array(tokens["ghost"], dtype=np.uint8)
    handle.points, handle.colors = points, colours
