"""The studio's further pages: one frame with a bar of places, what is in it is drawn by each page's own module."""

from dataclasses import dataclass

from fastapi import APIRouter
from starlette.responses import HTMLResponse

from studio.web.pages import NAME, html_page

router = APIRouter(tags=["page"], include_in_schema=False)

TEMPLATE = "document.html"
RAIL = (
    '<nav class="rail" aria-label="{title}">\n    <div class="rail-head">\n      <h2>{title}</h2>\n      {button}'
    '\n    </div>\n    <div class="entries" id="entries"></div>\n  </nav>'
)
NEW = '<button class="quiet small" id="new">+ New</button>'


@dataclass(frozen=True, slots=True)
class DocumentPage:
    """A page. name : its address and its module. rail : whether it has a list at the left; new : and a button that
    makes something.
    """

    name: str
    title: str
    rail: bool = False
    new: bool = False


PAGES = (
    DocumentPage("comparisons", "Comparisons", rail=True, new=True),
    DocumentPage("behaviours", "Behaviours", rail=True, new=True),
    DocumentPage("recording", "Live cameras"),
    DocumentPage("reports", "Reports"),
)
PLACES = (
    ("/", "Studio"),
    ("/way", "Guided way"),
    *((f"/{page.name}", page.title) for page in PAGES),
    ("/guide", "Guide"),
)


@router.get("/comparisons")
def comparisons_page() -> HTMLResponse:
    """The page of comparisons."""
    return _answer("comparisons")


@router.get("/behaviours")
def behaviours_page() -> HTMLResponse:
    """The page of behaviour models."""
    return _answer("behaviours")


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
    own = {
        "title": f"{page.title} · {NAME}",
        "module": page.name,
        "columns": "" if page.rail else "wide",
        "places": "".join(_link(address, title, page) for address, title in PLACES),
        "rail": RAIL.format(title=page.title, button=NEW if page.new else "") if page.rail else "",
    }
    return html_page(TEMPLATE, own)


def _link(address: str, title: str, page: DocumentPage) -> str:
    """A place in the bar, marked where it is the page itself."""
    mark = ' aria-current="page"' if address == f"/{page.name}" else ""
    return f'<a href="{address}"{mark}>{title}</a>'
