"""What the 3-D scene shows: the page's timeline, layer buttons and camera keys arrive here."""

import dataclasses
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from studio.app.scene.model import LayerPlayback, LiveSearch, Selection
from studio.app.scene.search_view import Pointed
from studio.app.server.answers import Router
from studio.app.server.app_state import App, AppState, Scene
from studio.app.server.schemas import Request, RunName
from studio.app.server.windows import Window
from studio.body.reader import parse_body
from studio.foundations.declaring import LARGEST
from studio.foundations.errors import SettingsError
from studio.foundations.geometry.reach import within_reach
from studio.operations.own_bodies import MOST_TEXT

router = Router(prefix="/api/scene", tags=["scene"])

CHOSEN = ("limb", "parameter", "particle", "camera")


TrialPlace = Annotated[
    str | None, Field(max_length=200, description='SESSION/RUN/TRIAL, "" for what is stored.')
]
ChosenName = Annotated[str | None, Field(max_length=128)]


class GhostBody(Request):
    """A body beside the answer. colour: the name of a colour token. pose: radians and mm."""

    colour: str = Field("ghost", pattern="^(ghost|accent|stored|tried|truth|series-[0-7]|layer-[0-9])$")
    pose: list[float] = Field(max_length=512)


class SceneRequest(Request):
    """What is to be shown; what is left out stays as it is.

    With `session` the whole moment is named: `run` left out shows the session alone, `layer` left out all layers, or
    the ones that are played go on; a layer that is given is shown by itself, and playing layers ends. follow: whether
    each frame is shown as it is tracked. look_through: a camera's name, null or "" for the free view. options: what is
    drawn, by the names of the scene's own view options (body, truth, particles, trails, cameras, pictures, overlays …).
    playing, speed (1 is real time), loop: of stored frames. twin: whether trials are shown in a second scene, that of
    the window's name with "-tried" at its end, which shows the same moment and is seen alike. trial: the one to show in
    the place of its frame, "" for what is stored; with a twin it is shown there. against: the trial that the window's
    own scene shows beside a twin, "" for what is stored.
    limb, parameter, particle (a row of the layer's cloud), camera: what else is chosen, null for none. eye: from where
    the scene is looked at and what is looked at, metres; null: the usual place. ghosts: bodies beside the answer, until
    another frame is shown. body: the file of a body that is being made, shown in place of the session's own, or without
    a session alone. request_number: the page's own; `scene` events carry the last one that they know of.
    """

    session: RunName | None = None
    run: RunName | None = None
    frame: int | None = Field(None, ge=0, le=LARGEST)
    layer: int | None = Field(None, ge=0, le=LARGEST)
    follow: bool | None = None
    limb: ChosenName = None
    parameter: ChosenName = None
    particle: int | None = Field(None, ge=0, le=LARGEST)
    camera: ChosenName = None
    look_through: ChosenName = None
    eye: list[float] | None = Field(None, min_length=6, max_length=6)
    discard: bool = Field(False, description="Forget the frame that was annealed again.")
    ghosts: list[GhostBody] | None = Field(None, max_length=12)
    dark: bool | None = None
    twin: bool | None = None
    trial: TrialPlace = None
    against: TrialPlace = None
    playing: bool | None = None
    speed: float | None = Field(None, gt=0.0, le=10.0)
    loop: bool | None = None
    request_number: int = Field(0, ge=0)
    body: str | None = Field(None, max_length=MOST_TEXT)
    options: dict[str, bool | int | float | str | list[str] | None] = Field(default_factory=dict)


@router.post("/show", status_code=204)
def show(request: SceneRequest, app: App, scene: Scene, window: Window = "") -> None:
    """Show a moment of a run (or a session alone) in the asking window's scene; names are checked first."""
    given = request.model_fields_set
    if request.body is not None:
        body = parse_body(request.body, "body", "body.toml")
        session_name = app.workspace.session(request.session).name if request.session else ""
        scene.try_body(session_name, body)
    elif request.session is not None:
        session = app.workspace.session(request.session)
        run = session.run(request.run).name if request.run else ""
        scene.show_run(session.name, run, request.frame, request.layer, is_scrubbed="layer" in given)
    else:
        if request.frame is not None:
            scene.show_frame(request.frame)
        if "layer" in given:
            scene.show_layer(request.layer)
    if request.follow is not None:
        scene.follow(request.follow)
    if request.discard:
        scene.discard_what_if()
    if request.twin is not None:
        app.scenes.split(window, request.twin)
    if request.trial is not None:
        (app.scenes.twin(window) or scene).show_trial(_search(app, request.trial))
    if request.against is not None and app.scenes.twin(window) is not None:
        scene.show_trial(_search(app, request.against))
    chosen = {name: getattr(request, name) for name in CHOSEN if name in given}
    if chosen:
        scene.select(**chosen)
    if "look_through" in given:
        scene.look_through(request.look_through or None)
    if "eye" in given:
        if request.eye is not None and not within_reach(np.array(request.eye)):
            raise SettingsError(
                "Nobody can look at the scene from there.", "Give six finite numbers in metres."
            )
        scene.look_from(request.eye)
    if request.ghosts is not None:
        for ghost in request.ghosts:
            if not within_reach(np.array(ghost.pose)):
                raise SettingsError("A pose beside the answer is not finite.", "Give radians and mm.")
        scene.show_ghosts([(ghost.colour, ghost.pose) for ghost in request.ghosts])
    options = {
        name: tuple(value) if isinstance(value, list) else value for name, value in request.options.items()
    }
    if request.dark is not None:
        options["dark"] = request.dark
    if options:
        scene.set_options(**options)
    if {"playing", "speed", "loop"} & given:
        scene.play(request.playing, speed=request.speed, loop=request.loop)
    if "request_number" in given:
        scene.select(request_number=request.request_number)


