# pyright: standard
"""Tempered sequential Monte Carlo whose particles stay on a CUDA device: the prior is drawn from, moves are proposed,
taken or refused, and the ladder is climbed there.

`DeviceLadder` searches R runs side by side that have one body, one space and as many particles each; their seeds,
frames, σ0 and pictures may differ. The host decides nothing within a frame: t, the steps' widths and the evidence are
numbers of a run that lie there, and of a layer it reads the record alone. Symbols and equations are those of
`tempered`.

Poses are in single precision, so that a move of which chance decides by less than that may be taken here and refused by
the processor; from there on the two are other samples of the same posterior.

A prior of K Gaussians costs K D sums and products for each particle and layer, which from some thousand particles on is
more than weighing it; whose limbs are exchanged is found by comparing each particle's lot with all others'.

Not here: limbs kept apart, which the processor's search has.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array
from studio.search.likelihood.device_weighing import ProblemOnDevice, WeighingDevice
from studio.search.trackers.device_runs import THREADS, Launched, LayersAhead, Moment, kernel, limits_there
from studio.search.trackers.device_search import DeviceFilter, DeviceSet
from studio.search.trackers.device_search_kernels import (
    ANNEALED,
    DIFFUSED,
    SIGMA,
    SUMMING,
    SURVIVING,
    WANTED,
    WEIGHED,
)
from studio.search.trackers.device_tempered_kernels import (
    ALPHA,
    EVIDENCE,
    MIXING,
    RUNGS,
    STEP,
    TAKEN,
    TEMPER,
    TOGETHER,
    WALK,
    WEIGHED_AT,
)
from studio.search.trackers.frame_prior import FramePrior
from studio.search.trackers.particles import unweighted
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.settings import TemperedSettings
from studio.search.trackers.tempered import (
    BACK,
    BEFORE,
    BEFORE_ELIGIBLE,
    BEFORE_PRIOR,
    BEFORE_RAW,
    KIND,
    LADDER,
    PARTNER,
    TemperedFilter,
)
from studio.search.trackers.tracker import Arrays, FilterState, LayerRecord, ParticleSet, SearchSpace

CLIMBED = (TEMPER, EVIDENCE, STEP, WALK)
"""Of a run's ladder what goes on to the next layer, in the order of the processor's."""


@dataclass(frozen=True, slots=True, eq=False)
class DeviceMoves:
    """Poses of R runs there, `count` = N a run, that a layer is to weigh: drawn from the prior where `is_first`, else
    proposed from before (D, R N); of what leads there see `device_tempered_kernels`. ladder : (R, 7). turn : which of
    two places all of this has.
    """

    poses: Any
    count: int
    is_first: bool
    before: Any
    raw: Any
    prior: Any
    kinds: Any
    partners: Any
    back: Any
    ladder: Any
    turn: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class DevicePrior:
    """Priors of R runs there: centres (D, R K), K = count, log_weights and their sums so far, cumulated (R K,)."""

    centres: Any
    count: int
    log_weights: Any
    cumulated: Any


class DeviceLadder(DeviceFilter):
    """R runs of one body, side by side. A set of moves that it returns is valid until one is proposed from a set that
    was proposed from it; a weighed one until the next is weighed.
    """

    def __init__(self, device: WeighingDevice, space: SearchSpace, runs: int = 1) -> None:
        super().__init__(device, space, runs)
        self._bounds = [
            (self._copied(f"edges {kept}", edges), self._copied(f"limits {kept}", there))
            for kept, (edges, there) in enumerate(limits_of(space, kept=kept) for kept in (False, True))
        ]
        self._prior: DevicePrior | None = None
        self._shared: dict[bool, Any] = {}
        """What the prior's Gaussians count, where limits are kept or not."""

    def set_priors(self, priors: Sequence[FramePrior]) -> None:
        """Bring the runs' priors of a frame."""
        size, count = len(self.space.names), len(priors[0].centres)
        # A layer that was launched too early may still be at work with what is there.
        self._stream.synchronize()
        widths = np.array([one.deviation for one in priors]) * (self.space.upper > self.space.lower)
        self._widths = self._copied("widths", widths)
        centres = self._memory("centres", (size, max(self.runs * count, 1)), np.float32)
        weights = np.zeros(1)
        if count:
            weights = np.concatenate([one.log_weights for one in priors])
            self.device.bring(np.concatenate([one.centres for one in priors]).astype(np.float64), centres)
        cumulated = np.cumsum(np.exp(weights.reshape(self.runs if count else 1, -1)), axis=1).ravel()
        self._prior = DevicePrior(
            centres,
            count,
            self._copied("prior log-weights", weights),
            self._copied("prior cumulated", cumulated),
        )
        self._shared = {}

    def draw(self, moments: Sequence[Moment], count: int, *, bounded: bool) -> DeviceMoves:
        """The set of `count` particles a run, drawn from the prior, that a frame's first layer weighs."""
        prior, (edges, limits) = self._prior, self._bounds[bounded]
        assert prior is not None
        following = self._moves(count, 0, is_first=True)
        keys = self._copied("keys", np.array([tuple(moment) for moment in moments], dtype=np.uint64))
        kernel("draw_prior")[-(-self.runs * count // THREADS), THREADS, self._stream](
            prior.centres, prior.count, prior.cumulated, self._widths, edges, limits, keys, count, following.poses
        )  # fmt: skip
        return following

    def take_moves(self, sets: Sequence[ParticleSet]) -> DeviceMoves:
        """Sets of the host, one a run and of as many particles each, there."""
        count, extras = len(sets[0].poses), [one.extra for one in sets]
        there = self._moves(count, 0, is_first=LADDER not in extras[0])
        self.device.bring(np.concatenate([one.poses for one in sets]), there.poses)
        if there.is_first:
            return there
        self.device.bring(np.concatenate([extra[BEFORE] for extra in extras]), there.before)
        for array, name in (
            (there.raw, BEFORE_RAW),
            (there.prior, BEFORE_PRIOR),
            (there.kinds, KIND),
            (there.partners, PARTNER),
            (there.back, BACK),
        ):
            joined = np.concatenate([extra[name] for extra in extras])
            array.copy_to_device(joined.astype(array.dtype), stream=self._stream)
        ladder = np.zeros((self.runs, RUNGS))
        ladder[:, CLIMBED] = [extra[LADDER] for extra in extras]
        there.ladder.copy_to_device(ladder, stream=self._stream)
        return there

    def climb(
        self,
        given: DeviceMoves,
        problem: ProblemOnDevice,
        moments: Sequence[Moment],
        rules: TemperedSettings,
        *,
        is_last: bool,
    ) -> tuple[DeviceSet, DeviceMoves]:
        """Weigh moves, take or refuse them, climb the ladder, draw, and propose the next ones: the set with its
        weights, and what follows from it (of which only the ladder is meant in the last layer).
        """
        size, count, prior = len(self.space.names), given.count, self._prior
        assert prior is not None
        whole, bounded = self.runs * count, rules.constraints != "ignore"
        keys, dials, levers = self._told(moments, rules, count, is_last=is_last)
        following = self._moves(count, 1 - given.turn, is_first=False)
        weights = self._memory("weights", (2, whole), np.float64)
        densities = self._memory("densities", (whole,), np.float64)
        moved = given.poses if given.is_first else self._memory("moved", (size, whole), np.float32)
        moved_weights = weights if given.is_first else self._memory("moved weights", (2, whole), np.float64)
        moved_prior = densities if given.is_first else self._memory("moved prior", (whole,), np.float64)
        taken = self._memory("taken", (whole,), np.int32)
        annealed = self._memory("annealed", (self.runs, ANNEALED), np.float64)
        cumulated = self._memory("cumulated", (whole,), np.float64)
        parents = self._memory("parents", (2, whole), np.int32)
        lots = self._memory("lots", (whole,), np.uint32)
        ranks = self._memory("ranks", (whole,), np.int32)
        order = self._memory("order", (whole,), np.int32)
        shares, limits = self._shares(bounded), self._bounds[bounded][1]
        systematic = rules.resampling == "systematic"
        every = count if len(problem.frame.observed) > 1 else whole
        edges, found, stream = self.device.edges_of(None), self._moments, self._stream
        grid, runs = (-(-whole // THREADS), THREADS, stream), (self.runs, SUMMING, stream)
        blocks, few = ((size, self.runs), SUMMING, stream), (-(-self.runs // 32), 32, stream)

        def launch() -> None:
            self.device.weigh(given.poses, problem, edges, every, weights, stream, self._memory)
            kernel("find_densities")[(-(-count // TOGETHER), self.runs), MIXING, stream](
                given.poses, prior.centres, prior.count, shares, self._widths, limits, count, densities
            )
            if not given.is_first:
                kernel("take_moves")[grid](
                    given.poses, given.before, weights, densities, given.raw, given.prior, given.kinds,
                    given.partners, given.back, given.ladder, keys, count, moved, moved_weights, moved_prior, taken,
                )  # fmt: skip
            kernel("adapt_steps")[runs](
                taken, given.kinds, count, given.is_first, levers, dials, given.ladder, following.ladder
            )
            kernel("anneal_weights")[runs](moved_weights, count, dials, annealed, cumulated)
            kernel("climb")[few](annealed, dials, count, following.ladder)
            kernel("find_moments")[blocks](moved, count, WEIGHED, found)
            kernel("find_weighted_moments")[blocks](moved, cumulated, count, found)
            if is_last:
                return
            kernel("draw_sample")[grid](
                moved, moved_weights, moved_prior, cumulated, annealed, keys, count, systematic, following.before,
                following.raw, following.prior, parents, lots,
            )  # fmt: skip
            kernel("find_moments")[blocks](following.before, count, SURVIVING, found)
            pairs = (size, size, self.runs), SUMMING, stream
            kernel("find_weighted_correlations")[pairs](moved, cumulated, count, found, self._root)
            kernel("find_root")[few](self._root)
            kernel("rank_lots")[grid](lots, levers, count, ranks, order)
            kernel("propose_moves")[grid](
                following.before, found, self._root, following.ladder, levers, keys, self._place, ranks, order,
                count, following.poses, following.kinds, following.partners, following.back,
            )  # fmt: skip
            kernel("find_moments")[blocks](following.poses, count, DIFFUSED, found)

        where = "ladder", id(given.poses), id(following.poses), problem.frame.memory, every
        how = problem.factors, problem.frame.scale, given.is_first, is_last, bounded, systematic
        self._launch((*where, *how, count, id(prior.centres), prior.count), launch)
        return DeviceSet(moved, count, given.turn, cumulated, moved_weights, annealed), following

    def send_climbed(
        self, weighed: DeviceSet, climbed: DeviceMoves, layer: int, *, is_last: bool
    ) -> Callable[[], list[LayerRecord]]:
        """As `send`, with what the ladder says of the layer."""
        return self.send(weighed, layer, (), is_last=is_last, also={"ladder": climbed.ladder})

    def give_moves(self, there: DeviceMoves) -> list[ParticleSet]:
        """All runs' moves on the host, as far as they are known without the prior."""
        poses = self._given(there.poses)
        if there.is_first:
            return [unweighted(own) for own in poses]
        before = self._given(there.before)
        arrays = {
            BEFORE_RAW: there.raw,
            BEFORE_ELIGIBLE: there.raw,
            BEFORE_PRIOR: there.prior,
            KIND: there.kinds,
            PARTNER: there.partners,
            BACK: there.back,
        }
        parts = {name: np.split(self._fetched(array), self.runs) for name, array in arrays.items()}
        ladders = self._fetched(there.ladder)[:, CLIMBED]
        given = list[ParticleSet]()
        for run, own in enumerate(poses):
            extra: Arrays = {BEFORE: before[run], LADDER: ladders[run]}
            extra |= {name: np.ascontiguousarray(values[run]) for name, values in parts.items()}
            extra |= {name: extra[name].astype(np.int64) for name in (KIND, PARTNER)}
            given.append(unweighted(own, extra))
        return given

    def _records_of(
        self,
        sent: Mapping[str, NDArray[Any]],
        count: int,
        step: int,
        layer: int,
        wanted: Sequence[float],
    ) -> list[LayerRecord]:
        ladder = sent["ladder"]
        records = super()._records_of(sent, count, step, layer, ladder[:, ALPHA].tolist())
        return [
            dataclasses.replace(
                record,
                temper=float(own[WEIGHED_AT]),
                acceptance=float(own[TAKEN]),
                log_evidence=float(own[EVIDENCE]),
            )
            for record, own in zip(records, ladder, strict=True)
        ]

    def _shares(self, bounded: bool) -> Any:  # noqa: ANN401
        """What the prior's Gaussians count (R K,), found once a frame."""
        prior = self._prior
        assert prior is not None
        if bounded not in self._shared:
            many = max(self.runs * prior.count, 1)
            shares = self._shared[bounded] = self._memory(f"shares {bounded}", (many,), np.float64)
            if prior.count:
                kernel("share_centres")[-(-many // THREADS), THREADS, self._stream](
                    prior.centres,
                    prior.count,
                    prior.log_weights,
                    self._widths,
                    self._bounds[bounded][0],
                    shares,
                )
        return self._shared[bounded]

    def _told(
        self, moments: Sequence[Moment], rules: TemperedSettings, count: int, *, is_last: bool
    ) -> tuple[Any, Any, Any]:
        """Keys, dials and rules of a layer, there."""
        keys = np.array([tuple(moment) for moment in moments], dtype=np.uint64)
        dials = np.zeros((self.runs, SIGMA + len(self.space.names)))
        dials[:, WANTED] = rules.survival
        paired = 2 * int(rules.crossover * count / 2.0)
        levers = np.array([rules.likelihood_scale, rules.limb_moves, paired, is_last], dtype=np.float64)
        return self._copied("keys", keys), self._copied("dials", dials), self._copied("rules", levers)

    def _moves(self, count: int, turn: int, *, is_first: bool) -> DeviceMoves:
        """Where a set goes: one proposed from it, whose turn is the other, goes elsewhere."""
        size, whole = len(self.space.names), self.runs * count

        def own(name: str, kind: type[np.generic]) -> Any:  # noqa: ANN401
            return self._memory(f"{name} {turn}", (whole,), kind)

        return DeviceMoves(
            self._poses(count, turn),
            count,
            is_first,
            before=self._memory(f"before {turn}", (size, whole), np.float32),
            raw=own("raw", np.float64),
            prior=own("prior", np.float64),
            kinds=own("kinds", np.int32),
            partners=own("partners", np.int32),
            back=own("back", np.float64),
            ladder=self._memory(f"ladder {turn}", (self.runs, RUNGS), np.float64),
            turn=turn,
        )


def limits_of(space: SearchSpace, *, kept: bool) -> tuple[Array, Array]:
    """(2, D) lowest and highest values, and the same as a card has them, infinite where limits are not kept."""
    there = limits_there(space, kept)
    return np.stack([space.lower, space.upper]).astype(np.float64) if kept else there.copy(), there


@dataclass(frozen=True, slots=True, eq=False)
class _Rung:
    """A frame's moves, or the last layer's set with its weights."""

    moves: DeviceMoves
    weighed: DeviceSet | None = None


class DeviceSearch(LayersAhead[_Rung]):
    """Searches of one frame on a device, for `frame_loop`."""

    def __init__(
        self,
        tracker: TemperedFilter,
        problem: ProblemOnDevice,
        spaces: Sequence[SearchSpace],
        settings: Sequence[TemperedSettings],
    ) -> None:
        super().__init__(tracker, spaces)
        self._problem = problem
        self._ladder = DeviceLadder(problem.device, spaces[0], len(spaces))
        self._priors = list[FramePrior]()

    def begin(
        self,
        previous: Sequence[FilterState],
        numbers: Sequence[RandomNumbers],
        settings: Sequence[TemperedSettings],
    ) -> None:
        """Draw the first layer's sets from the priors that the last frame left."""
        shared = settings[0]
        bounded = shared.constraints != "ignore"
        self._priors = [
            FramePrior.of_frame(
                one, space, scale=shared.diffusion_scale, dynamics=shared.dynamics, bounded=bounded
            )
            for one, space in zip(previous, self._spaces, strict=True)
        ]
        self._ladder.set_priors(self._priors)
        moments = [Moment(*one.key) for one in numbers]
        self._set = _Rung(self._ladder.draw(moments, shared.particles, bounded=bounded))

    def take(self, sets: Sequence[ParticleSet]) -> None:
        """Go on from sets of the host."""
        self._priors = [
            FramePrior.of_arrays(one.extra, space, bounded=True)
            for one, space in zip(sets, self._spaces, strict=True)
        ]
        self._ladder.set_priors(self._priors)
        self._set = _Rung(self._ladder.take_moves(sets))

    def particles(self) -> list[ParticleSet]:
        """The sets that the next layer weighs, or the last layer's with their weights, on the host."""
        assert self._set is not None
        if self._set.weighed is not None:
            return self._ladder.give(self._set.weighed)
        return [
            dataclasses.replace(there, extra=there.extra | prior.arrays)
            for there, prior in zip(self._ladder.give_moves(self._set.moves), self._priors, strict=True)
        ]

    def _launch(
        self, given: _Rung, layer: int, moments: Sequence[Moment], settings: Sequence[TemperedSettings]
    ) -> Launched[_Rung]:
        is_last = layer == settings[0].layers - 1
        weighed, following = self._ladder.climb(
            given.moves, self._problem, moments, settings[0], is_last=is_last
        )
        sent = self._ladder.send_climbed(weighed, following, layer, is_last=is_last)
        return Launched(_Rung(following, weighed if is_last else None), given.moves.count, sent)
