"""Masks of one animal, or of anything else that is small, casts shadows and has thin limbs, before known backgrounds.

The agreement of views cannot tell a body from its shadow or its reflection in the floor, as both lie where all cameras
see them; colour can. What a camera cannot see, because the background there has the subject's own colour, the others
know. And a tail is as wide as the noise that a clean-up removes. So, frame by frame, from each camera's difference to
its empty picture:

1. The body: what differs, but for all that is the background in a shade of its own colour, no darker than the shadows
   of this footage: the brightness below which the subject begins is the valley of the shares of all pixels. Under an
   animal a camera that looks against the light sees shadow hardly lighter than fur, and of another colour where one of
   several lights is missing. But a shadow lies on the floor (z = 0) for all cameras: where one sees it plainly, what is
   darker than the background there, and lighter than the subject usually is, is that shadow to the others, too.
2. Filled in: pixels of the subject's colour before a background of that colour, where the other views' hull lies.
3. What the hull of all views does not reach is something else: litter, reflections in the floor or in glass.
4. Thin limbs: ridges of what remains of the difference without its shadow, above what that is at most times, if they
   lie in a chain that begins at the body. Those of a shadow's colour, such as a tail on grey steel, must be thinner and
   stand out more.

Lengths are in units of the subject's size in the picture, so that they mean the same at any resolution.
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.evidence.background import GaussianBackground
from studio.evidence.masks import cleaned, disc
from studio.evidence.settings import EvidenceSettings
from studio.evidence.volume.hull import Hull
from studio.evidence.volume.hull_settings import HullSettings
from studio.evidence.volume.reconstruction import Reconstructor, check_views
from studio.evidence.volume.tracking_space import Box
from studio.footage.calibration.boards import rays_of
from studio.footage.capture.footage import Footage
from studio.foundations.arrays import Array, Bytes, Floats, Indices, Mask
from studio.foundations.errors import FootageError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import nearest_pixels
from studio.foundations.progress import Progress
from studio.runs.setup.person_hull import covered, large_hull, person_box, spread_frames

Levels = NDArray[np.uint8 | np.float32]
CUTTING = "cutting the animal out"
LEARNT_FRAMES = 20
"""Frames from which colours, shadows and what changes all the time are learnt."""
SUBJECT_SIDE = 50.0
"""Pixels, root of the area, of the subject for which the lengths below are given."""
OPENED, CLOSED, THIN, THIN_SHADE, GAP, LEAST_THIN = 1.0, 2.0, 4.0, 3.0, 4.0, 14.0
"""Radii of specks and of slits; half the width that thin limbs have at most, and those of a shadow's colour; half a gap
in their chain; its length."""
SHADOW_COLOUR = 0.07
"""How far the colour of a shadow may lie from the background's: reflections in a floor are tinted."""
OWN_COLOUR = 0.025
"""The same where pieces are thin: no shadow of a body is."""
USUAL_DARKEST, LEAST_DARKEST, MOST_DARKEST = 0.4, 0.3, 0.6
FEWEST_DARK = 0.2
"""Share of what differs that is darker than shadows where the subject is dark."""
LIGHTER, QUARTILES = 2.0, 1.349
"""Deviations above the subject's usual brightness from which on something may be a shadow that another camera sees; and
those between the quartiles of normally distributed numbers."""
ROUNDS = 2
"""Shadows that others confirm confirm others so often."""
LIKE, ALIKE, WIDEST = (2.0, 95.0), 1.4, 60.0
"""Percentiles of the subject's brightness that are its colour; by how much the background's may exceed them; and the
largest range of them, grey levels, with which anything is filled in."""
RIDGE, SHADE_RIDGE, MOST_RIDGE, MOST_USUAL = 6.0, 12.0, 40.0, 12.0
"""Grey levels by which a thin limb stands out, and one of a shadow's colour; more does not count; and at most is usual
of a pixel."""
SHAKEN = 1.0
"""Pixels by which a camera may have moved since its background was taken: so much of an edge there is no limb."""
SELDOM, CHANGED = 15.0, 10.0
"""Percent of the frames in which a background is seen where something passes, and grey levels by which it is off if it
is wrong."""
EMPTY = 0.25
"""Share of the frames in which an animal that sits where the background shows one is elsewhere."""
RIM = 2.0
"""Pixels beyond the hull within which a mask is confirmed."""
HOLE = 150.0
"""Pixels of the largest hole that is filled."""
REACH = 3.0
"""Sizes of the subject within which its thin limbs end."""
CARVING = HullSettings(hull_depth=7, hull_least_views=2)
MARGIN = np.array([120.0, 120.0, 480.0])
"""mm at a person's size (`scale_of`) around the masks' hull in which the others' hulls are carved: where a camera
sees no upper half, a subject may be twice as high."""


