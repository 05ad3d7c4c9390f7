"""Every planted fault is caught by name; a sound calibration raises nothing (show 2)."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from calibrated_scenes import CHARUCO, CHESS, person_masks, ring, seen, true_lens, waved

from studio.footage.calibration.board_checks import mirrored_cameras
from studio.footage.calibration.boards import Board, Detection
from studio.footage.calibration.checks import Finding, check_calibration
from studio.footage.calibration.fault_hypotheses import inverted, rescaled, transposed, upside_down
from studio.footage.calibration.silhouette_checks import Masks
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.rotations import rotation_from_vector

RIG = ring(4)
POSES, DETECTIONS = waved(CHARUCO, RIG)
MASKS = person_masks(RIG)


def checked(cameras: tuple[Camera, ...], **evidence: object) -> tuple[Finding, ...]:
    return check_calibration(cameras, **evidence)  # type: ignore[arg-type]


def with_board(cameras: tuple[Camera, ...], detections: list[Detection] = DETECTIONS) -> tuple[Finding, ...]:
    return check_calibration(cameras, board=CHARUCO, detections=detections)


def with_masks(cameras: tuple[Camera, ...], masks: object = MASKS) -> tuple[Finding, ...]:
    return check_calibration(cameras, masks=masks, height_mm=1800.0)  # type: ignore[arg-type]


def in_metres(camera: Camera) -> Camera:
    return dataclasses.replace(camera, translation=camera.translation / 1000.0)


def y_up(camera: Camera) -> Camera:
    """The camera of a world written with Y up: (x, y, z)_z_up = (z, x, y)_y_up."""
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    return dataclasses.replace(camera, rotation=camera.rotation @ turn)


def turned(camera: Camera, rng: np.random.Generator, degrees: float) -> Camera:
    """The camera turned about its own centre, about any axis."""
    axis = rng.normal(size=3)
    turn = rotation_from_vector(np.radians(degrees) * axis / np.linalg.norm(axis))
    return dataclasses.replace(
        camera, rotation=turn @ camera.rotation, translation=-turn @ camera.rotation @ camera.centre
    )


def swapped(one: int, two: int) -> tuple[Camera, ...]:
    cameras = list(RIG)
    cameras[one] = dataclasses.replace(RIG[two], name=RIG[one].name)
    cameras[two] = dataclasses.replace(RIG[one], name=RIG[two].name)
    return tuple(cameras)


def flipped(detections: list[Detection], names: set[str]) -> list[Detection]:
    """What another program, which does not mind mirrored markers, would have seen in mirrored videos."""
    return [
        dataclasses.replace(
            detection,
            pixels=np.column_stack([detection.size[0] - 1 - detection.pixels[:, 0], detection.pixels[:, 1]]),
        )
        if detection.camera in names
        else detection
        for detection in detections
    ]


def code_of(findings: tuple[Finding, ...]) -> str:
    assert findings
    first = findings[0]
    assert first.severity == "blocks"
    assert first.message.endswith(".") or first.message.endswith(")")
    assert first.remedy
    return first.code


def test_a_sound_calibration_raises_nothing() -> None:
    sizes = {camera.name: (camera.width, camera.height) for camera in RIG}
    assert (
        check_calibration(
            RIG, footage_sizes=sizes, board=CHARUCO, detections=DETECTIONS, masks=MASKS, height_mm=1800.0
        )
        == ()
    )
    assert checked(ring(2)) == ()


@pytest.mark.parametrize("look", [with_board, with_masks])
@pytest.mark.parametrize(("one", "two"), [(0, 1), (0, 2), (1, 3), (2, 3)])
def test_swapped_cameras(look: Callable[..., tuple[Finding, ...]], one: int, two: int) -> None:
    findings = look(swapped(one, two))
    assert code_of(findings) == "swapped-cameras"
    assert findings[0].cameras == (RIG[one].name, RIG[two].name)


@pytest.mark.parametrize("names", [{"cam2"}, {"cam4"}, {"cam1", "cam2", "cam3", "cam4"}])
def test_mirrored_video_by_a_board(names: set[str]) -> None:
    findings = with_board(RIG, flipped(DETECTIONS, names))
    assert code_of(findings) == "mirrored-video"
    assert set(findings[0].cameras) == (names if len(names) == 1 else set())


@pytest.mark.parametrize("name", ["cam1", "cam2", "cam3", "cam4"])
@pytest.mark.parametrize("masks", [MASKS, person_masks(RIG, reach=100.0)], ids=["about", "in the middle"])
def test_mirrored_video_by_silhouettes(masks: Masks, name: str) -> None:
    mirrored = {
        frame: {camera: mask[:, ::-1] if camera == name else mask for camera, mask in views.items()}
        for frame, views in masks.items()
    }
    findings = with_masks(RIG, mirrored)
    assert code_of(findings) == "mirrored-video"
    assert findings[0].cameras == (name,)


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, 3, 4])
def test_cameras_that_were_knocked_have_no_other_fault(count: int) -> None:
    """Turned by 0.3 to 1.8 degrees each, which silhouettes show, but which no fault explains."""
    rng = np.random.default_rng(count)
    for degrees in (0.6, 1.2) * 4:
        knocked = tuple(turned(camera, rng, degrees * rng.uniform(0.5, 1.5)) for camera in RIG[:count])
        assert {finding.code for finding in with_masks(knocked)} <= {"views-disagree"}


@pytest.mark.parametrize("board", [CHESS, Board("chessboard", 7, 5, 90.0)])
def test_mirrored_video_while_calibrating_with_a_chessboard(board: Board) -> None:
    _, detections = waved(board, RIG)
    lenses = {camera.name: true_lens(camera) for camera in RIG}
    names = tuple(lenses)
    assert mirrored_cameras(board, detections, lenses, names) == ()
    across, down = board.corners
    grid = np.arange(across * down).reshape(down, across)
    # A chessboard is its own mirror image: the finder counts the mirrored corners in an order that is not mirrored.
    recount = (grid[:, ::-1] if across % 2 == 0 or board.turn_symmetric else grid[::-1]).ravel()
    spoilt = []
    for detection in flipped(detections, {"cam3"}):
        pixels = detection.pixels[recount] if detection.camera == "cam3" else detection.pixels
        if board.turn_symmetric and pixels[0].sum() > pixels[-1].sum():
            pixels = pixels[::-1]
        spoilt.append(dataclasses.replace(detection, pixels=pixels))
    lens = lenses["cam3"]
    matrix, distortion = lens.matrix.copy(), lens.distortion * np.array([1.0, 1.0, 1.0, -1.0, 1.0])
    matrix[0, 2] = lens.size[0] - 1 - matrix[0, 2]
    lenses["cam3"] = dataclasses.replace(lens, matrix=matrix, distortion=distortion)
    findings = mirrored_cameras(board, spoilt, lenses, names)
    assert code_of(findings) == "mirrored-video"
    assert findings[0].cameras == ("cam3",)


@pytest.mark.parametrize("which", [0, 2])
def test_a_half_turn_is_not_called_mirrored(which: int) -> None:
    cameras = tuple(upside_down(camera) if number == which else camera for number, camera in enumerate(RIG))
    findings = with_masks(cameras)
    assert code_of(findings) == "turned-video"
    assert f"--rotate {RIG[which].name}=180" in findings[0].remedy


def test_half_resolution_by_the_size_of_the_footage() -> None:
    sizes = {camera.name: (camera.width, camera.height) for camera in RIG} | {"cam2": (640, 480)}
    findings = checked(RIG, footage_sizes=sizes)
    assert code_of(findings) == "resolution"
    assert findings[0].cameras == ("cam2",)
    assert "0.5 times" in findings[0].message


@pytest.mark.parametrize("look", [with_board, with_masks])
@pytest.mark.parametrize("which", [(0,), (2,), (0, 1, 2, 3)])
def test_half_resolution_by_what_is_seen(
    look: Callable[..., tuple[Finding, ...]], which: tuple[int, ...]
) -> None:
    """The calibration is for twice the resolution but claims the recording's size."""
    cameras = tuple(rescaled(camera, 2.0) if number in which else camera for number, camera in enumerate(RIG))
    assert code_of(look(cameras)) == "resolution"


