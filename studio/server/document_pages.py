"""The studio's further pages: one frame with a bar of places, what is in it is drawn by each page's own module."""

from dataclasses import dataclass

from fastapi import APIRouter
from starlette.responses import HTMLResponse

from studio.server.pages import NAME, PLACES, html_page

router = APIRouter(tags=["page"], include_in_schema=False)

TEMPLATE = "document.html"
RAIL = (
    '<nav class="rail" aria-label="{title}">\n    <div class="rail-head">\n      <h2>{title}</h2>\n      '
    '<button class="quiet small" id="new">+ New</button>\n    </div>'
    '\n    <div class="entries" id="entries"></div>\n  </nav>'
)


@dataclass(frozen=True, slots=True)
class DocumentPage:
    """A page. name : its address and its module. rail : whether it has a list at the left, and a button that makes
    something.
    """

    name: str
    rail: bool = False


PAGES = (
    DocumentPage("comparisons", rail=True),
    DocumentPage("bodies", rail=True),
    DocumentPage("behaviours", rail=True),
    DocumentPage("gallery"),
    DocumentPage("recording"),
    DocumentPage("reports"),
)


@router.get("/comparisons")
def comparisons_page() -> HTMLResponse:
    """The page of comparisons."""
    return _answer("comparisons")


@router.get("/behaviours")
def behaviours_page() -> HTMLResponse:
    """The page of behaviour models."""
    return _answer("behaviours")


@router.get("/bodies")
def bodies_page() -> HTMLResponse:
    """The page of bodies."""
    return _answer("bodies")


@router.get("/gallery")
def gallery_page() -> HTMLResponse:
    """The page of sessions that can be opened or made."""
    return _answer("gallery")


@router.get("/recording")
def recording_page() -> HTMLResponse:
    """The page of live cameras."""
    return _answer("recording")


@router.get("/reports")
def reports_page() -> HTMLResponse:
    """The page of reproduced figures."""
    return _answer("reports")


def _answer(name: str) -> HTMLResponse:
    page = next(page for page in PAGES if page.name == name)
    title = PLACES[f"/{name}"]
    own = {
        "title": f"{title} · {NAME}",
        "module": name,
        "columns": "" if page.rail else "wide",
        "rail": RAIL.format(title=title) if page.rail else "",
    }
    return html_page(TEMPLATE, f"/{name}", own)
