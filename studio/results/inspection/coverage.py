"""Whether spread predicts error: spread of the last set against the error by limb, and the rank of the truth.

Where a set's spread is right, the share of its weight below the true coordinate (the probability integral transform) is
uniform over frames (Dawid 1984; Gneiting, Balabdaoui & Raftery 2007, "Probabilistic forecasts, calibration and
sharpness", JRSS B 69(2)). A ∪ tells that sets are too narrow, a hill that they are too wide. Bands are pointwise, 95 %,
of as many independent draws as there are frames: coordinates of one frame depend on one another.
"""

import numpy as np
import scipy  # stats, half a second, are loaded once they are used

from studio.results.inspection.limbs import errors_of
from studio.results.inspection.over_frames import spread_by_limb, summaries
from studio.results.inspection.reading import InspectedFrame, InspectedRun, no_value
from studio.results.inspection.reference import limbs_of_points
from studio.results.inspection.tables import Row, Selection, View, ViewResult, table

VIEW = View(
    "coverage",
    "Coverage",
    "Does spread predict error?",
    ("limb", "track"),
    (
        table(
            "frames",
            "Spread and error by frame and limb",
            "frame",
            "limb",
            ("spread", "Spread of the last set", "mm"),
            ("error", "Error", "mm"),
            of_run=True,
        ),
        table(
            "correlation",
            "Does spread rank as error does?",
            "limb",
            ("frames", "Frames"),
            ("rho", "Spearman's ρ"),
            ("p_value", "p"),
            of_run=True,
        ),
        table(
            "pit",
            "Rank of the truth in the last set",
            "limb",
            ("bin", "Bin"),
            ("count", "Share"),
            ("expected", "Expected"),
            ("lower", "Band, lower"),
            ("upper", "Band, upper"),
            of_run=True,
        ),
    ),
)


BINS = 10
BAND = 0.95
FEWEST = 4
NO_TRUTH = "The session has no truth: there is no error to compare the spread with."


def of_frame(frame: InspectedFrame, selection: Selection) -> ViewResult:
    return ViewResult({}, ("Coverage is measured over a whole run.",))


def over_run(run: InspectedRun, selection: Selection) -> ViewResult:
    by_frame, errors = summaries(run), errors_of(run, selection.track)
    limbs = list(dict.fromkeys(limbs_of_points(run.body)))
    frames: list[Row] = []
    pairs: dict[str, list[tuple[float, float]]] = {limb: [] for limb in limbs}
    for frame, entry in by_frame.items():
        for limb, spread in spread_by_limb(run, entry).items():
            error = errors.get(frame, {}).get(limb, float("nan"))
            frames.append((frame, limb, spread, no_value(error)))
            if np.isfinite(error):
                pairs[limb].append((spread, error))
    if selection.limb in limbs:
        limbs = [selection.limb]
    return ViewResult(
        {
            "frames": frames,
            "correlation": [_correlated(limb, pairs[limb]) for limb in limbs],
            "pit": [
                row
                for limb in limbs
                for row in _ranks(run, limb, [entry.ranks for entry in by_frame.values()])
            ],
        },
        () if errors else (NO_TRUTH,),
    )


def _correlated(limb: str, pairs: list[tuple[float, float]]) -> Row:
    """Spearman's ρ of spread and error."""
    if len(pairs) < FEWEST or len({pair[0] for pair in pairs}) < 2:
        return (limb, len(pairs), None, None)
    table = np.array(pairs)
    correlation = scipy.stats.spearmanr(table[:, 0], table[:, 1])
    return (limb, len(pairs), no_value(float(correlation.statistic)), no_value(float(correlation.pvalue)))


def _ranks(run: InspectedRun, limb: str, ranks: list[np.ndarray]) -> list[Row]:
    """Histogram of the truth's ranks in a limb's coordinates."""
    own = np.array(limbs_of_points(run.body)) == limb
    values = np.concatenate([entry[own].ravel() for entry in ranks]) if ranks else np.zeros(0)
    values = values[np.isfinite(values)]
    if not len(values):
        return []
    counts, _ = np.histogram(np.clip(values, 0.0, 1.0), BINS, (0.0, 1.0))
    low, high = (
        float(scipy.stats.binom.ppf(at, len(ranks), 1.0 / BINS)) / len(ranks)
        for at in ((1.0 - BAND) / 2.0, (1.0 + BAND) / 2.0)
    )
    return [(limb, at, float(count / len(values)), 1.0 / BINS, low, high) for at, count in enumerate(counts)]
