"""Refinement inside the loop: each frame's pose is moved onto the silhouettes, and the next frame starts from there.

The search finds the valley, the local descent (`refinement`) its minimum. Where the silhouettes show that a limb is off
(`agreement`), that limb alone is resampled over its whole range (`limb_resampling`). Where the pictures show a limb
elsewhere then (`limbs_elsewhere`), that limb is resampled on silhouettes that have what changed there, shadows too, by
the same rule, and the pose is taken if fewer limbs are elsewhere with it. Tried without gain: draws that are bent
towards those places by inverse kinematics. Areas where something stands in front of the body are left out
(`hidden_areas`). A limb before the body is in no silhouette: the colours that were learnt of it say where it is
(`limb_colours`), and of a person every few frames the network that knows people (`reported_limbs`).
"""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from studio.body.model import BodyModel
from studio.foundations.arrays import Array, Indices
from studio.foundations.geometry.camera import Camera
from studio.foundations.knobs import next_frame_knob
from studio.search.trackers.agreement import Agreement
from studio.search.trackers.hidden_areas import learnt, without_hidden
from studio.search.trackers.limb_certainty import CertaintyOfLimbs
from studio.search.trackers.limb_colours import ColouredView, LimbColours
from studio.search.trackers.limb_resampling import (
    DOUBTFUL_SHARE,
    SURELY_ALONG,
    Hypothesis,
    SeenFrame,
    chains_of,
    drawn_along_lines,
    drawn_where_reported,
    recoloured,
    redrawn,
    thin_limbs_of,
    turned_along_lines,
)
from studio.search.trackers.limbs_elsewhere import Change, Elsewhere, LimbsElsewhere, lost_of
from studio.search.trackers.random_numbers import keyed_generator
from studio.search.trackers.refinement import FLOOR_HELP, Distances, RefinementSettings, Refiner
from studio.search.trackers.reported_limbs import (
    REPORTED,
    LimbSource,
    ReportedLimb,
    hidden_of,
    is_asked,
    last_lost,
    remembered,
    remembered_longer,
    reported_limbs,
    reported_lost,
)
from studio.search.trackers.thin_limbs import Lines, ThinLimb, lines_along
from studio.search.trackers.tracker import FilterState, FrameLikelihood, FrameResult, SearchSpace

POSE, CLOUD = "pose", "cloud"
REDRAWN_STEPS = 10
"""Least descent steps from a drawn pose, which is farther from the minimum than where a search ended."""
REDRAWN = 0x11A6


@dataclass(frozen=True, slots=True)
class FrameRefinementSettings:
    """The knobs of refining each frame after its search, the same for every tracker."""

    title = "Refinement of each frame"

    refine_frames: bool = next_frame_knob(
        True, label="refine each frame",
        help="Move each frame's pose onto the silhouettes after its search, and start the next frame from there.",
    )  # fmt: skip
    # Rendered clips of the validation half, two seeds: 6 steps are as accurate as 10 (within 0.3 mm, both ways).
    refine_frame_steps: int = next_frame_knob(
        6, 1, 100, 1, label="refinement steps", unit="steps",
        help="Most steps of the local descent of a frame.",
    )  # fmt: skip
    refine_frame_points: int = next_frame_knob(
        150, 20, 1000, 10, label="border points",
        help="Points of each view's silhouette border that the descent uses.",
    )  # fmt: skip
    redraw_limbs: bool = next_frame_knob(
        True, label="resample lost limbs",
        help="Where the silhouettes show that a limb is off, sample it over its whole range and refine the best.",
    )  # fmt: skip
    limb_colours: bool = next_frame_knob(
        True, label="colours of limbs",
        help="Learn the colours of limbs, and resample one before the body where they say that it is not there.",
    )  # fmt: skip
    thin_limbs: bool = next_frame_knob(
        True, label="thin limbs along lines",
        help="Find a tail by the lines in the pictures, too: of what is a few pixels wide masks hold only pieces.",
    )  # fmt: skip
    ask_network_every: int = next_frame_knob(
        5, 0, 1000, 1, label="ask the network every", unit="frames",
        help="How often the network that knows people is asked where an arm is that does not show; 0: never.",
    )  # fmt: skip
    above_floor: bool = next_frame_knob(True, label="stays above the floor", help=FLOOR_HELP)
    refined_spread: float = next_frame_knob(
        0.5, 0.05, 3.0, 0.05, label="spread after refinement",
        help="Multiplies σ0 where a frame starts from a refined pose, which is nearer to the body than a searched one.",
    )  # fmt: skip
    next_frame_from: str = next_frame_knob(
        POSE, choices=(POSE, CLOUD), label="next frame starts from",
        help="Where every particle of the next frame starts: at the refined pose, or in the cloud moved with it.",
    )  # fmt: skip


