"""What the API takes and gives of a search's pace."""

from pydantic import Field

from studio.web.schemas import Answer, Request
from studio.worker.search_pace import MOST_SECONDS


class PaceRequest(Request):
    """How long each tracked layer takes at least; 0: as fast as it can."""

    seconds_a_layer: float = Field(ge=0.0, le=MOST_SECONDS, allow_inf_nan=False)


class SpeedView(Answer):
    """A speed of the search in words, and the seconds that a layer takes at least."""

    label: str
    seconds_a_layer: float


class PaceView(Answer):
    """The pace that the search has, and what is offered: fast to slow, the present one among them."""

    seconds_a_layer: float
    choices: list[SpeedView]