@dataclass(frozen=True, slots=True, eq=False)
class Learnt:
    """What a camera's footage shows. model : its background. settings, own : masks without all shadows, and without
    those of the background's very colour. lightest : brightness that the subject seldom exceeds. colours : least and
    most brightness of the subject. usual : (H, W) of `unshaded`. usual_shade : (H, W) of what differs, shades too.
    unit : pixels that a length of 1 has.
    """

    model: GaussianBackground
    settings: EvidenceSettings
    own: EvidenceSettings
    lightest: float
    colours: tuple[float, float]
    usual: Floats
    usual_shade: Floats
    unit: float


def animal_masks(
    cameras: Sequence[Camera],
    footage: Footage,
    backgrounds: Mapping[str, Bytes],
    scale: float,
    progress: Progress,
) -> Iterator[tuple[int, dict[str, Bytes]]]:
    """Number and masks, (H, W) 0 or 255 by camera, of every frame in turn.

    backgrounds : (H, W, 3) of each camera. scale : of the body (`scale_of`). Raises FootageError where nothing differs
    from the backgrounds.
    """
    check_views(cameras)
    cv2.setNumThreads(1)
    with ThreadPoolExecutor(max(1, min(len(cameras), 2)), "animal masks") as threads:
        learnt = list(
            threads.map(
                partial(learn, footage=footage, backgrounds=backgrounds), [one.name for one in cameras]
            )
        )
        views = list(zip(cameras, learnt, strict=True))
        for frame in range(footage.frame_count):
            absent = footage.absent(frame)
            seeing = [(camera, one) for camera, one in views if camera.name not in absent]
            pictures = [footage.picture(camera.name, frame) for camera, _ in seeing]
            shades = list(threads.map(shades_of, pictures, [one for _, one in seeing]))
            shadows = confirmed_shadows([camera for camera, _ in seeing], shades)
            shadows = [_opened(one, CLOSED, own.unit) for one, (_, own) in zip(shadows, seeing, strict=True)]
            masks = list(threads.map(body_alone, pictures, [one for _, one in seeing], shadows))
            if len(seeing) > 1:
                masks = _by_all_views(masks, pictures, seeing, scale)
            masks = list(threads.map(with_thin_limbs, masks, pictures, [one for _, one in seeing], shadows))
            of_frame = {camera.name: mask for (camera, _), mask in zip(seeing, masks, strict=True)}
            for name in absent:
                width, height = footage.size(name)
                of_frame[name] = np.zeros((height, width), np.uint8)
            yield frame, of_frame
            progress(CUTTING, frame + 1, footage.frame_count)


