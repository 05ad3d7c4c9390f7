"""Whether a tracked frame is on the body at all, and whether there is anything to track.

Three answers:

- *No evidence*: nothing of a body's size is in any mask, or every picture is blank (a covered lens, a dead signal,
  where background subtraction sees foreground everywhere). The pose is held.
- *Lost*: the best log weight is far below what it was in well tracked frames of this run, or the silhouettes of model
  and mask hardly overlap. How far is too far differs with the likelihood; the limits were measured (below).
- *Tracked*: neither.

The weight of a pose depends on clothes, light and masks as much as on the pose, so it is compared with the run's own
median over its last well tracked frames, in units of their own spread (1.4826 × the median distance from the median)
but never of less than the likelihood's usual one (`Weighting.loss`). Overlap is f_s (`likelihood.silhouette_areas`): it
means the same for every likelihood, and serves in the first frames, before there is a distribution. Of a body with
meshes it is that of these, and the weight says nothing: how far cones around links are off differs from pose to pose.

Measured with the annealed filter, 1000 evaluations, on rendered footage: the twin of the Lee walk at 20 Hz, a circle
seen by three cameras at 20 Hz, the bundled walk; masks by subtraction. Tracked: frames with a mean marker error below
100 mm of a run that starts from the truth. Lost: frames with more than 150 mm of runs that start from another frame's
pose or 250 to 700 mm aside; found: those with less than 60 mm. Turned: of runs that start back to front. Each is
taken as a frame alone; a run believes three in a row.

    likelihood               tracked: called lost   lost: missed   found: called lost   turned: called lost
    edge-region                     233: 0             156: 7           43: 0                60: 22
    edge-silhouette                 350: 0             145: 0           67: 1                60: 33
    edge-region-silhouette          344: 0             138: 0           48: 0                60: 34
    bodytrack                       264: 0             156: 7           39: 0                60: 30
    template                        350: 0             130: 0           75: 11               60: 50
    blobs                           211: 0             102: 3           24: 11               40: 5

All that were missed are 150 to 187 mm off. The tracked frames' weights lie at most 3.3 spreads below the median, those
of 99 of 100 lost frames 6 and more below. A body that is tracked back to front often goes unnoticed: the outline
alone hardly shows it.
"""

import functools
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from studio.body.model import BodyModel
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence, half_mask
from studio.foundations.arrays import Array, Mask, median_and_spread
from studio.foundations.geometry.camera import Camera
from studio.search.likelihood.catalogue import LossLimit
from studio.search.likelihood.mesh_outlines import MeshOutlines
from studio.search.likelihood.outline_kernels import LANES, SEEN_ROW
from studio.search.likelihood.outlines import OutlineProjector
from studio.search.likelihood.problem import QualityMeasured
from studio.search.likelihood.silhouette_areas import FOREGROUND, HALF, Areas, halved, silhouettes_of
from studio.search.trackers.tracker import FrameLikelihood

SEEN = SEEN_ROW * LANES
"""Of an outline's block: how its first pose's limb is seen."""
REMEMBERED = 60
"""Well tracked frames that make the distribution."""
FEWEST = 10
"""Least frames for a distribution."""
LEAST_OVERLAP = 0.5
"""f_s below which a pose is lost whatever its weight."""
OVERLAP_SHARE = 0.85
"""f_s below this share of its median is lost."""
LEAST_AREA = 0.2
"""Mask, as a share of the body's own silhouette, below which a view shows no body."""
BLANK_SPREAD, BLANK_STEP = 4.0, 8
"""A picture whose grey levels, every eighth pixel, differ by less (standard deviation) is blank."""


@dataclass(frozen=True, slots=True)
class Sight:
    """Agreement of a frame's pose with the evidence. overlap : mean f_s over the views, NaN where there are no masks.
    seen : whether there is anything to track. called_lost : whether the likelihood itself says that it is lost. notes :
    of cameras that say nothing of the pose, a sentence each kind.
    """

    overlap: float
    seen: bool
    called_lost: bool = False
    notes: tuple[str, ...] = ()


