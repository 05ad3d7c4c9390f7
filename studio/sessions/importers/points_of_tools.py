"""The points in space that other tools leave beside their footage, taken for a session's truth.

    Pose2Sim    pose-3d/*.trc                             the filtered ones where there are such
    anipose     pose-3d/*.csv (pose-3d-filtered)          in the calibration's unit
    FreeMoCap   output_data/raw_data/*3d*.npy             before it is stood upright and filtered
    Caliscope   <take>/<TRACKER>/xyz_<TRACKER>_labelled.csv
    OpenCap     MarkerData/<trial>.trc                    in a world of its own: the board's, turned and lowered
    DANNCE      *dannce.mat (labelData), save_data_AVG.mat
    any         pose-3d/*.h5, *.nwb as DeepLabCut, SLEAP and ndx-pose write them

Of several takes the one is chosen that is named like the footage; where that leaves several, none is.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from studio.footage.capture.naming import natural_key
from studio.foundations.errors import FootageError
from studio.foundations.foreign_files import LARGEST_RECORD, foreign_file, read_foreign_text

PLACES = (
    "pose-3d-filtered/*",
    "pose-3d/*",
    "MarkerData/PostAugmentation/*",
    "MarkerData/*",
    "output_data/raw_data/*3[dD]*.npy",
    "*/xyz_*_labelled.csv",
    "DANNCE/predict_results/save_data_AVG*.mat",
    "*dannce.mat",
    "*Label3D.mat",
)
"""Patterns below the folder of a take, the first that has points counts."""
ENDINGS = (".trc", ".csv", ".h5", ".nwb", ".npy", ".mat")
OWN_WORLD = "MarkerData"
"""Folders whose points are in another world than the calibration's."""
DANNCE_PROJECT = "io.yaml"
LABEL3D_FILE = re.compile(r"^[\s-]*label3d_file:\s*['\"]?([^'\"#\n]+?)['\"]?\s*(?:#.*)?$", re.MULTILINE)
REFINED = ("_filt", "_lstm")
"""Marks in Pose2Sim's names of what was filtered or completed."""


@dataclass(frozen=True, slots=True)
class ToolPoints:
    """A file of points. placed : whether it is in the world of the calibration."""

    path: Path
    placed: bool


def label3d_of(folder: Path) -> Path | None:
    """The file of cameras and labels that a DANNCE project names (io.yaml), None without one, with several, or where it
    lies outside the folder.
    """
    project = folder / DANNCE_PROJECT
    if not project.is_file():
        return None
    with foreign_file(project, FootageError, "DANNCE's io.yaml", "Remove it, or write it again."):
        text = read_foreign_text(project, LARGEST_RECORD, FootageError)
        named = {(folder / name.strip()).resolve() for name in LABEL3D_FILE.findall(text)}
        files = [path for path in named if path.is_relative_to(folder.resolve()) and path.is_file()]
    return folder / files[0].relative_to(folder.resolve()) if len(files) == 1 else None


def points_of_tool(folder: Path, take: str) -> tuple[ToolPoints | None, str]:
    """The points of a take, None without any or with several that it could be; and then a note on these. take : ""
    where the folder holds one alone.
    """
    named = label3d_of(folder)
    if named is not None:
        return ToolPoints(named, placed=True), ""
    for pattern in PLACES:
        files = [path for path in folder.glob(pattern) if path.suffix.lower() in ENDINGS and path.is_file()]
        files = sorted(files, key=lambda path: natural_key(path.name))
        of_take = [path for path in files if take and path.stem.lower().startswith(take.lower())]
        chosen = _one(of_take or files)
        if chosen is not None:
            return ToolPoints(chosen, OWN_WORLD not in chosen.relative_to(folder).parts), ""
        if files:
            names = ", ".join(path.name for path in files[:4])
            return None, (
                f"'{files[0].parent.name}' holds points of several takes ({names}): none was taken for the truth. Put"
                " the right one into 'truth/', or give it to 'studio evaluate --truth'."
            )
    return None, ""


def _one(files: Sequence[Path]) -> Path | None:
    refined = [path for path in files if any(mark in path.stem.lower() for mark in REFINED)]
    if len(files) == 1:
        return files[0]
    return refined[0] if len(refined) == 1 and len(_stems(files)) == 1 else None


def _stems(files: Sequence[Path]) -> set[str]:
    """Names without the marks and what follows them."""
    stems = {path.stem.lower() for path in files}
    for mark in REFINED:
        stems = {stem.split(mark)[0] for stem in stems}
    return stems
