"""The quality of each camera's masks without ground truth: how far the views agree in the visual hull.

Where a mask contains something else than the person (a bystander, a reflection), the other views carve it away, and
the hull's silhouette leaves that part of the mask uncovered. Where a mask has a hole, its own camera carves the
person, and the *other* masks stay uncovered. So for each camera the hull is carved once more without it: the part of
the other masks that is then covered is removed by this camera alone.

Agreement says nothing of what all masks lack. So the contrast of subject and background has a say too
(`runs.setup.contrast`), and where masks are not made by contrast, the edges of the pictures along their borders.
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from studio.body.scale import scale_of
from studio.evidence.frame_evidence import ViewEvidence
from studio.evidence.masks import PackedMasks, reduced
from studio.evidence.pipeline import EvidenceMaker
from studio.evidence.settings import EvidenceSettings
from studio.evidence.volume.hull_settings import HullSettings
from studio.evidence.volume.reconstruction import Reconstructor, check_views
from studio.footage.calibration.findings import Finding, blocking
from studio.foundations.arrays import Bytes
from studio.foundations.errors import FootageError, RunError, StudioError
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress, no_progress
from studio.foundations.words import enumerated
from studio.runs.setup.contrast import Contrast, border_support, measure_contrast
from studio.runs.setup.person_hull import (
    FINE,
    JUDGED_SIDE,
    ROUGH,
    covered,
    large_hull,
    person_box,
    spread_frames,
)
from studio.runs.setup.session_settings import masks_of, session_settings
from studio.runs.setup.silhouette_faults import MEASURED, height_of, person_alone, silhouette_faults
from studio.runs.setup.subject_masks import count_subjects
from studio.sessions.provenance import changed_inputs, origin_of, remember
from studio.sessions.session import Session

FRAMES = 5
USABLE = 0.9
"""Agreement from which masks are usable (issue 5)."""
USELESS = 0.5
"""Agreement below which masks show little of the subject, or much else."""
MOST_FILLED = 0.5
"""Masks that cover more of the picture agree in every view and show nothing."""
LEAST_BORDER = 0.25
"""`border_support` from which a mask lies where something ends."""
BLAMED = 0.05
"""Share of the other masks that one camera may remove before it is named."""


@dataclass(frozen=True, slots=True)
class ViewQuality:
    """One camera's masks against the hull, pixels of all frames together.

    covered : share of the mask that the hull's silhouette covers. inside : share of the silhouette that lies in the
    mask. denied : share of the other cameras' masks that only this camera's mask removes from the hull. frames :
    (covered, inside) of each frame; NaN where there is nothing. filled : share of the picture that the masks cover.
    border : how much the pictures change along the masks' border, 0 to 1 (`border_support`); NaN: not measured.
    """

    camera: str
    covered: float
    inside: float
    denied: float
    frames: tuple[tuple[float, float], ...]
    filled: float = 0.0
    border: float = float("nan")

    @property
    def agreement(self) -> Annotated[float, Field()]:
        """The smaller of covered and inside."""
        return min(self.covered, self.inside)

    @property
    def usable(self) -> Annotated[bool, Field()]:
        """Whether the masks agree well enough with the other views."""
        return self.agreement >= USABLE and self.filled <= MOST_FILLED

    @property
    def note(self) -> Annotated[str, Field()]:
        """What the user should check, "" if the masks are good."""
        if np.isnan(self.agreement):
            return "The mask, or the hull that all views allow, is empty: check the masks of all cameras."
        sentences: list[str] = []
        if self.filled > MOST_FILLED:
            share = f"{100.0 * self.filled:.0f} %"
            sentences.append(f"The mask covers {share} of the picture: is it inverted, or of no person?")
        if self.denied > BLAMED:
            share = f"{100.0 * self.denied:.0f} %"
            sentences.append(f"The mask has holes: it alone removes {share} of what the other cameras see.")
        if self.covered < USABLE:
            share = f"{100.0 * (1.0 - self.covered):.0f} %"
            sentences.append(
                f"{share} of the mask is seen by no other camera: exclude it, or find the camera whose mask has holes."
            )
        if self.inside < USABLE:
            sentences.append("The mask lacks parts of what the other cameras see.")
        return " ".join(sentences)


@dataclass(frozen=True, slots=True)
class MaskQuality:
    """How good the masks of all cameras are in some frames.

    hull_litres : the hull's volume in each frame.
    doubts : findings of the silhouettes against the calibration.
    subjects : seen in two frames or more (in one frame: in that one); 0: not counted.
    contrast : of subject and background; None: not measured, or the masks are not made by it.
    """

    frames: tuple[int, ...]
    views: Annotated[tuple[ViewQuality, ...], Field(serialization_alias="cameras")]
    hull_litres: tuple[float, ...]
    doubts: tuple[Finding, ...] = ()
    subjects: int = 0
    contrast: Contrast | None = None

    @property
    def agreeing(self) -> bool:
        """Whether every camera's masks agree with the others, of one subject, and show no fault of the calibration."""
        return all(view.usable for view in self.views) and self.subjects < 2 and not blocking(self.doubts)

    @property
    def usable(self) -> Annotated[bool, Field()]:
        """Whether the masks agree and something else confirms them: they also agree about whatever all of them lack."""
        return self.agreeing and not self.unconfirmed

    @property
    def unconfirmed(self) -> Annotated[str, Field()]:
        """Why agreement does not prove the masks, "" where it does: low contrast; without contrast, borders that lie on
        no edges of the pictures.
        """
        if self.contrast is not None:
            return self.contrast.words
        faint = [view.camera for view in self.views if not view.border >= LEAST_BORDER]
        if not faint:
            return ""
        if all(np.isnan(view.border) for view in self.views):
            return "nothing but the agreement was measured"
        return f"the masks' borders lie on no edges of the pictures of {enumerated(faint)}"

    @property
    def worst(self) -> Annotated[str, Field()]:
        """The camera to check first, "" for none: one that removes what the others see, else the least agreeing."""
        if all(view.usable for view in self.views):
            return ""
        removing = max(self.views, key=lambda view: view.denied)
        if removing.denied > BLAMED:
            return removing.camera
        return min(self.views, key=lambda view: np.nan_to_num(view.agreement, nan=-1.0)).camera

    def in_words(self) -> str:
        """The agreement of the worst camera, as text."""
        if stops := blocking(self.doubts):
            return _in_doubt(stops[0])
        if self.subjects > 1:
            return f"{self.subjects} subjects are in view: say which of them the masks shall be of"
        least = min(float(np.nan_to_num(view.agreement)) for view in self.views)
        fullest = max(self.views, key=lambda view: view.filled)
        if fullest.filled > MOST_FILLED:
            share = f"{100.0 * fullest.filled:.0f} %"
            return f"the masks of camera {fullest.camera} cover {share} of the picture: are they inverted?"
        if self.usable:
            return f"every view agrees by {least:.2f} or more"
        if self.agreeing:
            return f"every view agrees by {least:.2f} or more, but {self.unconfirmed}"
        # Rounded down: what is below the mark never reads like it.
        least = np.floor(1000.0 * least) / 1000.0
        return f"least agreement {least:.3f}, below the mark of {USABLE:g}: check camera {self.worst}"


