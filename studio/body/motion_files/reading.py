"""Skeletons in motion out of a file, whatever its format."""

from pathlib import Path

from studio.body.motion_files.acclaim import read_acclaim
from studio.body.motion_files.bvh import read_bvh
from studio.body.motion_files.humanoid_arrays import read_humanoid_arrays
from studio.body.motion_files.recorded_motion import RecordedMotion
from studio.foundations.errors import StudioError


def read_recording(path: Path, skeleton: Path | None = None) -> RecordedMotion:
    """The motion in a file, by its ending: .amc, .bvh or .npz. Raises StudioError naming the endings there are."""
    ending = path.suffix.lower()
    if ending == ".amc":
        return read_acclaim(path, skeleton)
    readers = {".bvh": read_bvh, ".npz": read_humanoid_arrays}
    if ending not in readers:
        raise StudioError(
            f"'{path.name}' is no motion file that can be read.", "Give an .amc, .bvh or .npz file."
        )
    return readers[ending](path)
