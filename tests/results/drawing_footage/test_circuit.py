"""The circuit with a halt: the same motion at any frame rate, still in the halt, feet that do not slide."""

import numpy as np
import pytest

from studio.body.person import PersonMotion, Skeleton, joint_points, marker_motion
from studio.foundations.errors import StudioError
from studio.results.drawing_footage.circuit import Halt as CircuitHalt
from studio.results.drawing_footage.circuit import circuit, path_length
from studio.results.drawing_footage.person import skeleton_of_height

FRAMES = 450
OPTIONS = {
    "start_x_mm": 135.0,
    "start_y_mm": 940.0,
    "start_heading_degrees": 55.0,
    "radius_mm": 650.0,
    "turn": -1.0,
    "speed_mm_s": 850.0,
    "cadence": 1.9,
    "still_from_s": 330 / 60,
    "still_until_s": 430 / 60,
}
UNEVEN = Skeleton(
    height=1737.0,
    trunk=579.0,
    head=268.0,
    hip_half_width=(99.0, 113.0),
    thigh=(425.0, 394.0),
    shin=(449.0, 465.0),
    shoulder=((-40.0, 227.0, -70.0), (-40.0, 157.0, -70.0)),
    upper_arm=(206.0, 243.0),
    forearm=(220.0, 248.0),
    hand=188.0,
    foot=292.0,
    ankle_height=24.0,
)


@pytest.fixture(scope="module", params=["even", "uneven"])
def bones(request: pytest.FixtureRequest) -> Skeleton:
    return UNEVEN if request.param == "uneven" else skeleton_of_height(1760.0, np.random.default_rng(2))


@pytest.fixture(scope="module")
def made(bones: Skeleton) -> PersonMotion:
    return circuit(bones, np.arange(FRAMES) / 60.0, OPTIONS)


def soles(motion: PersonMotion, side: str) -> tuple[np.ndarray, np.ndarray]:
    """(F, 3) ball and heel of a foot on its sole."""
    foot, bones = joint_points(motion)[f"{side}_foot"], motion.skeleton
    ends = [np.array([share * bones.foot, 0.0, -bones.ankle_height]) for share in (0.66, -0.20)]
    ball, heel = (foot + motion.turns[f"{side}_foot"] @ end for end in ends)
    return ball, heel


def test_it_starts_as_in_the_options_and_turns_to_the_right(made: PersonMotion) -> None:
    np.testing.assert_allclose(made.root[0, :2], (135.0, 940.0), atol=25.0)
    ahead = made.turns["pelvis"][:, :2, 0]
    heading = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
    assert np.degrees(heading[0]) == pytest.approx(55.0, abs=8.0)
    assert heading[320] - heading[0] < -2.0 * np.pi
    centre = np.array([135.0, 940.0]) + 650.0 * np.array([np.sin(np.radians(55)), -np.cos(np.radians(55))])
    away = np.linalg.norm(made.root[:, :2] - centre, axis=1)
    np.testing.assert_allclose(away, 650.0, atol=30.0)


