"""Checks of the cameras' own numbers: up axis, floor, unit, place, resolution."""

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from studio.footage.calibration.boards import Board
from studio.footage.calibration.fault_hypotheses import inverted, transposed
from studio.footage.calibration.findings import Finding
from studio.footage.calibration.vertical import Vertical, camera_at_origin, common_vertical
from studio.footage.capture.sanity import common_target
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.rotations import orthonormality_error
from studio.foundations.geometry.worlds import WORLDS

ROTATION_TOLERANCE = 1e-3
SMALLEST_RIG_MM, LARGEST_RIG_MM = 100.0, 100_000.0
FAR_FROM_AXES = 0.35
"""Cameras look at one place if their optical axes pass it within this share of their distance."""
LEVEL, UPRIGHT = 0.3, 0.2
"""Cameras stand upright about an axis if their pictures' rows lie across it within the first (sine) and their
pictures' up has at least the second of it."""
TILTED_DEGREES, ASKEW_DEGREES, LYING_DEGREES = 8.0, 40.0, 45.0
"""From where on Z is said to be off the vertical of level pictures, off that of pictures that are not level, or another
axis."""
TILTED, NO_FLOOR, UNIT = "tilted-world", "floor-unknown", "unit"
ROOM, FAR_ENOUGH, USUALLY_AWAY = (0.4, 60.0), 6.0, 2.3
"""A body is filmed from these multiples of its height, usually from less than the second, most often from the third."""
SIDE_BY_SIDE = 0.9
"""Cosine between lines of sight from which on cameras stand side by side, as of a stereo rig."""
LEVEL_IT = (
    "Level it: studio level SESSION turns the world to the vertical and finds the floor (by the silhouettes, by the"
    " feet of a run, or --clicks of floor points); or calibrate with the board on the floor (studio calibrate --floor)."
)
AXES = {
    sign + axis: np.array(WORLDS[sign + axis][2], dtype=np.float64) for axis in "xyz" for sign in ("", "-")
}
STEREO_MM = 15.0
"""Cameras side by side lie at least so far from their middle."""
CENTRED = (0.2, 0.8)
SIZE_TOLERANCE = 0.02
ASPECT_TOLERANCE = 0.01


def rig_findings(cameras: Sequence[Camera], up: str = "z") -> tuple[Finding, ...]:
    """Doubts that need nothing but the cameras. up : the axis of the file's world that was taken for the cameras' z."""
    wrong = tuple(_rotations(cameras))
    if wrong:
        return wrong
    turned = tuple(_transposed(cameras))
    axes = () if turned else tuple(_up_axis(cameras, up))
    checks = () if turned else (_floor, _origin, _unit, _place)
    return (*turned, *axes, *(finding for check in (*checks, _principal) for finding in check(cameras)))


def size_findings(
    cameras: Sequence[Camera], footage_sizes: Mapping[str, tuple[int, int]]
) -> tuple[Finding, ...]:
    """Footage that was not recorded at the size its camera was calibrated for."""
    return tuple(_sizes(cameras, footage_sizes))


def _sizes(cameras: Sequence[Camera], footage_sizes: Mapping[str, tuple[int, int]]) -> Iterator[Finding]:
    for camera in cameras:
        size = footage_sizes.get(camera.name, (camera.width, camera.height))
        across, down = size[0] / camera.width, size[1] / camera.height
        if max(abs(across - 1.0), abs(down - 1.0)) <= SIZE_TOLERANCE:
            continue
        mismatch = f"Camera {camera.name} recorded {size[0]}x{size[1]} pixels and was calibrated at"
        mismatch = f"{mismatch} {camera.width}x{camera.height}"
        if abs(across / down - 1.0) < ASPECT_TOLERANCE:
            message = f"{mismatch}: the recording has {across:.3g} times the resolution."
            remedy = "Scale the calibration to the recording, or record at the calibrated resolution."
        elif (size[0] - size[1]) * (camera.width - camera.height) < 0:
            message = f"{mismatch}: one is upright, the other lies on its side."
            remedy = "Rotate the footage as it was rotated for the calibration."
        else:
            message = f"{mismatch}: the shape of the picture differs, so part of it was cut off."
            remedy = "Record with the same mode of the camera as for the calibration, or calibrate again."
        yield Finding("resolution", "blocks", message, remedy, (camera.name,))


