"""The report: one self-contained page that opens from any folder without a server.

It is drawn by the same module as in the studio's pages (`js/findings.js`), with the same colours; styles, scripts,
type and data are inside.
"""

import html

from studio.results.comparison.findings_document import Document
from studio.results.self_contained import self_contained_page

BODY = """<header class="report-head">
<div>
<h1>Reproduction report</h1>
<p>{software}, {date}</p>
</div>
<button type="button" id="theme" aria-label="Light or dark" title="Light or dark">◐</button>
</header>
<main id="findings"><p>This report is drawn by a script; allow scripts for this file to read it.</p></main>"""

SCRIPT = """import * as echarts from "vendor/echarts.esm.min.js";
import { drawFindings } from "js/findings.js";
const root = document.documentElement;
const { experiments } = JSON.parse(document.getElementById("data").textContent);
drawFindings(document.getElementById("findings"), experiments, echarts);
const turn = (theme) => { root.dataset.theme = theme; };
document.getElementById("theme").onclick = () => turn(root.dataset.theme === "dark" ? "light" : "dark");
let seen = "";
addEventListener("beforeprint", () => { seen = root.dataset.theme; turn("light"); });
addEventListener("afterprint", () => turn(seen));"""


def report_html(results: Document) -> str:
    """The page of all results. Raises StudioError where the pages' files are not installed."""
    software = html.escape(f"Capture studio {results['software']}")
    date = html.escape(results["date"][:16].replace("T", " ") + " UTC")
    return self_contained_page(
        title="Reproduction report",
        kind="report",
        styles=("report.css",),
        entries=("vendor/echarts.esm.min.js", "js/findings.js"),
        body=BODY.format(software=software, date=date),
        data=results,
        script=SCRIPT,
    )
