"""`/guide`: the packaged text, with a table of every knob made from the declarations; beside it pages of examples."""

import html
import itertools
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from markdown_it import MarkdownIt
from starlette.responses import HTMLResponse

import studio
from studio import arena
from studio.app.server.answers import Router
from studio.app.server.interfaces_page import INTERFACES, interfaces_page, text_of
from studio.app.server.pages import NAME, html_page
from studio.evidence.settings import EvidenceSettings
from studio.foundations.declaring import DECLARED, REQUIRED, Knobs, Operation, Parameter, declared
from studio.foundations.errors import NotFoundError
from studio.foundations.knobs import Knob, Value, allowed, knobs_of
from studio.foundations.package import assets_folder
from studio.runs.learning.oversampling import OversamplingSettings
from studio.search.behaviour.settings import LearningSettings
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.settings import RecordingSettings, all_knobs, default_settings
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.frame_refinement import FrameRefinementSettings
from studio.search.trackers.paper_presets import PAPERS
from studio.search.trackers.recovery_settings import RecoverySettings
from studio.search.trackers.tracker import Printed

router = Router(tags=["page"], include_in_schema=False)
contents_router = Router(prefix="/api", tags=["page"])

PLACE_OF_KNOBS, PLACE_OF_SUMMARY, PLACE_OF_FINDINGS = "{{knobs}}", "{{reproduction}}", "{{findings}}"
PLACE_OF_PRINTED = "{{printed}}"
# Of `studio reproduce --into-guide`, and what it is compared with.
REPRODUCTION, BEFORE = "reproduction", "before.json"
VERBS_WORDS = (
    "What a person lets the studio do: each is a function of <code>studio</code> or <code>studio.arena</code>, most are"
    " a command, and the page asks for them over HTTP. A keyword, an option and an entry of a body are one declaration."
)
VERB_COLUMNS = ("Keyword", "What it means", "Default", "Option", "HTTP")
TEXTS = {
    "": ("guide.md", "Guide"),
    "course": ("course.md", "Course"),
    "arm": ("arm.md", "An arm of four links"),
    "particle": ("particle.md", "What a particle is"),
    "layer": ("layer.md", "Why one layer fails"),
    "annealing": ("annealing.md", "What annealing changes"),
    "partitions": ("partitions.md", "What partitions and behaviour add"),
    "python": ("python.md", "Python"),
    "adding": ("adding.md", "Adding your own"),
    "animal": ("animal.md", "Your own animal in an hour"),
    "formats": ("formats.md", "Formats"),
    "live-out": ("live_out.md", "Live out"),
    "glossary": ("glossary.md", "Glossary"),
    "commands": ("commands.md", "Commands"),
    "figures": ("figures.md", "How well, how fast"),
    REPRODUCTION: ("reproduction.md", "The papers' claims"),
    "by-hand": ("reproduction_by_hand.md", "Five verdicts by hand"),
}
"""The packaged texts and their titles, by the addresses below /guide."""
COURSE = ("course", "arm", "particle", "layer", "annealing", "partitions")
"""Those of the course, in their order."""
VERBS = "verbs"
COLUMNS = ("Name", "What it does", "Range", "Default", "Unit", "Takes effect")


@dataclass(frozen=True, slots=True)
class GuideHeading:
    """A heading of the guide. page: the title of the page that it is on. address: of its place there."""

    title: str
    page: str
    address: str


@dataclass(frozen=True, slots=True)
class GuideContents:
    """All pages of the guide with their headings."""

    headings: tuple[GuideHeading, ...]


@contents_router.get("/guide-contents")
def contents() -> GuideContents:
    """What the guide has, for a search."""
    return GuideContents(_headings())


@cache
def _headings() -> tuple[GuideHeading, ...]:
    headings: list[GuideHeading] = []
    for name, (file, page) in TEXTS.items():
        address = f"/guide/{name}" if name else "/guide"
        headings.append(GuideHeading(page, NAME, address))
        tokens = MarkdownIt("commonmark").parse(
            (assets_folder() / "guide" / file).read_text(encoding="utf-8")
        )
        headings += [
            GuideHeading(inline.content, page, f"{address}#{anchor_of(inline.content)}")
            for opening, inline in itertools.pairwise(tokens)
            if opening.type == "heading_open" and opening.tag == "h2"
        ]
    made = (("All verbs", VERBS), ("Interfaces", INTERFACES))
    return (*headings, *(GuideHeading(title, NAME, f"/guide/{page}") for title, page in made))


@router.get("/guide")
@router.get("/guide/{page}")
def guide(page: str = "") -> HTMLResponse:
    """The guide, and what it refers to: examples for Python, all verbs, how to add one's own, figures."""
    if page == VERBS:
        return html_page("guide.html", "/guide", verbs_page())
    if page == INTERFACES:
        return html_page("guide.html", "/guide", interfaces_page())
    if page not in TEXTS:
        raise NotFoundError(f"The guide has no page '{page[:40]}'.", "Begin at /guide.")
    return html_page("guide.html", "/guide", rendered(*TEXTS[page], in_course=page in COURSE))


