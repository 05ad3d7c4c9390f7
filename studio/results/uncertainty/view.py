"""How far off a run's joints may be, as tables: half widths, promised against found coverage, faults of the masks."""

from studio.results.inspection.reading import InspectedFrame, InspectedRun
from studio.results.inspection.tables import Selection, View, ViewResult, table
from studio.results.uncertainty.conformal import LEVELS
from studio.results.uncertainty.half_widths import kept_uncertainty, true_coverage

PERCENT = tuple(round(100 * level) for level in LEVELS)
JOINT = ("point", "Joint")
VIEW = View(
    "uncertainty",
    "Uncertainty",
    "How far off may a joint be?",
    ("limb",),
    (
        table(
            "joints",
            "Half widths by joint",
            JOINT,
            "limb",
            *((f"within_{level}", f"{level} % of frames within", "mm") for level in PERCENT),
            ("bias", "Bias", "mm"),
            ("carrier", "Its axes: those of joint"),
            *((f"scatter_{level}", f"Without the bias, {level} %", "mm") for level in PERCENT),
            of_run=True,
        ),
        table(
            "coverage",
            "Promised against found coverage",
            JOINT,
            ("promised", "Promised"),
            ("found", "Found: run drawn again"),
            ("true", "Found: truth"),
            of_run=True,
        ),
        table(
            "faults",
            "What the masks get wrong",
            "camera",
            ("holes", "Holes, share of the silhouette"),
            ("false_areas", "False areas, share of the silhouette"),
            ("empty", "Frames without a mask"),
            ("touched", "Frames with a fault"),
            of_run=True,
        ),
    ),
    is_job=True,
)


def of_frame(frame: InspectedFrame, selection: Selection) -> ViewResult:
    return ViewResult({}, ("Half widths are measured over a whole run.",))


def over_run(run: InspectedRun, selection: Selection) -> ViewResult:
    """The run's tables; empty where they have not been measured, or no longer hold."""
    kept = kept_uncertainty(run)
    if kept.of is None or kept.stale:
        return ViewResult({}, kept.words)
    points = [point for point in kept.of.points if selection.limb in ("", point.limb)]
    truth = true_coverage(run, kept.of)
    none = (None,) * len(kept.of.levels)
    return ViewResult(
        {
            "joints": [
                (one.point, one.limb, *one.half_widths_mm, one.bias, one.carrier, *one.scatter_mm)
                for one in points
            ],
            "coverage": [
                (one.point, level, share, true)
                for one in points
                for level, share, true in zip(
                    kept.of.levels, one.found, truth.get(one.point, none), strict=True
                )
            ],
            "faults": [
                (one.camera, one.holes, one.false_areas, one.empty, one.touched) for one in kept.of.faults
            ],
        },
        kept.words,
    )
