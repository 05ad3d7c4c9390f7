"""Which markers of a body a stick figure joins, read from the body's tree.

The first marker on a joint hangs on the nearest marker (in the rest pose) of the nearest joint above that has
any; further ones on a joint hang on its first. So any body has a stick figure, and markers of other names are
left alone.
"""

from collections.abc import Sequence

import numpy as np

from studio.body.forward_kinematics import joint_frames, marker_points
from studio.body.model import BodyModel, Marker


def marker_links(body: BodyModel, names: Sequence[str]) -> list[tuple[int, int]]:
    """Pairs of indices into `names` to be joined; names that the body does not carry are left alone."""
    known = [marker for marker in body.markers if marker.name in names]
    if not known:
        return []
    place = {name: index for index, name in enumerate(names)}
    points = marker_points(body, body.neutral)[0]
    rest = {marker.name: point for marker, point in zip(body.markers, points, strict=True)}
    origins = joint_frames(body, body.neutral)[0, :, :, 3]
    carried: dict[int, list[Marker]] = {}
    for marker in known:
        carried.setdefault(marker.joint, []).append(marker)
    links: list[tuple[int, int]] = []
    for joint, markers in carried.items():
        first = markers[0]
        links += [(place[first.name], place[other.name]) for other in markers[1:]]
        above = body.joints[joint].parent
        while above >= 0 and above not in carried:
            above = body.joints[above].parent
        if above >= 0:
            distances = [float(np.linalg.norm(rest[other.name] - origins[joint])) for other in carried[above]]
            links.append((place[carried[above][int(np.argmin(distances))].name], place[first.name]))
    return links


def marker_sides(body: BodyModel) -> dict[str, str]:
    """Marker name to "left", "right" or "middle": the side of the nearest limb on its joint or above."""
    sides = {limb.joint: limb.side for limb in body.limbs}
    found: dict[str, str] = {}
    for marker in body.markers:
        joint = marker.joint
        while joint >= 0 and joint not in sides:
            joint = body.joints[joint].parent
        found[marker.name] = sides.get(joint, "middle")
    return found
