"""The outline of each layer for the pages, made once a layer; a run's body and first camera are read once."""

from functools import lru_cache
from pathlib import Path

from studio.body.model import BodyModel
from studio.foundations.errors import StudioError
from studio.foundations.geometry.camera import Camera
from studio.operations.jobs.events import LayerFinished
from studio.results.inspection.cloud_outlines import CloudOutline, outline_of
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace

RUNS_KEPT = 8


class LayerOutlines:
    """Outlines of the layers of a workspace's runs."""

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace

    def of_event(self, event: LayerFinished) -> CloudOutline | None:
        """The outline of a finished layer; None where its run no longer exists."""
        try:
            folder = self._workspace.session(event.session).run(event.run).folder
            body, camera = _seen_by_first_camera(folder, (folder / "run.json").stat().st_mtime_ns)
            return outline_of(body, camera, event.record.poses, event.record.mean)
        except (StudioError, OSError):
            return None


@lru_cache(RUNS_KEPT)
def _seen_by_first_camera(folder: Path, _: int) -> tuple[BodyModel, Camera]:
    """A run's body and first camera; again where its record was written again."""
    run = StoredRun(folder)
    return run.body(), run.cameras()[0]
