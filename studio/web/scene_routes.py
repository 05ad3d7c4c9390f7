"""What the 3-D scene shows: the page's timeline, layer buttons and camera keys arrive here."""

from typing import Annotated

from fastapi import APIRouter, Depends
from pydantic import Field

from studio.web.doors import Doors, doors_of
from studio.web.schemas import Request, RunName

router = APIRouter(prefix="/api/scene", tags=["scene"])

Door = Annotated[Doors, Depends(doors_of)]


class SceneWish(Request):
    """What is to be shown; what is left out stays as it is.

    layer: null shows all layers together. look_through: a camera's name, "" for the free view.
    """

    session: RunName | None = None
    run: RunName | None = None
    frame: int | None = Field(None, ge=0)
    layer: int | None = Field(None, ge=0)
    look_through: str | None = Field(None, max_length=128)
    dark: bool | None = None


@router.post("/show", status_code=204)
def show(wish: SceneWish, doors: Door) -> None:
    """Show a moment of a run (or a session without one). Names are checked before anything changes."""
    if wish.session is not None:
        session = doors.workspace.session(wish.session)
        if wish.run is not None:
            session.run(wish.run)
    doors.stage.show(**{name: getattr(wish, name) for name in wish.model_fields_set})


@router.post("/view", status_code=204)
def view(wish: SceneWish, doors: Door) -> None:
    """The same under a name that says what it is for: the theme, the camera looked through."""
    show(wish, doors)
