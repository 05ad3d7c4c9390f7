"""A body's sizes from landmarks that a person clicked in several views of a few frames.

Each landmark is triangulated, and clicks that disagree are named and left out (`footage.calibration.landmark_points`);
what agrees gives the tree's lengths and every frame's pose together (`body.film_fit`). Radii come from the session's
masks in these frames (`film_radii.py`), limits from the angles seen. What it does not decide keeps the
template's proportion.
"""

import math
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from studio.body.dragging import root_joint
from studio.body.editing import edited
from studio.body.film_fit import DECIDED, FilmedTree, FilmFit, FrameClicks, fit_film, fit_poses
from studio.body.forward_kinematics import limb_ends, marker_points
from studio.body.mirroring import Mirror, has_sides
from studio.body.model import BodyModel
from studio.body.shape_space import dimension_kinds
from studio.body.writing import body_text
from studio.footage.calibration.landmark_points import landmark_point
from studio.foundations.arrays import Array, Bytes, Mask
from studio.foundations.declaring import Terminal, Web
from studio.foundations.errors import BodyError
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress, no_progress
from studio.foundations.words import counted, enumerated
from studio.runs.setup.film_radii import measured_radii
from studio.runs.setup.session_settings import masks_of
from studio.sessions.landmark_clicks import LandmarkClick
from studio.sessions.session import Session

FEWEST_FRAMES, FEWEST_LANDMARKS = 2, 3
MOST_FRAMES = 60
FRAMES_FOR_LIMITS, MOVED = 20, 30.0
"""Frames, and degrees through which an angle moved in them, from which its limits are also narrowed."""
LIMIT_MARGIN, LIMIT_SHARE, NARROWEST = 15.0, 0.5, 60.0
"""Degrees beyond the angles seen, and as a share of their range; the narrowest range that is set."""
AT_A_LIMIT = 1.0
"""Degrees."""


@dataclass(frozen=True, slots=True)
class FilmRequest:
    """How a body is made of its film. frames : none: all that have clicks."""

    frames: Annotated[
        Sequence[int],
        Field(
            max_length=MOST_FRAMES,
            description="Frames that give the sizes; these are checked in the others. Default: all with clicks.",
        ),
    ] = ()
    tolerance: Annotated[
        float,
        Field(
            gt=0.0,
            le=200.0,
            description="Pixels by which a click may miss its landmark; clicks that disagree by more are left out.",
        ),
    ] = 10.0
    held: Annotated[
        bool, Field(description="The body is held: its root is in the same place in all frames.")
    ] = False
    symmetric: Annotated[
        bool, Field(description="Left and right alike."), Terminal("--symmetric/--asymmetric")
    ] = True
    radii: Annotated[bool, Field(description="Measure radii in the session's masks, if it has any.")] = True
    limits: Annotated[bool, Field(description="Set limits of joints by the angles seen.")] = True


@dataclass(frozen=True, slots=True)
class FilmedSize:
    """One size, mm. dimensions : that have it. before : in the template. deviation : standard deviation, of a radius
    the scatter of its measurements. decided : whether the film decided it; else it is drawn to the
    template's proportion.
    """

    name: str
    kind: Literal["length", "radius"]
    dimensions: tuple[str, ...]
    before: float
    after: float
    deviation: float
    decided: bool


@dataclass(frozen=True, slots=True)
class FilmedLimb:
    """A limb both of whose ends were clicked. length : of the body, mm. mean, scatter : of the distance of its ends in
    the frames, and its standard deviation, mm. count : of frames.
    """

    limb: str
    length: float
    mean: float
    scatter: float
    count: int


@dataclass(frozen=True, slots=True)
class FilmedLandmark:
    """How well a landmark fits. clicks : that were used. off, worst : pixels between them and the body's, median and
    greatest.
    """

    name: str
    clicks: int
    off: float
    worst: float


@dataclass(frozen=True, slots=True)
class DisagreeingClick:
    """A click that was left out. off : pixels from where the other views have its landmark."""

    frame: int
    camera: str
    landmark: str
    off: float


