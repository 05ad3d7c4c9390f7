"""The usual faults, each as the cameras that would be right if it had happened.

A mirrored picture is a camera with a negative focal length across, a smaller recording one with a scaled matrix, so
every fault is a change of cameras; evidence (a board, silhouettes) then shows which change makes views agree.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from studio.footage.calibration.findings import Finding
from studio.foundations.geometry.camera import Camera

NAMED_SHARE, NAMED_SHARE_OF_TWO = 0.4, 0.25
"""A fault is named if undoing it leaves less than this share of the disagreement, with three cameras or more and with
two. On silhouettes of two real and four rendered takes, every camera turned by up to 2 degrees, undoing a fault that is
not there left 0.72 or more with three to five cameras (280 trials), 0.38 with two (200); one that was planted, 0.01 to
0.4.
"""
CERTAIN = 2.5
"""A disagreement that no fault explains is reported from this multiple of the usual one."""
RUNNER_UP = 1.3
"""Another explanation that is nearly as good (by this factor) is reported too."""


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """One fault. cameras : as they would be right. about : names; empty for all."""

    code: str
    cameras: tuple[Camera, ...]
    about: tuple[str, ...]
    message: str
    remedy: str


def mirrored(camera: Camera) -> Camera:
    """The camera whose picture is this one's, left and right exchanged."""
    flip = np.array([[-1.0, 0.0, camera.width - 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    return replace(camera, matrix=flip @ camera.matrix)


def upside_down(camera: Camera) -> Camera:
    """The camera whose picture is this one's, turned by half a turn."""
    turn = np.array([[-1.0, 0.0, camera.width - 1.0], [0.0, -1.0, camera.height - 1.0], [0.0, 0.0, 1.0]])
    return replace(camera, matrix=turn @ camera.matrix)


def rescaled(camera: Camera, factor: float) -> Camera:
    """The camera for a picture of `factor` times the resolution; its nominal size stays."""
    shift = 0.5 * factor - 0.5
    scale = np.array([[factor, 0.0, shift], [0.0, factor, shift], [0.0, 0.0, 1.0]])
    return replace(camera, matrix=scale @ camera.matrix)


def transposed(camera: Camera) -> Camera:
    """The camera with its rotation matrix read the other way, translation kept."""
    return replace(camera, rotation=camera.rotation.T.copy())


def inverted(camera: Camera) -> Camera:
    """The camera whose numbers mean world from camera instead of camera from world."""
    return replace(
        camera, rotation=camera.rotation.T.copy(), translation=-camera.rotation.T @ camera.translation
    )


def _exchanged(one: Camera, two: Camera) -> tuple[Camera, Camera]:
    return replace(two, name=one.name), replace(one, name=two.name)


def hypotheses(cameras: Sequence[Camera]) -> tuple[Hypothesis, ...]:
    """The faults to try: one camera's, all cameras', exchanges of two."""
    faults: list[Hypothesis] = []
    for code, change, words, remedy in _CHANGES:
        everything = tuple(change(camera) for camera in cameras)
        for number, camera in enumerate(cameras):
            right = (*cameras[:number], everything[number], *cameras[number + 1 :])
            faults.append(
                Hypothesis(
                    code,
                    right,
                    (camera.name,),
                    words.format(f"camera {camera.name}"),
                    remedy.replace("CAMERA", camera.name),
                )
            )
        faults.append(Hypothesis(code, everything, (), words.format("all cameras"), remedy))
    for one, two in combinations(range(len(cameras)), 2):
        right = list(cameras)
        right[one], right[two] = _exchanged(cameras[one], cameras[two])
        names = (cameras[one].name, cameras[two].name)
        faults.append(
            Hypothesis(
                "swapped-cameras",
                tuple(right),
                names,
                f"Cameras {names[0]} and {names[1]} are exchanged: the views agree once they are swapped.",
                "Give each footage the calibration of its own camera.",
            )
        )
    return tuple(faults)


Change = Callable[[Camera], Camera]
_CHANGES: tuple[tuple[str, Change, str, str], ...] = (
    (
        "mirrored-video",
        mirrored,
        "The pictures of {} are mirrored: the views agree once left and right are exchanged.",
        "Switch mirroring off in the camera's program, or flip the footage.",
    ),
    (
        "turned-video",
        upside_down,
        "The pictures of {} are upside down against the calibration: the views agree after half a turn.",
        "Turn them: --rotate CAMERA=180 (studio import, or studio synchronise for a session).",
    ),
    (
        "resolution",
        lambda camera: rescaled(camera, 0.5),
        "The footage of {} has half the resolution of the calibration: the views agree once it is scaled.",
        "Scale the calibration to the recording, or record at the calibrated resolution.",
    ),
    (
        "resolution",
        lambda camera: rescaled(camera, 2.0),
        "The footage of {} has twice the resolution of the calibration: the views agree once it is scaled.",
        "Scale the calibration to the recording, or record at the calibrated resolution.",
    ),
    (
        "transposed-rotation",
        transposed,
        "The rotation of {} is transposed: the views agree once rows and columns are exchanged.",
        "Export the rotation in row order, or transpose it.",
    ),
    (
        "transposed-rotation",
        inverted,
        "The pose of {} is written the other way round (world from camera): the views agree once it is inverted.",
        "Export camera-from-world poses, or invert them.",
    ),
)


def explained(
    cameras: Sequence[Camera],
    disagreement: Callable[[Sequence[Camera]], float],
    good: float,
    evidence: str,
    least: float | None = None,
) -> tuple[Finding, ...]:
    """No finding if the views agree; else the fault whose correction makes them agree, or an unexplained disagreement.

    disagreement : of cameras with the evidence, NaN if undetermined. good : that of a sound calibration.
    evidence : its name, for the message. least : disagreement from which a fault is searched for, default
    `good`: a fault that hardly shows, such as a mirrored view of someone in its middle, explains a small one as well.
    """
    now = disagreement(cameras)
    if np.isnan(now) or now <= (good if least is None else least):
        return ()
    tried = [(disagreement(entry.cameras), number, entry) for number, entry in enumerate(hypotheses(cameras))]
    tried = sorted((value, number, entry) for value, number, entry in tried if not np.isnan(value))
    share = NAMED_SHARE if len(cameras) > 2 else NAMED_SHARE_OF_TWO
    if not tried or tried[0][0] > share * now:
        if now < CERTAIN * good:
            return ()
        message = f"The calibration does not fit the {evidence}: the views disagree ({now:.2g}, usual is {good:.2g})."
        remedy = (
            "Check that the calibration was made with these cameras in these places, and calibrate again."
        )
        return (Finding("views-disagree", "blocks", message, remedy),)
    best, _, entry = tried[0]
    rivals = sorted({other.code for value, _, other in tried[1:] if value <= RUNNER_UP * best} - {entry.code})
    rival_note = f" Nearly as good an explanation: {', '.join(rivals)}." if rivals else ""
    return (Finding(entry.code, "blocks", entry.message + rival_note, entry.remedy, entry.about),)