@cache
def rendered(name: str, title: str, in_course: bool = False) -> dict[str, str]:
    """The text of a page, made once. name : among the guide's texts. in_course : with the course's contents."""
    markdown = MarkdownIt("commonmark", {"html": False}).enable("table")
    folder = assets_folder() / "guide"
    text = (folder / name).read_text(encoding="utf-8")
    tokens = markdown.parse(text)
    contents: list[str] = [] if name == "guide.md" else ['<a href="/guide">Guide</a>']
    if in_course:
        contents += [_course_link(page, name) for page in COURSE]
    for opening, inline in itertools.pairwise(tokens):
        if opening.type == "heading_open" and opening.tag in ("h2", "h3"):
            anchor = anchor_of(inline.content)
            opening.attrSet("id", anchor)
            if opening.tag == "h2" and not in_course:
                contents.append(f'<a href="#{anchor}">{html.escape(inline.content)}</a>')
    # Lines within a table's cell are the one thing that the text cannot say without HTML.
    content = markdown.renderer.render(tokens, markdown.options, {}).replace("&lt;br&gt;", "<br>")
    places = {
        PLACE_OF_KNOBS: all_knob_tables,
        PLACE_OF_PRINTED: printed_and_run,
        PLACE_OF_SUMMARY: before_and_after,
        PLACE_OF_FINDINGS: place_of_findings,
    }
    for place, made in places.items():
        if place in text:
            content = content.replace(f"<p>{place}</p>", made())
    return {"title": f"{title} · {NAME}", "contents": "".join(contents), "content": content}


def _course_link(page: str, shown: str) -> str:
    """A page of the course among the contents of one of them."""
    file, title = TEXTS[page]
    current = ' aria-current="page"' if file == shown else ""
    return f'<a href="/guide/{page}"{current}>{html.escape(title)}</a>'


@cache
def verbs_page() -> dict[str, str]:
    """The page on what each verb does and takes, in Python, on the command line and over HTTP."""
    verbs = {name: getattr(studio, name) for name in dir(studio) if name not in ("StudioError", "arena")}
    own = [name for name in dir(arena) if hasattr(getattr(arena, name), DECLARED)]
    verbs |= {f"arena.{name}": getattr(arena, name) for name in own}
    contents = ['<a href="/guide">Guide</a>', '<a href="/guide/python">Examples</a>']
    contents += [f'<a href="#{name}">{name}</a>' for name in verbs]
    parts = [_verb(name, declared(function)) for name, function in verbs.items()]
    content = "\n".join(["<h1>Verbs</h1>", f"<p>{VERBS_WORDS}</p>", *parts])
    return {"title": f"Verbs · {NAME}", "contents": "".join(contents), "content": content}


def _verb(name: str, verb: Operation) -> str:
    """One verb: what it does, a table of its parameters, and what it returns."""
    words = "".join(f"<p>{html.escape(part)}</p>" for part in verb.about.split("\n\n"))
    head = "".join(f"<th>{column}</th>" for column in VERB_COLUMNS)
    rows = "\n".join(
        f"<tr>{''.join(f'<td>{cell}</td>' for cell in _entry(entry))}</tr>"
        for entry in verb.parameters.values()
    )
    table = f'<div class="wide"><table><thead><tr>{head}</tr></thead>\n<tbody>{rows}</tbody></table></div>'
    head = f'<h2 id="{name}"><code>studio.{name}</code></h2>'
    return "\n".join([head, words, table if rows else "", text_of(verb.returned)])


def _entry(entry: Parameter) -> tuple[str, ...]:
    """A row: the keyword, what it means, its default, its option, and its entry of a body."""
    default = "" if entry.default in (REQUIRED, None, "", ()) else str(entry.default)
    option = "" if entry.terminal.left_out or entry.mark(Knobs) else entry.option
    body = "" if entry.web.left_out else entry.web.name or entry.name
    code = [f"<code>{html.escape(word)}</code>" if word else "" for word in (default, option, body)]
    return f"<code>{entry.name}</code>", html.escape(entry.meaning), *code


def findings_of_the_guide() -> dict[str, dict[str, Any]]:
    """What `studio reproduce --into-guide` wrote, by experiment."""
    folder = assets_folder() / "guide" / REPRODUCTION
    files = sorted(path for path in folder.glob("*.json") if path.name != BEFORE)
    return {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in files}


def printed_and_run() -> str:
    """A table a paper's preset: what is printed, what is run for it by the knobs of the preset, and why they differ."""
    learning = {knob.name: knob for knob in knobs_of(LearningSettings)}
    parts: list[str] = []
    for preset in PAPERS:
        knobs = {knob.name: knob for knob in all_knobs(default_settings(preset.tracker, preset.weighting))}
        rows = [
            f"<tr><td>{html.escape(entry.printed)}</td><td>{html.escape(_what_is_run(entry, known))}</td>"
            f"<td>{html.escape(entry.why)}</td></tr>"
            for known, entries in ((knobs, preset.printed), (learning, preset.learning))
            for entry in entries
        ]
        parts.append(
            f'<h3 id="{anchor_of(preset.name)}">{html.escape(preset.name)}</h3>\n'
            f"<p>{html.escape(preset.help)}</p>\n"
            f'<div class="wide"><table><thead><tr><th>Printed</th><th>What we run</th><th>Why</th></tr></thead>\n'
            f"<tbody>{''.join(rows)}</tbody></table></div>"
        )
    return "\n".join(parts)