def learn(name: str, footage: Footage, backgrounds: Mapping[str, Bytes]) -> Learnt:
    frames = [
        frame
        for frame in spread_frames(footage.frame_count, LEARNT_FRAMES)
        if name not in footage.absent(frame)
    ]
    pictures = [footage.picture(name, frame) for frame in frames]
    model = GaussianBackground(without_ghosts(backgrounds[name], pictures))
    changed = EvidenceSettings(mask_shadow_test=False, mask_opening=3, mask_closing=0)
    masks = [cleaned(model.foreground(picture, changed).mask, changed) for picture in pictures]
    if not any(mask.any() for mask in masks):
        raise FootageError(
            f"Nothing in the pictures of camera {name} differs from its background.",
            "Give a picture of the empty place, taken with the same camera in the same position.",
        )
    shares = [_share(model, picture)[mask > 0] for picture, mask in zip(pictures, masks, strict=True)]
    settings = EvidenceSettings(
        mask_opening=0, mask_closing=0, mask_fill_holes=0, mask_min_component=0,
        mask_shadow_darkest=darkest_shadow(np.concatenate(shares)), mask_shadow_colour=SHADOW_COLOUR,
    )  # fmt: skip
    bodies = [_largest(model.foreground(picture, settings).mask) for picture in pictures]
    unit = float(np.sqrt(np.median([np.count_nonzero(body) for body in bodies]))) / SUBJECT_SIDE
    cores = [cv2.erode(body, disc(_pixels(2.0 * CLOSED, unit))) > 0 for body in bodies]
    brightness = np.concatenate(
        [picture[core].max(axis=1) for picture, core in zip(pictures, cores, strict=True)]
    )
    low, high = np.percentile(brightness, LIKE) if len(brightness) else (0.0, 255.0)
    first, middle, third = (
        np.percentile(brightness, [25.0, 50.0, 75.0]) if len(brightness) else (0.0, 0.0, 0.0)
    )
    lightest = float(middle + LIGHTER * (third - first) / QUARTILES)
    darkest = settings.mask_shadow_darkest
    usual = np.median(
        [unshaded(picture, model.mean, model.gain(picture), darkest) for picture in pictures], axis=0
    )
    own = dataclasses.replace(settings, mask_shadow_colour=OWN_COLOUR)
    usual = np.minimum(1.3 * usual, MOST_USUAL) + SHAKEN * _steepness(model)
    differs = np.median([_differences(one, model.mean, model.gain(one)) for one in pictures], axis=0)
    usual_shade = np.minimum(1.3 * differs, MOST_USUAL) + SHAKEN * _steepness(model)
    maps = usual.astype(np.float32), usual_shade.astype(np.float32)
    return Learnt(model, settings, own, lightest, (float(low), float(high)), *maps, unit)


