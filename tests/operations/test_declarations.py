"""Every verb is declared once: Python, command line and HTTP take the same entries with the same defaults and help."""

import inspect
from typing import Any

import click
import pytest
from fastapi import FastAPI

import studio
from studio import arena
from studio.app.server import app, guide_routes
from studio.app.server.requests import MADE
from studio.cli.main import load
from studio.foundations.declaring import REQUIRED, Knobs, Operation, Parameter, declared
from studio.operations.opening import _is_target

NAMED = {
    "import_footage": "import",
    "export_run": "export",
    "new_session": "new",
    "mask_quality": "background",
    "problems": "list",
}
OF_ANOTHER = {
    "unalign": "align",
    "mask_quality": "background",
    "new_run": "track",
    "go_on": "track",
    "resume_live": "live",
    "replay": "live",
    "problems_of": "export",
}
"""Verbs that are options of another one's command: --undo, --quality, --resume, --replay; or that it does first."""
OWN_WORDS = {
    "track": {"first", "last"},
    "batch": {"first", "last"},
    "background": {"source", "plates", "exclude", "exclude_unused", "in_front"},
    "compare": {"trackers", "first", "last", "changes"},
    "sweep": {"vary", "first", "last"},
    "view": {"layer"},
}
"""Parameters that the terminal writes in another way: --frames A:B, --exclude CAMERA=…, layers counted from 1."""
FUNCTIONS = {
    name: getattr(public, name)
    for public in (studio, arena)
    for name in dir(public)
    if hasattr(getattr(public, name), "__operation__")
}
VERBS = {name: declared(function) for name, function in FUNCTIONS.items()}


LEFT_WHERE_IT_IS = {
    "notes": "reads a record",
    "note": "writes a record, in its turn",
    **dict.fromkeys(("track", "branch", "correct"), "of verbs that keep theirs in place"),
}
"""Verbs on a session or a run during which that may be renamed or deleted, and why."""


def test_a_session_stays_where_it_is_while_a_verb_works_on_it() -> None:
    about = {
        name
        for name, one in VERBS.items()
        if any(map(_is_target, inspect.signature(one.function).parameters.values()))
    }
    keeping = {name for name in about if getattr(FUNCTIONS[name], "keeps_in_place", False)}
    assert about - keeping == set(LEFT_WHERE_IT_IS)


def command_of(verb: str) -> click.Command:
    name = NAMED.get(verb, verb.replace("_", "-"))
    if verb not in dir(arena):
        return load(name)
    group = load("arena")
    assert isinstance(group, click.Group)
    return group.commands[name]


@pytest.fixture(scope="module")
def schemas() -> dict[str, Any]:
    return FastAPI(routes=app.ROUTES).openapi()["components"]["schemas"]


@pytest.mark.parametrize("verb", VERBS)
def test_every_entry_has_a_help_and_every_verb_says_what_it_does(verb: str) -> None:
    assert VERBS[verb].about
    for entry in VERBS[verb].parameters.values():
        assert entry.target or entry.any_name or entry.help, f"{verb}: {entry.name}"


@pytest.mark.parametrize("verb", [name for name in VERBS if name not in OF_ANOTHER])
def test_the_command_line_takes_what_python_takes(verb: str) -> None:
    command = command_of(verb)
    assert inspect.cleandoc(command.help or "").startswith(VERBS[verb].about[:60])
    options = {str(option.name): option for option in command.params}
    for entry in VERBS[verb].parameters.values():
        if entry.terminal.left_out or entry.name in OWN_WORDS.get(verb, ()):
            continue
        if entry.target:
            assert set(options) >= {"session", "run"} if entry.target == "run" else {"session"}
        elif knobs := entry.mark(Knobs):
            assert {one.name for one in knobs.listed()} <= set(options)
            assert ("changes" in options) == knobs.others
        else:
            agrees(entry, options[entry.name])


def agrees(entry: Parameter, option: click.Parameter) -> None:
    """The option of a parameter says and means what was declared."""
    if not isinstance(option, click.Option):
        assert entry.default is REQUIRED
        return
    assert (option.help or "").startswith(entry.help.removesuffix("."))
    assert not option.required or entry.default is REQUIRED
    if entry.default not in (None, "", (), REQUIRED):
        assert option.default == entry.default


@pytest.mark.parametrize("body", MADE)
def test_a_body_takes_what_python_takes(body: str, schemas: dict[str, Any]) -> None:
    verb, _, entries = MADE[body]
    schema = schemas[body]
    assert schema["additionalProperties"] is False
    for key, name in entries.items():
        entry, said = VERBS[verb].parameters[name], schema["properties"][key]
        assert said["description"] == entry.help
        assert key == (entry.web.name or name)
        if entry.default is REQUIRED:
            assert key in schema["required"]
        elif entry.default not in (None, "", ()) and "anyOf" not in said:
            assert said["default"] == entry.default


def test_no_body_names_a_file_of_this_machine(schemas: dict[str, Any]) -> None:
    """Text that is no name: what a person reads, boards, and footage under the roots, which routes check."""
    free = {
        ("calibrate", "board"),
        ("new_session", "title"),
        ("edit_body", "title"),
        ("edit_body", "text"),
        ("note", "text"),
        ("new_run", "start_source"),
        *((verb, name) for verb in ("import_footage", "add_footage") for name in ("calibration", "trial")),
    }
    for body, (verb, _, entries) in MADE.items():
        for key, name in entries.items():
            said = schemas[body]["properties"][key]
            for kind in said.get("anyOf", [said]):
                if kind.get("type") == "string":
                    assert "pattern" in kind or "enum" in kind or (verb, name) in free, f"{verb}: {name}"


def test_what_is_wrong_is_said_with_the_verb_the_entry_and_its_help() -> None:
    wrong: list[tuple[Any, dict[str, Any], str]] = [
        (studio.track, {"session": "walk", "seed": -1}, "track: 'seed' cannot be -1"),
        (studio.check, {"run": "walk/one", "every": 0}, "check: 'every' cannot be 0"),
        (studio.background, {"session": "walk", "source": "none"}, "background: 'source' cannot be 'none'"),
    ]
    for verb, given, words in wrong:
        with pytest.raises(studio.StudioError, match=words) as refusal:
            verb(**given)
        assert refusal.value.hint
    with pytest.raises(TypeError, match="sed"):
        studio.track("walk", sed=3)  # pyright: ignore[reportCallIssue]


def test_the_signature_that_an_editor_shows_is_the_declaration() -> None:
    shown = inspect.signature(studio.track).parameters
    assert list(shown) == [*Operation(studio.new_run).parameters, "progress"]
    assert list(VERBS["track"].parameters) == list(VERBS["new_run"].parameters)


def test_the_guide_lists_every_verb_with_its_entries() -> None:
    page = guide_routes.verbs_page()["content"]
    for name, verb in VERBS.items():
        place = f"arena.{name}" if name in dir(arena) else name
        assert f'id="{place}"' in page
        for entry in verb.parameters:
            assert f"<code>{entry}</code>" in page, f"{name}: {entry}"