def looks_at_one_place(cameras: Sequence[Camera]) -> tuple[str, ...]:
    """Names of the cameras that do not look at the place that the others look at; none for parallel axes."""
    target = common_target(tuple(cameras))
    if target is None:
        return ()
    away: list[str] = []
    for camera in cameras:
        seen = camera.rotation @ target + camera.translation
        if seen[2] <= 0.0 or np.hypot(seen[0], seen[1]) > FAR_FROM_AXES * seen[2]:
            away.append(camera.name)
    return tuple(away)


def upright_about(cameras: Sequence[Camera], axis: Array) -> bool:
    """Whether all pictures stand upright if the (3,) unit vector `axis` points up."""
    rows = np.array([camera.rotation[0] @ axis for camera in cameras])
    ups = np.array([-camera.rotation[1] @ axis for camera in cameras])
    return bool(np.sqrt(np.mean(rows**2)) < LEVEL and ups.min() > UPRIGHT)


def _rotations(cameras: Sequence[Camera]) -> Iterator[Finding]:
    for camera in cameras:
        if np.isfinite(camera.rotation).all() and np.linalg.det(camera.rotation) < 0.0:
            message = f"The rotation of camera {camera.name} mirrors the world (its determinant is -1)."
            remedy = "The axes were taken for left-handed ones: flip one axis where the calibration was made."
            yield Finding("handedness", "blocks", message, remedy, (camera.name,))
        elif orthonormality_error(camera.rotation) > ROTATION_TOLERANCE:
            message = f"The rotation matrix of camera {camera.name} is no rotation."
            remedy = "Check that the nine numbers are complete, or export the calibration again."
            yield Finding("rotation", "blocks", message, remedy, (camera.name,))


def _sound(cameras: Sequence[Camera]) -> bool:
    return (
        common_target(tuple(cameras)) is not None
        and not looks_at_one_place(cameras)
        and upright_about(cameras, AXES["z"])
        and all(camera.centre[2] > 0.0 for camera in cameras)
    )


def _transposed(cameras: Sequence[Camera]) -> Iterator[Finding]:
    """Rotations that make a sound rig only once rows and columns are exchanged, or the pose is inverted."""
    if len(cameras) < 2 or _sound(cameras):
        return
    for change, remedy in (
        (transposed, "Export the rotation in row order, or transpose it."),
        (inverted, "The poses are world from camera: export camera from world, or invert them."),
    ):
        everything = tuple(change(camera) for camera in cameras)
        tries = [(everything, tuple(camera.name for camera in cameras))]
        for number, camera in enumerate(cameras):
            single = (*cameras[:number], everything[number], *cameras[number + 1 :])
            tries.append((single, (camera.name,)))
        for changed, names in tries:
            if _sound(changed):
                message = (
                    f"The rotation of camera {', '.join(names)} is transposed: the cameras look at one place, upright"
                    " and above the floor, only once it is read the other way."
                )
                yield Finding("transposed-rotation", "blocks", message, remedy, names)
                return


def _up_axis(cameras: Sequence[Camera], up: str) -> Iterator[Finding]:
    vertical = common_vertical(cameras)
    if upright_about(cameras, AXES["z"]):
        yield from _tilt(vertical)
        return
    for direction in AXES.values():
        if upright_about(cameras, direction):
            off = vertical.off(direction) if vertical is not None else 0.0
            axis = _axis_of_file(direction, up)
            message = f"The world's {_spoken(axis)} axis points up in all pictures, not {_spoken(up)}"
            message += f"; the cameras' common vertical is {off:.1f} degrees off it." if off > 1.0 else "."
            yield Finding("up-axis", "blocks", message, _import_with(axis))
            return
    if vertical is not None and vertical.level and vertical.off(AXES["z"]) <= LYING_DEGREES:
        yield from _tilt(vertical)
    elif vertical is not None and not _upright_in_turned_pictures(cameras):
        yield from _lying(cameras, vertical, up)


