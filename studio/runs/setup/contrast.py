"""How well a subject can be told from what lies behind it, by colour: measured before anything is tracked.

Agreement of the views cannot say it: masks that all lack both forearms agree about a body without forearms. So each
picture's masks are made twice more, with a shadow test that lets more pass, and without one. What the first calls
background where the subject is might as well be background: a little noise, another lamp, and it is. Where the subject
is, says

- a pose, if one is known: the middle of each limb's projection, limb by limb;
- else the hull of all that changed, shadows too. Where the other cameras see the floor behind a pixel empty, it is no
  shadow on the floor, so it is of the subject.

Masks that are not made by difference from a background have no such contrast. Of these, and of nothing else, the edges
of the picture along a mask's border say whether it lies where something ends (`border_support`).
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from studio.body.dimensions import follows_height
from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.body.scale import scale_of
from studio.evidence.backgrounds import Backgrounds
from studio.evidence.masks import PackedMask, reduced
from studio.evidence.pipeline import EvidenceMaker, PackedRaw
from studio.evidence.settings import EvidenceSettings
from studio.evidence.volume.hull import Hull
from studio.evidence.volume.hull_pieces import chosen_voxels
from studio.evidence.volume.reconstruction import Reconstructor
from studio.footage.capture.footage import Footage
from studio.footage.capture.pictures import png_of
from studio.foundations.arrays import Array, Bytes
from studio.foundations.errors import StudioError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import nearest_pixels
from studio.foundations.progress import Progress, no_progress
from studio.foundations.words import enumerated, sentence
from studio.runs.setup.person_hull import FINE, JUDGED_SIDE, covered, large_hull, person_box, spread_frames
from studio.runs.tracks import BEST, read_track
from studio.search.likelihood.outlines import OutlineProjector
from studio.sessions.atomic_files import write_bytes
from studio.sessions.session import Session

WIDER = 1.6
"""Times the shadow test's colour tolerance, each pixel alone."""
FRAMES = 3
MIDDLE, WITHIN = 0.5, 0.1
"""Breadth of a limb's middle, as a share of its own, and the share of its length that is left out at both ends."""
FEWEST_PIXELS, LEAST_LIMB = 100, 0.025
"""Of a limb's middle in a picture whose shorter side is JUDGED_SIDE, and as a share of all limbs' middles: smaller ones
lie beside their pose."""
CONFIRMED = 0.5
"""Share of a limb's middle, over all views, that must have changed: else the limb is not where the pose says."""
MOSTLY = 0.9
"""Of it over all other views: then what did not change in one view is of the limb, too, and like the background."""
ON_FLOOR = 150.0
"""mm at a person's size: a limb whose ends are lower lies beside its own shadow."""
ALIKE_LIMB, ALIKE_SUBJECT = 0.15, 0.03
"""Shares of a limb's, or of the subject's, pixels from which a camera sees them alike with what is behind. Of two clips
of others, on wood: 59, 66, 19 and 17 % of a shin in the four cameras; on tiles, and on the bundled walk: 1 % of any
limb at most. By the hull 6.1, 5.9, 8.0 and 4.2 %; at most 1.8 and 2.1 %."""
ABOVE_FLOOR, FLOOR_OFF = 300.0, 150.0
"""mm at a person's size: below it the hull holds shadows as well; how far its lowest point may lie from z = 0 if that
is the floor."""
BESIDE_SHADOW = 9
"""Pixels: what changed, made wider by half of it. A shadow's border changes too little to be seen."""
EMPTY_VIEWS = 3
"""Other cameras that must see the floor behind a pixel empty; all others where there are fewer."""
STRONGEST_EDGE = 40.0
"""Grey levels between neighbouring pixels, twice: from there an edge counts whole."""
MOST_OUTLINES = 24

Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class ViewContrast:
    """One camera. share : of the subject's pixels that might as well be background. limbs : the same of each limb that
    it sees, where a pose says where limbs are. frame : in which there are most. outlines : polygons around them in that
    frame, (x, y) pixels of the stored picture.
    """

    camera: str
    share: float
    limbs: dict[str, float]
    frame: int
    outlines: tuple[tuple[tuple[int, int], ...], ...]


