"""Draws evidence and projected body onto a camera's picture (OpenCV; pictures are BGR).

Silhouettes are coloured as in the paper's figures: red observed only, blue projected only, yellow both;
violet where it cannot be told what is observed.
Everything is drawn for pictures resized by `scale`; pixel (0, 0) is the centre of the top-left pixel at
every scale.
"""

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.evidence.frame_evidence import ViewEvidence
from studio.foundations.arrays import Array, Bytes
from studio.runs.drawing.colour_tokens import Colour, ColourTokens

OVERLAYS = ("outline", "filled", "truth", "mask", "edges", "samples", "cost", "particles")

JPEG_QUALITY = 85
_SHIFT = 4
_MASK_SHARE = 0.5
_FILLED_SHARE = 0.45
_FULL = 255.0
_COST_LEVELS = 10
_HALO = (12, 12, 12)
_FARTHEST = 1.0e5


@dataclass(frozen=True, slots=True, eq=False)
class ViewMarks:
    """What to draw in one camera, in pixels of the stored picture; NaN where a point is behind the camera.

    contours : L closed polylines (K, 2), one a limb; empty for a limb that is not seen. sides : L times "left",
    "right" or "middle".
    edge_samples, region_samples : (K, 2). clouds : one (points (K, 2), colour) a layer, drawn in order.
    truth : (S, 2, 2) ends of the lines of the reference's stick figure. own : the token of all its own contours, "" for
    the colours of the limbs' sides. beside : other bodies, the contours of each with its token.
    """

    contours: tuple[Array, ...]
    sides: tuple[str, ...]
    edge_samples: Array
    region_samples: Array
    clouds: tuple[tuple[Array, Colour], ...] = ()
    truth: Array = field(default_factory=lambda: np.zeros((0, 2, 2)))
    own: str = ""
    beside: tuple[tuple[tuple[Array, ...], str], ...] = ()


NO_MARKS = ViewMarks((), (), np.zeros((0, 2)), np.zeros((0, 2)))


def draw_view(
    view: ViewEvidence, marks: ViewMarks, layers: tuple[str, ...], tokens: ColourTokens, *, scale: float = 1.0
) -> Bytes:
    """(h, w, 3) BGR: the view's picture with the chosen layers of `OVERLAYS` over it, from the ground up."""
    picture = _resized(_three_channels(view.picture), scale)
    if "mask" in layers:
        picture = _with_mask(picture, view, marks.contours, tokens, scale)
    if "edges" in layers:
        strength = _resized(view.edges, scale)[:, :, None].astype(np.float32) / 255.0
        tint = np.array(_bgr(tokens["edge-map"]), dtype=np.float32)
        picture = np.round(picture * (1.0 - strength) + tint * strength).astype(np.uint8)
    if "particles" in layers:
        for points, colour in marks.clouds:
            picture = _with_dots(picture, points, colour, scale, radius=0.9)
    if "filled" in layers:
        picture = _with_fillings(picture, marks, tokens, scale)
    if "outline" in layers:
        picture = _with_outlines(picture, marks, tokens, scale)
    if "truth" in layers:
        picture = _with_lines(picture, marks.truth, tokens["truth"], scale)
    if "samples" in layers:
        picture = _with_dots(picture, marks.region_samples, tokens["sample-region"], scale, radius=0.8)
        picture = _with_dots(picture, marks.edge_samples, tokens["sample-edge"], scale, radius=0.8)
    if "cost" in layers:
        for points, map_ in ((marks.region_samples, view.mask), (marks.edge_samples, view.edges)):
            picture = _with_costs(picture, points, map_, tokens, scale)
    return picture


def sample_costs(points: Array, map_: Bytes) -> Array:
    """(K,) what each sample point (K, 2) adds to the error: (1 − p)² of its nearest pixel of a map, 255 for p = 1
    (Deutscher & Reid 2005, Eq. 14, 15); 1 outside the map.
    """
    costs = np.ones(len(points))
    if not map_.size or not len(points):
        return costs
    pixels = np.round(np.nan_to_num(points, nan=-1.0)).astype(np.int64)
    inside = ((pixels >= 0) & (pixels < (map_.shape[1], map_.shape[0]))).all(axis=1)
    columns, rows = pixels[inside].T
    costs[inside] = (1.0 - map_[rows, columns] / _FULL) ** 2
    return costs


def projected_silhouette(contours: tuple[Array, ...], height: int, width: int, scale: float = 1.0) -> Bytes:
    """(h, w) uint8, 255 inside any limb's contour."""
    filled = np.zeros((height, width), dtype=np.uint8)
    for contour in contours:
        if _is_drawable(contour):
            cv2.fillPoly(filled, [_fixed_point(contour, scale)], (255,), shift=_SHIFT)
    return filled


def encode_jpeg(picture: Bytes) -> bytes:
    _, encoded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return encoded.tobytes()


def upright(picture: Bytes, quarter_turns: int) -> Bytes:
    """The picture turned clockwise by so many times 90 degrees."""
    return np.ascontiguousarray(np.rot90(picture, -quarter_turns))


def _three_channels(picture: Bytes) -> Bytes:
    return picture if picture.ndim == 3 else np.repeat(picture[:, :, None], 3, axis=2)


def _resized(picture: Bytes, scale: float) -> Bytes:
    if scale == 1.0:
        return picture.copy()
    size = (max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale)))
    method = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(picture, size, interpolation=method), dtype=np.uint8)