@dataclass(frozen=True, slots=True, eq=False)
class FilmedBody:
    """A body made of its film.

    body, text : the body, and its file's text.
    saved, file : its name and its file among the workspace's own bodies; "" and None where it was not saved.
    sizes, limbs, landmarks, disagreeing : what was measured.
    frames, poses : whose clicks gave the sizes, and the body's poses (F, D) in them.
    off, off_most : pixels between clicks and the body's landmarks there, median and 90 %.
    checked : frames in which the sizes were checked. checked_off, checked_off_most : the same there; None for none.
    notes : sentences.
    """

    body: Annotated[BodyModel, Web(left_out=True)]
    text: str
    sizes: tuple[FilmedSize, ...]
    limbs: tuple[FilmedLimb, ...]
    landmarks: tuple[FilmedLandmark, ...]
    disagreeing: tuple[DisagreeingClick, ...]
    frames: tuple[int, ...]
    poses: Annotated[Array, Web(left_out=True)]
    off: float
    off_most: float
    checked: tuple[int, ...]
    checked_off: float | None
    checked_off_most: float | None
    notes: tuple[str, ...]
    saved: str = ""
    file: Annotated[Path | None, Web(left_out=True)] = None


def body_of_film(
    session: Session,
    template: BodyModel,
    clicks: Sequence[LandmarkClick],
    request: FilmRequest | None = None,
    progress: Progress = no_progress,
) -> FilmedBody:
    """A body like the template, in the size of the film.

    Raises BodyError where the clicks name what the template has not, or say too little.
    """
    request = request or FilmRequest()
    cameras = session.cameras()
    tree = FilmedTree(
        template, tuple(dict.fromkeys(click.landmark for click in clicks)), symmetric=request.symmetric
    )
    if not tree.groups:
        raise BodyError(
            f"No dimension of body '{template.name}' moves a clicked landmark.",
            "Click other landmarks, or give the lengths in the body's file as named dimensions.",
        )
    progress("triangulating the landmarks", 0, 4)
    seen = SeenLandmarks(tree.names, cameras, clicks, request.tolerance)
    usable = seen.usable()
    for frame in request.frames:
        if frame not in usable:
            known = ", ".join(map(str, usable))
            raise BodyError(f"Frame {frame} has too few landmarks in two views.", f"Choose of {known}.")
    chosen = tuple(sorted(set(request.frames))) or tuple(usable)[:MOST_FRAMES]
    if len(chosen) < FEWEST_FRAMES:
        raise BodyError(
            f"Only {counted(len(chosen), 'frame')} is to give the sizes: they would take over every click's error.",
            "Click the same landmarks in three frames or more, in different poses.",
        )
    progress("fitting sizes and poses", 1, 4)
    frames = [usable[frame] for frame in chosen]
    fit = fit_film(tree, cameras, frames, held=request.held)
    others = tuple(frame for frame in usable if frame not in chosen)
    progress("checking other frames", 2, 4)
    check = (
        fit_poses(tree, cameras, [usable[one] for one in others], fit.body, list(fit.poses))
        if others
        else None
    )
    progress("measuring radii", 3, 4)
    sizes, notes = _lengths(tree, fit), seen.notes()
    radii = _radii(session, cameras, template, fit, chosen, request, notes)
    poses = fit.poses if check is None else np.concatenate([fit.poses, check.poses])
    limits = _limits(template, fit.turns, poses, notes) if request.limits else {}
    if not any(size.decided for size in sizes):
        raise BodyError(
            "The clicks tell no length of the body.",
            "Click both ends of a limb in the same frame, in two views.",
        )
    body = _body(template, fit.scale, [*sizes, *radii], limits, notes)
    undecided = [size.name for size in sizes if not size.decided]
    if undecided:
        notes.append(
            f"Not decided one by one, and drawn to the template's proportion: {enumerated(undecided)}."
        )
    every = [*fit.off, *(check.off if check else ())]
    off, most = _off(fit)
    checked_off, checked_most = _off(check) if check else (None, None)
    return FilmedBody(
        body,
        body_text(body),
        tuple(_kept(size, body) for size in (*sizes, *radii)),
        _limbs(tree, fit, body, frames),
        _landmarks(tree.names, [*frames, *(usable[one] for one in others)], every),
        tuple(seen.disagreeing),
        chosen,
        fit.poses,
        off,
        most,
        others,
        checked_off,
        checked_most,
        tuple(notes),
    )


