"""The pages: the studio's own around the scene, those of documents, and what a browser wants remembered."""

import mimetypes
from pathlib import Path

import msgspec
from starlette.responses import Response

from studio.app.server.answers import Router
from studio.app.server.app_state import App
from studio.app.server.pages import NAME, PLACES, html_page
from studio.foundations.errors import SessionError, StudioError
from studio.foundations.foreign_files import LARGEST_RECORD, read_file
from studio.foundations.typed_decoding import decode_json
from studio.sessions.atomic_files import write_bytes

router = Router(tags=["page"])

DOCUMENT = "document.html"
"""One frame with a bar of places; what is in it is drawn by each page's own module."""
RAILED = ("comparisons", "bodies", "behaviours")
"""Pages that have a list at the left, and a button that makes something."""
UNRAILED = ("gallery", "recording", "reports")
RAIL = (
    '<nav class="rail" aria-label="{title}">\n    <div class="rail-head">\n      <h2>{title}</h2>\n      '
    '<button class="quiet small" id="new">+ New</button>\n    </div>'
    '\n    <div class="entries" id="entries"></div>\n  </nav>'
)
PREFERENCES_FILE = "preferences.json"
PREFERENCES_LIMIT = 16_384

# Windows machines may have other words for these in their registry, and browsers refuse modules of another
# type.
mimetypes.add_type("text/javascript", ".js")
mimetypes.add_type("text/css", ".css")
mimetypes.add_type("image/svg+xml", ".svg")
mimetypes.add_type("font/woff2", ".woff2")


class PreferencesError(StudioError, status=422, code="preferences"):
    """View preferences that cannot be kept."""


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
        title = PLACES[address]
        own = {"title": f"{title} · {NAME}", "module": name, "columns": "" if railed else "wide"}
        return html_page(DOCUMENT, address, own | {"rail": RAIL.format(title=title) if railed else ""})


for _name in (*RAILED, *UNRAILED):
    _add_document(_name)


@router.get("/api/preferences")
def preferences(app: App) -> dict[str, object]:
    """What the page keeps (theme, speed, folded panels): a free object, `{}` at first."""
    return read_preferences(app.state_folder / PREFERENCES_FILE)


@router.patch("/api/preferences")
def change_preferences(changes: dict[str, object], app: App) -> dict[str, object]:
    """Set some entries (null removes one) and return all of them; at most 16 KB in all."""
    path = app.state_folder / PREFERENCES_FILE
    merged = read_preferences(path) | changes
    kept = {name: value for name, value in merged.items() if value is not None}
    content = msgspec.json.encode(kept)
    if len(content) > PREFERENCES_LIMIT:
        raise PreferencesError(
            f"The view preferences take {len(content)} bytes.", f"Keep them under {PREFERENCES_LIMIT}."
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, content)
    return kept


def read_preferences(path: Path) -> dict[str, object]:
    """The stored object; a missing or damaged file counts as empty, for nothing depends on it."""
    try:
        return decode_json(read_file(path, LARGEST_RECORD), dict[str, object])
    except (OSError, SessionError, msgspec.DecodeError):
        return {}
