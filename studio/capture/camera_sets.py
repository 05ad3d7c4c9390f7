"""Which pictures of several cameras belong together, and how far apart they were taken.

Cameras that run on their own take their pictures at any time; of the newest ones those are paired that lie nearest to
the newest picture of the camera that is behind. So pictures of one set are at most half a frame apart unless a camera
lags or loses pictures, and then that is said with its name.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from studio.arrays import Array
from studio.capture.camera_streams import Shot

APART = 0.5
"""Pictures further apart than this share of a frame's duration are said to be."""


@dataclass(frozen=True, slots=True, eq=False)
class PictureSet:
    """One picture of every camera that runs, all of one moment as nearly as can be.

    shots : by camera. left_out : cameras that give no pictures now. spread : seconds between the first and the last
    picture. lagging : the camera that is furthest from the others where that is more than half a frame, else "".
    """

    shots: Mapping[str, Shot]
    left_out: tuple[str, ...]
    spread: float
    lagging: str

    @property
    def moment(self) -> float:
        """The middle of its pictures' times, seconds."""
        times = [shot.came for shot in self.shots.values()]
        return 0.5 * (min(times) + max(times))


@dataclass(frozen=True, slots=True)
class SpreadFigures:
    """Spreads of many sets, milliseconds: median, 95 % of them, worst; apart : how many lay more than half a frame
    apart, of how many; lagging : the camera that was behind most often, "" if none.
    """

    median: float
    most: float
    worst: float
    apart: int
    sets: int
    lagging: str

    @property
    def in_words(self) -> str:
        """As a person reads it."""
        if not self.sets:
            return "no complete set of pictures came"
        words = f"pictures {self.median:.1f} ms apart (95 %: {self.most:.1f}, worst {self.worst:.1f})"
        if self.apart:
            late = f"; camera {self.lagging} lags" if self.lagging else ""
            words += f"; {self.apart} of {self.sets} sets more than half a frame apart{late}"
        return words


def paired(
    recent: Mapping[str, Sequence[Shot]], left_out: Sequence[str], frame_seconds: float, after: float
) -> PictureSet | None:
    """The newest complete set, None where a camera has no picture above the moment `after`.

    recent : the last pictures of the cameras that run, oldest first. frame_seconds : a frame's duration.
    """
    newer = {name: [shot for shot in shots if shot.came > after] for name, shots in recent.items()}
    if not newer or not all(newer.values()):
        return None
    moment = min(shots[-1].came for shots in newer.values())
    chosen = {name: min(shots, key=lambda shot: abs(shot.came - moment)) for name, shots in newer.items()}
    times = {name: shot.came for name, shot in chosen.items()}
    spread = max(times.values()) - min(times.values())
    lagging = furthest(times) if spread > APART * frame_seconds else ""
    return PictureSet(chosen, tuple(left_out), spread, lagging)


def furthest(times: Mapping[str, float]) -> str:
    """The camera whose picture lies furthest from the middle one of all; of two the later."""
    middle = float(np.median(list(times.values())))
    return max(times, key=lambda name: (abs(times[name] - middle), times[name]))


def spread_figures(spreads: Array, lagging: Sequence[str]) -> SpreadFigures:
    """Figures of sets with these spreads (K,), seconds, and the lagging camera of each ("" where none lags)."""
    late = [name for name in lagging if name]
    worst = max(sorted(set(late)), key=late.count, default="")
    if not len(spreads):
        return SpreadFigures(float("nan"), float("nan"), float("nan"), 0, 0, "")
    median, most, largest = (1e3 * float(np.quantile(spreads, share)) for share in (0.5, 0.95, 1.0))
    return SpreadFigures(median, most, largest, len(late), len(spreads), worst)
