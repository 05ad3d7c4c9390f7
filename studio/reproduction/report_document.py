"""The report: one self-contained page that opens from any folder without a server.

It is drawn by the same module as in the studio's pages (`js/findings.js`), with the same colours; styles, scripts,
type and data are inside.
"""

import base64
import html
import json
from pathlib import Path

from studio.comparison.findings_document import Document
from studio.errors import StudioError
from studio.runs.colour_tokens import tokens_file

# Modules; each may import those before it.
MODULES = ("elements.js", "chart_looks.js", "findings_options.js", "findings_charts.js", "findings.js")
ECHARTS = "vendor/echarts.esm.min.js"
TYPE = "vendor/inter.woff2"

PAGE = """<!doctype html>
<html lang="en" data-theme="light">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Reproduction report · Capture studio</title>
<script>
document.documentElement.dataset.theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
</script>
<style>
@font-face {{ font-family: "Inter"; src: url("{type}") format("woff2"); font-weight: 100 900; font-display: block; }}
{styles}
</style>
</head>
<body class="report">
<header class="report-head">
<div>
<h1>Reproduction report</h1>
<p>{software}, {date}</p>
</div>
<button type="button" id="theme" aria-label="Light or dark" title="Light or dark">◐</button>
</header>
<main id="findings"><p>This report is drawn by a script; allow scripts for this file to read it.</p></main>
<script type="application/json" id="results">{results}</script>
<script type="module">
import * as echarts from "{echarts}";
import {{ drawFindings }} from "{findings}";
const root = document.documentElement;
const {{ experiments }} = JSON.parse(document.getElementById("results").textContent);
drawFindings(document.getElementById("findings"), experiments, echarts);
const turn = (theme) => {{ root.dataset.theme = theme; }};
document.getElementById("theme").onclick = () => turn(root.dataset.theme === "dark" ? "light" : "dark");
let seen = "";
addEventListener("beforeprint", () => {{ seen = root.dataset.theme; turn("light"); }});
addEventListener("afterprint", () => turn(seen));
</script>
</body>
</html>
"""


def report_html(results: Document) -> str:
    """The page of all results. Raises StudioError where the pages' files are not installed."""
    assets = tokens_file().parent
    addresses: dict[str, str] = {}
    for name in MODULES:
        source = _text(assets / "js" / name)
        for other, address in addresses.items():
            source = source.replace(f'"./{other}"', f'"{address}"')
        addresses[name] = _module(source)
    return PAGE.format(
        styles=_text(tokens_file()) + _text(assets / "report.css"),
        type=_address("font/woff2", _content(assets / TYPE)),
        echarts=_module(_text(assets / ECHARTS)),
        findings=addresses[MODULES[-1]],
        software=html.escape(f"Capture studio {results['software']}"),
        date=html.escape(results["date"][:16].replace("T", " ") + " UTC"),
        results=_inside_script(json.dumps(results, allow_nan=False)),
    )


def _module(source: str) -> str:
    return _address("text/javascript", source.encode("utf-8"))


def _address(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


def _inside_script(text: str) -> str:
    """JSON that cannot end its script element."""
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _text(path: Path) -> str:
    return _content(path).decode("utf-8")


def _content(path: Path) -> bytes:
    if not path.is_file():
        raise StudioError(f"The page's file {path.name} is missing.", "Install the package again.")
    return path.read_bytes()
