"""Which markers of a body a stick figure joins, read from the body's tree.

A marker hangs on the first marker of its own joint, or of the nearest joint above that has one; so any body
has a stick figure, and markers of other names are left alone.
"""

from collections.abc import Sequence

from studio.body.model import BodyModel


def marker_links(body: BodyModel, names: Sequence[str]) -> list[tuple[int, int]]:
    """Pairs of indices into `names` to be joined; names that the body does not carry are left alone."""
    place = {name: index for index, name in enumerate(names)}
    first: dict[int, str] = {}
    for marker in body.markers:
        if marker.name in place:
            first.setdefault(marker.joint, marker.name)
    links: list[tuple[int, int]] = []
    for marker in body.markers:
        if marker.name not in place:
            continue
        joint = marker.joint if first[marker.joint] != marker.name else body.joints[marker.joint].parent
        while joint >= 0 and joint not in first:
            joint = body.joints[joint].parent
        if joint >= 0:
            links.append((place[first[joint]], place[marker.name]))
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
