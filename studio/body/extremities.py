"""Where a body ends: hands, feet, head, tips of arms."""

from studio.body.model import BodyModel


def extremities(body: BodyModel) -> tuple[int, ...]:
    """Indices of the drawn limbs on which no other drawn limb's joint hangs."""
    carried: set[int] = set()
    for limb in body.drawn:
        above = body.joints[limb.joint].parent
        while above >= 0:
            carried.add(above)
            above = body.joints[above].parent
    return tuple(index for index, limb in enumerate(body.drawn) if limb.joint not in carried)