def descent(
    settings: FrameRefinementSettings, steps: int = RefinementSettings().refinement_steps
) -> RefinementSettings:
    """The settings of a run's local descents, of at most so many steps."""
    return RefinementSettings(refinement_steps=steps, refinement_floor=settings.above_floor)


def followed_along_lines(body: BodyModel, settings: FrameRefinementSettings) -> list[str]:
    """The limbs that a run follows along lines in the pictures: silhouettes lack them."""
    return chains_of(body) if settings.thin_limbs else []


def space_after(space: SearchSpace, carried: FilterState, settings: FrameRefinementSettings) -> SearchSpace:
    """The search space of a frame that follows a refined one: a smaller σ0. carried : into the frame."""
    if not settings.refine_frames or carried.estimate is None or settings.refined_spread == 1.0:
        return space
    return dataclasses.replace(space, sigma=settings.refined_spread * space.sigma)


class SilhouettesOf(Protocol):
    """A frame's silhouettes by camera."""

    def __call__(
        self, most: int, spots: Mapping[str, tuple[Indices, float]] | None = None, /
    ) -> Mapping[str, Distances]:
        """With at most so many border points each. spots : by camera pixels (K, 2) up to so many pixels from which they
        have what looks like a shadow, too, and what cannot be told.
        """
        ...


class FrameRefiner:
    """Refines the frames of one body; what is prepared for some cameras is kept. seed : of the run. source : reports
    where limbs are; None: silhouettes and pictures alone say so.
    """

    def __init__(
        self, body: BodyModel, cameras: tuple[Camera, ...], seed: int, source: LimbSource | None = None
    ) -> None:
        self._body, self._cameras = body, {camera.name: camera for camera in cameras}
        self._seed, self._source = seed, source if source is not None and source.limbs else None
        self._prepared = functools.cache(self._made_for)

    def refined(
        self,
        result: FrameResult,
        silhouettes_of: SilhouettesOf,
        problem: FrameLikelihood,
        settings: FrameRefinementSettings,
        changes_of: Callable[[], Mapping[str, Change]] | None = None,
    ) -> FrameResult:
        """The result with its pose refined, and the next frame's start; unchanged where refinement is off or no mask
        shows anything.

        changes_of : what changed in its pictures, by camera; None: silhouettes alone say which limbs are lost.
        """
        seen: Mapping[str, Distances] = (
            silhouettes_of(settings.refine_frame_points) if settings.refine_frames else {}
        )
        if not any(len(view.border) for view in seen.values()):
            return result
        tools = self._prepared(
            tuple(seen),
            descent(settings, settings.refine_frame_steps),
            descent(settings, max(settings.refine_frame_steps, REDRAWN_STEPS)),
        )
        source = self._source if settings.ask_network_every else None
        memory = result.carried.memory
        is_due = source is not None and is_asked(settings.ask_network_every, memory)
        frame = _FrameInWork(tools, result, silhouettes_of, settings, self._seed, tuple(seen.values()))
        if settings.redraw_limbs:
            frame.redraw_where_silhouettes_deny()
        follows_lines = settings.thin_limbs and bool(tools.thin)
        if changes_of is not None and (tools.witness.usable or is_due or follows_lines):
            frame.look_at(changes_of())
        if settings.redraw_limbs:
            frame.redraw_where_changes_show()
        views: Sequence[ColouredView] = frame.views_of_colours() if settings.limb_colours else ()
        if views and settings.redraw_limbs:
            frame.redraw_where_colours_deny(views)
        reported = frame.reported_by(source) if source is not None and is_due else {}
        if reported and settings.redraw_limbs:
            frame.redraw_where_reported(reported)
        if follows_lines:
            frame.redraw_along_lines(settings.redraw_limbs)

        pose = frame.pose
        certainty = tools.certainty_of.of(pose, frame.normal_matrix(), memory)
        limbs = certainty.limbs
        memory = {
            **learnt(memory, frame.off, tools.agreement.cameras, frame.masks),
            **certainty.moved,
            **tools.colours.learnt(pose, views, frame.elsewhere, memory),
        }
        if source is not None:
            memory[REPORTED] = (
                remembered(limbs, reported_lost(self._body, pose, reported))
                if is_due
                else remembered_longer(limbs, memory)
            )
        lost = [] if source is None else hidden_of(last_lost(limbs, memory), frame.elsewhere)
        carried = _carried(result, pose, settings.next_frame_from, tools.refiner)
        weight = float(problem.log_likelihood(pose[None])[0])
        return dataclasses.replace(
            result,
            estimate=dataclasses.replace(
                result.estimate, pose=pose, searched=result.estimate.pose, log_weight=weight
            ),
            carried=dataclasses.replace(carried, memory=memory),
            evaluations=result.evaluations + frame.evaluations,
            disagreement=frame.off.shares(),
            limb_loss=certainty.lost(frame.off, frame.elsewhere, lost, frame.along_lines()),
        )

    def _made_for(
        self, names: tuple[str, ...], settings: RefinementSettings, redrawing: RefinementSettings
    ) -> "_Tools":
        cameras = tuple(self._cameras[name] for name in names)
        ending = Refiner(self._body, cameras, settings)
        return _Tools(
            ending,
            Refiner(self._body, cameras, redrawing),
            Agreement(self._body, cameras),
            CertaintyOfLimbs(ending),
            LimbsElsewhere(self._body, cameras),
            LimbColours(self._body, cameras),
            thin_limbs_of(self._body, cameras, settings.refinement_floor),
        )


