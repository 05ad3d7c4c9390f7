"""Schemas of answers are those of the records that routes return."""

import asyncio
import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import msgspec
import numpy as np
import pytest
from fastapi import FastAPI
from httpx import ASGITransport, AsyncClient
from pydantic import BaseModel, Field, FiniteFloat

from studio.app.server.answers import Router, Shown, shown_as
from studio.foundations.arrays import Array
from studio.foundations.declaring import Web
from studio.foundations.knobs import Value


class Place(NamedTuple):
    """A place. x : mm."""

    x: float
    kept: bool = False
    certain: FiniteFloat = 1.0


class Kept(msgspec.Struct, frozen=True):
    """What is stored."""

    name: str
    kind: type
    sizes: tuple[int, ...] = ()
    value: Value = 2.0
    file: Annotated[Path, Web(left_out=True)] = Path()


@dataclasses.dataclass(frozen=True, slots=True)
class Track:
    """A track."""

    place: Place
    kept: Kept | None
    poses: Array
    by_name: dict[str, Place]
    pair: tuple[str, float]
    words: Annotated[str, Field(description="In words.")] = ""
    more: list[Place] = dataclasses.field(default_factory=list)

    @property
    def whole(self) -> Annotated[bool, Field()]:
        """Whether nothing lacks."""
        return bool(np.isfinite(self.poses).all())

    @property
    def inner(self) -> int:
        raise AssertionError("a property without a Field is no entry")


TRACK = Track(
    Place(math.nan), Kept("a", float, (1, 2)), np.array([1.0, math.inf]), {"b": Place(2.0)}, ("c", 3.0)
)


@pytest.fixture
def answers() -> Callable[[str], Any]:
    router, app = Router(), FastAPI()

    @router.get("/track")
    def track() -> Track:
        return TRACK

    @router.get("/many")
    def many() -> tuple[Track, ...]:
        return (TRACK, TRACK)

    app.include_router(router)

    async def get(path: str) -> object:
        async with AsyncClient(transport=ASGITransport(app), base_url="http://studio") as client:
            return (await client.get(path)).json()

    return lambda path: asyncio.run(get(path))


def test_a_record_is_answered_whole_with_null_for_what_is_not_finite(answers: Callable[[str], Any]) -> None:
    answered = answers("/track")
    assert answered == {
        "place": {"x": None, "kept": False, "certain": 1.0},
        "kept": {"name": "a", "sizes": [1, 2], "kind": "float", "value": 2.0},
        "poses": [1.0, None],
        "by_name": {"b": {"x": 2.0, "kept": False, "certain": 1.0}},
        "pair": ["c", 3.0],
        "words": "",
        "more": [],
        "whole": False,
    }
    assert answers("/many") == [answered, answered]


def test_the_schema_says_what_the_record_says(answers: Callable[[str], Any]) -> None:
    schemas = answers("/openapi.json")["components"]["schemas"]
    assert schemas["Place"]["description"] == "A place. x : mm."
    assert {"type": "null"} in schemas["Place"]["properties"]["x"]["anyOf"]
    assert schemas["Place"]["properties"]["certain"]["type"] == "number"
    assert {"type": "null"} not in schemas["Kept"]["properties"]["value"]["anyOf"]
    assert schemas["Track"]["properties"]["words"]["description"] == "In words."
    assert schemas["Track"]["properties"]["whole"]["description"] == "Whether nothing lacks."


def test_a_model_holds_records_as_answers_show_them() -> None:
    class State(BaseModel):
        places: Annotated[tuple[Place, ...], Shown] = ()

    state = State.model_validate({"places": [Place(math.nan), Place(2.0)]})
    assert state.model_dump(mode="json") == {
        "places": [{"x": None, "kept": False, "certain": 1.0}, {"x": 2.0, "kept": False, "certain": 1.0}]
    }
    again = State.model_validate({**dict(state)})
    assert again == state


def test_other_types_stay_as_they_are() -> None:
    assert shown_as(str) is str
    assert shown_as(Path) is Path
    assert shown_as(None) is None