@dataclass(frozen=True, slots=True)
class Contrast:
    """How well a subject can be told from what is behind it. views : in the order of the cameras. pose : where the pose
    came from that says where limbs are; "" : the hull says where the subject is. tolerance : of the shadow test in use.
    person : whether the body is one of a person.
    """

    views: tuple[ViewContrast, ...]
    pose: str
    tolerance: float
    person: bool = True

    @property
    def alike(self) -> dict[str, tuple[str, ...]]:
        """By limb ("subject" where limbs are not known) the cameras in which it and its background are alike; only
        where these are at least half of those that see it, for one camera alone is made up for by the others.
        """
        return {
            name: tuple(camera for camera, share in seen.items() if share > limit)
            for name, seen, limit in self._limbs_in_view()
            if 2 * sum(share > limit for share in seen.values()) >= max(len(seen), min(4, len(self.views)))
        }

    def _limbs_in_view(self) -> Iterator[tuple[str, dict[str, float], float]]:
        if not self.pose:
            yield "subject", {view.camera: view.share for view in self.views}, ALIKE_SUBJECT
            return
        for limb in dict.fromkeys(limb for view in self.views for limb in view.limbs):
            yield (
                limb,
                {view.camera: view.limbs[limb] for view in self.views if limb in view.limbs},
                ALIKE_LIMB,
            )

    @property
    def low(self) -> Annotated[bool, Field()]:
        """Whether the subject, or a limb of it, is hard to tell from its background."""
        return bool(self.alike)

    @property
    def words(self) -> Annotated[str, Field()]:
        """What is alike and where: "forearms and background are alike in cam1 to cam4"; "" where nothing is."""
        by_cameras: dict[tuple[str, ...], list[str]] = {}
        for name, cameras in _both_sides(self.alike, [view.camera for view in self.views]).items():
            by_cameras.setdefault(cameras, []).append(name)
        order = [view.camera for view in self.views]
        return "; ".join(
            f"{enumerated(limbs)} and background are alike in {_cameras_in_words(cameras, order)}"
            for cameras, limbs in by_cameras.items()
        )

    @property
    def remedy(self) -> Annotated[str, Field()]:
        """What may help, a sentence; "" where nothing needs help."""
        if not self.low:
            return ""
        ways = [f"narrow the shadow colour tolerance (mask_shadow_colour, now {self.tolerance:g})"]
        ways += ["let the network cut the person out (source person)"] if self.person else []
        ways += ["paint strokes (source strokes)", "try every source (source best)"]
        if self.person:
            ways.append("film again in clothes of another colour than floor and walls")
        return f"{sentence(', '.join(ways))}: any of these may help."


def _both_sides(alike: Mapping[str, tuple[str, ...]], order: list[str]) -> dict[str, tuple[str, ...]]:
    """The same with "left shin" and "right shin" as "shins", with the cameras of both."""
    joined: dict[str, tuple[str, ...]] = {}
    for name, cameras in alike.items():
        side, _, limb = name.partition(" ")
        other = {"left": "right", "right": "left"}.get(side)
        if other is None or f"{other} {limb}" not in alike:
            joined[name] = cameras
        else:
            joined[_plural(limb)] = tuple(sorted({*cameras, *alike[f"{other} {limb}"]}, key=order.index))
    return joined


def _plural(limb: str) -> str:
    return "feet" if limb == "foot" else f"{limb}s"


def _cameras_in_words(cameras: Sequence[str], order: list[str]) -> str:
    first, last = order.index(cameras[0]), order.index(cameras[-1])
    if len(cameras) > 2 and last - first + 1 == len(cameras):
        return f"{cameras[0]} to {cameras[-1]}"
    return enumerated(list(cameras))


@dataclass(frozen=True, slots=True, eq=False)
class KnownPoses:
    """Poses (D,) of a body by frame, and their origin as text."""

    body: BodyModel
    poses: Mapping[int, Array]
    origin: str


