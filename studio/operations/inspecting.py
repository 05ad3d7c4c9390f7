"""Looking into a run: views of its search, why a frame failed, other seeds, runs side by side."""

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from studio.foundations.declaring import LARGEST, Terminal, Web, operation
from studio.foundations.errors import RunError
from studio.operations.opening import RunName, keeping_in_place, open_run, session_of
from studio.operations.progress import Reporting, reporting
from studio.results.inspection.comparing import RunsCompared, compare_stored
from studio.results.inspection.limbs import disagreements_of, errors_of
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.seeds import search_seeds
from studio.results.inspection.tables import Selection, Viewed
from studio.results.inspection.views import VIEWS, look, look_over

ViewName = Annotated[
    str, Field(description=f"Which: {', '.join(VIEWS)}."), Terminal("--view", metavar="NAME")
]
Frame = Annotated[
    int, Field(ge=0, le=LARGEST, description="The frame that is looked at."), Terminal("--frame")
]


def inspected(run: RunName) -> InspectedRun:
    """A run, ready to be looked into. Raises RunError, NotFoundError."""
    stored = open_run(run)
    return InspectedRun(session_of(stored), stored)


@operation
@keeping_in_place
def view(
    run: RunName,
    name: ViewName,
    frame: Annotated[
        int | None, Field(ge=0, le=LARGEST, description="The frame; default: the tables of the whole run.")
    ] = None,
    *,
    layer: Annotated[
        int | None, Field(ge=0, le=LARGEST, description="Its index, from 0; default: the last one.")
    ] = None,
    parameter: Annotated[str, Field(description="A parameter of the body.")] = "",
    limb: Annotated[str, Field(description="A limb of the body.")] = "",
    particle: Annotated[int | None, Field(ge=0, le=LARGEST, description="A particle of the layer.")] = None,
    camera: Annotated[str, Field(description="A camera.")] = "",
    track: Annotated[str, Field(description="Whose pose; default: what the search found.")] = "",
    second: Annotated[str, Field(description="Another parameter, for a plane of the landscape.")] = "",
    towards: Annotated[
        str,
        Field(description="End of a line in the landscape: truth, mean, mode, searched, particle, a track."),
    ] = "",
) -> Viewed:
    """Show the inside of a run's search: the tables of a view, of a frame or of the whole run.

    Raises NotFoundError for a view, frame, layer or name that is none.
    """
    selection = Selection(layer, parameter, limb, particle, camera, track, second, towards)
    opened = inspected(run)
    return look_over(opened, name, selection) if frame is None else look(opened, frame, name, selection)


@operation
@keeping_in_place
def why(
    run: RunName,
    frame: Annotated[
        int | None, Field(ge=0, le=LARGEST, description="The frame; default: the run's worst one.")
    ] = None,
    *,
    track: Annotated[str, Field(description="Whose pose; default: what the search found.")] = "",
) -> Viewed:
    """Say why a frame failed, and what may help: findings and remedies, from measurements.

    Raises RunError for a run without frames.
    """
    opened = inspected(run)
    return look(opened, worst_frame(opened) if frame is None else frame, "why", Selection(track=track))


def worst_frame(run: InspectedRun) -> int:
    """The frame whose worst limb is farthest off; without a truth, disagrees most with the silhouettes. Raises
    RunError.
    """
    known = errors_of(run) or disagreements_of(run)
    if not known:
        raise RunError(f"Run '{run.run.name}' has no finished frame.", "Track it first.")
    return max(known, key=lambda number: max(known[number].values(), default=0.0))


@operation
@keeping_in_place
def seeds(
    run: RunName,
    frame: Frame,
    *,
    count: Annotated[int, Field(ge=2, le=64, description="How many other seeds.")] = 8,
    progress: Reporting = None,
) -> Viewed:
    """Search a stored frame again with other seeds: spread within and between them. Nothing of the run changes.

    Raises NotFoundError for a frame that is not finished.
    """
    opened = inspected(run)
    with reporting(progress, f"{opened.session.name} / {opened.run.name}: seeds") as report:
        search_seeds(opened, frame, count, report)
    return look(opened, frame, "seeds", Selection())


@operation
def compare_runs(
    runs: Annotated[
        Sequence[str],
        Field(description="Two to six stored runs, as SESSION/RUN."),
        Terminal(metavar="SESSION/RUN..."),
        Web(left_out=True),
    ],
) -> RunsCompared:
    """Put two to six stored runs side by side: curves over frames, settings that differ, the worst frame of each.

    Raises RunError.
    """
    return compare_stored([inspected(run) for run in runs])
