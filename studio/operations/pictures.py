"""Pictures of a session's cameras, upright, bare or with overlays."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from studio.body.model import checked_pose
from studio.foundations.arrays import Array
from studio.foundations.errors import NotFoundError, SettingsError
from studio.operations.person import FitSoFar, FittedSubject
from studio.results.footage_pictures import bare_picture
from studio.results.inspection.comparing import MOST
from studio.results.overlay_pictures import OtherBody, compose_view
from studio.runs.drawing.overlay_drawing import encode_jpeg
from studio.runs.setup.session_settings import session_settings
from studio.runs.tracks import RAW, pose_in_track
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun


@dataclass(frozen=True, slots=True)
class View:
    """What is shown.

    layers : over the picture, of `OVERLAYS`.
    height : of the picture as shown, None: as stored.
    """

    frame: int
    camera: str
    layers: tuple[str, ...] = ()
    height: int | None = None


def footage_picture(session: Session, view: View) -> bytes:
    """JPEG: a camera's picture with its offset and turn, as it is before any calibration.

    Raises NotFoundError, FootageError.
    """
    return encode_jpeg(bare_picture(session, view.camera, view.frame, view.height))


def session_picture(
    session: Session, view: View, knobs: Mapping[str, object], pose: Array | None = None
) -> bytes:
    """JPEG: what a camera saw in a frame; masks and edges are made with the session's settings and the changed knobs.

    pose : (D,) of the session's body, whose outlines are drawn.

    Raises NotFoundError, SettingsError.
    """
    _check(session, view)
    settings = session_settings(session, changes=knobs)
    if pose is not None:
        pose = checked_pose(session.body(), pose, SettingsError)
    picture = compose_view(
        session, None, view.frame, view.camera, view.layers, pose, height=view.height, settings=settings
    )
    return encode_jpeg(picture)


def run_picture(
    session: Session,
    run: StoredRun,
    view: View,
    *,
    track: str = RAW,
    beside: Array | None = None,
    compared: Sequence[str] = (),
) -> bytes:
    """JPEG: what a camera saw in a frame, with a run's pose and evidence over it.

    track : whose pose is projected.
    beside : (D,) another pose that is outlined too.
    compared : other runs of the session that are outlined too, coloured by their place; "" keeps a place free.

    Raises NotFoundError, SettingsError.
    """
    _check(session, view, run)
    pose = None if track == RAW else pose_in_track(run, track, view.frame)
    others: list[OtherBody] = []
    if beside is not None:
        others.append(OtherBody(checked_pose(run.body(), beside, SettingsError), "tried"))
    for place, name in enumerate(compared, 1):
        if name and (other := _body_of(session, name, view.frame, place)):
            others.append(other)
    own = "stored" if beside is not None else "series-0" if others else ""
    picture = compose_view(
        session, run, view.frame, view.camera, view.layers, pose, height=view.height, beside=others, own=own
    )
    return encode_jpeg(picture)


def fit_picture(session: Session, fit: FitSoFar | FittedSubject, view: View) -> bytes:
    """JPEG: the body of a fit over what a camera saw in one of its frames. Raises NotFoundError for another frame."""
    if view.frame not in fit.frames:
        listed = ", ".join(map(str, fit.frames))
        raise NotFoundError(f"Frame {view.frame} was not looked at in this fit.", f"These were: {listed}.")
    pose = fit.poses[fit.frames.index(view.frame)]
    layers = ("outline", "mask")
    picture = compose_view(
        session, None, view.frame, view.camera, layers, pose, height=view.height, body=fit.body
    )
    return encode_jpeg(picture)


def _body_of(session: Session, name: str, frame: int, place: int) -> OtherBody | None:
    """The body of another run in a frame, in the colour of its place among those compared; None where it has none.

    Raises NotFoundError for an unknown run, SettingsError for more than are compared.
    """
    if place >= MOST:
        raise SettingsError(f"{place} runs are too many.", f"Name at most {MOST - 1} beside the run itself.")
    run = session.run(name)
    with run.results() as results:
        try:
            pose = results.result(frame).estimate.pose
        except NotFoundError:
            return None
    return OtherBody(pose, f"series-{place}", run.body())


def _check(session: Session, view: View, run: StoredRun | None = None) -> None:
    """Raise NotFoundError for names that the session lacks, before any footage is opened."""
    last = session.manifest.frame_count
    if run is not None and run.record.ping_pong:
        last = max(last, run.record.last)
    if not 0 <= view.frame < last:
        raise NotFoundError(
            f"Session '{session.name}' has no frame {view.frame}.", f"It has frames 0 to {last - 1}."
        )
    session.camera_source(view.camera)
