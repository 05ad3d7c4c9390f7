# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false
# pynwb and ndx-pose have no types.
"""NWB with ndx-pose, as DANDI keeps it and `movement` reads it: the points as pose estimates with their skeleton.

Needs the extra `labs`. Confidence is the frame's, the same for all points: the search has none by point.
"""

from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.extras import load_extra
from studio.results.export.marker_files import marked_points, unit_and_point_notes
from studio.results.export.naming import Points
from studio.results.export.task import ExportTask, Written, agreed, apart

EXTRA = "labs"
SERIES = "PoseEstimation"


def write_nwb(task: ExportTask) -> Written:
    """Write the points, the pose's entries and their confidence, and read them back.

    Raises StudioError without the extra, ExportError where the file does not read back.
    """
    nwb, pose = load_extra("pynwb", EXTRA), load_extra("ndx_pose", EXTRA)
    points, places = marked_points(task)
    source = task.source
    file = nwb.NWBFile(
        session_description=f"Run '{source['run']}' of session '{source['session']}', track '{source['track']}'.",
        identifier="/".join((source["session"], source["run"], source["track"])),
        session_start_time=datetime.fromisoformat(task.run.record.created),
        source_script=f"capture studio {task.run.record.software}".rstrip(),
        source_script_file_name="studio export",
    )
    skeleton = pose.Skeleton(
        name=source["body"],
        nodes=list(points.names),
        edges=np.array(points.edges(task.motion.body), np.uint8),
    )
    behaviour = file.create_processing_module("behavior", "Motion recovered from calibrated cameras.")
    behaviour.add(pose.Skeletons(skeletons=[skeleton]))
    behaviour.add(
        pose.PoseEstimation(
            name=SERIES,
            pose_estimation_series=_series(task, pose, points, task.axes.points(places)),
            description=f"Points of body '{source['body']}' in the cameras' world, {task.options.up} up.",
            scorer=task.run.record.tracker,
            source_software="capture studio",
            source_software_version=task.run.record.software or "unknown",
            skeleton=skeleton,
        )
    )
    poses = np.where(task.motion.known[:, None], task.motion.poses, np.nan)
    names = ", ".join(entry.name for entry in task.motion.body.parameters)
    behaviour.add(
        nwb.TimeSeries(
            name="pose",
            data=poses,
            unit="rad and mm",
            description=f"The body's parameters: {names}.",
            **_times(task),
        )
    )
    task.step("writing", 0, 2)
    with nwb.NWBHDF5IO(str(task.place), "w") as stream:
        stream.write(file)
    task.step("reading back", 1, 2)
    read = _read_points(task.place, nwb, points.names)
    checked = agreed(task.place, apart(task.axes.points_back(read), places))
    notes = unit_and_point_notes(task, points, "NaN")
    return Written((task.place,), checked, (*notes, "The session's start is when the run was made."))


def _times(task: ExportTask) -> dict[str, float]:
    return {"rate": task.motion.fps, "starting_time": float(task.motion.frames[0]) / task.run.record.fps}


def _series(task: ExportTask, pose: Any, points: Points, places: Array) -> list[Any]:  # noqa: ANN401
    return [
        pose.PoseEstimationSeries(
            name=name,
            description=f"Point {name}.",
            data=places[:, at],
            unit=task.options.unit,
            reference_frame=f"The world of the calibration, {task.options.up} up.",
            confidence=task.motion.confidence,
            confidence_definition="The tracker's confidence in the whole pose of the frame, 0 to 1; NaN unknown.",
            **_times(task),
        )
        for at, name in enumerate(points.names)
    ]


def _read_points(place: Path, nwb: Any, names: tuple[str, ...]) -> Array:  # noqa: ANN401
    with nwb.NWBHDF5IO(str(place), "r") as stream:
        series = stream.read().processing["behavior"][SERIES].pose_estimation_series
        return np.stack([np.asarray(series[name].data) for name in names], axis=1)
