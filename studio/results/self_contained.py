"""Pages that open from any folder without a server: modules, styles, type and data of `web_assets` inside one file."""

import base64
import html
import json
import re
from pathlib import PurePosixPath

from studio.foundations.errors import StudioError
from studio.foundations.package import assets_folder

TYPE = "vendor/inter.woff2"

_IMPORT = re.compile(r'(from |import )"(\.{1,2}/[\w./-]+\.js)"')
# The page brings the type along itself.
_FONT = re.compile(r"@font-face\s*\{[^}]*\}")

PAGE = """<!doctype html>
<html lang="en" data-theme="light">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title} · Capture studio</title>
<script>
document.documentElement.dataset.theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
</script>
<style>
@font-face {{ font-family: "Inter"; src: url("{type}") format("woff2"); font-weight: 100 900; font-display: block; }}
{styles}
</style>
<script type="importmap">{modules}</script>
</head>
<body class="{kind}">
{body}
<script type="application/json" id="data">{data}</script>
<script type="module">
{script}
</script>
</body>
</html>
"""


def self_contained_page(
    *,
    title: str,
    kind: str,
    styles: tuple[str, ...],
    entries: tuple[str, ...],
    body: str,
    data: object,
    script: str,
) -> str:
    """The page's text. title : not escaped yet. kind : class of its body. styles : style sheets by their names, after
    the tokens. entries : modules that the script imports, such as "js/figure.js"; what these import comes along. data :
    JSON for the script, in the element `data`; NaN is refused.

    Raises StudioError where the pages' files are not installed.
    """
    return PAGE.format(
        title=html.escape(title),
        kind=kind,
        type=_address("font/woff2", _content(TYPE)),
        styles=_FONT.sub("", "\n".join(_text(name) for name in ("tokens.css", *styles))),
        modules=_inside_script(json.dumps({"imports": modules_of(*entries)})),
        body=body,
        data=_inside_script(json.dumps(data, allow_nan=False, separators=(",", ":"))),
        script=script,
    )


def modules_of(*entries: str) -> dict[str, str]:
    """By name the addresses (`data:`) of modules and of all that they import, which then import by these names."""
    modules: dict[str, str] = {}
    waiting = list(entries)
    while waiting:
        name = waiting.pop()
        if name in modules:
            continue
        needed: list[str] = []

        def named(match: re.Match[str], name: str = name, needed: list[str] = needed) -> str:
            needed.append(_resolved(name, match[2]))
            return f'{match[1]}"{needed[-1]}"'

        source = _IMPORT.sub(named, _text(name))
        modules[name] = _address("text/javascript", source.encode("utf-8"))
        waiting += needed
    return modules


def _resolved(importer: str, path: str) -> str:
    """A relative path in a module as a name from the assets' folder."""
    parts = list(PurePosixPath(importer).parent.parts)
    for part in PurePosixPath(path).parts:
        if part == "..":
            parts.pop()
        elif part != ".":
            parts.append(part)
    return "/".join(parts)


def _address(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


def _inside_script(text: str) -> str:
    """JSON that cannot end its script element."""
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _text(name: str) -> str:
    return _content(name).decode("utf-8")


def _content(name: str) -> bytes:
    path = assets_folder() / name
    if not path.is_file():
        raise StudioError(f"The page's file {path.name} is missing.", "Install the package again.")
    return path.read_bytes()
