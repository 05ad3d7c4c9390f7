"""Where cameras should stand: a run's rig and others, for the motion at hand."""

from typing import Annotated, Any

from pydantic import Field

from studio.foundations.declaring import operation, taking
from studio.operations.inspecting import inspected
from studio.operations.opening import RunName, keeping_in_place
from studio.operations.progress import Reporting, reporting
from studio.results.rig.study import RigRequest, RunRig, check_request, kept_rig, study_rig


@operation
@taking(RigRequest)
@keeping_in_place
def rig(
    run: RunName,
    *,
    again: Annotated[
        bool, Field(description="Also track what was tracked before, though the run has not changed.")
    ] = False,
    progress: Reporting = None,
    **request: Any,  # noqa: ANN401 - of the types that are declared
) -> RunRig:
    """Say where cameras should stand: the errors to expect of a run's joints with other cameras than its own.

    The run is drawn again and tracked, once, which takes two to four times as long as the run took. What other rigs'
    errors would be is predicted from that and from what their cameras would see of the limbs, in seconds; with
    `--twins` each of them is drawn and tracked as well, as long again for each. All of it is kept with the run as it
    comes, so what Ctrl-C ends goes on from there.

    Raises RunError for a run that says nothing of its rig, for a camera or a place that is none, and for a grid from
    which too few see the body.
    """
    opened = inspected(run)
    with reporting(progress, f"{opened.session.name} / {opened.run.name}: rigs") as report:
        return study_rig(opened, RigRequest(**request), report, again=again)


def check_rig(run: RunName, *, again: bool = False, **request: Any) -> None:  # noqa: ANN401 - as `rig` takes
    """Raise RunError for a run that says nothing of its rig, and for cameras and places that are none."""
    check_request(inspected(run), RigRequest(**request))


def rig_so_far(run: RunName) -> RunRig:
    """What is known of a run's rig and others. Raises SessionError where it cannot be read."""
    return kept_rig(inspected(run))
