"""What is read once of every frame of a run, for the views over frames: kept while it is used, bounded by bytes.

A frame is read again when its numbers in the store have changed (it was annealed again, say).
"""

import threading
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studio.foundations.arrays import Array, Floats, Mask
from studio.foundations.errors import NotFoundError
from studio.foundations.words import enumerated
from studio.results.inspection.reading import InspectedFrame, InspectedRun, no_value, ordinal
from studio.results.inspection.reference import body_points, by_limb, true_points
from studio.results.inspection.schedule import alarm_of, effective_number
from studio.results.inspection.tables import Row, Selection, ViewResult
from studio.sessions.results_reader import Timeline

MOST_BYTES = 128 << 20
SOME = 3
"""Frames that a note names, at most."""


@dataclass(frozen=True, slots=True, eq=False)
class FrameSummary:
    """variances : (L, 3, D) of each layer as weighed, before and after noise. betas, alphas, effective : (L,).
    alarms : (L,) which layers have one. spread : (M,) root mean squared distance of the last set's points from their
    mean, mm. ranks : (M, 3) share of the last set's weight below the truth's coordinates, NaN where there is none.
    disagreement : as in the frame's result. log_evidence : of the last layer, NaN where the tracker has none.
    search_layers, searches : layers of one search of the frame, and how many it had.
    """

    variances: Floats
    betas: Array
    alphas: Array
    effective: Array
    alarms: Mask
    spread: Array
    ranks: Array
    disagreement: Mapping[str, float]
    log_evidence: float
    search_layers: int
    searches: int

    @property
    def last_search(self) -> slice:
        """The layers of the last search, whose result is the frame's: what frames are compared by."""
        return slice((self.searches - 1) * self.search_layers, None)

    @property
    def size(self) -> int:
        parts = (self.variances, self.betas, self.alphas, self.effective, self.spread, self.ranks)
        return sum(part.nbytes for part in parts)


def summary_of(frame: InspectedFrame) -> FrameSummary:
    """What the views over frames need of a frame."""
    layers, run = frame.layers, frame.of
    last = len(layers) - 1
    points, weights = body_points(run.body, layers[last].poses), frame.weights(last)
    mean = np.tensordot(weights, points, axes=1)
    spread = np.sqrt(weights @ np.sum((points - mean) ** 2, axis=2))
    truth, ranks = true_points(run, frame.number), np.full(points.shape[1:], np.nan)
    if truth is not None:
        below = (points < truth) + 0.5 * (points == truth)
        ranks = np.where(np.isfinite(truth), np.tensordot(weights, below, axes=1), np.nan)
    return FrameSummary(
        np.stack(
            [[one.variance_weighed, one.variance_resampled, one.variance_diffused] for one in layers]
        ).astype(np.float32),
        np.array([record.beta for record in layers]),
        np.array([record.alpha_reached for record in layers]),
        np.array([effective_number(frame.log_weights(layer)) for layer in range(len(layers))]),
        np.array([bool(alarm_of(frame, layer)) for layer in range(len(layers))]),
        spread,
        ranks,
        {} if frame.result is None else frame.result.disagreement,
        layers[last].log_evidence,
        frame.search_layers,
        frame.searches,
    )


def stamps_of(line: Timeline) -> dict[int, tuple[float, float, int]]:
    """By frame, numbers that change when it is annealed again."""
    return {
        int(frame): (float(weight), float(time), int(version))
        for frame, weight, time, version in zip(
            line.frames, line.log_weights, line.milliseconds, line.settings_versions, strict=True
        )
    }


