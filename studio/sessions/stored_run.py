"""A run on disk: its record, its results, and its status, computed from them."""

import dataclasses
import html
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from studio.body.catalogue import load_body
from studio.body.dimensions import with_dimensions
from studio.body.model import BodyModel
from studio.footage.capture.calibration_files import read_calibration
from studio.foundations.errors import BodyError
from studio.foundations.geometry.camera import Camera
from studio.search.behaviour.model import BehaviourModel
from studio.search.behaviour.model_file import read_model
from studio.sessions.results_store import ResultsReader, is_being_written
from studio.sessions.run_arrays import particles_dataset
from studio.sessions.run_record import BEHAVIOUR_NAME, CAMERAS_NAME, RunRecord, read_run_record

BODY_FOLDER = "body"
NAMED = 10
"""So many damaged frames are named in a sentence."""


@dataclass(frozen=True, slots=True)
class RunSummary:
    """A run in a list.

    status : "new", "tracking" (some process has it open), "interrupted", "cancelled" or "finished".
    done : intact finished frames of first … last.
    tracked_to : the frame after the last of them.
    damaged : damaged stored frames; resuming the run tracks them again.
    """

    session: str
    name: str
    created: str
    tracker: str
    weighting: str
    body: str
    seed: int
    first: int
    last: int
    done: int
    tracked_to: int
    status: str
    damaged: tuple[int, ...] = ()

    @property
    def damage(self) -> str:
        """The damaged frames and the remedy, as a sentence; "" if there are none."""
        return damage_in_words(self.damaged)


def damage_in_words(frames: Sequence[int]) -> str:
    """The damaged frames and the remedy, as a sentence; "" if there are none."""
    if not frames:
        return ""
    named = ", ".join(str(frame) for frame in list(frames)[:NAMED])
    more = f" and {len(frames) - NAMED} more" if len(frames) > NAMED else ""
    subject = f"Frame {named} is" if len(frames) == 1 else f"Frames {named}{more} are"
    return f"{subject} damaged on the disk and left out: resume the run to track them again."


class StoredRun:
    """A run's folder. Opening it reads nothing; each part is read on demand."""

    def __init__(self, folder: Path, record: RunRecord | None = None) -> None:
        self.folder = folder
        self._record = record

    @property
    def name(self) -> str:
        """The run's name: its folder's."""
        return self.folder.name

    @property
    def session_name(self) -> str:
        return self.folder.parent.parent.name

    @property
    def record(self) -> RunRecord:
        """The run's request. Raises SessionError."""
        if self._record is None:
            self._record = read_run_record(self.folder)
        return self._record

    def results(self) -> ResultsReader:
        """A reader of the run's results; close it when done."""
        return ResultsReader(self.folder)

    def body(self) -> BodyModel:
        """The run's own copy of the body, with its dimensions. Raises BodyError."""
        snapshots = sorted((self.folder / BODY_FOLDER).glob("*.toml"))
        tree = load_body(str(snapshots[0]) if snapshots else self.record.body)
        body = with_dimensions(tree, self.record.dimensions)
        if tuple(entry.name for entry in body.parameters) != self.record.parameters:
            raise BodyError(
                f"The body '{self.record.body}' has changed since run '{self.name}' was made.",
                "Start a new run with the current body.",
            )
        return body

    def cameras(self) -> tuple[Camera, ...]:
        """The run's own copy of the cameras. Raises CalibrationError."""
        return tuple(read_calibration(self.folder / CAMERAS_NAME).cameras)

    def behaviour(self) -> BehaviourModel | None:
        """The run's own copy of its behaviour model, at the footage's rate; None without one. Raises BehaviourError."""
        if not self.record.behaviour:
            return None
        return read_model(self.folder / BEHAVIOUR_NAME).at_rate(self.record.fps)

    def to_xarray(self, frames: Iterable[int] | None = None) -> Any:  # noqa: ANN401 - xarray.Dataset
        """The particles as an `xarray.Dataset` with the dimensions frame, layer, particle and parameter
        (`run_arrays.particles_dataset`); of all finished frames, or of some.

        Raises StudioError where xarray is not installed, NotFoundError, RunError.
        """
        with self.results() as results:
            chosen = list(results.frames() if frames is None else frames)
            stored = ((results.layers(frame), results.result(frame)) for frame in chosen)
            return particles_dataset(self.record, chosen, stored)

    def as_html(self) -> str:
        """The run as a small table, for notebooks."""
        summary = self.summary(blobs=False)
        rows = {
            "run": f"{summary.session} / {summary.name}",
            "status": f"{summary.status}, {summary.done} of {summary.last - summary.first} frames",
            "tracker": f"{summary.tracker}, {summary.weighting}",
            "body": summary.body,
            "seed": str(summary.seed),
            "made": f"{summary.created} by {self.record.software or 'an older studio'}",
        }
        lines = "".join(
            f"<tr><th style='text-align:left'>{html.escape(name)}</th><td>{html.escape(value)}</td></tr>"
            for name, value in rows.items()
        )
        return f"<table>{lines}</table>"

    _repr_html_ = as_html

    def being_tracked(self) -> bool:
        """Whether some living process has the run open for tracking."""
        return is_being_written(self.folder)

    def damage(self) -> str:
        """The damaged frames and the remedy, as a sentence; "" if there are none. Raises SessionError."""
        with self.results() as results:
            return damage_in_words(list(results.damaged()))

    def summary(self, *, blobs: bool = True) -> RunSummary:
        """The run as a line of a list, its status computed from the facts in its store. Raises SessionError.

        blobs : also check results and layers that this process has not checked yet (`ResultsReader.damaged`).
        """
        record = self.record
        with self.results() as results:
            damaged, frames, ended = (
                results.damaged(blobs=blobs),
                results.frames(blobs=blobs),
                results.ended(),
            )
        done = len(frames)
        if done >= record.frame_count or ended == "finished":
            status = "finished"
        elif self.being_tracked():
            status = "tracking"
        elif ended:
            status = ended
        else:
            status = "interrupted" if done else "new"
        tracked_to = frames[-1] + 1 if frames else record.first
        return dataclasses.replace(
            self.empty_summary(), done=done, tracked_to=tracked_to, status=status, damaged=tuple(damaged)
        )

    def empty_summary(self) -> RunSummary:
        """The run as if nothing had been tracked."""
        record = self.record
        return RunSummary(
            session=self.session_name,
            name=self.name,
            created=record.created,
            tracker=record.tracker,
            weighting=record.weighting,
            body=record.body,
            seed=record.seed,
            first=record.first,
            last=record.last,
            done=0,
            tracked_to=record.first,
            status="new",
        )
