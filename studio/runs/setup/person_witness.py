"""Limbs of a person that are not where the network sees them: a witness that knows no silhouettes.

An arm before the trunk is in no silhouette, and one that the masks lack denies no pose; the network sees it all the
same. In one picture it is often wrong: in a quarter of the frames of eleven clips a joint is 150 mm or more from where
its points meet. So pictures vote. Those count against a limb that agree with one another on another place of one of its
joints, those for it that see the joint where the pose has it; which of both sides is the left one, which the network
exchanges at times, each picture says as the pose does. A limb is missed where at least MORE pictures more are against
it than for it.

A picture in which the network does not even see shoulders and hips where the pose has them counts for nothing: people
upside down are read badly.

Planted losses of eight clips, three frames each (`studio reproduce planted-losses`): of 264 a check names 235 (89 %)
without the network and 252 (95 %) with it. Of 280 sound frames of fourteen clips the network's limbs are in three
(two of them in clips by which the numbers below were chosen); with all that pictures say counted, no votes, they were
in a quarter of 134.
"""

from collections.abc import Mapping, Sequence

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
from studio.search.trackers.limbs_elsewhere import Elsewhere, is_shown

LIMB_JOINTS = ("Elbow", "Wrist", "Knee", "Ankle")
"""Joints that tell where a limb is, by the network and by our bodies' markers; all but those at the trunk."""
TRUNK = ("Shoulder", "Hip")
"""Joints by which a picture shows that it is read right."""
FAR_MM = 150.0
"""mm at a person's size from which a joint is not where the network sees it."""
AGREE, NEAR = 0.03, 0.06
"""Shares of a crop's side within which pictures agree on a point, and within which one sees a joint where the pose has
it: on a crop around a standing person 6 and 12 cm."""
READ = 0.05
"""Share of a crop's side by which TRUNK is off, on the mean, in a picture that counts."""
MORE = 2
"""Pictures that are more against a limb than for it."""


class LimbsByNetwork:
    """Asks the network where a person's limbs are; usable for bodies whose markers are a person's."""

    def __init__(self, body: BodyModel, cameras: Sequence[Camera]) -> None:
        names = [marker.name for marker in body.markers]
        self.usable = len(cameras) >= MORE and all(
            f"{side}{joint}" in names for joint in (*TRUNK, *LIMB_JOINTS) for side in "LR"
        )
        if not self.usable:
            return
        self._body, self._cameras, self._far = (
            body,
            {one.name: one for one in cameras},
            FAR_MM * scale_of(body),
        )
        self._rows = [[names.index(f"{side}{joint}") for side in "LR"] for joint in LIMB_JOINTS]
        self._trunk = [names.index(f"{side}{joint}") for joint in TRUNK for side in "LR"]
        self._limbs = [
            [limb_moving(body, body.markers[row].joint) or "" for row in rows] for rows in self._rows
        ]
        self._network = PersonNetwork()

    def lost(self, pose: Array, pictures: Mapping[str, Bytes]) -> dict[str, float]:
        """By limb of a pose (D,) that is not where the network sees it how far one of its joints is from there, mm at
        most. pictures : (H, W, 3), BGR, by camera.
        """
        around = joint_frames(self._body, pose)[0, :, :, 3]
        seen = person_around(self._network, tuple(self._cameras.values()), pictures, around)
        places = marker_points(self._body, pose[None])[0]
        trunk = places[self._trunk]
        seen = {name: one for name, one in seen.items() if self._is_read_right(name, one, trunk)}
        found = dict[str, float]()
        if len(seen) < MORE:
            return found
        for joint, rows, limbs in zip(LIMB_JOINTS, self._rows, self._limbs, strict=True):
            for limb, off in zip(limbs, self._off(places[rows], PAIRS[joint], seen), strict=True):
                if off > self._far:
                    found[limb] = max(found.get(limb, 0.0), off)
        return found

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

    def _off(self, own: Array, pair: tuple[int, int], seen: Detections) -> list[float]:
        """How far a left and a right joint (2, 3) are from where more pictures see them, mm; 0 where as many see them
        where they are. pair : the network's points.
        """
        shown, near = dict[str, Array](), dict[str, Array]()
        for name, one in seen.items():
            pixels, side = project(self._cameras[name], own)[0], one.next_crop.side
            ways = [one.points[list(way)] for way in (pair, pair[::-1])]
            away = [np.linalg.norm(way - pixels, axis=1) / side for way in ways]
            best = int(np.argmin([each.sum() for each in away]))
            shown[name], near[name] = ways[best], away[best] < NEAR
        found: list[float] = []
        for row, place in enumerate(own):
            rays = {name: points[row : row + 1] for name, points in shown.items()}
            point = meeting_of(self._cameras, rays)
            if point is None:
                found.append(0.0)
                continue
            point, against = of_those_that_agree(self._cameras, rays, seen, point, AGREE)
            kept = against - sum(bool(one[row]) for one in near.values()) < MORE
            found.append(0.0 if kept else float(np.linalg.norm(point[0] - place)))
        return found


def missed(lost: Mapping[str, float], pictures: Mapping[str, Elsewhere]) -> set[str]:
    """Of limbs that the network sees elsewhere (`LimbsByNetwork.lost`) those that do not show by themselves where the
    pose has them: a leg that is kicked high explains what changed there, whatever the network makes of it.
    """
    return {limb for limb in lost if limb not in pictures or not is_shown(pictures[limb])}