class Onlooker:
    """Compares poses with evidence from all or some of the cameras."""

    def __init__(self, body: BodyModel, cameras: tuple[Camera, ...]) -> None:
        by_name = {camera.name: camera for camera in cameras}

        def projector(names: tuple[str, ...]) -> OutlineProjector:
            return OutlineProjector.of_body(body, tuple(by_name[name] for name in names))

        def meshes(names: tuple[str, ...]) -> MeshOutlines:
            return MeshOutlines(body, tuple(by_name[name] for name in names))

        self._projector, self._meshes = functools.cache(projector), functools.cache(meshes)
        self._has_meshes = bool(body.meshes)

    def sight(self, evidence: FrameEvidence, pose: Array, problem: FrameLikelihood | None = None) -> Sight:
        """How a pose (D,) agrees with a frame's evidence. problem : the frame's, given the expected poses."""
        return self.looking(evidence, problem)(pose)

    def looking(
        self, evidence: FrameEvidence, problem: FrameLikelihood | None = None
    ) -> Callable[[Array], Sight]:
        """`sight` of one frame as a function of poses (D,). Holds only the evidence's silhouettes, a bit a pixel."""
        lost = isinstance(problem, QualityMeasured) and problem.lost_evidence
        cameras = tuple(view.camera for view in evidence.views)
        names = np.array(cameras)
        blank, empty = shown_by(evidence)
        carved = all(view.background is not None for view in evidence.views)
        notes = (*_noted("The picture of {} is blank.", names[blank]),)
        notes += (*_noted("Nothing stands out in {}.", names[empty & ~blank]),)
        if blank.all():
            return lambda _: Sight(float("nan"), seen=False, called_lost=lost, notes=notes)
        if carved and empty.all():
            nothing = isinstance(problem, QualityMeasured) and problem.quality == -np.inf
            return lambda _: Sight(float("nan"), seen=not nothing, called_lost=lost, notes=notes)
        silhouettes, projector = silhouettes_of(evidence, HALF), self._projector(cameras)
        meshes = self._meshes(cameras) if self._has_meshes else None
        masks = [halved(half_mask(view) >= FOREGROUND) for view in evidence.views] if meshes else []

        def sight(pose: Array) -> Sight:
            outlines = projector.blocks(pose[None])
            areas = _areas_of_links(meshes, pose, masks) if meshes else silhouettes.areas(outlines, 1)
            own = areas.projected[0] + areas.outside[0]
            shown = (areas.observed >= LEAST_AREA * own) & ~blank
            overlap = float(areas.fitness()[0][~blank].mean())
            behind = (outlines[0, :, :, SEEN] < 0.0).all(axis=1)
            said = (*notes, *_noted("The pose is out of sight of {}.", names[behind]))
            seen = bool((shown & (areas.observed > 0)).any())
            return Sight(overlap, seen, called_lost=lost, notes=said)

        return sight


class WeightWatch:
    """Distribution of weight and overlap over a run's well tracked frames, which are given in order."""

    def __init__(self, limit: LossLimit, tracked: Iterable[tuple[float, float]] = ()) -> None:
        self._limit = limit
        self._weights: deque[float] = deque(maxlen=REMEMBERED)
        self._overlaps: deque[float] = deque(maxlen=REMEMBERED)
        for log_weight, overlap in tracked:
            self.well_tracked(log_weight, overlap)

    def well_tracked(self, log_weight: float, overlap: float) -> None:
        """Add a well tracked frame."""
        self._weights.append(log_weight)
        if np.isfinite(overlap):
            self._overlaps.append(overlap)

    def is_lost(self, log_weight: float, sight: Sight) -> bool:
        """Whether a frame's best pose is off the body."""
        if sight.called_lost or sight.overlap < LEAST_OVERLAP:
            return True
        limit = self._limit
        if len(self._overlaps) >= FEWEST and sight.overlap < OVERLAP_SHARE * float(np.median(self._overlaps)):
            return True
        if len(self._weights) < FEWEST:
            return False
        median, spread = median_and_spread(np.array(self._weights))
        return log_weight < median - limit.spreads * max(limit.spread, spread)


def _areas_of_links(meshes: MeshOutlines, pose: Array, masks: Sequence[Mask]) -> Areas:
    """The areas of the links of a pose (D,) and of masks (H, W) at half resolution; what lies beyond a picture is not
    counted.
    """
    links = [
        meshes.owners(pose, view, 2, (mask.shape[1], mask.shape[0])) >= 0 for view, mask in enumerate(masks)
    ]
    both = [np.count_nonzero(mask & own) for mask, own in zip(masks, links, strict=True)]
    return Areas(
        np.array([both]),
        np.array([[np.count_nonzero(own) for own in links]]),
        np.array([np.count_nonzero(mask) for mask in masks]),
        np.zeros((1, len(masks))),
    )


def _noted(sentence: str, cameras: Iterable[str]) -> tuple[str, ...]:
    """The sentence about these cameras, none about none."""
    names = [f"'{name}'" for name in cameras]
    return (sentence.format(f"camera{'s' if len(names) > 1 else ''} {', '.join(names)}"),) if names else ()


def anything_seen(evidence: FrameEvidence) -> bool:
    """Whether any view that is not blank has foreground in its mask."""
    blank, empty = shown_by(evidence)
    return bool((~blank & ~empty).any())


_shown: WeakKeyDictionary[FrameEvidence, tuple[Mask, Mask]] = WeakKeyDictionary()


def shown_by(evidence: FrameEvidence) -> tuple[Mask, Mask]:
    """Whether the picture of each view is blank (V,), and whether its mask is empty (V,). Kept as long as the evidence
    is, so that it can be made ready beforehand.
    """
    found = _shown.get(evidence)
    if found is None:
        blank = np.array([is_blank(view) for view in evidence.views], np.bool_)
        empty = np.array([not view.mask.any() for view in evidence.views], np.bool_)
        found = _shown[evidence] = blank, empty
    return found


def is_blank(view: ViewEvidence) -> bool:
    """Whether a picture is blank: one grey, black or white."""
    seen = view.picture[::BLANK_STEP, ::BLANK_STEP]
    return seen.size > 0 and float(seen.std()) < BLANK_SPREAD