def _tilt(vertical: Vertical | None) -> Iterator[Finding]:
    """Z is nearly the vertical, and evidently not quite."""
    off = vertical.off(AXES["z"]) if vertical is not None else 0.0
    if vertical is None or not vertical.level or off <= max(TILTED_DEGREES, 3.0 * vertical.degrees):
        return
    message = (
        f"The world's Z axis is {off:.1f} degrees off the cameras' common vertical: a person who stands upright leans"
        " by that, and the floor is tilted."
    )
    yield Finding(TILTED, "warns", message, LEVEL_IT)


def _lying(cameras: Sequence[Camera], vertical: Vertical, up: str) -> Iterator[Finding]:
    """Z is not upright, and no axis is in all pictures."""
    off = vertical.off(AXES["z"])
    if off <= ASKEW_DEGREES:
        return
    direction = min(AXES.values(), key=vertical.off)
    axis, nearest = _axis_of_file(direction, up), vertical.off(direction)
    message = (
        f"The world's {_spoken(up)} axis does not point up in the pictures: it is {off:.0f} degrees off their"
        " common up."
    )
    if off <= LYING_DEGREES:
        yield Finding(TILTED, "warns", message, LEVEL_IT)
        return
    # Rolled pictures show only roughly what is up; that all cameras look down from above the floor speaks for Z.
    looks_down = all(camera.centre[2] > 0.0 and camera.rotation[2, 2] < 0.0 for camera in cameras)
    if looks_down and not vertical.level:
        return
    message = f"{message} {_spoken(axis)}".replace(". minus", ". Minus")
    message += f" is the likeliest, {nearest:.0f} degrees off" + ("." if vertical.level else " (roughly).")
    yield Finding("up-axis", "blocks", message, _import_with(axis))


def _axis_of_file(direction: Array, up: str) -> str:
    """The axis of the file's world ("x", "-z", …) that one of AXES is in the cameras', where the file's `up` was taken
    for their z.
    """
    in_file = direction @ np.array(WORLDS[up])
    return next(axis for axis, own in AXES.items() if (own == in_file).all())


def _spoken(axis: str) -> str:
    """ "-x" as "minus X"."""
    return axis.upper().replace("-", "minus ")


def _import_with(axis: str) -> str:
    """The remedy for a world in which the file's `axis` points up."""
    if axis == "z":
        return (
            "Import it with --up=z, or without --up, which is the same; where that axis is not exactly vertical, level"
            " it then (studio level)."
        )
    return (
        f"Import it with --up={axis} (of x, y, z, -x, -y, -z), or export the calibration with Z up; where that axis is"
        " not exactly vertical, level it then (studio level)."
    )


def _upright_in_turned_pictures(cameras: Sequence[Camera]) -> bool:
    """Whether Z is upright once pictures are turned by quarters, as of a camera that was mounted on its side."""
    up = np.array([camera.rotation[:2, 2] for camera in cameras])
    seen = up[np.linalg.norm(up, axis=1) > UPRIGHT]
    if not len(seen):
        return all(camera.rotation[2, 2] < 0.0 for camera in cameras)
    off: Array = np.min(np.abs(seen), axis=1) / np.linalg.norm(seen, axis=1)
    return float(np.sqrt(np.mean(off**2))) < LEVEL


def _origin(cameras: Sequence[Camera]) -> Iterator[Finding]:
    name = camera_at_origin(cameras)
    if name:
        message = f"The world's origin is the lens of camera {name}: where the floor is is unknown."
        yield Finding(NO_FLOOR, "warns", message, LEVEL_IT)


def _floor(cameras: Sequence[Camera]) -> Iterator[Finding]:
    low = tuple(camera.name for camera in cameras if camera.centre[2] < 0.0)
    if not low:
        return
    most = 2 * len(low) > len(cameras)
    message = f"Camera {', '.join(low)} lies under the floor (z < 0)."
    remedy = (
        "The world is mirrored or its Z axis points down: set the floor again, with Z up."
        if most
        else "Check that the floor is at z = 0 and that this camera's calibration is its own."
    )
    yield Finding("below-floor", "blocks" if most else "warns", message, remedy, low)


