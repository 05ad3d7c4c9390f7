"""Numbers of frames, layers and particles that no footage has: every address that takes one refuses it in words."""

import re
from collections.abc import Iterator
from typing import Any

from web_doubles import Studio

from studio.app.server.api_document import api_document
from studio.sessions.stored_run import StoredRun

DOCUMENT = api_document()
SCHEMAS = DOCUMENT["components"]["schemas"]
COUNTING = re.compile(r"frames?|first|last|back_to|layer|particle")
FILLED = {"session": "take1", "run": "first", "camera": "cam1", "view": "variance", "track": "raw"}
POSE = [0.0] * 35
STROKE = {"frame": 0, "kind": "inside", "width": 3.0, "points": [[9.0, 9.0]]}
ENTRIES: dict[str, Any] = {
    "session": "take1",
    "pose": POSE,
    "trackers": [{"name": "annealed"}],
    "vary": {"survival": [0.4]},
    "strokes": [STROKE],
    "run": "first",
    "frame": 0,
}
"""What a body needs besides."""


def of_body(operation: dict) -> dict[str, Any]:
    """The properties of a request's body."""
    for content in operation.get("requestBody", {}).get("content", {}).values():
        schema = content["schema"]
        return SCHEMAS.get(schema.get("$ref", "").rpartition("/")[2], schema)
    return {}


def is_whole(schema: dict) -> bool:
    """Whether a number is wanted, or several."""
    parts = [schema, *schema.get("anyOf", ()), schema.get("items", {})]
    return any(part.get("type") == "integer" for part in parts)


def numbers() -> Iterator[tuple[str, str, str, str]]:
    """Method, path, place and name of each that counts frames, layers or particles."""
    for path, operations in DOCUMENT["paths"].items():
        for method, operation in operations.items():
            for entry in operation.get("parameters", ()):
                if COUNTING.fullmatch(entry["name"]) and is_whole(entry["schema"]):
                    yield method, path, entry["in"], entry["name"]
            for name, schema in of_body(operation).get("properties", {}).items():
                if COUNTING.fullmatch(name) and is_whole(schema):
                    yield method, path, "body", name


def test_numbers_that_no_footage_has_are_refused(studio: Studio, tracked: StoredRun) -> None:
    asked = [(*where, number) for where in numbers() for number in (2**63 - 1, 2**63, 2**64)]
    assert len(asked) > 100
    for method, path, place, name, number in asked:
        body = of_body(DOCUMENT["paths"][path][method])
        content = {entry: ENTRIES[entry] for entry in body.get("required", ()) if entry in ENTRIES}
        if place == "body":
            content[name] = [number] if body["properties"][name].get("type") == "array" else number
        filled = FILLED | ({name: str(number)} if place == "path" else {})
        address = re.sub(r"{(\w+)}", lambda found, filled=filled: filled.get(found[1], "0"), path)
        answer = studio.client.request(
            method, address, params={name: number} if place == "query" else {}, json=content if body else None
        )
        # The largest that is stored is left to what knows the footage, or to the job that begins.
        highest, said = 400 if number > 2**63 - 1 else 200, f"{method} {path} {name}={number}: {answer.text}"
        assert highest <= answer.status_code < 500, said
        assert answer.is_success or answer.json()["message"].endswith("."), said
