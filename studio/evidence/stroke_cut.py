"""A subject of any kind cut out of one camera's pictures: brush strokes in one of them, carried through the others.

A picture is cut by a graph cut (Boykov & Jolly 2001; OpenCV's, which Rother et al. 2004's GrabCut is made of) of
log-odds of two kinds. *Colour*: how probable a pixel's colour is in the subject against what lies behind it. That is
the background's own colour at this place where an earlier picture showed it (cameras stand still), with its shadow;
else that of all that is outside. *Place*: in the first picture the strokes' nearness, then the last mask, moved by
optical flow, and the model's projection where a run has tracked it. What is cut is reduced until the subject is about
`SUBJECT_SIDE` pixels long; the border is then refined at full resolution by the guided filter.

What is known of the subject after a picture is a function of pictures, strokes and masks up to there: with kept masks
`learn` alone brings a `StrokeCut` to where it was, so that strokes in a later picture change nothing before it.
"""

import copy
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.evidence.guided_filter import guided
from studio.evidence.strokes import Stroke, painted
from studio.foundations.arrays import Bytes, Floats
from studio.foundations.errors import FootageError

SUBJECT_SIDE, COARSE_SIDE = 240.0, 320.0
"""Pixels: the subject's longer side in what is cut, and the picture's where it is not known yet."""
AS_IT_IS = 1.25
"""Factor up to which pictures are not reduced at all."""
ROUNDS = 3
"""In which the colours of a first mask are learnt again."""
MARGIN = 0.25
"""Around the last mask, as a share of its longer side: where the subject may be in the next picture."""
BINS = 32
"""Of each of a colour's three coordinates."""
LUMA_STEP, CHROMA_STEP = 8.0, 4.0
"""Grey levels in a bin."""
STRAY = 0.05
"""Share of pixels of any colour."""
STROKED = 0.6
"""Share of the strokes' own colours in what is learnt from a first picture."""
MOST_COLOUR = 4.0
"""Of the colour's log-odds."""
NEARNESS = 2.0
"""Log-odds of place on a stroke of the first picture."""
PLACE_SLOPE, MOST_INSIDE, MOST_OUTSIDE = 0.5, 2.5, 6.0
"""Log-odds of place per pixel from the expected border, and their limits."""
SHADOW, SHADOW_SHARE = 0.55, 0.25
"""Least share of the background's brightness in a shadow, and the share of pixels in one."""
NOISE = (3.0, 12.0)
"""Grey levels: limits of the camera's noise."""
RECENT = 0.35
"""Weight of the last picture's colours beside those of pictures with strokes."""
SETTLING = 12
"""Pictures after which what the background was counts for a third."""
OFF_MASK = 4
"""Pixels from the mask from which a picture shows the background."""
DATA_WEIGHT, LARGEST = 9.0, 10.0
"""Of log-odds against OpenCV's fixed weight of borders (50), and the largest log-odds."""
REFINED = 2.0
"""Radius of the guided filter in pixels of what was cut."""
LEAST_PIECE = 0.02
"""Of the mask: smaller pieces are dropped."""
LEAST_HOLE = 0.25
"""Of a least piece: smaller holes are filled."""