class _Tools(NamedTuple):
    """What refines poses in some cameras, and says how far they are off."""

    refiner: Refiner
    redrawing: Refiner
    agreement: Agreement
    certainty_of: CertaintyOfLimbs
    witness: LimbsElsewhere
    colours: LimbColours
    thin: Mapping[str, ThinLimb]


class _FrameInWork:
    """A frame's pose, from where the search ended to where all that witnesses against its limbs was heard.

    pose : (D,). off : where it and the silhouettes disagree. masks, silhouettes : one a camera; the latter without what
    is hidden. elsewhere : by limb what changed in the pictures. evaluations : poses compared.
    """

    def __init__(
        self,
        tools: _Tools,
        result: FrameResult,
        silhouettes_of: SilhouettesOf,
        settings: FrameRefinementSettings,
        seed: int,
        masks: tuple[Distances, ...],
    ) -> None:
        self._tools, self._result, self._seed = tools, result, seed
        self._silhouettes_of, self._points = silhouettes_of, settings.refine_frame_points
        self._memory, self.masks = result.carried.memory, masks
        self._changes, self.elsewhere, self.evaluations = dict[str, Change](), dict[str, Elsewhere](), 0
        self._lines = dict[str, list[Lines | None]]()
        self.pose = result.estimate.pose
        self.silhouettes = self._without_hidden(masks)
        self._ended = tools.refiner.refine(self.pose, self.silhouettes)
        self.pose = self._ended.pose
        self.off = tools.agreement.of(self.pose, self.silhouettes)

    def redraw_where_silhouettes_deny(self) -> None:
        """Resample limbs that are not where the silhouettes are."""
        if max(self.off.shares().values()) < DOUBTFUL_SHARE:
            return
        frame = self._seen(self.silhouettes)
        began, last = self._hypothesis(frame), self._result.carried.previous_estimate
        self._take(began, *redrawn(self._rng(0), began, frame, last))

    def look_at(self, changes: Mapping[str, Change]) -> None:
        """Take in what changed in the pictures, by camera."""
        self._changes = dict(changes)
        self.elsewhere = self._elsewhere_of(self.pose)

    def redraw_where_changes_show(self) -> None:
        """Resample limbs that the pictures show elsewhere, on silhouettes that have what changed there."""
        if not (named := lost_of(self.elsewhere)):
            return
        masks, silhouettes = self._with_changes(named)
        frame = self._seen(silhouettes)
        began, last = frame.hypothesis(self.pose), self._result.carried.previous_estimate
        found, drawn = redrawn(self._rng(1), began, frame, last, elsewhere=named)
        self.evaluations += drawn
        then = self.elsewhere if found is began else self._elsewhere_of(found.pose)
        if len(lost_of(then)) < len(named):
            self.pose, self.off, self.elsewhere = found.pose, found.off, then
            self.masks, self.silhouettes = masks, silhouettes

    def views_of_colours(self) -> Sequence[ColouredView]:
        """The pictures, as limbs' colours are learnt of them."""
        return self._tools.colours.views(self.pose, self._changed) if self._changed else []

    def redraw_where_colours_deny(self, views: Sequence[ColouredView]) -> None:
        """Resample limbs where the pictures have not their colours."""
        colours, frame = self._tools.colours, self._seen(self.silhouettes)
        began = self._hypothesis(frame)
        gains_of = functools.partial(colours.gains, views=views, known=colours.known(self._memory))
        self._take(began, *recoloured(self._rng(2), began, frame, self.elsewhere, gains_of))

    def reported_by(self, source: LimbSource) -> dict[str, ReportedLimb]:
        """The limbs that a source reports elsewhere."""
        pictures = {name: one.picture for name, one in self._changes.items()}
        return reported_limbs(source, self.pose, pictures, self.elsewhere)

    def redraw_where_reported(self, reported: Mapping[str, ReportedLimb]) -> None:
        """Resample limbs where they are reported to be, on silhouettes that have what changed there."""
        masks, silhouettes = (
            self._with_changes(tuple(reported)) if self._changed else (self.masks, self.silhouettes)
        )
        frame = self._seen(silhouettes)
        began = frame.hypothesis(self.pose)
        if self._take(began, *drawn_where_reported(self._rng(3), began, frame, reported)):
            self.masks, self.silhouettes = masks, silhouettes

    def redraw_along_lines(self, redraw: bool) -> None:
        """See where lines in the pictures run, and resample thin limbs along them. redraw : whether they are."""
        for number, (limb, thin) in enumerate(self._tools.thin.items()):
            lines = self._lines_of(thin, self.pose)
            if not any(one is not None for one in lines):
                continue
            self._lines[limb] = lines
            if not redraw:
                continue
            frame = self._seen(self.silhouettes)
            began, last = self._hypothesis(frame), self._result.carried.previous_estimate
            rng = self._rng(4 + number)
            self._take(began, *drawn_along_lines(rng, began, frame, thin, lines, last))
            if (thin.support(self.pose, lines) or 0.0) < SURELY_ALONG:
                began, lines_of = self._hypothesis(frame), functools.partial(self._lines_of, thin)
                if self._take(began, *turned_along_lines(rng, began, frame, thin, lines, lines_of)):
                    self._lines[limb] = lines_of(self.pose)

    def _lines_of(self, thin: ThinLimb, pose: Array) -> list[Lines | None]:
        return thin.lines(pose, self._changes, self._tools.agreement.corners(pose))

    def along_lines(self) -> dict[str, float]:
        """By thin limb how plainly lines run along it, where they are seen."""
        return lines_along(self._tools.thin, self.pose, self._lines)

    def normal_matrix(self) -> Array:
        """(D, D) of the least squares at the pose."""
        if self._ended.matrix is not None and self.pose is self._ended.pose:
            return self._ended.matrix
        return self._tools.refiner.loss(self.pose, self.silhouettes)[2]

    def _hypothesis(self, frame: SeenFrame) -> Hypothesis:
        """The pose as it stands. frame : of `silhouettes`."""
        return Hypothesis(self.pose, frame.refiner.loss_with_pull(self.pose, self.silhouettes), self.off)

    def _take(self, began: Hypothesis, found: Hypothesis, drawn: int) -> bool:
        """Whether something was found, which is the pose then. drawn : poses compared."""
        self.evaluations += drawn
        if found is began:
            return False
        self.pose, self.off = found.pose, found.off
        self.elsewhere = self._elsewhere_of(found.pose)
        return True

    @property
    def _changed(self) -> tuple[Change, ...]:
        return tuple(self._changes.values()) if self._tools.witness.usable else ()

    def _elsewhere_of(self, pose: Array) -> dict[str, Elsewhere]:
        return self._tools.witness.of(pose, self._changed, self._memory) if self._changed else {}

    def _with_changes(self, limbs: Sequence[str]) -> tuple[tuple[Distances, ...], list[Distances]]:
        """Masks and silhouettes with what changed where some limbs may be."""
        spots = self._tools.witness.spots(self.pose, self._changed, limbs, self._memory)
        masks = tuple(self._silhouettes_of(self._points, spots).values())
        return masks, self._without_hidden(masks)

    def _without_hidden(self, masks: Sequence[Distances]) -> list[Distances]:
        agreement = self._tools.agreement
        return without_hidden(masks, agreement.cameras, agreement.mm_per_pixel(self.pose), self._memory)

    def _seen(self, silhouettes: Sequence[Distances]) -> SeenFrame:
        return SeenFrame(self._tools.redrawing, self._tools.agreement, silhouettes)

    def _rng(self, witness: int) -> np.random.Generator:
        return keyed_generator(self._seed, self._result.frame, 0, witness, REDRAWN)


def _carried(result: FrameResult, pose: Array, start: str, refiner: Refiner) -> FilterState:
    """State for the next frame: the set at the frame's end, moved to the refined pose."""
    particles = result.carried.particles
    if particles is not None and start == POSE:
        particles = dataclasses.replace(particles, poses=np.repeat(pose[None], len(particles.poses), axis=0))
    elif particles is not None:
        moved = particles.poses + (pose - result.estimate.pose)
        particles = dataclasses.replace(particles, poses=np.clip(moved, refiner.lower, refiner.upper))
    return dataclasses.replace(result.carried, particles=particles, estimate=pose)