class SeenLandmarks:
    """The landmarks in space, frame by frame."""

    def __init__(
        self,
        names: Sequence[str],
        cameras: Sequence[Camera],
        clicks: Sequence[LandmarkClick],
        tolerance: float,
    ) -> None:
        self.disagreeing: list[DisagreeingClick] = []
        self.frames = dict[int, FrameClicks]()
        self.single = self.flat = self.landmarks = 0
        places = {camera.name: place for place, camera in enumerate(cameras)}
        by_frame = dict[int, dict[str, list[LandmarkClick]]]()
        for click in clicks:
            if click.camera in places:
                by_frame.setdefault(click.frame, {}).setdefault(click.landmark, []).append(click)
        for frame in sorted(by_frame):
            points = np.full((len(names), 3), np.nan)
            used: list[tuple[int, int, tuple[float, float]]] = []
            for number, name in enumerate(names):
                views = by_frame[frame].get(name, [])
                self.landmarks += bool(views)
                if len(views) < 2:
                    self.single += len(views)
                    continue
                at = [places[view.camera] for view in views]
                pixels = np.array([(view.x, view.y) for view in views])
                seen = landmark_point([cameras[place] for place in at], pixels, tolerance)
                self.flat += seen.flat
                if not seen.flat:
                    self.disagreeing += [
                        DisagreeingClick(frame, view.camera, name, float(off))
                        for view, off, agrees in zip(views, seen.off, seen.agrees, strict=True)
                        if not agrees
                    ]
                if seen.point is not None:
                    points[number] = seen.point
                    used += [
                        (place, number, (view.x, view.y))
                        for place, view, agrees in zip(at, views, seen.agrees, strict=True)
                        if agrees
                    ]
            if used:
                self.frames[frame] = FrameClicks(
                    np.array([one[0] for one in used]),
                    np.array([one[1] for one in used]),
                    np.array([one[2] for one in used]),
                    points,
                )

    def usable(self) -> dict[int, FrameClicks]:
        """Frames with landmarks enough. Raises BodyError where there are none."""
        usable = {
            frame: one
            for frame, one in self.frames.items()
            if np.isfinite(one.points).all(axis=1).sum() >= FEWEST_LANDMARKS
        }
        if usable:
            return usable
        if not self.landmarks:
            raise BodyError(
                "No landmark was clicked.", "Click the body's joints in two views of a few frames."
            )
        if self.single == self.landmarks:
            raise BodyError(
                "Every landmark is clicked in one view only: where it is in space cannot be told.",
                "Click each landmark in two views or more of the same frame.",
            )
        if self.flat:
            raise BodyError(
                "The views of the clicked landmarks look along nearly the same line: how far away these are cannot be"
                " told.",
                "Click them in cameras that stand farther apart.",
            )
        if self.disagreeing:
            worst = max(self.disagreeing, key=lambda one: one.off)
            raise BodyError(
                f"The clicks disagree: '{worst.landmark}' of frame {worst.frame} is {worst.off:.0f} pixels off in"
                f" {worst.camera}.",
                "Correct the clicks, check the calibration, or allow a greater --tolerance.",
            )
        raise BodyError(
            f"No frame has {FEWEST_LANDMARKS} landmarks in two views.", "Click more landmarks in each frame."
        )

    def notes(self) -> list[str]:
        notes: list[str] = []
        if self.single:
            notes.append(f"{counted(self.single, 'click')} in one view only of a frame said nothing.")
        if self.flat:
            seen = counted(self.flat, "landmark is", "landmarks are")
            notes.append(f"{seen} seen along nearly the same line only, and left out.")
        for one in sorted(self.disagreeing, key=lambda entry: -entry.off)[:8]:
            notes.append(
                f"'{one.landmark}' of frame {one.frame} was left out in {one.camera}: {one.off:.0f} pixels off."
            )
        if len(self.disagreeing) > 8:
            notes.append(f"{len(self.disagreeing) - 8} more clicks disagree and were left out.")
        return notes


