"""Which window of the page a request comes from: each has a name of its own, and a scene under that name."""

from typing import Annotated

from fastapi import Header, Path, Query

_NAME = r"^[A-Za-z0-9_-]{0,64}$"
_MEANING = (
    "The window whose scene is meant: every window sends its own name. Without it: the scene that all windows"
    " without a name share."
)

Window = Annotated[str, Header(alias="X-Studio-Window", pattern=_NAME, description=_MEANING)]
WindowInPath = Annotated[str, Path(pattern=_NAME, description=_MEANING)]
WindowInQuery = Annotated[str, Query(pattern=_NAME, description=_MEANING)]
