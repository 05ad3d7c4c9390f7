"""Which footage belongs to which calibrated camera, by their names.

Names are compared in a normal form: lower case, only letters and digits, a number without leading
zeros, and the words that mean a camera (`camera`, `cam`, `view`, ...) made the same, so that Camera1,
CAM1, cam_01 and cam01.mp4 are one name. Where that finds nothing, a name that is contained in the other
as whole words counts (`take3_cam_01` and `cam1`), and at last the only numbers in the names.
"""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from studio.foundations.errors import StudioError

CAMERA_WORDS = frozenset(("camera", "cam", "c", "view", "port", "video", "vid", "fg", "mask"))


@dataclass(frozen=True, slots=True)
class CameraMatch:
    """One piece of footage and the camera it was taken for. how : the reason, in words."""

    footage: str
    camera: str
    how: str


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """A sort key under which cam_2 comes before cam_10."""
    parts = re.findall(r"\d+|\D+", name.lower())
    return tuple((0, int(part), "") if part.isdigit() else (1, 0, part) for part in parts)


def words(name: str) -> tuple[str, ...]:
    """The words and numbers of a name in their normal form: cam_01 and Camera1 both give ("cam", "1")."""
    tokens: list[str] = []
    for part in re.findall(r"\d+|[a-z]+", name.lower()):
        if part.isdigit():
            tokens.append(str(int(part)))
        else:
            tokens.append("cam" if part in CAMERA_WORDS else part)
    return tuple(tokens)


def match_names(
    footage: Sequence[str], cameras: Sequence[str], what: str, wrong: type[StudioError]
) -> tuple[CameraMatch, ...]:
    """The camera of every piece of footage, in the order of `footage`.

    what : plural noun for messages ("videos", "masks"). Raises `wrong`, naming both lists, if a name of
    `footage` fits no camera or several, or if two names fit the same camera.
    """
    rules: tuple[tuple[str, Callable[[str, str], bool]], ...] = (
        ("same name", lambda a, b: a == b),
        ("same normalised name", lambda a, b: words(a) == words(b)),
        ("name contains the camera's", lambda a, b: _contains(words(a), words(b))),
        ("name contained in the camera's", lambda a, b: _contains(words(b), words(a))),
        ("same number", lambda a, b: _numbers(a) == _numbers(b) != ()),
    )
    for how, fits in rules:
        matched = _one_to_one(footage, cameras, fits)
        if matched is not None:
            return tuple(
                CameraMatch(name, camera, how) for name, camera in zip(footage, matched, strict=True)
            )
    raise wrong(
        f"The {what} ({listed(footage)}) cannot be matched one to one with the calibrated cameras"
        f" ({listed(cameras)}).",
        f"Rename the {what} after the cameras.",
    )


def listed(names: Iterable[str]) -> str:
    """Names for a message, in natural order."""
    return ", ".join(sorted(names, key=natural_key)) or "none"


def _one_to_one(
    footage: Sequence[str], cameras: Sequence[str], fits: Callable[[str, str], bool]
) -> list[str] | None:
    """The camera of each name if every name fits exactly one camera and no camera is taken twice."""
    matched: list[str] = []
    for name in footage:
        fitting = [camera for camera in cameras if fits(name, camera)]
        if len(fitting) != 1 or fitting[0] in matched:
            return None
        matched.append(fitting[0])
    return matched


def _contains(long: tuple[str, ...], short: tuple[str, ...]) -> bool:
    """Whether `short` is a run of whole words of `long`."""
    width = len(short)
    return width > 0 and any(long[k : k + width] == short for k in range(len(long) - width + 1))


def _numbers(name: str) -> tuple[str, ...]:
    return tuple(word for word in words(name) if word.isdigit())
