"""How far off a run's joints may be, as tables: half widths, promised against found coverage, faults of the masks."""

from studio.results.inspection.reading import InspectedFrame, InspectedRun
from studio.results.inspection.reference import body_points
from studio.results.inspection.tables import Row, Selection, View, ViewResult, table
from studio.results.uncertainty.conformal import LEVELS
from studio.results.uncertainty.half_widths import Uncertainty, kept_uncertainty, true_coverage
from studio.results.uncertainty.twin import points_of, reported

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
            "path",
            "Where a joint is, with its half width",
            "frame",
            JOINT,
            *((axis, axis, "mm") for axis in "xyz"),
            ("half_width", "Half width", "mm"),
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
            "path": _path(run, kept.of, selection.limb),
            "faults": [
                (one.camera, one.holes, one.false_areas, one.empty, one.touched) for one in kept.of.faults
            ],
        },
        kept.words,
    )


def _path(run: InspectedRun, known: Uncertainty, limb: str) -> list[Row]:
    """Rows of the points of a limb, of the one that may be farthest off where none is selected: where the run reports
    them, with the half width of the highest level that is known.
    """
    widest = {
        one.point: [width for width in one.half_widths_mm if width is not None][-1:] for one in known.points
    }
    shown = [one.point for one in known.points if limb == one.limb and widest[one.point]]
    if not limb and any(widest.values()):
        shown = [max(widest, key=lambda point: widest[point] or [0.0])]
    track, names = reported(run.run), points_of(run.body)
    places = body_points(run.body, track.poses)
    return [
        (frame, point, *map(float, places[at, names.index(point)]), widest[point][0])
        for point in shown
        for at, frame in enumerate(track.frames.tolist())
    ]
