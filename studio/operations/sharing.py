"""A run for others: one page that opens without the studio."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field

from studio.foundations.declaring import Terminal, operation
from studio.foundations.progress import Progress, no_progress
from studio.operations.inspecting import inspected, worst_frame
from studio.operations.opening import RunName, keeping_in_place, open_run
from studio.operations.progress import Reporting, reporting
from studio.results.inspection.shared_page import shared_page
from studio.sessions.atomic_files import write_text, writing
from studio.sessions.stored_run import StoredRun


@dataclass(frozen=True, slots=True)
class Shared:
    """A page that was written.

    path : its file.
    frame : that it looks into.
    size : bytes.
    """

    path: Path
    frame: int
    size: int


@operation
@keeping_in_place
def share(
    run: RunName,
    to: Annotated[
        str | Path, Field(description="The page to write, FILE.html."), Terminal("--to", "FILE", kind=Path)
    ],
    *,
    frame: Annotated[
        int | None, Field(ge=0, description="The frame whose search is shown; default: the run's worst one.")
    ] = None,
    track: Annotated[
        str, Field(description="The track that is drawn and measured; default: raw, the search's own.")
    ] = "",
    clouds: Annotated[
        Sequence[int],
        Field(
            max_length=11, description="Frames whose particles are in the page; default: that frame alone."
        ),
    ] = (),
    progress: Reporting = None,
) -> Shared:
    """Write a run as one self-contained page: settings, the views of its search, the body moving in 3-D, the particles
    of chosen frames playing layer by layer.

    It opens from any folder without the studio and asks no other machine for anything; it has a few MB at most.

    Raises RunError for a run without frames, NotFoundError for an unknown frame or track.
    """
    stored, place = open_run(run), Path(to)
    with reporting(progress, f"{stored.session_name} / {stored.name}: page") as report:
        chosen, text = page_text(stored, frame, track, clouds, progress=report)
    with writing("The page", place):
        write_text(place, text)
    return Shared(place, chosen, len(text.encode("utf-8")))


def page_text(
    run: StoredRun,
    frame: int | None = None,
    track: str = "",
    clouds: Sequence[int] = (),
    *,
    progress: Progress = no_progress,
) -> tuple[int, str]:
    """The frame that the page of a run looks into (default: the worst one), and the page. Raises as `share`."""
    opened = inspected(run)
    chosen = worst_frame(opened) if frame is None else frame
    return chosen, shared_page(opened, chosen, track=track, clouds=clouds, progress=progress)
