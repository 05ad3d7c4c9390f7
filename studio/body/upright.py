"""A body as it stands upright, limb by limb, for a drawing."""

from dataclasses import dataclass

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.body.stretching import written_limbs


@dataclass(frozen=True, slots=True)
class LimbDrawing:
    """A drawn limb of the body as it stands upright. start, end: mm, x to the front, y to the left, z up. radii: at
    both. dimension: the name of its length, "" where it has none.
    """

    name: str
    side: str
    start: list[float]
    end: list[float]
    radii: tuple[float, float]
    dimension: str


def limb_drawings(body: BodyModel) -> list[LimbDrawing]:
    """The drawn limbs of a body as it stands upright."""
    written = written_limbs(body.definition) if body.definition else ()
    entries = {limb.name: entry for limb, entry in zip(body.limbs, written, strict=bool(written))}
    drawings: list[LimbDrawing] = []
    for limb, (start, end) in zip(body.drawn, limb_ends(body, body.neutral)[0], strict=True):
        length = entries[limb.name].length if limb.name in entries else ""
        drawings.append(
            LimbDrawing(
                limb.name,
                limb.side,
                start.tolist(),
                end.tolist(),
                (limb.radius_start, limb.radius_end),
                length.lstrip("-") if isinstance(length, str) else "",
            )
        )
    return drawings
