"""The options of an export: one declaration each, from which command, API and page derive theirs."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.knobs import knob
from studio.runs.tracks import BEST

OWN = "own"
AUTO = "auto"
MM_PER_UNIT = {"mm": 1.0, "cm": 10.0, "m": 1000.0}


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """The options of an export; every format takes some of them (`formats.ExportFormat.takes`).

    first, last : frames, half open; last 0 means to the end. fps 0 : as it was tracked.
    """

    title: ClassVar[str] = "Export"

    track: str = knob(
        BEST,
        help="Which track: best is the smoothed one, else the refined, else raw, the search's own; a track that is"
        " older than the run's frames is skipped.",
    )
    first: int = knob(0, 0, 100_000_000, label="from frame", help="The first frame.")
    last: int = knob(0, 0, 100_000_000, label="to frame", help="The frame after the last; 0: to the end.")
    fps: float = knob(
        0.0, 0.0, 1000.0, label="frame rate", unit="Hz", help="Poses in between are made; 0: as tracked."
    )
    lost: str = knob(
        "gap",
        label="lost frames",
        choices=("gap", "keep"),
        help="Frames in which the body was lost become gaps, or keep the held pose.",
    )
    unit: str = knob(
        AUTO, choices=(AUTO, "m", "cm", "mm"), help="Of lengths; auto: what the format's readers expect."
    )
    up: str = knob(
        AUTO,
        label="up axis",
        choices=(AUTO, "y", "z"),
        help="Auto: what the format's readers expect; z: the world's.",
    )
    names: str = knob(
        OWN,
        choices=(OWN, "halpe26", "mixamo", "opensim"),
        help="Names of points and bones: the body's own, or those that another program knows. Points that the body does"
        " not have are left out, and the file's note names them: of halpe26 nose, eyes, ears and small toes, which no"
        " body of the studio has, and without feet (human31) heels and big toes.",
    )
    rest: str = knob(
        "tpose",
        label="rest pose",
        choices=("tpose", "neutral"),
        help="The skeleton without motion: arms stretched sideways, or the body's neutral pose.",
    )
    euler: str = knob(
        "ZXY",
        label="rotation order",
        choices=("ZXY", "ZYX", "XYZ", "XZY", "YXZ", "YZX"),
        help="Of the rotation channels, first applied last.",
    )
    angles: str = knob("degrees", choices=("degrees", "radians"), help="Of the angles in the table.")
    layout: str = knob(
        OWN,
        label="table layout",
        choices=(OWN, "deeplabcut", "anipose"),
        help="Of a CSV: the studio's own, with angles; or points alone, as DeepLabCut's or anipose's tools read it. Of"
        " an H5: SLEAP's (own), or DeepLabCut's.",
    )
    split: bool = knob(False, help="More frames than the format counts go into several files.")
    camera: str = knob("", help="Only this camera's video; none: one video a camera.")
    height: int = knob(
        0, 0, 4320, label="picture height", unit="px", help="Of the videos; 0: as it was recorded."
    )
    calibration: str = knob(
        "", label="calibration format", help="Which writer of calibrations; none: the ending's own."
    )


# x forward, y left, z up becomes z forward, x left, y up: as TRC files have it, and as Blender and Maya expect a BVH.
Y_UP = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


@dataclass(frozen=True, slots=True)
class Axes:
    """unit : "mm", "cm" or "m". up : "y" or "z"."""

    unit: str
    up: str

    @property
    def turn(self) -> Array:
        """(3, 3) from the world's axes to the file's."""
        return Y_UP if self.up == "y" else np.eye(3)

    @property
    def mm(self) -> float:
        """Millimetres in one unit of the file."""
        return MM_PER_UNIT[self.unit]

    def points(self, points: Array) -> Array:
        """Points (..., 3) mm of the world in the file's units and axes."""
        return points @ self.turn.T / self.mm

    def points_back(self, points: Array) -> Array:
        """Points (..., 3) of the file in the world, mm."""
        return points @ self.turn * self.mm

    def turns(self, turns: Array) -> Array:
        """Rotations (..., 3, 3) of the world written in the file's axes."""
        return self.turn @ turns @ self.turn.T

    def turns_back(self, turns: Array) -> Array:
        """Rotations (..., 3, 3) of the file written in the world's axes."""
        return self.turn.T @ turns @ self.turn
