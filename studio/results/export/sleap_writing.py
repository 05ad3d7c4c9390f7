# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false
# h5py has no types.
"""SLEAP's analysis file (HDF5) with three coordinates a point, which `movement` and keypoint-moseq read.

Needs the extra `labs`. Axes are in the order of MATLAB, as SLEAP writes them.
"""

import json

import numpy as np

from studio.foundations.errors import ExportError
from studio.foundations.extras import load_extra
from studio.results.export.deeplabcut_writing import write_deeplabcut
from studio.results.export.marker_files import marked_points, unit_and_point_notes
from studio.results.export.options import OWN
from studio.results.export.task import ExportTask, Written, agreed, apart

EXTRA = "labs"


def write_sleap(task: ExportTask) -> Written:
    """Write one track of M points (as DeepLabCut does, where that layout is requested) over K frames and read it back.

    tracks (1, 3, M, K) in the requested unit, NaN in gaps; point_scores (1, M, K) and instance_scores (1, K), the
    frame's confidence; track_occupancy (K, 1). Raises StudioError without the extra, ExportError where the file does
    not read back.
    """
    if task.options.layout == "deeplabcut":
        return write_deeplabcut(task)
    if task.options.layout != OWN:
        raise ExportError(
            f"'{task.options.layout}' has no HDF5 file of points.",
            "Choose the layout own (SLEAP's analysis file) or deeplabcut, or export to .csv.",
        )
    h5 = load_extra("h5py", EXTRA)
    points, places = marked_points(task)
    count, confidence = len(places), task.motion.confidence
    edges = np.array(points.edges(task.motion.body), np.int64).reshape(-1, 2)
    names = np.array(points.names, dtype=object)
    text = h5.string_dtype()
    task.step("writing", 0, 2)
    with h5.File(task.place, "w") as file:
        file["tracks"] = task.axes.points(places).transpose(2, 1, 0)[None]
        file["track_occupancy"] = task.motion.known[:, None].astype(np.uint8)
        file["point_scores"] = np.broadcast_to(confidence, (1, len(names), count))
        file["instance_scores"] = confidence[None]
        file["tracking_scores"] = np.full((1, count), np.nan)
        file.create_dataset("node_names", data=names, dtype=text)
        file.create_dataset("track_names", data=np.array([task.source["body"]], dtype=object), dtype=text)
        file.create_dataset("edge_names", data=names[edges], dtype=text)
        file["edge_inds"] = edges
        file.create_dataset("labels_path", data="", dtype=text)
        file.create_dataset("video_path", data="", dtype=text)
        file["video_ind"] = 0
        about = {**task.source, "unit": task.options.unit, "up": task.options.up, "fps": task.motion.fps}
        file.create_dataset(
            "provenance", data=json.dumps({**about, "first_frame": float(task.motion.frames[0])}), dtype=text
        )
    task.step("reading back", 1, 2)
    with h5.File(task.place, "r") as file:
        read = np.asarray(file["tracks"])[0].transpose(2, 1, 0)
    checked = agreed(task.place, apart(task.axes.points_back(read), places))
    notes = unit_and_point_notes(task, points, "NaN")
    return Written((task.place,), checked, (*notes, f"Row 0 is frame {task.motion.frames[0]:g}."))
