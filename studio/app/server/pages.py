"""The pages' HTML: files of `web_assets`, with what all pages share (its `parts`) put in at `{{part}}`."""

import re
from collections.abc import Mapping

from starlette.responses import HTMLResponse

from studio.app.server.access import MAKING_PAGES, VIEWING
from studio.foundations.package import assets_folder

PLACE = re.compile(r"\{\{(\w+)\}\}")
PARTS = "parts"
NAME = "Capture studio"
PLACES = {
    "/": "Studio",
    "/way": "Guided set-up",
    "/gallery": "Gallery",
    "/recording": "Live cameras",
    "/comparisons": "Comparisons",
    "/bodies": "Bodies",
    "/behaviours": "Behaviours",
    "/reports": "Reports",
    "/arena": "Arena",
    "/guide": "Guide",
}
OF_RUNS = {"/rig": "Where cameras should stand"}
"""Pages that are about one run, and are reached from it."""


def html_page(file: str, address: str, own: Mapping[str, str]) -> HTMLResponse:
    """The page at an address, read again each time. own : what is put in beside the parts, not escaped."""
    return HTMLResponse(page_text(file, address, own), headers={"cache-control": "no-cache"})


def page_text(file: str, address: str, own: Mapping[str, str]) -> str:
    """The page's text, every place filled: with the parts that all pages share, then with its own."""
    text = (assets_folder() / file).read_text(encoding="utf-8")
    parts = {
        path.stem: path.read_text(encoding="utf-8").rstrip()
        for path in (assets_folder() / PARTS).glob("*.html")
    }
    own = {"places": navigation(address), "access": "view" if VIEWING.get() else "all"} | dict(own)
    text = PLACE.sub(lambda place: parts.get(place[1], place[0]), text)
    return PLACE.sub(lambda place: own[place[1]], text)


def navigation(address: str) -> str:
    """The same links on every page, marked where one is the page itself. The guide stands beside the others."""

    def link(to: str, title: str) -> str:
        if to == address:
            return f'<a href="{to}" aria-current="page">{title}</a>'
        beside = ' target="_blank" rel="noopener"' if to == "/guide" else ""
        return f'<a href="{to}"{beside}>{title}</a>'

    shown = {to: title for to, title in PLACES.items() if not (VIEWING.get() and to in MAKING_PAGES)}
    links = "".join(link(to, title) for to, title in shown.items())
    return f'<nav class="places" aria-label="Pages">{links}</nav>'