def _lengths(tree: FilmedTree, fit: FilmFit) -> list[FilmedSize]:
    return [
        FilmedSize(
            group[0],
            "length",
            group,
            float(np.mean([tree.lengths[name] for name in group])),
            float(value),
            float(deviation),
            bool(decided >= DECIDED),
        )
        for group, value, deviation, decided in zip(
            tree.groups, fit.values, fit.deviations, fit.decided, strict=True
        )
    ]


def _radii(
    session: Session,
    cameras: Sequence[Camera],
    template: BodyModel,
    fit: FilmFit,
    frames: Sequence[int],
    request: FilmRequest,
    notes: list[str],
) -> list[FilmedSize]:
    measured = dict[str, tuple[float, float]]()
    shown = _masks(session, frames) if request.radii else []
    if shown:
        pairs = list(zip(fit.poses, shown, strict=True))
        measured = measured_radii(fit.body, cameras, pairs, symmetric=request.symmetric)
    if not measured:
        why = "no limb forms a border of the masks" if shown else "the session has no masks"
        why = why if request.radii else "they were not to be measured"
        notes.append(f"Radii are the template's, scaled with the body: {why}.")
    elif hidden := _without_radii(template, measured):
        notes.append(
            f"Of {enumerated(hidden)} the masks show no border: their radii are scaled with the body."
        )
    return [
        FilmedSize(name, "radius", (name,), template.dimensions[name], value, scatter, decided=True)
        for name, (value, scatter) in measured.items()
    ]


def _without_radii(template: BodyModel, measured: Mapping[str, object]) -> list[str]:
    """Limbs of whose radii none was measured."""
    assert template.definition is not None
    return [
        limb.name
        for limb in template.definition.limbs
        if not {limb.radius_start, limb.radius_end} & set(measured) and isinstance(limb.radius_start, str)
    ]


def _masks(session: Session, frames: Sequence[int]) -> list[dict[str, Bytes]]:
    """Masks by camera of each frame; none where the session has neither masks nor empty views."""
    with closing(session.footage()) as footage:
        names = [
            camera.name
            for camera in session.cameras()
            if footage.has_masks(camera.name) or footage.background_path(camera.name) is not None
        ]
    if not names:
        return []
    with masks_of(session) as maker:
        return [
            {
                view.camera: view.mask
                for view in maker.evidence(frame).views
                if view.camera in names and view.mask.any()
            }
            for frame in frames
        ]


def _limits(template: BodyModel, turns: Mask, poses: Array, notes: list[str]) -> dict[str, float]:
    """Limits of bounded angles below the root, degrees, by the poses seen: widened, and narrowed where an angle moved
    in many frames; a pair's angles alike. turns : (D,) which parameters the clicks decided.
    """
    root = root_joint(template)
    of_root = template.joints[root].parameters if root >= 0 else ()
    rest = np.degrees(template.neutral)
    ends = np.degrees(np.stack([poses.min(axis=0), poses.max(axis=0)])) - rest
    if has_sides(template):
        mirror = Mirror(template)
        other = np.sort(mirror.signs * ends[:, mirror.twins], axis=0)
        ends = np.stack([np.minimum(ends[0], other[0]), np.maximum(ends[1], other[1])])
    lows: list[float] = (ends[0] + rest).tolist()
    highs: list[float] = (ends[1] + rest).tolist()
    limits, widened, narrowed = dict[str, float](), list[str](), 0
    for at, (entry, low, high) in enumerate(zip(template.parameters, lows, highs, strict=True)):
        bounded = math.isfinite(entry.lower) and math.isfinite(entry.upper)
        if entry.kind != "angle" or at in of_root or not bounded or not turns[at]:
            continue
        before = math.degrees(entry.lower), math.degrees(entry.upper)
        narrow = len(poses) >= FRAMES_FOR_LIMITS and high - low >= MOVED
        margin = max(LIMIT_MARGIN, LIMIT_SHARE * (high - low), 0.5 * (NARROWEST - (high - low)))
        lower, upper = low - margin, high + margin
        below, above = low < before[0] - AT_A_LIMIT, high > before[1] + AT_A_LIMIT
        if not below:
            lower = max(lower, before[0]) if narrow else before[0]
        if not above:
            upper = min(upper, before[1]) if narrow else before[1]
        if below or above:
            widened.append(entry.label)
        narrowed += lower > before[0] + AT_A_LIMIT or upper < before[1] - AT_A_LIMIT
        limits |= {f"{entry.name}.lower": round(lower), f"{entry.name}.upper": round(upper)}
    if widened:
        notes.append(f"Seen beyond the template's limits, which were widened: {enumerated(widened)}.")
    if narrowed:
        notes.append(
            f"The limits of {counted(narrowed, 'angle')} were narrowed to what was seen, with a margin."
        )
    elif len(poses) < FRAMES_FOR_LIMITS:
        notes.append(f"Limits were not narrowed: {len(poses)} frames do not show how far the joints go.")
    return limits