def _unit(cameras: Sequence[Camera]) -> Iterator[Finding]:
    if len(cameras) < 2:
        return
    centres = np.array([camera.centre for camera in cameras])
    spread = float(np.linalg.norm(centres - centres.mean(axis=0), axis=1).max())
    together = min(float(a.rotation[2] @ b.rotation[2]) for a in cameras for b in cameras) > SIDE_BY_SIDE
    if SMALLEST_RIG_MM < spread < LARGEST_RIG_MM or (together and STEREO_MM < spread <= SMALLEST_RIG_MM):
        return
    message = f"The cameras lie within {spread:.3g} mm of their middle"
    if 0.5 < spread <= SMALLEST_RIG_MM:
        message = f"{message}: it seems that metres were taken for millimetres."
        remedy = "Import it with --unit m (or cm, in, board=MM)."
    elif spread > LARGEST_RIG_MM:
        message = f"{message}: it seems that millimetres were taken for metres."
        remedy = "Import it with --unit mm (or cm, in, board=MM)."
    else:
        message, remedy = f"{message}: they are all in one place.", "Calibrate the cameras' positions, too."
    yield Finding("scale", "blocks", message, remedy)


def distance_of_subject(cameras: Sequence[Camera]) -> float | None:
    """mm from the cameras to the place that they look at; None where that cannot be said: cameras side by side cross
    their axes anywhere.
    """
    target = common_target(tuple(cameras))
    if target is None or looks_at_one_place(cameras):
        return None
    around = min(float(a.rotation[2] @ b.rotation[2]) for a in cameras for b in cameras) < SIDE_BY_SIDE
    away = float(np.median([np.linalg.norm(camera.centre - target) for camera in cameras]))
    return away if around else None


def has_room(cameras: Sequence[Camera], size_mm: float) -> bool:
    """Whether the cameras surround a body of `size_mm` (0: unknown) at a distance from which it is filmed."""
    away = distance_of_subject(cameras)
    return away is not None and size_mm > 0.0 and ROOM[0] * size_mm <= away <= ROOM[1] * size_mm


def room_findings(cameras: Sequence[Camera], size_mm: float) -> tuple[Finding, ...]:
    """A rig in which a body of `size_mm` (0: unknown) has no room: another unit was meant."""
    away = distance_of_subject(cameras)
    if away is None or size_mm <= 0.0 or has_room(cameras, size_mm):
        return ()
    units = {"cm": 10.0, "in": 25.4, "m": 1000.0}
    fitting = [unit for unit, factor in units.items() if ROOM[0] <= factor * away / size_mm <= FAR_ENOUGH]
    fitting.sort(key=lambda unit: abs(math.log(units[unit] * away / size_mm / USUALLY_AWAY)))
    lengths = [f"--unit {unit} would make it {units[unit] * away / 1000:.2g} m" for unit in fitting]
    meant = f" {', '.join(lengths)}." if lengths else ""
    message = (
        f"The cameras look at a place {away:.4g} mm in front of them, where a body of {size_mm / 1000:.2f} m has no"
        " room: the calibration is of another unit, it seems."
    )
    if away > ROOM[1] * size_mm:
        message = (
            f"The cameras look at a place {away / 1000:.4g} m in front of them, too far for a body of"
            f" {size_mm / 1000:.2f} m: the calibration is of another unit, it seems."
        )
    remedy = f"Import it with --unit mm, cm, m or in, or board=MM (the mm that are 1 in the file).{meant}"
    return (Finding(UNIT, "warns", message, remedy),)


def _place(cameras: Sequence[Camera]) -> Iterator[Finding]:
    away = looks_at_one_place(cameras)
    if away:
        message = f"Camera {', '.join(away)} does not look where the others look."
        remedy = "Check that each calibration belongs to its footage and was not exchanged."
        yield Finding("no-common-view", "warns", message, remedy, away)