def _in_doubt(finding: Finding) -> str:
    return f"the calibration is in doubt: {finding.message}"


def mask_quality(
    session: Session,
    settings: EvidenceSettings,
    frames: Sequence[int] = (),
    *,
    blame: bool = True,
    progress: Progress = no_progress,
) -> MaskQuality:
    """The quality of a session's masks in some frames (default: five, evenly spread).

    blame : compute what each camera alone removes (most of the time; else 0), check the calibration by the
    silhouettes, and count the subjects. Only one camera's pictures are held at a time. Raises RunError for a single
    camera, FootageError, NotFoundError.
    """
    cameras = session.cameras()
    if len(cameras) < 2:
        raise RunError(
            f"Session '{session.name}' has one camera: masks cannot be compared between views.",
            "Check its masks by eye instead.",
        )
    check_views(cameras)
    lenses = {camera.name: camera.reduced(JUDGED_SIDE) for camera in cameras}
    small, scale = tuple(lenses.values()), scale_of(session.body())
    with masks_of(session, settings) as maker:
        chosen = tuple(frames) or spread_frames(maker.footage.frame_count, FRAMES)
        if not chosen:
            raise FootageError(
                f"Session '{session.name}' has no frame whose masks could be measured.", "Add footage."
            )
        masks: dict[int, list[Bytes]] = {frame: [] for frame in chosen}
        people = {frame: PackedMasks() for frame in chosen}
        total = (len(cameras) + 1) * len(masks)
        borders: dict[str, list[float]] = {camera.name: [] for camera in cameras}
        for camera, frame, view in _each_view(maker, cameras, sorted(masks), total, progress):
            masks[frame].append(reduced(view.mask, lenses[camera.name]))
            borders[camera.name].append(border_support(view.picture, view.mask))
            if blame:
                people[frame].put(camera.name, person_alone(view.mask))
        in_front = _small_in_front(maker, lenses)
        counted: list[FrameCounts] = []
        seen: list[int] = []
        for done, frame in enumerate(chosen):
            progress("comparing masks", len(cameras) * len(masks) + done, total)
            seen += [count_subjects(masks[frame], small, scale)] if blame else []
            counted.append(count_frame(masks[frame], small, blame, scale=scale, in_front=in_front))
    quality = summed(chosen, tuple(camera.name for camera in cameras), counted)
    faults = silhouette_faults(cameras, people, height_of(session), scale) if blame else ()
    subjects = sorted(seen, reverse=True)[:2][-1] if seen else 0
    contrast = measure_contrast(session, settings, progress=progress)
    views = tuple(
        dataclasses.replace(view, border=float(np.mean(borders[view.camera]))) for view in quality.views
    )
    return dataclasses.replace(quality, views=views, doubts=faults, subjects=subjects, contrast=contrast)


