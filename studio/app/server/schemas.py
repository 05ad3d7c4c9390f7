"""What the API takes and gives, as OpenAPI shows it. Lengths in mm, angles in radians, NaN as null."""

import math
from typing import Annotated, Any, Self, cast

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from studio.foundations.typed_decoding import is_list

NAME = r"^[A-Za-z0-9_-]{1,64}$"


def finite(value: object) -> object:
    """NaN and infinities as None; numpy's numbers as Python's."""
    number: object = cast("np.generic[Any]", value).item() if isinstance(value, np.generic) else value
    return None if isinstance(number, float) and not math.isfinite(number) else number


def _finite_list(values: object) -> object:
    plain = values.tolist() if isinstance(values, np.ndarray) else values
    plain = list(cast("tuple[object, ...]", plain)) if isinstance(plain, tuple) else plain
    return [finite(value) for value in plain] if is_list(plain) else plain


Number = Annotated[float | None, BeforeValidator(finite)]
Numbers = Annotated[list[float | None], BeforeValidator(_finite_list)]
RunName = Annotated[str, Field(pattern=NAME)]


class Answer(BaseModel):
    """An answer made from the studio's own values by their attributes."""

    model_config = ConfigDict(from_attributes=True)

    @classmethod
    def of(cls, value: object, **own: object) -> Self:
        """Made of a value's attributes by the names of the entries. own : entries that differ, or that it lacks."""
        names = [name for name in cls.model_fields if name not in own and hasattr(value, name)]
        return cls.model_validate({**{name: getattr(value, name) for name in names}, **own})


class Request(BaseModel):
    """What a client sends; unknown entries are refused."""

    model_config = ConfigDict(extra="forbid")


class ErrorAnswer(BaseModel):
    """Every answer that is no success."""

    code: str
    message: str = Field(description="What is wrong, in one sentence.")
    hint: str = Field(description="What to do, in one sentence.")
    status: int
