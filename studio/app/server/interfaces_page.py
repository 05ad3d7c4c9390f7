"""`/guide/interfaces`: what `studio.extending` gives, and what a racer of the arena meets, from the docstrings."""

import html
import inspect
import re
from collections.abc import Callable
from functools import cache, cached_property
from typing import Any

from studio import arena, extending
from studio.app.server.pages import NAME

INTERFACES = "interfaces"
WORDS = (
    "What <code>studio.extending</code> gives: of this a tracker, a likelihood, an export or a calibration format of"
    " your own is made; and of <code>studio.arena</code> what a racer is made of. "
    '<a href="/guide/adding">Adding your own</a> has an example of each.'
)
ENTRY = re.compile(r"^((?:[a-z_]\w*(?:\([^)]*\))?)(?:, [a-z_]\w*)*) : ", re.MULTILINE)
"""How a docstring's line about a field begins."""


@cache
def interfaces_page() -> dict[str, str]:
    """The page on every class, function and constant, in the order of their names."""
    members = {name: getattr(extending, name) for name in dir(extending)}
    members |= {name: one for name in dir(arena) if inspect.isclass(one := getattr(arena, name))}
    contents = ['<a href="/guide">Guide</a>', '<a href="/guide/adding">Adding your own</a>']
    contents += [f'<a href="#{name}">{name}</a>' for name in members]
    parts = [_member(name, value) for name, value in members.items()]
    content = "\n".join(["<h1>Interfaces</h1>", f"<p>{WORDS}</p>", *parts])
    return {"title": f"Interfaces · {NAME}", "contents": "".join(contents), "content": content}


def _member(name: str, value: Any) -> str:  # noqa: ANN401 - whatever is public
    head = f'<h2 id="{name}"><code>{name}</code></h2>'
    if inspect.isclass(value):
        members: dict[str, Any] = {part: one for part, one in vars(value).items() if not part.startswith("_")}
        parts = [
            _describe(f"{part}{_signature(one)}" if inspect.isfunction(one) else part, one)
            for part, one in members.items()
            if inspect.isfunction(one) or type(one) in (property, cached_property)
        ]
        return "\n".join([head, text_of(inspect.getdoc(value) or ""), *parts])
    if inspect.isfunction(value):
        return f"{head}\n{_describe(f'{name}{_signature(value)}', value)}"
    return f"{head}\n<p><code>{html.escape(repr(value))}</code></p>"


def _describe(call: str, one: object) -> str:
    return f"<h3><code>{html.escape(call)}</code></h3>\n{text_of(inspect.getdoc(one) or '')}"


def _signature(function: Callable[..., object]) -> str:
    """The call without types: the text says what each argument is."""
    names: list[str] = []
    for name, entry in inspect.signature(function).parameters.items():
        if name == "self":
            continue
        if entry.kind is entry.KEYWORD_ONLY and "*" not in names:
            names.append("*")
        names.append(name if entry.default is entry.empty else f"{name}={entry.default!r}")
    return f"({', '.join(names)})"


def text_of(text: str) -> str:
    """A docstring: its paragraphs, and its fields as a list."""
    parts: list[str] = []
    for paragraph in text.split("\n\n"):
        entries = list(ENTRY.finditer(paragraph))
        before = paragraph[: entries[0].start()] if entries else paragraph
        if before.strip():
            parts.append(f"<p>{_words(before)}</p>")
        ends = [*(entry.start() for entry in entries[1:]), len(paragraph)]
        rows = [
            f"<dt><code>{html.escape(entry[1])}</code></dt><dd>{_words(paragraph[entry.end() : end])}</dd>"
            for entry, end in zip(entries, ends, strict=False)
        ]
        if rows:
            parts.append(f"<dl>{''.join(rows)}</dl>")
    return "\n".join(parts)


def _words(text: str) -> str:
    """Text of a docstring on one line, names in backticks as code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(" ".join(text.split())))