def _small_in_front(maker: EvidenceMaker, lenses: Mapping[str, Camera]) -> dict[str, Bytes]:
    """Things in front, of the cameras that have one, as small as the compared masks."""
    things = {name: maker.in_front(name) for name in lenses}
    return {name: reduced(one, lenses[name]) for name, one in things.items() if one is not None}


def _each_view(
    maker: EvidenceMaker, cameras: tuple[Camera, ...], frames: Sequence[int], total: int, progress: Progress
) -> Iterator[tuple[Camera, int, ViewEvidence]]:
    """Picture and mask of every camera and frame, camera by camera: only one camera's pictures are held."""
    by_name = {camera.name: camera for camera in cameras}

    def looked(done: int, pictures: int) -> None:
        # The masks are compared afterwards, which makes up the rest of `total`.
        progress("comparing masks", len(cameras) * len(frames) * done // pictures, total)

    for name, frame, view in maker.views(tuple(by_name), frames, looked):
        yield by_name[name], frame, view


def measure_masks(
    session: Session, frames: Sequence[int] = (), progress: Progress = no_progress
) -> MaskQuality:
    """The quality of the session's masks. For the default frames it is stored: a blocking finding then refuses new runs
    (`silhouette_faults.accepted_faults`). Raises as `mask_quality` does.
    """
    quality = mask_quality(session, session_settings(session).evidence, frames, progress=progress)
    if frames:
        return quality
    stops = tuple(str(finding) for finding in blocking(quality.doubts))
    remember(session, MEASURED, quality.in_words(), quality.usable, stops)
    return quality


def look_before_the_first_run(session: Session, progress: Progress = no_progress) -> tuple[str, ...] | None:
    """For the notes of the first run of imported footage: that its masks are of no use, and what may help; None where
    something was tracked before. Its masks are measured, unless that was done: exchanged cameras, a mirrored video or a
    wrong unit refuse the run, instead of losing its frames. Masks that cannot be compared say nothing.
    """
    if not session.manifest.layout or len(session.manifest.footage.cameras) < 2 or session.runs():
        return None
    measured = origin_of(session, MEASURED)
    if measured is not None and not changed_inputs(session, MEASURED, ("footage", "calibration")):
        return ()
    try:
        quality = _measured_quickly(session, progress)
    except StudioError:
        return ()
    if stops := blocking(quality.doubts):
        remember(session, MEASURED, _in_doubt(stops[0]), False, tuple(map(str, stops)))
        return ()
    least = min(float(np.nan_to_num(view.agreement)) for view in quality.views)
    if least >= USELESS:
        return ()
    return (
        f"The views' masks agree by {least:.2f} only ({USABLE:g} is usual): hardly anything can be tracked with them."
        f" Set another background first: 'studio background {session.name} --source best', or \"Best of all\" in step"
        " Background, tries every source.",
    )


def _measured_quickly(session: Session, progress: Progress) -> MaskQuality:
    """The part of `mask_quality` that takes little time: agreement with a rough hull, and what the silhouettes say
    against the calibration.
    """
    cameras, scale = session.cameras(), scale_of(session.body())
    check_views(cameras)
    small = tuple(camera.reduced(JUDGED_SIDE) for camera in cameras)
    lenses = {camera.name: camera for camera in small}
    with masks_of(session, session_settings(session).evidence) as maker:
        frames = spread_frames(maker.footage.frame_count, FRAMES)
        masks: dict[int, list[Bytes]] = {frame: [] for frame in frames}
        people = {frame: PackedMasks() for frame in frames}
        total = len(cameras) * len(people)
        for camera, frame, view in _each_view(maker, cameras, frames, total, progress):
            masks[frame].append(reduced(view.mask, lenses[camera.name]))
            people[frame].put(camera.name, person_alone(view.mask))
        in_front = _small_in_front(maker, lenses)
    counted = [count_frame(masks[frame], small, False, ROUGH, scale, in_front) for frame in frames]
    faults = silhouette_faults(cameras, people, height_of(session), scale)
    return dataclasses.replace(
        summed(frames, tuple(camera.name for camera in cameras), counted), doubts=faults
    )


@dataclass(frozen=True, slots=True, eq=False)
class FrameCounts:
    """Pixels of one frame, (V,) each: of mask, silhouette, both, and of other masks removed only by this camera."""

    mask: NDArray[np.int64]
    hull: NDArray[np.int64]
    both: NDArray[np.int64]
    removed: NDArray[np.int64]
    litres: float
    pixels: NDArray[np.int64] | None = None


def count_frame(
    masks: Sequence[Bytes],
    cameras: tuple[Camera, ...],
    blame: bool = True,
    fineness: HullSettings = FINE,
    scale: float = 1.0,
    in_front: Mapping[str, Bytes] | None = None,
) -> FrameCounts:
    """The pixels that `ViewQuality`'s shares are made of.

    masks : (H, W) 0 or 255, in the order of the cameras. fineness : of the hull that the masks are compared with.
    scale : of the body (`scale_of`). in_front : (H, W) of cameras, above 0 where a thing in front may hide the subject:
    there a mask that lacks it removes nothing, and does not disagree.
    """
    nothing = np.zeros((1, 1), np.uint8)
    hidden: list[Bytes] = [(in_front or {}).get(camera.name, nothing) for camera in cameras]
    opened: list[Bytes] = [one | thing for one, thing in zip(masks, hidden, strict=True)]
    box = person_box(opened, cameras, scale)
    whole = None if box is None else large_hull(Reconstructor(cameras, box, fineness), opened)
    covers: list[Bytes] = [
        covered(whole, camera) & (one | ~thing)
        for camera, one, thing in zip(cameras, masks, hidden, strict=True)
    ]
    mask = np.array([np.count_nonzero(one) for one in masks])
    both = np.array([np.count_nonzero(one & cover) for one, cover in zip(masks, covers, strict=True)])
    removed = np.zeros(len(cameras), dtype=np.int64)
    if blame and len(cameras) > 2 and box is not None:
        removed = removed_pixels(masks, opened, cameras, Reconstructor(cameras, box, ROUGH))
    hull = np.array([np.count_nonzero(cover) for cover in covers])
    pixels = np.array([one.size for one in masks])
    return FrameCounts(mask, hull, both, removed, 0.0 if whole is None else whole.volume() * 1e-6, pixels)


def removed_pixels(
    masks: Sequence[Bytes], opened: Sequence[Bytes], cameras: tuple[Camera, ...], carver: Reconstructor
) -> NDArray[np.int64]:
    """(V,) pixels of the other cameras' masks that the hull covers only when a camera is left out. opened : the masks
    that carve, with what things in front may hide.
    """
    whole = large_hull(carver, opened)
    open_yet = [mask & ~covered(whole, camera) for mask, camera in zip(masks, cameras, strict=True)]
    removed = np.zeros(len(cameras), dtype=np.int64)
    for left_out in range(len(cameras)):
        alone = large_hull(carver, without(opened, left_out))
        for other, camera in enumerate(cameras):
            if other != left_out:
                removed[left_out] += np.count_nonzero(open_yet[other] & covered(alone, camera))
    return removed


def without(masks: Sequence[Bytes], left_out: int) -> list[Bytes]:
    """The masks with one camera's filled, so that it removes nothing."""
    changed = list(masks)
    changed[left_out] = np.full_like(masks[left_out], 255)
    return changed


def summed(frames: tuple[int, ...], names: tuple[str, ...], counted: Sequence[FrameCounts]) -> MaskQuality:
    """The quality over all frames' pixels. names : of the cameras. counted : one entry a frame."""
    mask, hull = np.stack([one.mask for one in counted]), np.stack([one.hull for one in counted])
    both, removed = np.stack([one.both for one in counted]), np.stack([one.removed for one in counted])
    covered, inside = _share(both, mask), _share(both, hull)
    everything = mask.sum()
    pixels = np.sum([one.mask * 0 if one.pixels is None else one.pixels for one in counted], axis=0)
    views = tuple(
        ViewQuality(
            camera=name,
            covered=float(_share(both[:, v].sum(), mask[:, v].sum())),
            inside=float(_share(both[:, v].sum(), hull[:, v].sum())),
            denied=float(_share(removed[:, v].sum(), everything - mask[:, v].sum())),
            frames=tuple((float(c), float(i)) for c, i in zip(covered[:, v], inside[:, v], strict=True)),
            filled=float(np.nan_to_num(_share(mask[:, v].sum(), pixels[v]))),
        )
        for v, name in enumerate(names)
    )
    return MaskQuality(frames, views, tuple(one.litres for one in counted))


def _share(part: NDArray[np.int64], whole: NDArray[np.int64]) -> NDArray[np.float64]:
    """part / whole, NaN where the whole is nothing."""
    return np.where(whole > 0, part / np.maximum(whole, 1), np.nan)