class StrokeCut:
    """One camera's subject, from picture to picture: `begin` once, then `cut` and `learn` each."""

    def __init__(self) -> None:
        self._factor = 1.0
        self._keys: list[tuple[Floats, Floats]] = []
        self._recent: tuple[Floats, Floats] | None = None
        self._grey: Bytes | None = None
        self._mask: Bytes | None = None
        self._mean: Floats | None = None
        self._known: NDArray[np.bool_] | None = None
        self._noise = NOISE[0]
        self._last: tuple[Bytes, Bytes] | None = None

    def copy(self) -> "StrokeCut":
        """A copy that continues from here independently."""
        self._last = None
        return copy.deepcopy(self)

    def begin(self, picture: Bytes, strokes: Sequence[Stroke]) -> Bytes:
        """(H, W) uint8, 0 or 255: the mask of the first picture (H, W, 3) BGR, by its strokes, which is then learnt.

        Raises FootageError where no stroke is inside.
        """
        if not any(stroke.kind == "inside" for stroke in strokes):
            raise FootageError("No stroke is inside the subject.", "Paint over a part of it first.")
        height, width = picture.shape[:2]
        factor = max(1.0, max(height, width) / COARSE_SIDE)
        small = _reduced(picture, factor)
        full = painted(strokes, (width, height))
        stroked = _stroked_colours(picture, full)
        mask = _first_mask(small, _reduced_marks(full, small.shape[1::-1]), stroked, None)
        left, top, right, bottom = _box(mask)
        side = max(right - left, bottom - top) * factor / SUBJECT_SIDE
        self._factor = side if side > AS_IT_IS else 1.0
        small = self._small(picture)
        size = small.shape[1::-1]
        coarse = np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_LINEAR)) > 127
        place = _grown(_box(np.where(coarse, np.uint8(255), np.uint8(0))), size)
        part = np.s_[place[1] : place[3], place[0] : place[2]]
        fine = np.zeros(size[::-1], np.uint8)
        marks = _reduced_marks(full, size)
        fine[part] = _first_mask(small[part], marks[part], stroked, coarse[part])
        out = self._refined(picture, fine, strokes)
        self.learn(picture, out, True)
        return out

    def cut(self, picture: Bytes, strokes: Sequence[Stroke] = (), expected: Bytes | None = None) -> Bytes:
        """(H, W) uint8, 0 or 255: the mask of the next picture. strokes : in it. expected : (H, W) where the subject
        is by a model's projection, 0 or 255.
        """
        small = self._small(picture)
        size = small.shape[1::-1]
        grey = np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2GRAY), np.uint8)
        marks = _reduced_marks(painted(strokes, picture.shape[1::-1]), size)
        assert self._mask is not None
        assert self._grey is not None
        known = self._mask if expected is None else self._mask | _reduced_mask(expected, size)
        if marks.any():
            known = known | np.where(marks == 1, np.uint8(255), np.uint8(0))
        place = (0, 0, *size) if not known.any() else _grown(_box(known), size)
        part = np.s_[place[1] : place[3], place[0] : place[2]]
        moved = _flow_mask(self._mask[part], self._grey[part], grey[part])
        odds = _of_place(moved)
        if expected is not None:
            projected = _reduced_mask(expected, size)[part]
            odds, moved = 0.5 * (odds + _of_place(projected)), moved | projected
        odds = odds + self._of_colour(small[part], part)
        out = np.zeros(size[::-1], np.uint8)
        foreground = _graph_cut(small[part], odds, marks[part])
        out[part] = _connect(foreground, moved, marks[part])
        return self._refined(picture, out, strokes)

    def learn(self, picture: Bytes, mask: Bytes, is_key: bool) -> None:
        """Learn a picture whose mask (H, W) is decided. is_key : whether it has strokes: its colours count for good."""
        small = self._small(picture)
        size = small.shape[1::-1]
        reduced = _reduced_mask(mask, size)
        if reduced.any():
            place = _grown(_box(reduced), size)
            part = np.s_[place[1] : place[3], place[0] : place[2]]
            colours = _histograms(_cells(small[part]), reduced[part])
            self._recent = colours
            if is_key:
                self._keys.append(colours)
        self._remember(small, reduced)
        self._grey = np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2GRAY), np.uint8)
        self._mask = reduced

    def _small(self, picture: Bytes) -> Bytes:
        """The picture as it is cut; the last one is kept, for it is learnt after it was cut."""
        if self._last is None or self._last[0] is not picture:
            self._last = picture, _reduced(picture, self._factor)
        return self._last[1]

    def _remember(self, small: Bytes, mask: Bytes) -> None:
        """Take up what a picture shows of the background."""
        reach = 2 * OFF_MASK + 1
        free = np.asarray(cv2.dilate(mask, np.ones((reach, reach), np.uint8))) == 0
        seen = np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2YCrCb), np.uint8)
        if self._mean is None or self._known is None:
            self._mean, self._known = seen.astype(np.float32), free
            return
        both = (free & self._known)[::4, ::4]
        if both.any():
            away = np.abs(seen[::4, ::4, 0] - self._mean[::4, ::4, 0])[both]
            self._noise = float(np.clip(1.5 * np.median(away), *NOISE))
        cv2.accumulateWeighted(seen, self._mean, 1.0 / SETTLING, (free & self._known).view(np.uint8))
        np.copyto(self._mean, seen, where=(free & ~self._known)[..., None])
        self._known |= free

    def _of_colour(self, part: Bytes, where: tuple[slice, slice]) -> Floats:
        """(h, w) log-odds of the colours of a part of the picture."""
        assert self._recent is not None
        assert self._mean is not None
        assert self._known is not None
        inside, outside = (
            (sum(pair[k] for pair in self._keys) / len(self._keys) + RECENT * self._recent[k])
            / (1.0 + RECENT)
            for k in (0, 1)
        )
        cells = _cells(part)
        of_subject = (1.0 - STRAY) * inside.ravel()[cells] + STRAY / BINS**3
        anything = (1.0 - STRAY) * outside.ravel()[cells] + STRAY / BINS**3
        seen = np.asarray(cv2.cvtColor(part, cv2.COLOR_BGR2YCrCb), np.float32)
        mean, known = self._mean[where], self._known[where]
        # A histogram's bins blur as much: both densities have one resolution.
        luma, chroma = np.hypot(self._noise, 0.8 * LUMA_STEP), np.hypot(0.6 * self._noise, 0.8 * CHROMA_STEP)
        ratio = np.clip(seen[..., 0] / np.maximum(mean[..., 0], 1.0), SHADOW, 1.0)
        off_luma = (seen[..., 0] - mean[..., 0]) / luma
        off_chroma = (seen[..., 1:] - mean[..., 1:]) / chroma
        shaded_luma = (seen[..., 0] - ratio * mean[..., 0]) / luma
        shaded_chroma = (seen[..., 1:] - 128.0 - ratio[..., None] * (mean[..., 1:] - 128.0)) / chroma
        room = LUMA_STEP * CHROMA_STEP**2 / (2.0 * np.pi * chroma**2)
        itself = np.exp(-0.5 * (off_luma**2 + (off_chroma**2).sum(-1))) * room / (np.sqrt(2.0 * np.pi) * luma)
        wide = np.maximum((1.0 - SHADOW) * mean[..., 0], 2.5 * luma)
        shadow = np.exp(-0.5 * (shaded_luma**2 + (shaded_chroma**2).sum(-1))) * room / wide
        behind = (1.0 - STRAY - SHADOW_SHARE) * itself + SHADOW_SHARE * shadow + STRAY * anything
        odds = np.log(of_subject) - np.log(np.where(known, behind, anything))
        return np.clip(odds, -MOST_COLOUR, MOST_COLOUR).astype(np.float32)

    def _refined(self, picture: Bytes, small: Bytes, strokes: Sequence[Stroke]) -> Bytes:
        """A mask of the size that is cut, at the picture's own, its border where the picture's colours change."""
        height, width = picture.shape[:2]
        out = np.zeros((height, width), np.uint8)
        if not small.any():
            return out
        if self._factor > 1.0:
            radius = REFINED * self._factor
            share = cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
            reach = round(3.0 * radius)
            left, top, right, bottom = _grown(_box(np.asarray(share, np.uint8)), (width, height), reach)
            part = np.s_[top:bottom, left:right]
            level = np.asarray(share[part], np.float32) / np.float32(255.0)
            out[part] = np.where(guided(picture[part], level, radius) > 0.5, np.uint8(255), np.uint8(0))
        else:
            out[:] = small
        marks = painted(strokes, (width, height))
        out[marks == 1], out[marks == 2] = 255, 0
        return out