def test_every_third_frame_is_that_of_20_hz(bones: Skeleton, made: PersonMotion) -> None:
    slow = circuit(bones, np.arange(FRAMES // 3) / 20.0, OPTIONS)
    assert slow.fps == pytest.approx(20.0)
    np.testing.assert_allclose(
        marker_motion(slow).positions, marker_motion(made).positions[::3], atol=1e-6, rtol=0.0
    )


def test_only_breath_moves_in_the_halt_and_it_walks_before_and_after(made: PersonMotion) -> None:
    speed = np.linalg.norm(np.diff(marker_motion(made).positions, axis=0), axis=2) * 60.0
    assert speed[330:429].max() < 12.0
    assert speed[335:425, 1].max() > 0.3
    hips = speed[:, 0]
    assert hips[:270].min() > 600.0
    assert hips[445:].min() > 150.0
    assert speed[445:].max() > 900.0
    still = joint_points(made)
    apart = np.linalg.norm(still["left_foot"][380] - still["right_foot"][380])
    assert 100.0 < apart < 250.0


def test_steps_are_smooth(made: PersonMotion) -> None:
    positions = marker_motion(made).positions
    acceleration = np.linalg.norm(np.diff(positions, 2, axis=0), axis=2) * 3600.0 / 9810.0
    assert acceleration.max() < 4.5
    assert acceleration[:, 0].max() < 0.5


def test_a_foot_that_bears_weight_stays_where_it_is(made: PersonMotion) -> None:
    """On the ball or the heel, whichever is on the floor; one foot at least always is. A foot leaves the floor slowly:
    in the frame in which it does it may move by a millimetre.
    """
    bearing = np.zeros(FRAMES, dtype=int)
    for side in ("left", "right"):
        for end in soles(made, side):
            down = np.abs(end[:, 2]) < 0.01
            pairs = down[1:] & down[:-1]
            slid = np.linalg.norm(np.diff(end[:, :2], axis=0), axis=1)
            assert slid[pairs].max() < 1.0
            assert np.quantile(slid[pairs], 0.95) < 1e-6
            bearing += down
    assert bearing.min() >= 1
    lowest = min(float(end[:, 2].min()) for side in ("left", "right") for end in soles(made, side))
    assert lowest > -1.0


def test_knees_bend_forward_and_legs_reach_their_feet(bones: Skeleton, made: PersonMotion) -> None:
    for index, side in enumerate(("left", "right")):
        relative = np.swapaxes(made.turns[f"{side}_thigh"], 1, 2) @ made.turns[f"{side}_shin"]
        flexion = np.arctan2(relative[:, 0, 2], relative[:, 2, 2])
        assert flexion.min() > 0.05
        assert flexion.max() < 1.7
        points = joint_points(made)
        reach = np.linalg.norm(points[f"{side}_foot"] - points[f"{side}_thigh"], axis=1)
        assert reach.max() < 0.998 * (bones.thigh[index] + bones.shin[index])


def test_arms_stay_out_of_the_trunk(made: PersonMotion) -> None:
    points = joint_points(made)
    for side in ("left", "right"):
        for joint in ("forearm", "hand"):
            local = (
                np.swapaxes(made.turns["thorax"], 1, 2) @ (points[f"{side}_{joint}"] - made.root)[..., None]
            )
            # An ellipse as wide as the trunk and half as much again as an arm's radius.
            away = np.hypot(local[:, 0, 0] / 150.0, local[:, 1, 0] / 175.0)
            assert away.min() > 1.0, (side, joint)


def test_the_path_length_stops_and_continues_smoothly() -> None:
    halt = CircuitHalt(5.5, 7.0)
    times = np.linspace(0.0, 10.0, 2001)
    way = path_length(times, 800.0, halt)
    speed = np.gradient(way, times)
    np.testing.assert_allclose(speed[(times < 4.7) | (times > 7.8)], 800.0, rtol=1e-6)
    np.testing.assert_allclose(
        way[(times >= 5.5) & (times <= 7.0)], path_length(np.array([6.0]), 800.0, halt)[0]
    )
    assert np.abs(np.diff(speed)).max() < 12.0
    assert way[0] == 0.0


def test_without_a_halt_it_walks_on(bones: Skeleton) -> None:
    motion = circuit(bones, np.arange(400) / 50.0, {"radius_mm": 800.0, "turn": 1.0})
    speed = np.linalg.norm(np.diff(motion.root, axis=0), axis=1) * 50.0
    assert speed.min() > 600.0
    np.testing.assert_allclose(np.linalg.norm(motion.root[:, :2], axis=1), 800.0, atol=30.0)


@pytest.mark.parametrize("halt", [(0.5, 3.0), (4.0, 4.2)])
def test_an_impossible_halt_is_refused(bones: Skeleton, halt: tuple[float, float]) -> None:
    options = {**OPTIONS, "still_from_s": halt[0], "still_until_s": halt[1]}
    with pytest.raises(StudioError, match="halt") as refusal:
        circuit(bones, np.arange(10) / 60.0, options)
    assert "still_from_s" in refusal.value.hint
