"""Motion as plain arrays of a humanoid's local quaternions, in NumPy's .npz (IsaacGymEnvs' AMP clips).

Entries: `rotation_local_xyzw` (F, J, 4), `root_translation_m` (F, 3), `local_translation_m` (J, 3),
`parent_indices` (J,), `node_names` (J,), `fps`. Metres, z up, facing x with hanging arms in the rest pose.
The clips hold every frame twice (30 recorded frames a second announced as 60): repetitions are left out.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from studio.body.motion_files.recorded_motion import RecordedMotion, moved_skeleton
from studio.foundations.arrays import Array, read_archive
from studio.foundations.errors import StudioError
from studio.foundations.foreign_files import foreign_file

ENTRIES = (
    "rotation_local_xyzw",
    "root_translation_m",
    "local_translation_m",
    "parent_indices",
    "node_names",
    "fps",
)
METRE = 1000.0


def read_humanoid_arrays(path: Path) -> RecordedMotion:
    """The motion in an .npz file. Raises StudioError naming file, entry and remedy."""
    entries = _entries(path)
    turns, root = (entries[name].astype(float) for name in ENTRIES[:2])
    offsets, parents = entries["local_translation_m"].astype(float), entries["parent_indices"]
    count = len(entries["node_names"])
    shapes = {
        "rotation_local_xyzw": ((*turns.shape[:1], count, 4), turns.shape),
        "root_translation_m": ((*turns.shape[:1], 3), root.shape),
        "local_translation_m": ((count, 3), offsets.shape),
        "parent_indices": ((count,), parents.shape),
    }
    for name, (wanted, shape) in shapes.items():
        if wanted != shape or 0 in shape:
            raise _error_of(path, name, f"has shape {shape}, not {wanted}")
    if any(parent >= joint or (parent < 0) != (joint == 0) for joint, parent in enumerate(parents)):
        raise _error_of(path, "parent_indices", "must name earlier joints, and -1 for the first alone")
    sizes = np.linalg.norm(turns, axis=-1)
    if not (np.all(np.isfinite(turns)) and np.all(np.abs(sizes - 1.0) < 1e-3)):
        raise _error_of(path, "rotation_local_xyzw", "holds quaternions that are not of length 1")
    if not (np.all(np.isfinite(root)) and np.all(np.isfinite(offsets))):
        raise _error_of(path, "root_translation_m or local_translation_m", "holds what is no number")
    fps = float(entries["fps"]) if entries["fps"].shape == () else 0.0
    if not 1.0 <= fps <= 1000.0:
        raise _error_of(path, "fps", "is not one number from 1 to 1000")
    repeated = _repetitions(turns, root)
    turns, root = turns[::repeated], root[::repeated]
    return moved_skeleton(
        tuple(str(name) for name in entries["node_names"]),
        tuple(int(parent) for parent in parents),
        offsets,
        Rotation.from_quat(turns.reshape(-1, 4)).as_matrix().reshape(len(turns), count, 3, 3),
        root,
        fps=fps / repeated,
        source=path.name,
        scale=METRE,
    )


def _repetitions(turns: Array, root: Array) -> int:
    """How often every frame is held, up to four times; 1 where frames differ."""
    frames = np.concatenate([turns.reshape(len(turns), -1), root], axis=1)
    for times in (4, 3, 2):
        firsts = np.arange(len(frames)) // times * times
        if len(frames) > 2 * times and np.array_equal(frames, frames[firsts]):
            return times
    return 1


def _entries(path: Path) -> dict[str, NDArray[np.generic]]:
    remedy = "Give the arrays as numpy.savez writes them."
    with foreign_file(path, StudioError, "an .npz file of plain arrays", remedy):
        arrays = read_archive(path)
    for name in ENTRIES:
        if name not in arrays:
            raise _error_of(path, name, "is missing")
    return arrays


def _error_of(path: Path, entry: str, what: str) -> StudioError:
    return StudioError(
        f"'{path.name}': entry '{entry}' {what}.", f"Write the entries {', '.join(ENTRIES)} as described."
    )
