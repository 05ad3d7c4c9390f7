"""The parts found in a source, before any of it is opened or copied."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from studio.body.subject import Subject
from studio.footage.capture.interlacing import Fields
from studio.foundations.arrays import Array
from studio.sessions.importers.points_of_tools import ToolPoints


@dataclass(frozen=True, slots=True)
class SourcePlan:
    """The parts of a source.

    calibration : a file, or the folder of several .cal files; None where footage is added without. footage, masks :
    videos and folders of pictures. backgrounds : pictures and clips. fps : known frame rate or None. subject,
    start_pose, sigma :
    values where the layout has its own form for them; the files of the same names otherwise.
    sigma_fps : the rate at which sigma was measured. tracker, weighting : defaults for runs of the session, "" for
    the studio's. layout : name of the recognised folder layout. timestamps : a recorder's times of the frames.
    offsets, rotations : given by hand, by the name of a camera or its footage. masks_inverted : black is the person.
    fields : the earlier field of footage that was split into its fields before, by camera. split : as of
    `ImportOptions.fields`. names : cameras of footage that its folder is named after.
    points : what the tool that made the folder left.
    """

    source: Path
    calibration: Path | None
    footage: tuple[Path, ...]
    masks: tuple[Path, ...] = ()
    backgrounds: tuple[Path, ...] = ()
    truth: tuple[Path, ...] = ()
    bodies: tuple[Path, ...] = ()
    fps: float | None = None
    subject: Subject | None = None
    subject_file: Path | None = None
    start_pose: Array | None = None
    start_pose_file: Path | None = None
    sigma: Array | None = None
    sigma_fps: float = 0.0
    sigma_file: Path | None = None
    tracker: str = ""
    weighting: str = ""
    notes: tuple[str, ...] = ()
    layout: str = ""
    timestamps: Path | None = None
    offsets: Mapping[str, int] = field(default_factory=dict[str, int])
    rotations: Mapping[str, int] = field(default_factory=dict[str, int])
    masks_inverted: bool = False
    fields: Mapping[str, Fields] = field(default_factory=dict[str, Fields])
    split: Literal["", "auto", "top", "bottom"] = ""
    names: Mapping[Path, str] = field(default_factory=dict[Path, str])
    points: ToolPoints | None = None

    def part_name(self, path: Path) -> str:
        """The name by which a video (without suffix) or folder is matched with a camera."""
        return self.names.get(path, path.name if path.is_dir() else path.stem)

    def without_person(self) -> "SourcePlan":
        """The footage alone: start pose and truth belong to a calibration."""
        return replace(
            self,
            truth=(),
            points=None,
            bodies=(),
            subject=None,
            subject_file=None,
            start_pose=None,
            start_pose_file=None,
            sigma=None,
            sigma_file=None,
        )