def _with_mask(
    picture: Bytes, view: ViewEvidence, contours: tuple[Array, ...], tokens: ColourTokens, scale: float
) -> Bytes:
    observed = _resized(view.mask, scale) > 127
    unknown = np.zeros_like(observed) if view.unknown is None else _resized(view.unknown, scale) > 127
    height, width = picture.shape[:2]
    projected = projected_silhouette(contours, height, width, scale) > 0
    tint = picture.astype(np.float32)
    for region, token in (
        (observed & ~projected, "silhouette-observed"),
        (projected & ~observed & ~unknown, "silhouette-projected"),
        (observed & projected, "silhouette-both"),
        (unknown & ~observed, "silhouette-unknown"),
    ):
        tint[region] = (1.0 - _MASK_SHARE) * tint[region] + _MASK_SHARE * np.array(_bgr(tokens[token]))
    return np.round(tint).astype(np.uint8)


def _bodies(marks: ViewMarks) -> list[tuple[Array, str]]:
    """The contours of all bodies, each with its token."""
    names = [marks.own or f"limb-{side}" for side in marks.sides]
    others = [(contour, token) for contours, token in marks.beside for contour in contours]
    return [*zip(marks.contours, names, strict=True), *others]


def _with_fillings(picture: Bytes, marks: ViewMarks, tokens: ColourTokens, scale: float) -> Bytes:
    filled = picture.copy()
    for contour, name in _bodies(marks):
        if _is_drawable(contour):
            cv2.fillPoly(filled, [_fixed_point(contour, scale)], _bgr(tokens[name]), cv2.LINE_AA, _SHIFT)
    return np.asarray(
        cv2.addWeighted(filled, _FILLED_SHARE, picture, 1.0 - _FILLED_SHARE, 0.0), dtype=np.uint8
    )


def _with_costs(picture: Bytes, points: Array, map_: Bytes, tokens: ColourTokens, scale: float) -> Bytes:
    """Sample points by what they cost, cheap ones below dear ones."""
    if not map_.size:
        return picture
    shares = sample_costs(points, map_)
    levels = np.minimum((shares * _COST_LEVELS).astype(np.int64), _COST_LEVELS - 1)
    for level in range(_COST_LEVELS):
        colour = tokens.layer(level, _COST_LEVELS)
        picture = _with_dots(picture, points[levels == level], colour, scale, radius=1.1)
    return picture


def _with_outlines(picture: Bytes, marks: ViewMarks, tokens: ColourTokens, scale: float) -> Bytes:
    thin = max(1, round(1.2 * scale))
    # Its own body is drawn last, others with a broader line: all are seen where they lie on one another.
    own, others = _bodies(marks)[: len(marks.contours)], _bodies(marks)[len(marks.contours) :]
    broad = thin + 2 if others else thin
    for colours, drawn, thickness in (
        (None, others + own, broad + 2),
        (tokens, others, broad),
        (tokens, own, thin),
    ):
        for contour, name in drawn:
            if not _is_drawable(contour):
                continue
            colour = _HALO if colours is None else _bgr(colours[name])
            pixels = _fixed_point(contour, scale)
            cv2.polylines(picture, [pixels], True, colour, thickness, cv2.LINE_AA, _SHIFT)
    return picture


def _with_lines(picture: Bytes, lines: Array, colour: Colour, scale: float) -> Bytes:
    thin = max(1, round(1.2 * scale))
    for shade, thickness in ((_HALO, thin + 2), (_bgr(colour), thin)):
        for ends in lines:
            if not _is_drawable(ends):
                continue
            pixels = _fixed_point(ends, scale)
            cv2.polylines(picture, [pixels], False, shade, thickness, cv2.LINE_AA, _SHIFT)
    return picture


def _with_dots(picture: Bytes, points: Array, colour: Colour, scale: float, *, radius: float) -> Bytes:
    """Small discs, all at once: there may be ten thousand particles in a picture."""
    # A point behind the camera is NaN, which compares false.
    near = points[(np.abs(points) < _FARTHEST).all(axis=1)]
    reach = max(1, round(radius * scale))
    around = np.mgrid[-reach : reach + 1, -reach : reach + 1].reshape(2, -1).T[:, ::-1]
    disc = around[(around**2).sum(axis=1) <= reach * reach]
    pixels = np.round((near + 0.5) * scale - 0.5).astype(np.int64)
    columns, rows = (pixels[:, None] + disc).reshape(-1, 2).T
    inside = (columns >= 0) & (rows >= 0) & (columns < picture.shape[1]) & (rows < picture.shape[0])
    picture[rows[inside], columns[inside]] = _bgr(colour)
    return picture


def _is_drawable(points: Array) -> bool:
    """Whether there are points, all in front of the camera and near enough to be drawn (NaN is not)."""
    return len(points) > 0 and bool((np.abs(points) < _FARTHEST).all())


def _fixed_point(points: Array, scale: float) -> NDArray[np.int32]:
    """Pixels of the stored picture to OpenCV's fixed-point pixels of the resized one."""
    return np.round(((points + 0.5) * scale - 0.5) * (1 << _SHIFT)).astype(np.int32)


def _bgr(colour: Colour) -> Colour:
    red, green, blue = colour
    return blue, green, red
