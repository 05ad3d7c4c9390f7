"""What the 3-D scene shows: the page's timeline, layer buttons and camera keys arrive here."""

from fastapi import APIRouter
from pydantic import Field

from studio.web.doors import Door, Doors, Scene, Shown
from studio.web.schemas import Request, RunName

router = APIRouter(prefix="/api/scene", tags=["scene"])


class SceneWish(Request):
    """What is to be shown; what is left out stays as it is.

    With `session` the whole moment is named: `run` left out shows the session alone, `layer` left out
    all layers. follow: whether each frame is shown as it is tracked. look_through: a camera's name, null
    or "" for the free view. options: what is drawn, by the names of the scene's own view options (body,
    truth, particles, trails, cameras, pictures, overlays …). playing, speed (1 is real time), loop: of stored frames.
    """

    session: RunName | None = None
    run: RunName | None = None
    frame: int | None = Field(None, ge=0)
    layer: int | None = Field(None, ge=0)
    follow: bool | None = None
    look_through: str | None = Field(None, max_length=128)
    dark: bool | None = None
    playing: bool | None = None
    speed: float | None = Field(None, gt=0.0, le=10.0)
    loop: bool | None = None
    options: dict[str, bool | int | float | str | list[str] | None] = Field(default_factory=dict)


@router.post("/show", status_code=204)
def show(wish: SceneWish, doors: Door, scene: Scene) -> None:
    """Show a moment of a run (or a session without one) in the asking window's scene. Names are checked before
    anything changes.
    """
    given = wish.model_fields_set
    if wish.session is not None:
        session = doors.workspace.session(wish.session)
        run = session.run(wish.run).name if wish.run else ""
        scene.show_run(session.name, run, wish.frame, wish.layer)
    else:
        if wish.frame is not None:
            scene.show_frame(wish.frame)
        if "layer" in given:
            scene.show_layer(wish.layer)
    if wish.follow is not None:
        scene.follow(wish.follow)
    if "look_through" in given:
        scene.look_through(wish.look_through or None)
    options = {
        name: tuple(value) if isinstance(value, list) else value for name, value in wish.options.items()
    }
    if wish.dark is not None:
        options["dark"] = wish.dark
    if options:
        scene.set_options(**options)
    if {"playing", "speed", "loop"} & given:
        scene.play(wish.playing, speed=wish.speed, loop=wish.loop)


@router.post("/view", status_code=204)
def view(wish: SceneWish, doors: Door, scene: Scene) -> None:
    """The same under a name that says what it is for: the theme, the camera looked through."""
    show(wish, doors, scene)


def report_moves(doors: Doors) -> None:
    """From now on, report the moves that a scene's own controls make to its window (`scene` events)."""

    def moved(window: str, shown: Shown) -> None:
        doors.events.publish(
            {
                "type": "scene",
                "session": shown.session,
                "run": shown.run,
                "frame": shown.frame,
                "layer": shown.layer,
                "look_through": shown.look_through,
                "follow": shown.follow,
                "editing": shown.editing,
            },
            window,
        )

    doors.scenes.watch(moved)
