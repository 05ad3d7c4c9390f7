"""The run's cameras for other tools, read back and compared."""

import numpy as np

from studio.capture.calibration_files import CALIBRATION_FORMATS, export_calibration, read_calibration
from studio.errors import ExportError
from studio.export.task import ExportTask, Written, agreed, turned_apart

USUAL = {".toml": "pose2sim", ".yml": "opencv"}


def write_cameras(task: ExportTask) -> Written:
    """Write the run's cameras with `options.calibration`, or the ending's usual writer. Raises ExportError for a writer
    that there is not, or that writes another kind of file.
    """
    name = task.options.calibration or USUAL[task.place.suffix]
    writer = CALIBRATION_FORMATS.get(name)
    if writer is None or writer.suffix != task.place.suffix:
        fitting = [known for known, entry in CALIBRATION_FORMATS.items() if entry.suffix == task.place.suffix]
        raise ExportError(
            f"No calibration '{name[:40]}' is written as '{task.place.suffix}'.",
            f"Choose {' or '.join(fitting)}.",
        )
    cameras = task.run.cameras()
    task.step("writing", 0, 2)
    written = export_calibration(cameras, task.place, name)
    task.step("reading back", 1, 2)
    source = task.place if written.files == (task.place,) else task.place.parent
    read = {camera.name: camera for camera in read_calibration(source).cameras}
    missing = [camera.name for camera in cameras if camera.name not in read]
    if missing:
        raise ExportError(
            f"Camera '{missing[0]}' does not read back from '{task.place.name}'.",
            "Rename it, and export again.",
        )
    apart_mm = max(float(np.linalg.norm(camera.centre - read[camera.name].centre)) for camera in cameras)
    turned = max(turned_apart(camera.rotation[None], read[camera.name].rotation[None]) for camera in cameras)
    checked = agreed(task.place, apart_mm, turned)
    return Written(
        tuple(written.files),
        f"{len(cameras)} {'camera' if len(cameras) == 1 else 'cameras'}, {checked}",
        tuple(written.notes),
    )
