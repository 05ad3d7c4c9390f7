"""The pages: the studio's own around the scene, those of documents, and what a browser wants remembered."""

import mimetypes

from starlette.responses import Response

from studio.app.server.answers import Router
from studio.app.server.app_state import App
from studio.app.server.pages import NAME, OF_RUNS, PLACES, html_page
from studio.operations.preferences import change_preferences, read_preferences

router = Router(tags=["page"])

DOCUMENT = "document.html"
"""One frame with a bar of places; what is in it is drawn by each page's own module."""
RAILED = ("comparisons", "bodies", "behaviours")
"""Pages that have a list at the left, and a button that makes something."""
UNRAILED = ("gallery", "recording", "reports", "arena", "rig")
RAIL = (
    '<nav class="rail" aria-label="{title}">\n    <div class="rail-head">\n      <h2>{title}</h2>\n      '
    '<button class="quiet small" id="new">+ New</button>\n    </div>'
    '\n    <div class="entries" id="entries"></div>\n  </nav>'
)

# Windows machines may have other words for these in their registry, and browsers refuse modules of another
# type.
mimetypes.add_type("text/javascript", ".js")
mimetypes.add_type("text/css", ".css")
mimetypes.add_type("image/svg+xml", ".svg")
mimetypes.add_type("font/woff2", ".woff2")


@router.get("/", include_in_schema=False)
def page() -> Response:
    """The studio's page."""
    return html_page("index.html", "/", {"title": NAME})


def _add_document(name: str) -> None:
    """Add a page by its name: that of its address and of its module."""
    address, railed = f"/{name}", name in RAILED

    @router.get(address, include_in_schema=False)
    def document_page() -> Response:
        """A page of its own beside the studio's."""
        title = PLACES.get(address) or OF_RUNS[address]
        own = {"title": f"{title} · {NAME}", "module": name, "columns": "" if railed else "wide"}
        return html_page(DOCUMENT, address, own | {"rail": RAIL.format(title=title) if railed else ""})


for _name in (*RAILED, *UNRAILED):
    _add_document(_name)


@router.get("/api/preferences")
def preferences(app: App) -> dict[str, object]:
    """What the page keeps (theme, speed, folded panels): a free object, `{}` at first."""
    return read_preferences(app.state_folder)


@router.patch("/api/preferences")
def patch_preferences(changes: dict[str, object], app: App) -> dict[str, object]:
    """Set some entries (null removes one) and return all of them; at most 16 KB in all."""
    return change_preferences(app.state_folder, changes)
