"""Limbs that are not where the network sees them: pictures vote."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
import pytest
from drawn_people import ring_of_cameras

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import marker_points
from studio.evidence.person_network import Crop, Detection
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.runs.setup import person_witness
from studio.runs.setup.person_landmarks import PAIRS
from studio.runs.setup.person_witness import LimbsByNetwork
from studio.search.trackers.reported_limbs import ReportedLimb

BODY = load_body("human35")
CAMERAS = tuple(ring_of_cameras(4))
NAMES = [marker.name for marker in BODY.markers]
SIDE = 400.0
"""Pixels: side of the crop around the person."""


def seen(camera: Camera, places: Array, exchanged: bool = False) -> Detection:
    """What a network that errs nowhere sees of a person with markers (M, 3)."""
    points, pixels = np.zeros((39, 2)), project(camera, places)[0]
    for joint, pair in PAIRS.items():
        for side, row in zip("RL" if exchanged else "LR", pair, strict=True):
            points[row] = pixels[NAMES.index(f"{side}{joint}")]
    # The two points that say where the next crop lies, and how large it is.
    points[33] = pixels.mean(axis=0)
    points[34] = points[33] - [0.0, SIDE / 2.5]
    return Detection(1.0, np.ones((4, 4), np.float32), points, Crop(*points[33].tolist(), SIDE))


def lost(
    monkeypatch: pytest.MonkeyPatch,
    pose: Array,
    shown: Mapping[str, Array],
    exchanged: Collection[str] = (),
) -> dict[str, ReportedLimb]:
    """Limbs of a pose (D,) that are lost where cameras show people with markers (M, 3)."""
    by_name = {camera.name: camera for camera in CAMERAS}
    found = {name: seen(by_name[name], places, name in exchanged) for name, places in shown.items()}

    def around(_network: object, _cameras: Sequence[Camera], _pictures: object, _joints: Array) -> object:
        return found

    monkeypatch.setattr(person_witness, "person_around", around)
    return LimbsByNetwork(BODY, CAMERAS).elsewhere(pose, {})


def standing(**degrees: float) -> Array:
    pose, names = BODY.neutral.copy(), [parameter.name for parameter in BODY.parameters]
    for name, value in degrees.items():
        pose[names.index(name)] = np.radians(value)
    return pose


def shown_by_all(places: Array) -> dict[str, Array]:
    return {camera.name: places for camera in CAMERAS}


RAISED = next(entry.name for entry in BODY.parameters if entry.limb == "left arm" and entry.kind == "angle")


def test_a_limb_is_missed_that_the_pictures_show_in_another_place(monkeypatch: pytest.MonkeyPatch) -> None:
    truth, wrong = standing(), standing(**{RAISED: 70.0})
    places = marker_points(BODY, truth[None])[0]
    assert lost(monkeypatch, truth, shown_by_all(places)) == {}
    named = lost(monkeypatch, wrong, shown_by_all(places))
    wrist = NAMES.index("LWrist")
    assert set(named) == {"left arm"}
    assert named["left arm"].is_lost
    assert list(named["left arm"].markers) == [NAMES.index("LElbow"), wrist]
    np.testing.assert_allclose(named["left arm"].places, places[list(named["left arm"].markers)], atol=1.0)


def test_pictures_that_see_it_where_it_is_count_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    truth, wrong = standing(), standing(**{RAISED: 70.0})
    places, moved = (marker_points(BODY, pose[None])[0] for pose in (truth, wrong))
    first, second, third, fourth = (camera.name for camera in CAMERAS)
    two_each = {first: places, second: places, third: moved, fourth: moved}
    assert lost(monkeypatch, wrong, two_each) == {}
    assert lost(monkeypatch, wrong, {**two_each, third: places}) != {}
    assert lost(monkeypatch, wrong, {first: places}) == {}


def test_pictures_that_show_the_trunk_elsewhere_say_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    truth, wrong = standing(), standing(**{RAISED: 70.0})
    places = marker_points(BODY, truth[None])[0]
    assert lost(monkeypatch, wrong, shown_by_all(places)) != {}
    assert lost(monkeypatch, wrong, shown_by_all(places + np.array([0.0, 0.0, 900.0]))) == {}


def test_sides_that_the_network_exchanges_lose_no_limb(monkeypatch: pytest.MonkeyPatch) -> None:
    truth = standing(**{RAISED: 70.0})
    places = marker_points(BODY, truth[None])[0]
    exchanged = [camera.name for camera in CAMERAS[1:3]]
    assert lost(monkeypatch, truth, shown_by_all(places), exchanged) == {}
    assert lost(monkeypatch, truth, shown_by_all(places), [camera.name for camera in CAMERAS]) == {}


def test_only_people_seen_from_two_sides_are_asked_for() -> None:
    assert LimbsByNetwork(BODY, CAMERAS).limbs == ("left arm", "right arm")
    for nobody in (LimbsByNetwork(BODY, CAMERAS[:1]), LimbsByNetwork(load_body("mouse31"), CAMERAS)):
        assert nobody.limbs == ()