def _reduced(picture: Bytes, factor: float) -> Bytes:
    if factor <= 1.0:
        return np.ascontiguousarray(picture)
    size = max(2, round(picture.shape[1] / factor)), max(2, round(picture.shape[0] / factor))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)


def _reduced_mask(mask: Bytes, size: tuple[int, int]) -> Bytes:
    if mask.shape[::-1] == size:
        return mask
    share = np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_AREA))
    return np.where(share > 127, np.uint8(255), np.uint8(0))


def _box(mask: Bytes) -> tuple[int, int, int, int]:
    """Left, top, right, bottom (exclusive) of what is not 0; of all where nothing is."""
    left, top, width, height = cv2.boundingRect((mask > 0).astype(np.uint8))
    if not width:
        return 0, 0, mask.shape[1], mask.shape[0]
    return left, top, left + width, top + height


def _grown(
    box: tuple[int, int, int, int], size: tuple[int, int], reach: int | None = None
) -> tuple[int, int, int, int]:
    left, top, right, bottom = box
    by = max(16, round(MARGIN * max(right - left, bottom - top))) if reach is None else reach
    return max(0, left - by), max(0, top - by), min(size[0], right + by), min(size[1], bottom + by)


def _stroked_colours(picture: Bytes, marks: Bytes) -> tuple[Floats | None, Floats | None]:
    """Shares of the colours under the strokes inside, and under those outside; None without any."""
    chosen = [marks == value for value in (1, 2)]
    inside, outside = (_shares(_cells(picture[one][None])[0]) if one.any() else None for one in chosen)
    return inside, outside