@router.post("/view", status_code=204)
def view(request: SceneRequest, app: App, scene: Scene, window: Window = "") -> None:
    """The same under a name that says what it is for: the theme, the camera looked through."""
    show(request, app, scene, window)


def _search(app: AppState, trial: str) -> LiveSearch | None:
    """The search of a trial, None for "". Raises NotFoundError."""
    if not trial:
        return None
    session, _, rest = trial.partition("/")
    run, _, name = rest.partition("/")
    tried = app.events.tried.tried(app.workspace.session(session).run(run), session, name)
    return LiveSearch(tried.number, True, tried.layers, tried.result)


class LayerPlaying(Request):
    """How the shown frame's layers are to be played; what is left out stays as it is.

    rate: layers a second. mode: what follows the last layer, the first one or the way back. Frames and layers are not
    played at once.
    """

    playing: bool | None = None
    rate: float | None = Field(None, ge=1.0, le=10.0)
    mode: Literal["loop", "pingpong"] | None = None


class LayersPlayed(Request):
    """Whether and how layers are played in the asking window's scene. rate: layers a second."""

    playing: bool
    rate: float
    mode: Literal["loop", "pingpong"]


@router.post("/play-layers", status_code=204)
def play_layers(request: LayerPlaying, scene: Scene) -> None:
    """Play the shown frame's layers in the asking window's scene, or stop: the stored ones, those of the frame in
    progress so far, or those of a what-if. Each move is told by a `scene` event.
    """
    scene.play_layers(request.playing, rate=request.rate, mode=request.mode)


@router.get("/play-layers")
def layers_played(scene: Scene) -> LayersPlayed:
    """Whether and how layers are played."""
    return LayersPlayed.model_validate(_layers_answer(scene.layers))


def _layers_answer(layers: LayerPlayback) -> dict[str, object]:
    return {"playing": layers.playing, "rate": layers.rate, "mode": layers.mode}


class CameraMove(Request):
    """Where the viewers of the asking window's scene are to go: one of these, or both one after the other.

    move: body frames the shown body from where it is seen, front, side and top from there, first is the view that a
    session opens with. zoom: of the distance, less than 1 is nearer. at: what the zoom goes to, shares of the view's
    width and height from the top left.
    """

    move: Literal["body", "front", "side", "top", "first"] | None = None
    zoom: float | None = Field(None, gt=0.01, lt=100.0)
    at: list[float] = Field(default_factory=lambda: [0.5, 0.5], min_length=2, max_length=2)


@router.post("/camera", status_code=204)
def move_camera(request: CameraMove, scene: Scene) -> None:
    """Move the viewers of the asking window's scene; the body is never lost on the way."""
    if request.move is not None:
        scene.move_camera(request.move)
    if request.zoom is not None:
        across, down = (min(1.0, max(0.0, share)) for share in request.at)
        scene.zoom(request.zoom, (across, down))


class Pointer(Request):
    """Where a viewer's pointer is. at: shares of the view's width and height from the top left, null where it is none.
    choose: whether the particle that is there is to be chosen, or let go.
    """

    at: list[float] | None = Field(None, min_length=2, max_length=2)
    choose: bool = False


@router.post("/point")
def point(request: Pointer, scene: Scene) -> Pointed | None:
    """The particle of the layer that is looked at at the pointer; its line back to the first layer is drawn."""
    return scene.point(None if request.at is None else (request.at[0], request.at[1]), request.choose)


def report_moves(app: AppState) -> None:
    """From now on, report the moves that a scene's own controls make to its window (`scene` events)."""

    def moved(window: str, shown: Selection, layers: LayerPlayback) -> None:
        app.events.publish(
            {"type": "scene", **dataclasses.asdict(shown), "layers": _layers_answer(layers)}, window
        )

    app.scenes.watch(moved)
