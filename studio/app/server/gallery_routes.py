"""The gallery: sessions that can be opened or made at a click."""

from fastapi import APIRouter, Response
from pydantic import Field

from studio.app.server import files
from studio.app.server.app_state import App, AppState
from studio.app.server.schemas import Answer
from studio.foundations.errors import NotFoundError
from studio.foundations.foreign_files import read_file
from studio.operations.gallery import (
    CARDS,
    GALLERY_PICTURES,
    Card,
    CardKind,
    CardStanding,
    card_of,
    make_card,
    standing_of,
)
from studio.operations.jobs.job_runner import Job, JobKind, SessionJob
from studio.sessions.samples import sample_folder
from studio.sessions.session import Session, thumbnail_of

router = APIRouter(prefix="/api/gallery", tags=["gallery"])


class GalleryState(SessionJob):
    """How the making of a card's session stands."""


GALLERY = JobKind(
    "gallery",
    "making of a session",
    GalleryState,
    changes_session=True,
    makes_session=True,
    at="/api/gallery/{session}",
    page="/?session={session}",
)


class CardView(Answer):
    """A card. there: whether its session is in the workspace. missing: why it cannot be made here, "" where it can.
    data: where footage or motion that is not shipped comes from. commands: that make the session. guide: the page that
    tells how. picture: whether it has one. job: how its making stands.
    """

    name: str
    title: str
    words: str
    kind: CardKind
    there: bool
    missing: str
    data: str
    commands: list[str]
    guide: str
    picture: bool
    job: GalleryState | None = None


class GalleryView(Answer):
    """All cards, in the order in which they are shown."""

    cards: list[CardView] = Field(default_factory=list[CardView])


@router.get("")
def gallery_cards(app: App) -> GalleryView:
    """The cards, and what can be done with each."""
    return GalleryView(cards=[_view(app, standing_of(card, app.workspace)) for card in CARDS])


@router.get("/{card}/picture.jpg", response_class=Response)
def card_picture(card: str, app: App) -> Response:
    """A small picture of a card's session (JPEG): of one that is there, or of what travels with the studio."""
    found = card_of(card)
    if standing_of(found, app.workspace).there:
        place = app.workspace.session(found.name).thumbnail()
        content = read_file(place) if place else None
    else:
        shipped = GALLERY_PICTURES / f"{found.name}.jpg"
        content = read_file(shipped) if shipped.is_file() else None
        if found.kind == "sample":
            content = thumbnail_of(Session(sample_folder(found.name)))
    if content is None:
        raise NotFoundError(f"Card '{card}' has no picture.", "Make its session first.")
    return files.picture(content, checked_anew=True)


@router.post("/{card}", status_code=202)
def begin_card(card: str, app: App) -> GalleryState:
    """Make a card's session in the background (`gallery` events); one that is there is done at once."""
    found = card_of(card)
    going = app.jobs.known(GALLERY, found.name)
    if going is not None and going.state.is_going:
        return going

    def work(job: Job) -> dict[str, object]:
        make_card(found, app.workspace.root / found.name, None, job.report_or_stop)
        return {}

    return app.jobs.begin(GALLERY, GalleryState(session=found.name), work)


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


def _view(app: AppState, standing: CardStanding) -> CardView:
    card: Card = standing.card
    return CardView.of(
        card,
        commands=list(card.commands),
        there=standing.there,
        missing=standing.missing,
        picture=standing.there or card.kind == "sample" or (GALLERY_PICTURES / f"{card.name}.jpg").is_file(),
        job=app.jobs.known(GALLERY, card.name),
    )