class _Kept:
    """Summaries of runs, those of the least lately used runs forgotten. Thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._runs: OrderedDict[Path, dict[int, tuple[object, FrameSummary]]] = OrderedDict()
        self._one_at_a_time = threading.Lock()

    def of(self, run: InspectedRun) -> dict[int, FrameSummary]:
        """Summaries by frame, ascending."""
        # What several tables of a page need at once is read once.
        with self._one_at_a_time, run.run.results() as results:
            with self._lock:
                known = dict(self._runs.get(run.run.folder, {}))
            by_frame: dict[int, tuple[object, FrameSummary]] = {}
            for frame, stamp in stamps_of(results.timeline()).items():
                before = known.get(frame)
                if before is not None and before[0] == stamp:
                    by_frame[frame] = before
                    continue
                try:
                    by_frame[frame] = (stamp, summary_of(run.frame(frame, results)))
                except NotFoundError:
                    continue
            self._keep(run.run.folder, by_frame)
        return {frame: entry[1] for frame, entry in by_frame.items()}

    def _keep(self, folder: Path, by_frame: dict[int, tuple[object, FrameSummary]]) -> None:
        with self._lock:
            self._runs[folder] = by_frame
            self._runs.move_to_end(folder)
            while len(self._runs) > 1 and self._bytes() > MOST_BYTES:
                self._runs.popitem(last=False)

    def _bytes(self) -> int:
        return sum(entry.size for frames in self._runs.values() for _, entry in frames.values())


_kept = _Kept()


def summaries(run: InspectedRun) -> dict[int, FrameSummary]:
    """What was read of every finished frame, of one that was tried what was found there."""
    by_frame = _kept.of(run)
    if run.tried is not None:
        by_frame[run.tried.number] = summary_of(run.frame(run.tried.number))
    return by_frame


def variance_rows(run: InspectedRun, selection: Selection) -> ViewResult:
    """The run's tables of view `variance`, of each frame's last search: first as drawn, last after weighing; all
    layers of one parameter where it is selected.
    """
    by_frame = summaries(run)
    tables: dict[str, list[Row]] = {
        "first": [
            (frame, *map(float, entry.variances[entry.last_search][0, 0]))
            for frame, entry in by_frame.items()
        ],
        "last": [(frame, *map(float, entry.variances[-1, 1])) for frame, entry in by_frame.items()],
        "parameter": [],
    }
    if selection.parameter:
        at = run.parameter(selection.parameter)
        tables["parameter"] = [
            (frame, 1 + layer // entry.search_layers, layer, *map(float, moments[:, at]))
            for frame, entry in by_frame.items()
            for layer, moments in enumerate(entry.variances)
        ]
    return ViewResult(tables, _of_last_searches(by_frame))


def schedule_rows(run: InspectedRun, selection: Selection) -> ViewResult:
    """The run's table of view `schedule`, of each frame's last search."""
    by_frame = summaries(run)
    return ViewResult(
        {
            "frames": [
                (
                    frame,
                    no_value(float(entry.betas[entry.last_search][0])),
                    no_value(float(entry.betas[-1])),
                    no_value(float(entry.alphas[entry.last_search].min())),
                    float(entry.effective[entry.last_search].min()),
                    int(entry.alarms[entry.last_search].sum()),
                    no_value(entry.log_evidence),
                )
                for frame, entry in by_frame.items()
            ]
        },
        _of_last_searches(by_frame),
    )


def _of_last_searches(by_frame: Mapping[int, FrameSummary]) -> tuple[str, ...]:
    """Which search of the frames that have several is meant."""
    several = [(frame, entry.searches) for frame, entry in by_frame.items() if entry.searches > 1]
    if not several:
        return ()
    named = enumerated([f"frame {frame} by the {ordinal(count)}" for frame, count in several[:SOME]])
    more = f" and {len(several) - SOME} more frames by their last" if len(several) > SOME else ""
    return (
        f"Frames that were searched several times over stand here with their last search: {named}{more}.",
    )


def spread_by_limb(run: InspectedRun, entry: FrameSummary) -> dict[str, float]:
    """Spread of each limb's points, mm."""
    return {limb: float(mm) for limb, mm in by_limb(run.body, entry.spread).items()}