def _body(
    template: BodyModel,
    scale: float,
    measured: Sequence[FilmedSize],
    limits: Mapping[str, float],
    notes: list[str],
) -> BodyModel:
    assert template.definition is not None
    kinds = dimension_kinds(template.definition)
    entries = template.definition.dimensions
    sizes = {
        name: scale * value
        for name, value in template.dimensions.items()
        if entries[name].mm is not None and (name in kinds or value > 0.0)
    }
    sizes |= {name: size.after for size in measured for name in size.dimensions}
    changed = edited(
        template,
        sizes={name: float(f"{value:.4g}") for name, value in sizes.items()},
        limits={name: value for name, value in limits.items() if not _same(template, name, value)},
        title=f"{template.title}, sized by its film",
    )
    notes += changed.notes
    return changed.body


def _same(template: BodyModel, limit: str, value: float) -> bool:
    name, _, key = limit.rpartition(".")
    entry = next(one for one in template.parameters if one.name == name)
    return abs(math.degrees(getattr(entry, key)) - value) < 1.0


def _kept(size: FilmedSize, body: BodyModel) -> FilmedSize:
    """The size as the body has it."""
    after = float(np.mean([body.dimensions[name] for name in size.dimensions]))
    return FilmedSize(size.name, size.kind, size.dimensions, size.before, after, size.deviation, size.decided)


def _limbs(
    tree: FilmedTree, fit: FilmFit, body: BodyModel, frames: Sequence[FrameClicks]
) -> tuple[FilmedLimb, ...]:
    ends = limb_ends(fit.body, fit.body.neutral)[0]
    rest = marker_points(fit.body, fit.body.neutral)[0]
    near = 1e-3 * float(np.ptp(rest, axis=0).max() + 1e-9)
    points = np.stack([one.points for one in frames])
    limbs: list[FilmedLimb] = []
    for limb, (start, end), sized in zip(fit.body.drawn, ends, body.drawn, strict=True):
        places = [np.flatnonzero(np.linalg.norm(rest - one, axis=1) < near) for one in (start, end)]
        if not all(map(len, places)):
            continue
        seen = np.linalg.norm(points[:, places[0][0]] - points[:, places[1][0]], axis=1)
        seen = seen[np.isfinite(seen)]
        if len(seen):
            limbs.append(
                FilmedLimb(limb.name, abs(sized.length), float(seen.mean()), float(seen.std()), len(seen))
            )
    return tuple(limbs)


def _landmarks(
    names: Sequence[str], frames: Sequence[FrameClicks], off: Sequence[Array]
) -> tuple[FilmedLandmark, ...]:
    numbers = np.concatenate([one.landmark for one in frames])
    pixels = np.concatenate([np.linalg.norm(one, axis=1) for one in off])
    return tuple(
        FilmedLandmark(name, int(own.sum()), float(np.median(pixels[own])), float(pixels[own].max()))
        for number, name in enumerate(names)
        if (own := numbers == number).any()
    )


def _off(fit: FilmFit) -> tuple[float, float]:
    pixels = np.concatenate([np.linalg.norm(one, axis=1) for one in fit.off])
    return float(np.median(pixels)), float(np.quantile(pixels, 0.9))
