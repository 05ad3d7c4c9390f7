"""Names that other programs know: which point of the body each is, and what its joints are called there.

The maps are data (`name_maps/*.toml`). A body that lacks a point is exported without it, and that is reported.
"""

import itertools
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

import msgspec
import numpy as np

from studio.body.forward_kinematics import joint_frames
from studio.body.model import BodyModel, joints_above
from studio.foundations.arrays import Array, Indices
from studio.foundations.errors import ExportError
from studio.foundations.foreign_files import read_file
from studio.foundations.typed_decoding import decode_toml
from studio.foundations.words import enumerated
from studio.results.export.options import OWN


class PlaceEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where a point is: at a marker, or a share of the way along a drawn limb's axis."""

    marker: str = ""
    limb: str = ""
    at: float = 0.0


class NameMap(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """points : by the program's name, the places in order of preference. joints : its names of the body's joints."""

    title: str
    source: str
    points: dict[str, tuple[PlaceEntry, ...]]
    joints: dict[str, str]


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """M points fixed to joints. joints (M,), offsets (M, 3) mm in the joints' frames. note : what is missing."""

    names: tuple[str, ...]
    joints: Indices
    offsets: Array
    note: str = ""

    def positions(self, body: BodyModel, poses: Array) -> Array:
        """(N, M, 3) mm in the world."""
        frames = joint_frames(body, poses)[:, self.joints]
        return (frames[..., :3] @ self.offsets[..., None])[..., 0] + frames[..., 3]

    def edges(self, body: BodyModel) -> tuple[tuple[int, int], ...]:
        """Pairs of points to be joined by lines, one tree: each point with the one before it on its joint, the first of
        a joint with the point of the nearest joint above (where no joint above has one: of any before) that lies
        closest to where the joint begins, at the neutral pose.
        """
        places = self.positions(body, body.neutral[None])[0]
        origins = joint_frames(body, body.neutral[None])[0][:, :, 3]
        outwards = np.argsort(np.linalg.norm(self.offsets, axis=1), kind="stable")
        carried: dict[int, list[int]] = {}
        for point in map(int, outwards):
            carried.setdefault(int(self.joints[point]), []).append(point)
        lines: list[tuple[int, int]] = []
        before: list[int] = []
        for joint, points in sorted(carried.items()):
            lines += itertools.pairwise(points)
            if ends := next((carried[at] for at in joints_above(body, joint) if at in carried), before):
                far = [float(np.linalg.norm(places[point] - origins[joint])) for point in ends]
                lines.append((ends[int(np.argmin(far))], points[0]))
            before = before + points
        return tuple(lines)


@cache
def name_map(name: str) -> NameMap:
    """A map by its name. Raises ExportError for an unknown one."""
    file = Path(str(files("studio.results.export") / "name_maps" / f"{name}.toml"))
    if not name.isalnum() or not file.is_file():
        raise ExportError(
            f"There is no map of names '{name[:40]}'.", "Choose own, halpe26, mixamo or opensim."
        )
    return decode_toml(read_file(file), NameMap)


def points_of(body: BodyModel, names: str) -> Points:
    """The points of a body under the names of a map ("own": its markers). Raises ExportError if it has none."""
    if names == OWN:
        points = {
            marker.name: (marker.joint, np.asarray(marker.offset, dtype=float)) for marker in body.markers
        }
        missing: list[str] = []
    else:
        places = name_map(names).points
        points = {name: place for name, entries in places.items() if (place := _place(body, entries))}
        missing = [name for name in places if name not in points]
    if not points:
        raise ExportError(
            f"Body '{body.name}' has none of the points of '{names}'.", "Export with the body's own names."
        )
    note = ""
    if missing:
        title = name_map(names).title
        note = f"Body '{body.name}' has no {enumerated(missing)}: these points of {title} are left out."
    joints = np.array([joint for joint, _ in points.values()], dtype=np.int64)
    return Points(tuple(points), joints, np.array([offset for _, offset in points.values()]), note)


def joint_names(own: tuple[str, ...], names: str) -> tuple[tuple[str, ...], str]:
    """What joints are called under a map, those that it does not name by their own; and a sentence on that."""
    if names == OWN:
        return own, ""
    known = name_map(names).joints
    renames, kept = list[str](), list[str]()
    for name in own:
        renamed = known.get(name, name)
        if name not in known or renamed in renames:
            kept.append(name)
            renamed = name
        renames.append(renamed)
    note = (
        f"{name_map(names).title} has no name for {enumerated(kept)}: these joints keep their own names."
        if kept
        else ""
    )
    return tuple(renames), note


def _place(body: BodyModel, entries: tuple[PlaceEntry, ...]) -> tuple[int, Array] | None:
    """The joint and offset of the first place that the body has."""
    markers = {marker.name: marker for marker in body.markers}
    limbs = {limb.name: limb for limb in body.drawn}
    for entry in entries:
        if entry.marker in markers:
            marker = markers[entry.marker]
            return marker.joint, np.asarray(marker.offset, dtype=float)
        if entry.limb in limbs:
            limb = limbs[entry.limb]
            far = limbs.get(f"{entry.limb} end")
            if far is not None and far.slide >= 0 and entry.at > 0.0:
                # Along a limb of changing length only its end is always on the far part.
                limb = far
            return limb.joint, np.array([0.0, 0.0, entry.at * limb.length])
    return None