def _first_mask(
    picture: Bytes,
    marks: Bytes,
    stroked: tuple[Floats | None, Floats | None],
    coarse: NDArray[np.bool_] | None,
) -> Bytes:
    """The mask of a picture by strokes alone. coarse : what a coarser look found."""
    cells = _cells(picture)
    nearness = _nearness(marks)
    if coarse is None:
        inside = marks == 1
        outside = (marks == 2) | ((nearness < -0.5 * NEARNESS) & (marks != 1))
        mask = np.where(inside, np.uint8(255), np.uint8(0))
        known = inside | outside
    else:
        mask, known = np.where(coarse, np.uint8(255), np.uint8(0)), np.ones(marks.shape, np.bool_)
        nearness = 0.5 * nearness + 0.5 * _of_place(mask)
    odds = nearness
    for _ in range(ROUNDS):
        of_subject, anything = _histograms(cells, mask, known, stroked)
        colour = np.log((1.0 - STRAY) * of_subject.ravel()[cells] + STRAY / BINS**3) - np.log(
            (1.0 - STRAY) * anything.ravel()[cells] + STRAY / BINS**3
        )
        odds = np.clip(colour, -MOST_COLOUR, MOST_COLOUR).astype(np.float32) + nearness
        mask = _connect(_graph_cut(picture, odds, marks), np.zeros_like(marks), marks)
        known = np.ones(marks.shape, np.bool_)
    return mask


def _nearness(marks: Bytes) -> Floats:
    """(h, w) log-odds of place by which strokes are nearer, those outside or the picture's border."""
    framed = np.where(marks == 2, np.uint8(0), np.uint8(1))
    framed[0], framed[-1], framed[:, 0], framed[:, -1] = 0, 0, 0, 0
    framed[marks == 1] = 1
    to_inside = np.asarray(
        cv2.distanceTransform(np.where(marks == 1, np.uint8(0), np.uint8(1)), cv2.DIST_L2, 5)
    )
    to_outside = np.asarray(cv2.distanceTransform(framed, cv2.DIST_L2, 5))
    share = (to_outside - to_inside) / np.maximum(to_outside + to_inside, 1e-3)
    return np.asarray(NEARNESS * share, np.float32)