@pytest.mark.parametrize("evidence", ["none", "board", "masks"])
def test_metres_taken_for_millimetres(evidence: str) -> None:
    cameras = tuple(in_metres(camera) for camera in RIG)
    look = {"none": checked, "board": with_board, "masks": with_masks}[evidence]
    findings = look(cameras)
    assert code_of(findings) == "scale"
    assert "metres were taken for millimetres" in findings[0].message


def test_y_up_and_upside_down() -> None:
    findings = checked(tuple(y_up(camera) for camera in RIG))
    assert code_of(findings) == "up-axis"
    assert "Y axis points up" in findings[0].message
    half_turn = np.diag([1.0, -1.0, -1.0])
    under = tuple(dataclasses.replace(camera, rotation=camera.rotation @ half_turn) for camera in RIG)
    codes = {finding.code for finding in checked(under)}
    assert {"up-axis", "below-floor"} <= codes


def test_left_handed_rotations() -> None:
    mirror = np.diag([1.0, -1.0, 1.0])
    cameras = tuple(dataclasses.replace(camera, rotation=camera.rotation @ mirror) for camera in RIG)
    assert code_of(checked(cameras)) == "handedness"


@pytest.mark.parametrize("factor", [0.8, 1.1, 1.5])
def test_wrong_square_size(factor: float) -> None:
    cameras = tuple(dataclasses.replace(camera, translation=camera.translation * factor) for camera in RIG)
    findings = with_board(cameras)
    assert code_of(findings) == "square-size"
    distance = float(np.linalg.norm(RIG[0].centre - RIG[1].centre))
    findings = checked(cameras, board=CHARUCO, distances_mm={("cam1", "cam2"): distance})
    assert code_of(findings) == "square-size"
    assert f"{CHARUCO.square_mm / factor:.4g} mm instead of" in findings[0].remedy
    if abs(factor - 1.0) > 0.15:
        assert code_of(with_masks(cameras)) == "square-size"


@pytest.mark.parametrize("change", [transposed, inverted])
@pytest.mark.parametrize("which", [(0,), (3,), (0, 1, 2, 3)])
def test_transposed_rotation_by_the_rig_alone(
    change: Callable[[Camera], Camera], which: tuple[int, ...]
) -> None:
    cameras = tuple(change(camera) if number in which else camera for number, camera in enumerate(RIG))
    assert code_of(checked(cameras)) == "transposed-rotation"


def test_a_slightly_transposed_rotation_needs_a_board() -> None:
    """The second camera's rotation is nearly symmetric: only evidence tells."""
    cameras = (RIG[0], transposed(RIG[1]), *RIG[2:])
    assert checked(cameras) == ()
    assert code_of(with_board(cameras)) == "transposed-rotation"


def test_views_that_nothing_explains() -> None:
    poses, _ = waved(CHARUCO, RIG, seed=9)
    others = seen(CHARUCO, ring(4, seed=11, radius=3000.0), poses)
    assert code_of(with_board(RIG, others)) in {"views-disagree", "square-size"}
