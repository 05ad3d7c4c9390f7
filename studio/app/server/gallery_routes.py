"""The gallery: sessions that can be opened or made at a click."""

from dataclasses import dataclass

from fastapi import Response

from studio.app.server import files
from studio.app.server.answers import Router
from studio.app.server.app_state import App
from studio.operations.gallery import (
    GALLERY,
    CardView,
    GalleryState,
    card_of,
    card_picture,
    card_view,
    make_card,
    standing_of,
    standings,
)
from studio.operations.jobs.job_runner import Job, SessionJob

router = Router(prefix="/api/gallery", tags=["gallery"])


@dataclass(frozen=True, slots=True)
class GalleryView:
    """All cards, in the order in which they are shown."""

    cards: list[CardView]


@router.get("")
def gallery_cards(app: App) -> GalleryView:
    """The cards, and what can be done with each."""
    shown = standings(app.workspace)
    return GalleryView([card_view(one, app.jobs.known(GALLERY, one.card.name)) for one in shown])


@router.get("/{card}/picture.jpg", response_class=Response)
def picture(card: str, app: App) -> Response:
    """A small picture of a card's session (JPEG): of one that is there, or of what travels with the studio."""
    return files.picture(card_picture(card_of(card), app.workspace), revalidated=True)


@router.post("/{card}", status_code=202)
def begin_card(card: str, app: App) -> GalleryState:
    """Make a card's session in the background (`gallery` events); one that is there is done at once."""
    wanted = card_of(card)
    going = app.jobs.known(GALLERY, wanted.name)
    if going is not None and going.state.is_going:
        return going

    def work(job: Job) -> dict[str, object]:
        place = app.workspace.root / (standing_of(wanted, app.workspace).session or wanted.name)
        _, notes = make_card(wanted, place, None, job.report_or_stop)
        return {"notes": list(notes)}

    return app.jobs.begin(GALLERY, GalleryState(session=wanted.name), work)


@router.get("/{card}")
def card_job(card: str, app: App) -> GalleryState:
    """How the making of a card's session stands."""
    return app.jobs.state(GALLERY, card_of(card).name)


@router.delete("/{card}", status_code=202)
def cancel_card(card: str, app: App) -> SessionJob:
    """Stop making it; nothing of it is kept."""
    name = card_of(card).name
    app.jobs.cancel(GALLERY, name)
    return app.jobs.state(GALLERY, name)