def known_poses(session: Session) -> KnownPoses | None:
    """Poses of a session's newest run with frames; else its start pose; None without either."""
    for run in sorted(session.runs(), key=lambda run: run.record.created, reverse=True):
        if run.record.live or run.record.ping_pong:
            continue
        try:
            track, body = read_track(run, BEST), run.body()
        except StudioError:
            continue
        if len(track.frames):
            rows = spread_frames(len(track.frames), FRAMES)
            return KnownPoses(body, {int(track.frames[row]): track.poses[row] for row in rows}, run.name)
    try:
        pose, body = session.start_pose(), session.body()
    except StudioError:
        return None
    if pose is None:
        return None
    return KnownPoses(body, {session.start_pose_frame(): pose}, "the session's start pose")


def measure_contrast(
    session: Session,
    settings: EvidenceSettings,
    known: KnownPoses | None = None,
    progress: Progress = no_progress,
) -> Contrast | None:
    """The contrast of a session's subject under some knobs. known : poses; default: `known_poses`.

    None where masks are not made by difference from a background, or nothing says where the subject is: neither a pose
    nor, of two cameras or more, a hull that stands on the floor.

    Raises FootageError.
    """
    cameras, known = session.cameras(), known or known_poses(session)
    with closing(session.footage()) as footage:
        if not _by_difference(settings, footage, cameras):
            return None
        frames = sorted(known.poses) if known else spread_frames(footage.frame_count, FRAMES)
        seen = _Masks(cameras, footage, settings, frames, progress)
    body = known.body if known else session.body()
    views = (
        _of_limbs(seen, known) if known else _of_subject(seen, scale_of(body)) if len(cameras) > 1 else None
    )
    if views is None:
        return None
    return Contrast(views, known.origin if known else "", settings.mask_shadow_colour, follows_height(body))


def contrast_notes(session: Session, settings: EvidenceSettings, known: KnownPoses) -> tuple[str, ...]:
    """For a run's notes: which limbs of its start pose are like the background, and what may help; none if all can be
    told apart, or nothing can be measured.
    """
    try:
        contrast = measure_contrast(session, settings, known)
    except StudioError:
        return ()
    if contrast is None or not contrast.low:
        return ()
    return (f"{sentence(contrast.words)}: they may be lost. {contrast.remedy}",)


def _by_difference(settings: EvidenceSettings, footage: Footage, cameras: Sequence[Camera]) -> bool:
    given = any(footage.has_masks(camera.name) for camera in cameras)
    model = settings.background_model
    return model not in ("mask", "threshold") and not (model == "auto" and given)


class _Masks:
    """Some frames' masks: those in use, `changed` without the shadow test, `wide` with one that lets more pass. Of
    pictures whose shorter side is JUDGED_SIDE; only one camera's pictures are held at a time.
    """

    def __init__(
        self,
        cameras: tuple[Camera, ...],
        footage: Footage,
        settings: EvidenceSettings,
        frames: Sequence[int],
        progress: Progress,
    ) -> None:
        self.cameras, self.frames = cameras, tuple(frames)
        self.lenses = tuple(camera.reduced(JUDGED_SIDE) for camera in cameras)
        backgrounds = Backgrounds(footage)
        most = settings.mask_shadow_colour * WIDER
        kinds = {
            "used": settings,
            "changed": dataclasses.replace(settings, mask_shadow_test=False),
            "wide": dataclasses.replace(settings, mask_shadow_window=1, mask_shadow_colour=most),
        }
        makers = {
            kind: EvidenceMaker(cameras, footage, backgrounds, one, "none") for kind, one in kinds.items()
        }
        raw: dict[tuple[str, int, str], PackedRaw] = {}
        for number, camera in enumerate(cameras):
            for done, frame in enumerate(self.frames):
                progress("measuring the contrast", number * len(frames) + done, len(cameras) * len(frames))
                picture = footage.picture(camera.name, frame)
                for kind, maker in makers.items():
                    raw[kind, frame, camera.name] = PackedRaw(maker.raw_mask(camera.name, frame, picture))
            footage.release(camera.name)
            backgrounds.release(camera.name)
        self._masks: dict[tuple[str, int, int], PackedMask] = {}
        for kind, maker in makers.items():
            for frame in self.frames:
                seen = {camera.name: raw.pop((kind, frame, camera.name)).unpacked() for camera in cameras}
                seen = maker.without_false_shadows(seen)
                for number, (camera, lens) in enumerate(zip(cameras, self.lenses, strict=True)):
                    mask = maker.finished(camera.name, seen[camera.name])[0]
                    self._masks[kind, number, frame] = PackedMask(reduced(mask, lens))

    def of(self, kind: str, view: int, frame: int) -> Bytes:
        """(h, w) 0 or 255."""
        return self._masks[kind, view, frame].unpacked()

    def all_of(self, kind: str, frame: int) -> list[Bytes]:
        """One a camera."""
        return [self.of(kind, view, frame) for view in range(len(self.cameras))]


