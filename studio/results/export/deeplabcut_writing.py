# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false, reportUnknownMemberType=false
# pandas is loaded where it is used.
"""DeepLabCut's HDF5 file of points in space: a table of pandas with columns scorer, bodyparts, coords, as DeepLabCut's
triangulation writes it.

Needs the extra `labs`.
"""

import numpy as np

from studio.foundations.extras import load_extra
from studio.results.export.marker_files import marked_points, unit_and_point_notes
from studio.results.export.task import ExportTask, Written, agreed, apart

EXTRA = "labs"
KEY = "df_with_missing"
SCORER = "capture studio"


def write_deeplabcut(task: ExportTask) -> Written:
    """Write M points over K frames, a row a frame, NaN in gaps, and read it back.

    Raises StudioError without the extra, ExportError where the file does not read back.
    """
    load_extra("tables", EXTRA)
    pandas = load_extra("pandas", EXTRA)
    points, places = marked_points(task)
    columns = pandas.MultiIndex.from_product(
        [[SCORER], points.names, ["x", "y", "z"]], names=["scorer", "bodyparts", "coords"]
    )
    numbers = task.axes.points(places).reshape(len(places), -1)
    table = pandas.DataFrame(numbers, index=task.motion.numbers, columns=columns)
    task.step("writing", 0, 2)
    table.to_hdf(task.place, key=KEY, format="table", mode="w")
    task.step("reading back", 1, 2)
    read = pandas.read_hdf(task.place, KEY).to_numpy().reshape(places.shape)
    checked = agreed(task.place, apart(task.axes.points_back(np.asarray(read)), places))
    return Written((task.place,), checked, unit_and_point_notes(task, points, "NaN"))
