"""Results: the timeline, any stored frame with all its layers, the particles of a layer, CSV, the error.

Everything is read from the store, also while it is being written.
"""

from typing import Annotated, Literal

import numpy as np
from fastapi import Query, Response

from studio.app.server import files
from studio.app.server.answers import Router, shown_as
from studio.app.server.run_routes import RUN, Checked, RunInPath
from studio.app.server.session_routes import OpenSession
from studio.foundations.csv_text import as_csv
from studio.foundations.csv_text import poses_csv as csv_of_poses
from studio.operations.run_errors import Evaluation, measured
from studio.operations.stored_frames import (
    FrameDetail,
    FramesSummary,
    LayerView,
    LiveView,
    ParticlesView,
    frames_summary,
    live_view,
    particles_view,
    variance_table,
)
from studio.operations.stored_frames import frame_detail as detail_of
from studio.operations.stored_frames import layer_detail as layer_of
from studio.runs.tracks import RAW

router = Router(prefix="/api", tags=["results"])


@router.get(RUN + "/frames")
def frames(
    session: OpenSession,
    run: RunInPath,
    track: Annotated[str, Query(max_length=64, description="Whose poses the errors are of.")] = RAW,
    check: Checked = True,
) -> FramesSummary:
    """Weight, time and (with truth) error of every finished frame, where settings changed, what was corrected."""
    return frames_summary(session, run, track, check=check)


@router.get(RUN + "/live")
def live_figures(run: RunInPath) -> LiveView:
    """How well a live run has kept up so far. Refused (404) for others."""
    return live_view(run)


@router.get(RUN + "/frames/{frame}")
def frame_detail(session: OpenSession, run: RunInPath, frame: int) -> FrameDetail:
    """A frame with all its layers; of the frame in progress those that are done."""
    return detail_of(session, run, frame)


@router.get(RUN + "/frames/{frame}/layers/{layer}")
def layer_detail(run: RunInPath, frame: int, layer: int) -> LayerView:
    """One layer without its particles."""
    return layer_of(run, frame, layer)


@router.get(
    RUN + "/frames/{frame}/layers/{layer}/particles",
    response_model=shown_as(ParticlesView),
    responses={200: {"content": {"application/octet-stream": {}}}},
)
def particles(
    run: RunInPath,
    frame: int,
    layer: int,
    form: Annotated[Literal["json", "float32"], Query(alias="format")] = "json",
) -> Response | ParticlesView:
    """The particles of a layer as they were weighed.

    format=float32: little-endian numbers, N rows of D pose entries and the raw log-weight; headers
    X-Studio-Rows and X-Studio-Columns give N and D + 1.
    """
    view = particles_view(run, frame, layer)
    return _binary(view) if form == "float32" else view


@router.get(RUN + "/frames/{frame}/variance.csv", response_class=Response)
def variance_csv(run: RunInPath, frame: int) -> Response:
    """The variances of a frame: one row a layer (from 1) and moment, one column a parameter (mm² and rad²)."""
    name = f"{run.name}-frame{frame}-variance.csv"
    return files.download(as_csv(variance_table(run, frame)), name, files.CSV)


@router.get(RUN + "/poses.csv", response_class=Response)
def poses_csv(session: OpenSession, run: RunInPath) -> Response:
    """All poses: frame, then one column per parameter in the body's order (radians and mm)."""
    with run.results() as results:
        numbers, poses = results.poses()
    name = f"{session.name}-{run.name}-poses.csv"
    return files.download(csv_of_poses(run.record.parameters, numbers, poses), name, files.CSV)


@router.get(RUN + "/evaluation")
def evaluation(session: OpenSession, run: RunInPath) -> Evaluation:
    """The error of all finished frames. 404 without a truth or before the first frame."""
    return measured(session, run)


def _binary(view: ParticlesView) -> Response:
    table = np.column_stack([view.poses, view.log_weights]).astype("<f4")
    headers = {"x-studio-rows": str(table.shape[0]), "x-studio-columns": str(table.shape[1])}
    return Response(table.tobytes(), media_type="application/octet-stream", headers=headers)