def _what_is_run(entry: Printed, knobs: Mapping[str, Knob]) -> str:
    """The knobs that are set, by the words on screen, and what no knob says."""
    knobs_set = [f"{knobs[name].label} {_value_in_words(value)}" for name, value in entry.sets.items()]
    return "; ".join([*([entry.runs] if entry.runs else []), *knobs_set])


def _value_in_words(value: Value) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:g}" if isinstance(value, float) else str(value) or "empty"


def before_and_after() -> str:
    """A row an experiment: its verdict and numbers of BEFORE, those of today with seeds, day and commit, and why."""
    before = json.loads((assets_folder() / "guide" / REPRODUCTION / BEFORE).read_text(encoding="utf-8"))
    findings = findings_of_the_guide()
    rows: list[str] = []
    measured_first = sorted(
        dict.fromkeys((*before["rows"], *findings)), key=lambda name: name not in findings
    )
    for name in measured_first:
        was, now = before["rows"].get(name), findings.get(name)
        known = now or was
        head = f"{html.escape(known['title'])}<br><code>{name}</code><br>{html.escape(known['source'])}"
        old = "new" if was is None else _verdict(was["verdict"], was["numbers"])
        if now is None:
            new = f"not measured again; measured {before['date']}, before commits were kept"
        else:
            firm = "" if now["firm"] else " (not firm)"
            measured = f"{now['seeds']} seeds, {now['measured'][:10]}, commit {', '.join(now['commits'])}"
            new = f"{_verdict(now['verdict'] + firm, now['lines'])}{html.escape(measured)}"
        why = was["why"] if was else ""
        rows.append(f"<tr><td>{head}</td><td>{old}</td><td>{new}</td><td>{html.escape(why)}</td></tr>")
    heads = ("Experiment", f"Before ({before['date']})", "Now", "Why it changes")
    head = "".join(f"<th>{words}</th>" for words in heads)
    body = "\n".join(rows)
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table></div>'


def _verdict(verdict: str, numbers: Iterable[str]) -> str:
    """A verdict with its numbers folded away."""
    lines = "<br>".join(html.escape(line) for line in numbers)
    return f"<details><summary>{html.escape(verdict)}</summary><small>{lines}</small></details>"


def place_of_findings() -> str:
    """Where `js/guide.js` draws the findings whose files it names."""
    files = " ".join(f"/assets/guide/{REPRODUCTION}/{name}.json" for name in findings_of_the_guide())
    return f'<div id="findings" data-files="{html.escape(files)}"></div>'


def anchor_of(heading: str) -> str:
    """A heading as the name of its place in the page."""
    words = "".join(letter if letter.isalnum() else " " for letter in heading.lower())
    return "-".join(words.split())


def settings_groups() -> dict[str, type]:
    """Every settings class there is, by the words that head its table."""
    groups: dict[str, type] = {f"Tracker: {name}": entry.settings_type for name, entry in TRACKERS.items()}
    groups |= {f"Weighting: {name}": entry.settings_type for name, entry in WEIGHTINGS.items()}
    groups |= {"Evidence": EvidenceSettings, "Refinement of each frame": FrameRefinementSettings}
    groups |= {"Recovery": RecoverySettings, "Recording": RecordingSettings}
    return groups | {entry.title: entry for entry in (LearningSettings, OversamplingSettings)}


def all_knob_tables() -> str:
    """A table for each tracker, each weighting, the evidence, the recording and the learning of behaviour."""
    return "\n".join(knob_table(title, knobs_of(settings)) for title, settings in settings_groups().items())


def knob_table(title: str, knobs: tuple[Knob, ...]) -> str:
    head = "".join(f"<th>{name}</th>" for name in COLUMNS)
    rows = "\n".join(f"<tr>{_row(entry)}</tr>" for entry in knobs)
    return (
        f'<h3 id="{anchor_of(title)}">{html.escape(title)}</h3>\n<div class="wide"><table class="knobs">'
        f"<thead><tr>{head}</tr></thead>\n<tbody>{rows}</tbody></table></div>"
    )


def _row(entry: Knob) -> str:
    default = str(entry.default).lower() if entry.kind is bool else f"{entry.default}" or "empty"
    cells = (
        f"<strong>{html.escape(entry.label)}</strong><br><code>{html.escape(entry.name)}</code>",
        html.escape(entry.help),
        html.escape(allowed(entry)),
        html.escape(default),
        html.escape(entry.unit),
        html.escape(entry.takes_effect),
    )
    return "".join(f"<td>{cell}</td>" for cell in cells)
