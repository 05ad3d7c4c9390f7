"""Limbs of a person that are not where the network sees them: a witness that knows no silhouettes.

An arm before the trunk is in no silhouette, and one that the masks lack denies no pose; the network sees it all the
same. In one picture it is often wrong: in a quarter of the frames of eleven clips a joint is 150 mm or more from where
its points meet. So all pictures are asked how much likelier a joint is where the largest set of them that agree see it
than where the pose has it: the sum of log(1 + (r / USUAL)²) of the points' distances r from it, which a picture that is
wrong lengthens little, and to which one that looks along the limb's error adds nothing. Which of both sides is the left
one, which the network exchanges at times, each picture says as the pose does.

A picture in which the network does not even see shoulders and hips where the pose has them counts for nothing: people
upside down are read badly.

It is asked of arms alone. Of eight clips of the choosing half, *wood* and *tiles*, 18 frames each, with all cameras and
with the first three, true poses refined, it names an arm in one of 360 sound frames and 51 of 72 arms that are folded
where the masks deny them least. Of legs it names 13 of 27, which silhouettes show, and one in nine of the 36 sound
frames of *hard*, where things stand before them: crossed or hidden legs it exchanges.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from studio.body.forward_kinematics import joint_frames, marker_points
from studio.body.model import BodyModel, limb_moving
from studio.body.scale import scale_of
from studio.evidence.person_network import Detection, PersonNetwork
from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.runs.setup.person_facing import person_around
from studio.runs.setup.person_landmarks import PAIRS, meeting_of, of_those_that_agree
from studio.runs.setup.person_masks import Detections
from studio.search.trackers.reported_limbs import ReportedLimb

LIMB_JOINTS = ("Elbow", "Wrist")
"""Joints that tell where a limb is, by the network and by our bodies' markers."""
TRUNK = ("Shoulder", "Hip")
"""Joints by which a picture shows that it is read right."""
OFF_MM, FAR_MM = 100.0, 150.0
"""mm at a person's size from which a joint is not where the network sees it, and from which its limb is named."""
AGREE, USUAL = 0.03, 0.01
"""Shares of a crop's side within which pictures agree on a point, and by which a point is usually off: on a crop around
a standing person 6 and 2 cm."""
READ = 0.05
"""Share of a crop's side by which TRUNK is off, on the mean, in a picture that counts."""
LEAST_ODDS, SURE_ODDS = 3.0, 6.0
"""Log odds from which a limb may be elsewhere, and from which it surely is."""
FEWEST = 2
"""Pictures from which a place is known."""


class LimbsByNetwork:
    """Asks the network where a person's limbs are (`search.trackers.reported_limbs.LimbSource`).

    limbs : of which it knows; none for bodies whose markers are no person's.
    """

    def __init__(self, body: BodyModel, cameras: Sequence[Camera]) -> None:
        names = [marker.name for marker in body.markers]
        usable = len(cameras) >= FEWEST and all(
            f"{side}{joint}" in names for joint in (*TRUNK, *LIMB_JOINTS) for side in "LR"
        )
        self._body, self._cameras = body, {one.name: one for one in cameras}
        self._scale, self._joints = scale_of(body), LIMB_JOINTS if usable else ()
        self._rows = [[names.index(f"{side}{joint}") for side in "LR"] for joint in self._joints]
        self._trunk = [names.index(f"{side}{joint}") for joint in TRUNK for side in "LR"] if usable else []
        self._owners = [
            [limb_moving(body, body.markers[row].joint) or "" for row in rows] for rows in self._rows
        ]
        self.limbs = tuple(dict.fromkeys(limb for owners in self._owners for limb in owners))

    @cached_property
    def _network(self) -> PersonNetwork:
        return PersonNetwork()

    def elsewhere(self, pose: Array, pictures: Mapping[str, Bytes]) -> dict[str, ReportedLimb]:
        """The limbs of a pose (D,) that are not where the network sees them, with all of their joints that it sees.
        pictures : (H, W, 3), BGR, by camera.
        """
        around = joint_frames(self._body, pose)[0, :, :, 3]
        seen = person_around(self._network, tuple(self._cameras.values()), pictures, around)
        own = marker_points(self._body, pose[None])[0]
        trunk = own[self._trunk]
        seen = {name: one for name, one in seen.items() if self._is_read_right(name, one, trunk)}
        if len(seen) < FEWEST:
            return {}
        joints = {limb: list[_Joint]() for limb in self.limbs}
        for joint, rows, owners in zip(self._joints, self._rows, self._owners, strict=True):
            for limb, one in zip(owners, self._seen_joints(own, rows, PAIRS[joint], seen), strict=True):
                joints[limb] += [] if one is None else [one]
        away = dict[str, ReportedLimb]()
        for limb, found in joints.items():
            odds = max((one.odds for one in found if one.off > self._scale * OFF_MM), default=0.0)
            if odds > LEAST_ODDS:
                markers, places = [one.marker for one in found], np.array([one.place for one in found])
                away[limb] = ReportedLimb(
                    markers,
                    places,
                    min(odds / SURE_ODDS, 1.0),
                    any(one.off > self._scale * FAR_MM and one.odds >= SURE_ODDS for one in found),
                )
        return away

    def _is_read_right(self, camera: str, one: Detection, trunk: Array) -> bool:
        """Whether a picture shows the ends of shoulders and hips (4, 3) where the pose has them."""
        away = 0.0
        for pixels, pair in zip(
            project(self._cameras[camera], trunk)[0].reshape(-1, 2, 2),
            (PAIRS[joint] for joint in TRUNK),
            strict=True,
        ):
            ways = [one.points[list(way)] - pixels for way in (pair, pair[::-1])]
            away += min(float(np.linalg.norm(way, axis=1).mean()) for way in ways) / len(TRUNK)
        return away < READ * one.next_crop.side

    def _seen_joints(
        self, own: Array, markers: Sequence[int], pair: tuple[int, int], seen: Detections
    ) -> list["_Joint | None"]:
        """A left and a right joint as the pictures show them; None where no two pictures agree. own : (M, 3) the body's
        markers. markers : the two joints' among them. pair : the network's points.
        """
        shown, missed = dict[str, Array](), dict[str, Array]()
        for name, one in seen.items():
            pixels = project(self._cameras[name], own[markers])[0]
            ways = [one.points[list(way)] for way in (pair, pair[::-1])]
            away = [np.linalg.norm(way - pixels, axis=1) / one.next_crop.side for way in ways]
            best = int(np.argmin([each.sum() for each in away]))
            shown[name], missed[name] = ways[best], away[best]
        found = list[_Joint | None]()
        for row, marker in enumerate(markers):
            rays = {name: points[row : row + 1] for name, points in shown.items()}
            place = meeting_of(self._cameras, rays)
            agreed = 0
            if place is not None:
                place, agreed = of_those_that_agree(self._cameras, rays, seen, place, AGREE)
            if place is None or not agreed:
                found.append(None)
                continue
            odds = 0.0
            for name, ray in rays.items():
                off = np.linalg.norm(project(self._cameras[name], place)[0] - ray) / seen[name].next_crop.side
                odds += float(np.log1p((missed[name][row] / USUAL) ** 2) - np.log1p((off / USUAL) ** 2))
            found.append(_Joint(marker, place[0], float(np.linalg.norm(place[0] - own[marker])), odds))
        return found


class _Joint(NamedTuple):
    """A joint as pictures show it. marker : the body's row. place : (3,) mm. off : mm, from where the pose has it.
    odds : log odds that it is at the place rather than there.
    """

    marker: int
    place: Array
    off: float
    odds: float