def _cells(picture: Bytes) -> NDArray[np.int32]:
    """(h, w) the bin of each pixel's colour: luma and two differences of colour."""
    y, r, b = (np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2YCrCb), np.int32)[..., k] for k in range(3))
    half = BINS // 2
    r = np.clip((r - 128) // int(CHROMA_STEP) + half, 0, BINS - 1)
    b = np.clip((b - 128) // int(CHROMA_STEP) + half, 0, BINS - 1)
    return np.asarray((y // int(LUMA_STEP) * BINS + r) * BINS + b, np.int32)


def _histograms(
    cells: NDArray[np.int32],
    mask: Bytes,
    known: NDArray[np.bool_] | None = None,
    stroked: tuple[Floats | None, Floats | None] = (None, None),
) -> tuple[Floats, Floats]:
    """(BINS, BINS, BINS) shares of the colours inside and outside a mask, blurred a little.

    known : pixels that count. stroked : shares under strokes, which make up STROKED of the whole.
    """
    histograms: list[Floats] = []
    for is_inside, strokes in zip((True, False), stroked, strict=True):
        chosen = (mask > 0) == is_inside
        if known is not None:
            chosen &= known
        shares = _shares(cells[chosen])
        if strokes is not None:
            shares = (1.0 - STROKED) * shares + STROKED * strokes
        histograms.append(_blurred(np.asarray(shares, np.float32).reshape(BINS, BINS, BINS)))
    return histograms[0], histograms[1]


def _shares(cells: NDArray[np.int32]) -> Floats:
    counts = np.bincount(cells, minlength=BINS**3).astype(np.float32)
    return np.asarray(counts / max(len(cells), 1), np.float32)


def _reduced_marks(marks: Bytes, size: tuple[int, int]) -> Bytes:
    """Strokes in a smaller picture: where they cover a pixel at least half."""
    if marks.shape[::-1] == size or not marks.any():
        return marks if marks.shape[::-1] == size else np.zeros(size[::-1], np.uint8)
    inside, outside = (
        _reduced_mask(np.where(marks == value, np.uint8(255), np.uint8(0)), size) for value in (1, 2)
    )
    return np.where(inside > 0, np.uint8(1), np.where(outside > 0, np.uint8(2), np.uint8(0)))


def _blurred(counts: Floats) -> Floats:
    for axis in range(3):
        wide = np.pad(counts, [(1, 1) if k == axis else (0, 0) for k in range(3)], mode="edge")
        before, after = (np.take(wide, range(k, k + BINS), axis) for k in (0, 2))
        counts = np.asarray(0.5 * counts + 0.25 * (before + after), np.float32)
    return counts


def _flow_mask(mask: Bytes, before: Bytes, now: Bytes) -> Bytes:
    """(h, w) 0 or 255: a mask of the picture before, moved by optical flow to where it is now."""
    if not mask.any() or min(mask.shape) < 16:
        return mask
    field = np.zeros((*mask.shape, 2), np.float32)
    method = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    flow = np.asarray(method.calc(np.ascontiguousarray(now), np.ascontiguousarray(before), field), np.float32)
    height, width = mask.shape
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    moved = cv2.remap(mask, x + flow[..., 0], y + flow[..., 1], cv2.INTER_LINEAR)
    return np.where(np.asarray(moved) > 127, np.uint8(255), np.uint8(0))


def _of_place(expected: Bytes) -> Floats:
    """(h, w) log-odds of place by the distance from the border of an expected mask; nothing where it is empty."""
    if not expected.any():
        return np.full(expected.shape, -1.0, np.float32)
    inside = np.asarray(cv2.distanceTransform(expected, cv2.DIST_L2, 5))
    outside = np.asarray(
        cv2.distanceTransform(np.where(expected > 0, np.uint8(0), np.uint8(255)), cv2.DIST_L2, 5)
    )
    return np.clip(PLACE_SLOPE * (inside - outside), -MOST_OUTSIDE, MOST_INSIDE).astype(np.float32)


def _graph_cut(picture: Bytes, odds: Floats, marks: Bytes) -> Bytes:
    """(h, w) 0 or 255: the cut of least energy. odds : (h, w) log-odds of being inside.

    OpenCV's takes mixtures of Gaussians of three colours. Given one Gaussian a side that differ in the first colour
    only, and in their means only, its log-odds are a line in this colour: here the first colour *is* the log-odds, and
    the other two, brightness and difference of colours, only say where borders are cheap.
    """
    ycc = np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2YCrCb), np.float32)
    level = np.clip(odds, -LARGEST, LARGEST) * (127.5 / LARGEST) + 127.5
    tone = 0.5 * (ycc[..., 1] - ycc[..., 2]) + 128.0
    image = np.clip(np.rint(np.stack([level, ycc[..., 0], 2.0 * tone - 128.0], axis=-1)), 0, 255).astype(
        np.uint8
    )
    spread = 255.0 * 127.5 / (DATA_WEIGHT * LARGEST)
    models = [_one_gaussian(mean, spread) for mean in (0.0, 255.0)]
    labels = np.where(odds > 0.0, np.uint8(cv2.GC_PR_FGD), np.uint8(cv2.GC_PR_BGD))
    labels[marks == 1], labels[marks == 2] = cv2.GC_FGD, cv2.GC_BGD
    cv2.grabCut(image, labels, (0, 0, 0, 0), models[0], models[1], 1, cv2.GC_EVAL_FREEZE_MODEL)
    return np.where((labels == cv2.GC_FGD) | (labels == cv2.GC_PR_FGD), np.uint8(255), np.uint8(0))


def _one_gaussian(mean: float, variance: float) -> NDArray[np.float64]:
    """(1, 65) OpenCV's mixture of five Gaussians, of which the first is all."""
    model = np.zeros((1, 65))
    model[0, 0] = 1.0
    model[0, 5:8] = mean, 128.0, 128.0
    model[0, 20:29] = np.diag([variance, 1e6, 1e6]).ravel()
    return model


def _connect(mask: Bytes, moved: Bytes, marks: Bytes) -> Bytes:
    """The pieces of a mask that an expected one, or a stroke inside, touches, without specks; small holes filled."""
    labels, areas = _pieces(mask)
    if len(areas) <= 1:
        return mask
    least = max(9.0, LEAST_PIECE * float(areas[1:].sum()))
    touched = np.zeros(len(areas), np.bool_)
    touched[np.unique(labels[(moved > 0) | (marks == 1)])] = True
    if not touched[1:].any():
        touched[1 + int(areas[1:].argmax())] = True
    kept = touched & (areas >= least)
    kept[np.unique(labels[marks == 1])] = True
    kept[0] = False
    out = np.where(kept[labels], np.uint8(255), np.uint8(0))
    labels, areas = _pieces(np.where(out > 0, np.uint8(0), np.uint8(255)))
    holes = areas < LEAST_HOLE * least
    holes[0] = False
    out[holes[labels] & (marks != 2)] = 255
    return out


def _pieces(mask: Bytes) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(h, w) the number of each pixel's piece of a mask, 0 outside, and the pixels of each."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask)
    return np.asarray(labels, np.int64), np.asarray(stats, np.int64)[:, cv2.CC_STAT_AREA]