class _Marks:
    """Pixels of one camera that might as well be background, of the frame with most of them."""

    def __init__(self, camera: Camera, lens: Camera) -> None:
        self.camera, self.lens = camera, lens
        self.frame, self.most, self.pixels = 0, -1, np.zeros((lens.height, lens.width), np.bool_)

    def add(self, frame: int, pixels: Flags) -> None:
        """Keep a frame's pixels (h, w) if there are more of them."""
        count = int(np.count_nonzero(pixels))
        if count > self.most:
            self.frame, self.most, self.pixels = frame, count, pixels

    def outlines(self) -> tuple[tuple[tuple[int, int], ...], ...]:
        """Polygons around them, the largest first."""
        joined = cv2.morphologyEx(self.pixels.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
        outlines = cv2.findContours(joined, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)[0]
        largest = sorted(outlines, key=cv2.contourArea, reverse=True)[:MOST_OUTLINES]
        across, down = self.camera.width / self.lens.width, self.camera.height / self.lens.height
        return tuple(
            tuple((round(float(x) * across), round(float(y) * down)) for x, y in polygon[:, 0])
            for contour in largest
            if len(polygon := cv2.approxPolyDP(contour, 1.0, True)) > 2
        )


def _of_limbs(seen: _Masks, known: KnownPoses) -> tuple[ViewContrast, ...] | None:
    """Views by the limbs of known poses; None where no limb is where its pose says."""
    names = [limb.name for limb in known.body.drawn]
    projector = OutlineProjector.of_body(known.body, seen.lenses)
    counts = np.zeros((len(seen.lenses), len(names), 3), np.int64)
    middles: dict[tuple[int, int, int], tuple[Flags, Flags]] = {}
    for frame, pose in known.poses.items():
        corners, high = projector.corners(pose[None])[0][0], _off_floor(known.body, pose)
        for view, lens in enumerate(seen.lenses):
            wide, changed = seen.of("wide", view, frame) == 0, seen.of("changed", view, frame) > 0
            for limb, middle in _middles(corners[view], lens):
                if high[limb]:
                    counts[view, limb] += [np.count_nonzero(middle & one) for one in (middle, wide, changed)]
                    middles[view, limb, frame] = middle, middle & wide
    area, wide, changed = np.moveaxis(counts, 2, 0)
    # Where the other cameras see nothing of a limb either, it is beside its pose; else it is as if it were not there.
    others = [np.delete(counts, view, axis=0).sum(axis=0) for view in range(len(counts))]
    beside = np.array([one[:, 2] < MOSTLY * one[:, 0] for one in others])
    unseen = area - changed
    alike, area = np.where(beside, wide - unseen, wide), np.where(beside, changed, area)
    whole = counts[:, :, 0].sum(axis=0)
    confirmed = (changed.sum(axis=0) >= CONFIRMED * whole) & (whole >= LEAST_LIMB * whole.sum()) & (whole > 0)
    if not confirmed.any():
        return None
    is_seen = confirmed & (area >= FEWEST_PIXELS * len(known.poses))
    shares = np.where(is_seen, alike / np.maximum(area, 1), 0.0)
    marks = [_Marks(*pair) for pair in zip(seen.cameras, seen.lenses, strict=True)]
    for view, mark in enumerate(marks):
        chosen = [limb for limb, share in enumerate(shares[view]) if share > ALIKE_LIMB]
        for frame in seen.frames:
            pixels = np.zeros((mark.lens.height, mark.lens.width), np.bool_)
            for limb in chosen:
                if (view, limb, frame) in middles:
                    pixels |= middles[view, limb, frame][1]
            mark.add(frame, pixels)
    return tuple(
        ViewContrast(
            mark.camera.name,
            round(float((alike[view] * is_seen[view]).sum() / max((area[view] * is_seen[view]).sum(), 1)), 4),
            {names[limb]: round(float(shares[view, limb]), 4) for limb in np.flatnonzero(is_seen[view])},
            mark.frame,
            mark.outlines(),
        )
        for view, mark in enumerate(marks)
    )


def _off_floor(body: BodyModel, pose: Array) -> Flags:
    """(L,) which drawn limbs lie off the floor z = 0."""
    heights = np.abs(limb_ends(body, pose[None])[0, ..., 2])
    return np.asarray(heights.max(axis=1) > ON_FLOOR * scale_of(body))


def _middles(corners: Array, lens: Camera) -> Iterator[tuple[int, Flags]]:
    """The middle of each limb, where no other one lies before or behind it. corners : (L, 4, 2) of one view."""
    drawn = np.asarray(np.isfinite(corners).all(axis=(1, 2)))
    times = np.zeros((lens.height, lens.width), np.uint8)
    for limb in np.flatnonzero(drawn):
        times += _fill(corners[limb], lens)
    for limb, quad in enumerate(corners):
        if drawn[limb]:
            first, last = 0.5 * (quad[0] + quad[3]), 0.5 * (quad[1] + quad[2])
            a0, a1 = first + MIDDLE * (quad[0] - first), last + MIDDLE * (quad[1] - last)
            b1, b0 = last + MIDDLE * (quad[2] - last), first + MIDDLE * (quad[3] - first)
            short = [
                a0 + WITHIN * (a1 - a0),
                a1 + WITHIN * (a0 - a1),
                b1 + WITHIN * (b0 - b1),
                b0 + WITHIN * (b1 - b0),
            ]
            yield limb, (_fill(np.array(short), lens) > 0) & (times == 1)


def _fill(quad: Array, lens: Camera) -> Bytes:
    """(h, w) 1 inside a quadrilateral (4, 2) of pixels."""
    picture = np.zeros((lens.height, lens.width), np.uint8)
    limit = 4.0 * max(lens.height, lens.width)
    cv2.fillPoly(picture, [np.rint(16.0 * np.clip(quad, -limit, limit)).astype(np.int32)], (1,), shift=4)
    return picture


def _of_subject(seen: _Masks, scale: float) -> tuple[ViewContrast, ...] | None:
    """Views by the hull of all that changed; None without a hull that stands on z = 0. scale : of the body."""
    counts = np.zeros((len(seen.lenses), 2), np.int64)
    marks = [_Marks(*pair) for pair in zip(seen.cameras, seen.lenses, strict=True)]
    for frame in seen.frames:
        changed = seen.all_of("changed", frame)
        used, whole = (
            None
            if (box := person_box(masks, seen.lenses, scale)) is None
            else large_hull(Reconstructor(seen.lenses, box, FINE), masks)
            for masks in (seen.all_of("used", frame), changed)
        )
        if used is None or whole is None or abs(_lowest(used)) > FLOOR_OFF * scale:
            continue
        upper = chosen_voxels(whole, whole.centres[:, 2] > ABOVE_FLOOR * scale)
        near = [
            np.asarray(cv2.dilate(mask, np.ones((BESIDE_SHADOW, BESIDE_SHADOW), np.uint8)), np.uint8)
            for mask in changed
        ]
        for view, mark in enumerate(marks):
            inside = np.asarray(cv2.erode(covered(upper, mark.lens), np.ones((3, 3), np.uint8))) > 0
            might = inside & (changed[view] > 0) & (seen.of("wide", view, frame) == 0)
            might &= ~_shadows(might, view, near, seen.lenses)
            counts[view] += [np.count_nonzero(inside), np.count_nonzero(might)]
            mark.add(frame, might)
    if not counts[:, 0].all():
        return None
    return tuple(
        ViewContrast(mark.camera.name, round(float(might / whole), 4), {}, mark.frame, mark.outlines())
        for mark, (whole, might) in zip(marks, counts, strict=True)
    )


def _lowest(hull: Hull) -> float:
    return float((hull.centres[:, 2] - 0.5 * hull.edges).min())


def _shadows(pixels: Flags, view: int, changed: Sequence[Bytes], lenses: Sequence[Camera]) -> Flags:
    """(h, w) which of a view's pixels may be a shadow on the floor: too few other cameras see the floor there empty."""
    rows, columns = np.nonzero(pixels)
    shadows = np.zeros_like(pixels)
    if not len(rows):
        return shadows
    lens = lenses[view]
    places = np.stack([columns, rows], axis=1).astype(np.float64)
    flat = cv2.undistortPoints(places[:, None], lens.matrix, lens.distortion)[:, 0]
    rays = np.column_stack([flat, np.ones(len(flat))]) @ lens.rotation
    with np.errstate(divide="ignore", invalid="ignore"):
        along = -lens.centre[2] / rays[:, 2]
    falls = np.isfinite(along) & (along > 0.0)
    points = lens.centre + np.where(falls, along, 0.0)[:, None] * rays
    empty = np.zeros(len(points), np.int64)
    for other, camera in enumerate(lenses):
        if other == view:
            continue
        cells, inside = nearest_pixels(camera, points)
        empty[inside] += changed[other][cells[inside, 1], cells[inside, 0]] == 0
    shadows[rows, columns] = falls & (empty < min(EMPTY_VIEWS, len(lenses) - 1))
    return shadows


def border_support(picture: Bytes, mask: Bytes) -> float:
    """How much a picture (H, W, 3) changes along the border of a mask (H, W), 0 to 1; 0 for an empty one."""
    contours = cv2.findContours(mask, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[0]
    if not contours:
        return 0.0
    smooth = cv2.GaussianBlur(picture, (0, 0), 1.0)
    slopes = [np.asarray(cv2.Sobel(smooth, cv2.CV_32F, *along)) for along in ((1, 0), (0, 1))]
    edges = 0.25 * np.hypot(*slopes).max(axis=2)
    # The border may be a pixel off.
    near = np.asarray(cv2.dilate(edges, np.ones((3, 3), np.uint8)))
    x, y = np.concatenate([contour[:, 0] for contour in contours]).T
    return float(np.minimum(near[y, x] / STRONGEST_EDGE, 1.0).mean())


def draw_contrast(session: Session, contrast: Contrast, folder: Path) -> tuple[Path, ...]:
    """Write a picture a camera with what might as well be background outlined; cameras without any have none.

    Raises FootageError.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written: list[Path] = []
    with closing(session.footage()) as footage:
        for view in contrast.views:
            if not view.outlines:
                continue
            picture = np.ascontiguousarray(footage.picture(view.camera, view.frame)).copy()
            footage.release(view.camera)
            polygons = [np.array(outline, np.int32) for outline in view.outlines]
            thick = max(1, round(min(picture.shape[:2]) / JUDGED_SIDE))
            cv2.polylines(picture, polygons, True, (255, 0, 255), thick, cv2.LINE_AA)
            path = folder / f"{view.camera}-frame-{view.frame}.png"
            write_bytes(path, png_of(picture))
            written.append(path)
    return tuple(written)
