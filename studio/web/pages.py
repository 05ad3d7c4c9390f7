"""The pages' HTML: files of `web_assets`, with what all pages share (its `parts`) put in at `{{part}}`."""

import re
from collections.abc import Mapping
from pathlib import Path

from starlette.responses import HTMLResponse

PLACE = re.compile(r"\{\{(\w+)\}\}")
PARTS = "parts"
NAME = "Capture studio"
PLACES = {
    "/": "Studio",
    "/way": "Guided set-up",
    "/recording": "Live cameras",
    "/comparisons": "Comparisons",
    "/behaviours": "Behaviours",
    "/reports": "Reports",
    "/guide": "Guide",
}


def assets_folder() -> Path:
    """Where the pages lie: in an installed package beside this file, in a checkout in `web_assets`."""
    here = Path(__file__).resolve().parent
    installed = here / "assets"
    return installed if installed.is_dir() else here.parent.parent / "web_assets"


def html_page(file: str, address: str, own: Mapping[str, str]) -> HTMLResponse:
    """The page at an address, asked for anew each time. own : what is put in beside the parts, not escaped."""
    return HTMLResponse(page_text(file, address, own), headers={"cache-control": "no-cache"})


def page_text(file: str, address: str, own: Mapping[str, str]) -> str:
    """The page's text, every place filled: with the parts that all pages share, then with its own."""
    text = (assets_folder() / file).read_text(encoding="utf-8")
    parts = {
        path.stem: path.read_text(encoding="utf-8").rstrip()
        for path in (assets_folder() / PARTS).glob("*.html")
    }
    own = {"places": navigation(address)} | dict(own)
    text = PLACE.sub(lambda found: parts.get(found[1], found[0]), text)
    return PLACE.sub(lambda found: own[found[1]], text)


def navigation(address: str) -> str:
    """The same links on every page, marked where one is the page itself. The guide stands beside the others."""

    def link(to: str, title: str) -> str:
        if to == address:
            return f'<a href="{to}" aria-current="page">{title}</a>'
        beside = ' target="_blank" rel="noopener"' if to == "/guide" else ""
        return f'<a href="{to}"{beside}>{title}</a>'

    links = "".join(link(to, title) for to, title in PLACES.items())
    return f'<nav class="places" aria-label="Pages">{links}</nav>'
