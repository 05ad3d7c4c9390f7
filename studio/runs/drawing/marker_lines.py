"""The lines of a body's stick figure: which markers to join, from the body's tree.

The first marker on a joint hangs on the nearest marker (in the rest pose) of the nearest joint above that has any;
or on an earlier one that hangs there as well, where that is less than half as far (a shoulder on the neck, though its
joint hangs on the torso's). Further markers on a joint hang on its first. So any body has a stick figure; markers
of other names are ignored.
"""

from collections.abc import Sequence

import numpy as np

from studio.body.forward_kinematics import joint_frames, marker_points
from studio.body.model import BodyModel, Marker, extremities, joints_above, joints_upwards

_MUCH_NEARER = 0.5


def marker_links(body: BodyModel, names: Sequence[str]) -> list[tuple[int, int]]:
    """Pairs of indices into `names` to join; names that the body lacks are ignored."""
    carried: dict[int, list[Marker]] = {}
    for marker in body.markers:
        if marker.name in names:
            carried.setdefault(marker.joint, []).append(marker)
    if not carried:
        return []
    points = marker_points(body, body.neutral)[0]
    rest = {marker.name: point for marker, point in zip(body.markers, points, strict=True)}
    origins = joint_frames(body, body.neutral)[0, :, :, 3]
    pairs: list[tuple[str, str]] = []
    hanging: dict[int, list[str]] = {}
    for joint, markers in carried.items():
        first = markers[0].name
        pairs += [(first, other.name) for other in markers[1:]]
        above = next((at for at in joints_above(body, joint) if at in carried), None)
        if above is None:
            continue
        far = {name: float(np.linalg.norm(point - origins[joint])) for name, point in rest.items()}
        nearest = min((marker.name for marker in carried[above]), key=far.__getitem__)
        beside = min(hanging.get(above, []), key=far.__getitem__, default=nearest)
        pairs.append((beside if far[beside] < _MUCH_NEARER * far[nearest] else nearest, first))
        hanging.setdefault(above, []).append(first)
    place = {name: index for index, name in enumerate(names)}
    return [(place[one], place[other]) for one, other in pairs]


def marker_sides(body: BodyModel) -> dict[str, str]:
    """Marker name to "left", "right" or "middle": the side of the nearest limb on its joint or above."""
    sides = {limb.joint: limb.side for limb in body.limbs}
    return {
        marker.name: next((sides[at] for at in joints_upwards(body, marker.joint) if at in sides), "middle")
        for marker in body.markers
    }


def extremity_markers(body: BodyModel) -> tuple[str, ...]:
    """The outermost marker towards each extremity: wrists, ankles, head, tips (hands and feet may carry none)."""
    last = {marker.joint: marker.name for marker in body.markers}
    ends = (body.drawn[index].joint for index in extremities(body))
    nearest = (next((last[at] for at in joints_upwards(body, end) if at in last), None) for end in ends)
    return tuple(dict.fromkeys(name for name in nearest if name is not None))