def _principal(cameras: Sequence[Camera]) -> Iterator[Finding]:
    for camera in cameras:
        cx, cy = camera.matrix[0, 2] / camera.width, camera.matrix[1, 2] / camera.height
        if CENTRED[0] < cx < CENTRED[1] and CENTRED[0] < cy < CENTRED[1]:
            continue
        factor = 0.5 * (2.0 * cx + 2.0 * cy)
        scaled = abs(cx - cy) < 0.15 and (factor > 1.6 or factor < 0.4)
        message = (
            f"Camera {camera.name} has its principal point at ({camera.matrix[0, 2]:.0f},"
            f" {camera.matrix[1, 2]:.0f}), far from the centre of {camera.width}x{camera.height} pixels."
        )
        remedy = "Check that the picture size is the calibration's."
        if scaled:
            remedy = f"The calibration seems made at {factor:.2g} times this resolution: scale it."
        code = "resolution" if scaled else "principal-point"
        yield Finding(code, "blocks" if scaled else "warns", message, remedy, (camera.name,))


TOLERANCE = 0.05
UNITS = {
    1e-3: (
        "metres were taken for millimetres",
        "Import it with --unit m, or multiply the translations by 1000.",
    ),
    1e-2: ("decimetres were taken for millimetres", "Multiply the translations by 100."),
    1e-1: (
        "centimetres were taken for millimetres",
        "Multiply the translations by 10, or name the unit (cm).",
    ),
    1e3: (
        "millimetres were taken for metres",
        "Import it with --unit mm, or divide the translations by 1000.",
    ),
    1.0 / 25.4: ("inches were taken for millimetres", "Multiply the translations by 25.4."),
}
UNIT_TOLERANCE = 0.25


def unit_finding(ratio: float, known: str, tolerance: float = UNIT_TOLERANCE) -> Finding | None:
    """The unit that was mistaken, None for none. ratio : measured by the calibration over known. known : the length, in
    words. tolerance : of the length, a share.
    """
    for factor, (explanation, remedy) in UNITS.items():
        if abs(np.log(ratio / factor)) < np.log(1.0 + tolerance):
            return Finding(
                "scale",
                "blocks",
                f"By the calibration {known} is {ratio:.4g} times what it is: {explanation}.",
                remedy,
            )
    return None


def scale_finding(ratio: float, known: str, board: Board | None = None) -> Finding:
    """The finding for a measured length that does not match; parameters as of `unit_finding`."""
    return unit_finding(ratio, known) or Finding(
        "square-size",
        "blocks",
        f"By the calibration {known} is {ratio:.3f} times what it is: its board's squares were not of the given size.",
        f"Measure the printed squares and calibrate again with their true size{_true_size(ratio, board)}; or divide"
        f" lengths by {ratio:.3f}.",
    )


def height_finding(seen_mm: float, known_mm: float, known: str, board: Board | None = None) -> Finding:
    """The finding for a standing person's height that does not match the calibration. known : the height as text."""
    ratio = seen_mm / known_mm
    return unit_finding(ratio, known) or Finding(
        "square-size",
        "blocks",
        f"By the calibration the standing person is {seen_mm:.0f} mm tall, {ratio:.3f} times {known}.",
        f"Check the height. If it is right, the calibration board's squares were not of the size given: measure them"
        f" and calibrate again{_true_size(ratio, board)}, or divide lengths by {ratio:.3f}.",
    )


def _true_size(ratio: float, board: Board | None) -> str:
    return (
        f" ({board.square_mm / ratio:.4g} mm instead of {board.square_mm:.4g} mm)"
        if board is not None
        else ""
    )


def distance_findings(
    cameras: Sequence[Camera], distances_mm: Mapping[tuple[str, str], float], board: Board | None = None
) -> tuple[Finding, ...]:
    """Distances between lenses that were measured in the room, against the calibration's; unknown names are ignored."""
    centres = {camera.name: camera.centre for camera in cameras}
    ratios = {
        pair: float(np.linalg.norm(centres[pair[0]] - centres[pair[1]])) / length
        for pair, length in distances_mm.items()
        if pair[0] in centres and pair[1] in centres and length > 0.0
    }
    if not ratios:
        return ()
    ratio = float(np.median(list(ratios.values())))
    if abs(ratio - 1.0) <= TOLERANCE or ratio <= 0.0:
        return ()
    pair = next(iter(ratios))
    return (scale_finding(ratio, f"the distance from camera {pair[0]} to {pair[1]}", board),)
