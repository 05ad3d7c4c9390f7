"""The pages' HTML: files of `web_assets`, with what all pages share (its `parts`) put in at `{{part}}`."""

import re
from collections.abc import Mapping
from pathlib import Path

from starlette.responses import HTMLResponse

PLACE = re.compile(r"\{\{(\w+)\}\}")
PARTS = "parts"
NAME = "Capture studio"


def assets_folder() -> Path:
    """Where the pages lie: in an installed package beside this file, in a checkout in `web_assets`."""
    here = Path(__file__).resolve().parent
    installed = here / "assets"
    return installed if installed.is_dir() else here.parent.parent / "web_assets"


def html_page(file: str, own: Mapping[str, str]) -> HTMLResponse:
    """A page, asked for anew each time. own : what is put in beside the parts; it is our own HTML, not escaped."""
    text = (assets_folder() / file).read_text(encoding="utf-8")
    return HTMLResponse(_filled(text, _parts() | dict(own)), headers={"cache-control": "no-cache"})


def _parts() -> dict[str, str]:
    folder = assets_folder() / PARTS
    return {path.stem: path.read_text(encoding="utf-8").rstrip() for path in folder.glob("*.html")}


def _filled(text: str, values: Mapping[str, str]) -> str:
    """The text with every place filled, those within what was put in too."""
    while PLACE.search(text):
        text = PLACE.sub(lambda found: values[found[1]], text)
    return text