def without_ghosts(background: Bytes, pictures: Sequence[Bytes]) -> Bytes:
    """(H, W, 3) a background, the median of the pictures where nearly none of them looks like it, but for where the
    animal itself may be in all of them.

    What is wrong is an animal that sat there while the background was taken. If animals are darker than the
    background, the pictures are brighter there, and the other way round.
    """
    stack = np.stack(pictures)
    expected = background * GaussianBackground(background).gain(pictures[len(pictures) // 2])
    off = stack - expected
    away = np.abs(off).max(axis=3)
    seldom, often = np.percentile(away, [SELDOM, 100.0 - SELDOM], axis=0)
    brighter = off.mean(axis=3)
    passing = (often > 2.0 * CHANGED) & (seldom < CHANGED)
    extreme = np.take_along_axis(brighter, np.abs(brighter).argmax(axis=0)[None], axis=0)[0]
    sign = np.sign(np.median(extreme[passing])) if passing.any() else 0.0
    by_brightness = np.argsort(sign * brighter, axis=0)[round(EMPTY * (len(stack) - 1))][None]
    empty = np.take_along_axis(stack, by_brightness[..., None], axis=0)[0]
    wrong = sign * np.take_along_axis(brighter, by_brightness, axis=0)[0] < -CHANGED
    # A tail that lies still is brighter than the floor and no ghost of a dark animal: thin pieces stay.
    unit = float(np.sqrt(np.median(np.count_nonzero(away > 2.0 * CHANGED, axis=(1, 2))))) / SUBJECT_SIDE
    pieces = _opened(np.where(wrong, np.uint8(255), np.uint8(0)), 1.0, 1.0)
    grown = cv2.dilate(_touching(pieces, _opened(pieces, THIN, unit)), disc(2))
    return np.where(grown[..., None] > 0, empty, background)


def darkest_shadow(shares: Floats) -> float:
    """The share of the background's brightness that divides a dark subject from its shadows.

    shares : (N,) of what differs from the background. Where little is darker than any shadow: the usual one.
    """
    darker = shares[shares < 1.0]
    if not len(darker) or np.mean(darker < USUAL_DARKEST) < FEWEST_DARK:
        return USUAL_DARKEST
    counts, edges = np.histogram(darker, bins=50, range=(0.0, 1.0))
    middles = 0.5 * (edges[1:] + edges[:-1])
    below, above = np.cumsum(counts), len(darker) - np.cumsum(counts)
    sums = np.cumsum(counts * middles)
    with np.errstate(divide="ignore", invalid="ignore"):
        between = below * above * np.square(sums / below - (sums[-1] - sums) / above)
    best = float(edges[1 + int(np.nanargmax(between))])
    return float(np.clip(best, LEAST_DARKEST, MOST_DARKEST))


def unshaded(picture: Bytes, background: Levels, gain: Floats, darkest: float) -> Floats:
    """(H, W) grey levels by which a picture differs from its background, shades of which do not count.

    background : (H, W, 3). gain : (3,) of its colours. darkest : share of its brightness that a shade has at least.
    """
    blurred = cv2.GaussianBlur(picture, (3, 3), 0.8).astype(np.float32)
    expected = background.astype(np.float32) * gain
    norm = np.maximum(np.square(expected).sum(axis=2), 1.0)
    dot = (blurred * expected).sum(axis=2)
    share = dot / norm
    beside = np.sqrt(np.maximum(np.square(blurred).sum(axis=2) - share * dot, 0.0))
    whole = np.sqrt(np.square(blurred - expected).sum(axis=2))
    return np.asarray(np.where((share > darkest) & (share < 1.0), beside, whole), dtype=np.float32)


def _steepness(model: GaussianBackground) -> Floats:
    """(H, W) grey levels by which the background changes over a pixel, at the steepest one nearby."""
    grey = model.mean.astype(np.float32).mean(axis=2)
    across, down = (
        np.asarray(cv2.Sobel(grey, cv2.CV_32F, *way, scale=0.125), np.float32) for way in ((1, 0), (0, 1))
    )
    return np.asarray(cv2.dilate(np.hypot(across, down), disc(1)), np.float32)


def _share(model: GaussianBackground, picture: Bytes) -> Floats:
    """(H, W) brightness as a share of the background's."""
    expected = model.mean.astype(np.float32) * model.gain(picture)
    dot = (picture.astype(np.float32) * expected).sum(axis=2)
    return np.asarray(dot / np.maximum(np.square(expected).sum(axis=2), 1.0), dtype=np.float32)


def places_on_floor(camera: Camera, pixels: Indices) -> Array:
    """(K, 3) mm, the places of the floor z = 0 that pixels (K, 2) of a camera see; NaN where they see none."""
    rays, centre = rays_of(camera, pixels.astype(np.float64)), camera.centre
    with np.errstate(divide="ignore", invalid="ignore"):
        along = -centre[2] / rays[:, 2]
    return centre + np.where(along > 0.0, along, np.nan)[:, None] * rays


def shades_of(picture: Bytes, learnt: Learnt) -> tuple[Bytes, Bytes]:
    """What passes for shadow in a picture (H, W), and what may be one where another camera sees it: what is lighter
    than the subject and darker than its background in every colour, as one of several lights may be missing there.
    """
    seen = learnt.model.foreground(picture, learnt.settings)
    darker = (picture <= learnt.model.mean * learnt.model.gain(picture)).all(axis=2)
    lighter = _brightest(picture) > learnt.lightest
    dark = np.where(darker & lighter, seen.mask | seen.shadow, np.uint8(0))
    return _opened(seen.shadow, OPENED, learnt.unit), dark


def confirmed_shadows(cameras: Sequence[Camera], shades: Sequence[tuple[Bytes, Bytes]]) -> list[Bytes]:
    """(H, W) of each camera what may be shadow and lies on the floor where another camera sees one, or one that is
    confirmed so. shades : of each (`shades_of`).
    """
    plain, found = [one for one, _ in shades], [np.zeros_like(one) for one, _ in shades]
    pixels = [np.argwhere(dark)[:, ::-1] for _, dark in shades]
    others = [
        [
            (number, *nearest_pixels(other, places_on_floor(camera, own)))
            for number, other in enumerate(cameras)
            if other is not camera and len(own)
        ]
        for camera, own in zip(cameras, pixels, strict=True)
    ]
    for _ in range(ROUNDS):
        for mask, own, elsewhere in zip(found, pixels, others, strict=True):
            for number, near, there in elsewhere:
                seen = own[there][plain[number][near[there, 1], near[there, 0]] > 0]
                mask[seen[:, 1], seen[:, 0]] = 255
        plain = [one | more for one, more in zip(plain, found, strict=True)]
    return found


def body_alone(picture: Bytes, learnt: Learnt, shadow: Bytes | None = None) -> Bytes:
    """The mask of one view alone: the body, and thin pieces that touch it. shadow : (H, W) what is none of it."""
    unit, model = learnt.unit, learnt.model
    seen, loose = (model.foreground(picture, one).mask for one in (learnt.settings, learnt.own))
    if shadow is not None:
        seen, loose = seen & ~shadow, loose & ~shadow
    body = _opened(_closed(seen, CLOSED, unit), OPENED, unit)
    thin = loose & ~np.asarray(cv2.dilate(_opened(loose, THIN, unit), disc(1)), np.uint8)
    both = body | thin
    joined = _closed(both, CLOSED, unit)
    return _closed(both, OPENED, unit) & _touching(joined, _opened(body, THIN, unit))


def _by_all_views(
    masks: list[Bytes], pictures: Sequence[Bytes], views: Sequence[tuple[Camera, Learnt]], scale: float
) -> list[Bytes]:
    """The masks filled in, and without what no other view confirms."""
    cameras = tuple(camera for camera, _ in views)
    box = person_box(masks, cameras, scale)
    if box is None:
        return masks
    lower, upper = box.lower - scale * MARGIN, box.upper + scale * MARGIN
    carver = Reconstructor(cameras, Box(np.array([*lower[:2], max(lower[2], 0.0)]), upper), CARVING)
    first = list(masks)
    for number, (camera, learnt) in enumerate(views):
        unknown = unknown_pixels(pictures[number], learnt)
        if not unknown.any():
            continue
        others = [cv2.dilate(mask, disc(1)) for mask in masks]
        others[number] = np.full_like(masks[number], 255)
        hull = carver.shape([np.asarray(mask, np.uint8) for mask in others])
        filled = (covered(None if hull.empty else hull, camera) > 0) & unknown
        if filled.any():
            more = _opened(np.where(filled, np.uint8(255), np.uint8(0)), CLOSED, learnt.unit)
            masks[number] = first[number] | _touching(
                _closed(first[number] | more, CLOSED, learnt.unit), first[number]
            )
    hull = large_hull(carver, [np.asarray(cv2.dilate(mask, disc(2)), np.uint8) for mask in masks])
    return [_reached(mask, hull, camera, one.unit) for mask, (camera, one) in zip(masks, views, strict=True)]


def unknown_pixels(picture: Bytes, learnt: Learnt) -> Mask:
    """(H, W) where the picture has the subject's colour, and so has the background."""
    low, high = learnt.colours
    if high - low > WIDEST:
        return np.zeros(picture.shape[:2], np.bool_)
    behind = _brightest(learnt.model.mean)
    own = (_brightest(picture) <= ALIKE * high) & (behind <= ALIKE * high)
    return own & (behind >= low / ALIKE)


def _reached(mask: Bytes, hull: Hull | None, camera: Camera, unit: float) -> Bytes:
    """What of a mask lies on a hull, but for a rim; all without a hull."""
    if hull is None:
        return mask
    near = np.asarray(cv2.dilate(covered(hull, camera), disc(_pixels(RIM, unit))), np.uint8)
    return _opened(mask & near, OPENED, unit)


def with_thin_limbs(mask: Bytes, picture: Bytes, learnt: Learnt, shadow: Bytes | None = None) -> Bytes:
    """A mask, its holes filled, with the thin limbs that begin at it. shadow : (H, W) what is none of them, unless it
    is a ridge of a shadow's colour.
    """
    unit, gap = learnt.unit, _pixels(GAP, learnt.unit)
    left, top, width, height = cv2.boundingRect(mask)
    if not width:
        return mask
    reach = _pixels(REACH * SUBJECT_SIDE, unit)
    part = slice(max(0, top - reach), top + height + reach), slice(max(0, left - reach), left + width + reach)
    whole, mask = (
        mask.copy(),
        cleaned(mask[part], dataclasses.replace(learnt.settings, mask_fill_holes=_pixels(HOLE, unit * unit))),
    )
    darkest = learnt.settings.mask_shadow_darkest
    behind, gain = learnt.model.mean[part], learnt.model.gain(picture)
    differs = _unusual(unshaded(picture[part], behind, gain, darkest), learnt.usual[part])
    if shadow is not None:
        differs = np.where(shadow[part] > 0, np.float32(0.0), differs)
    shaded = _unusual(_differences(picture[part], behind, gain), learnt.usual_shade[part])
    dark = _ridges(shaded, THIN_SHADE * unit) > SHADE_RIDGE
    above = dark | (_ridges(differs, THIN * unit) > RIDGE)
    differs = np.maximum(differs, np.where(dark, shaded, np.float32(0.0)))
    found = np.where(above & (cv2.dilate(mask, disc(1)) == 0), np.uint8(255), np.uint8(0))
    found = _longer(found, 0.4 * LEAST_THIN * unit)
    chained = found & _touching(np.asarray(cv2.dilate(found | mask, disc(gap)), np.uint8), mask)
    wide = np.asarray(cv2.dilate(chained, disc(gap)), np.uint8)
    chained &= _longer(wide, LEAST_THIN * unit + 2.0 * gap)
    near = np.asarray(cv2.dilate(chained, disc(2 * gap)), np.uint8)
    line = cv2.erode(cv2.dilate(chained | mask, disc(gap)), disc(max(1, gap - 1)))
    bridges = np.where((differs > 0.5 * RIDGE) & (line > 0) & (near > 0), np.uint8(255), np.uint8(0))
    whole[part] = mask | chained | bridges
    return whole


def _unusual(differs: Floats, usual: Floats) -> Floats:
    """(H, W) by how much more than usual pixels differ."""
    return np.maximum(np.minimum(differs, MOST_RIDGE) - usual, 0.0)


def _ridges(differs: Floats, radius: float) -> Floats:
    """(H, W) of what differs that which is thinner than twice a radius, pixels."""
    opened = cv2.morphologyEx(differs, cv2.MORPH_OPEN, disc(_pixels(1.0, radius)))
    return differs - np.asarray(opened, np.float32)


def _differences(picture: Bytes, background: Levels, gain: Floats) -> Floats:
    """(H, W) grey levels by which a picture differs from its background, shades too."""
    blurred = cv2.GaussianBlur(picture, (3, 3), 0.8).astype(np.float32)
    return np.sqrt(np.square(blurred - background.astype(np.float32) * gain).sum(axis=2))


def _brightest(picture: Levels) -> Levels:
    """(H, W) the brightest of each pixel's colours."""
    return np.maximum(np.maximum(picture[..., 0], picture[..., 1]), picture[..., 2])


def _pixels(length: float, unit: float) -> int:
    return max(1, round(length * unit))


def _opened(mask: Bytes, radius: float, unit: float) -> Bytes:
    return np.asarray(cv2.morphologyEx(mask, cv2.MORPH_OPEN, disc(_pixels(radius, unit))), np.uint8)


def _closed(mask: Bytes, radius: float, unit: float) -> Bytes:
    return np.asarray(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, disc(_pixels(radius, unit))), np.uint8)


def _touching(mask: Bytes, seeds: Bytes) -> Bytes:
    """The pieces of a mask with any pixel of the seeds (H, W)."""
    count, found = cv2.connectedComponents(mask)
    pieces = np.asarray(found, np.int32)
    kept = np.zeros(count, np.uint8)
    kept[np.unique(pieces[seeds > 0])] = 255
    kept[0] = 0
    return np.asarray(kept[pieces], np.uint8)


def _longer(mask: Bytes, least: float) -> Bytes:
    """The pieces of a mask whose box has a diagonal of at least so many pixels."""
    _, pieces, boxes, _ = cv2.connectedComponentsWithStats(mask)
    kept = np.where(np.hypot(boxes[:, 2], boxes[:, 3]) >= least, np.uint8(255), np.uint8(0))
    kept[0] = 0
    return np.asarray(kept[np.asarray(pieces, np.int32)], np.uint8)


def _largest(mask: Bytes) -> Bytes:
    """The largest piece of a mask."""
    _, pieces, boxes, _ = cv2.connectedComponentsWithStats(mask)
    if len(boxes) == 1:
        return mask
    return np.where(pieces == 1 + int(np.argmax(boxes[1:, cv2.CC_STAT_AREA])), np.uint8(255), np.uint8(0))
