"""The formats that a run can be exported to, what opens and writes them, and which options each takes.

A new one is one module and one entry here, or a package's entry point (`studio.foundations.registry`).
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from studio.foundations.declaring import Web
from studio.foundations.errors import ExportError
from studio.foundations.knobs import knobs_of
from studio.foundations.registry import Registry
from studio.results.export.bvh_writing import write_bvh
from studio.results.export.glb_writing import write_glb
from studio.results.export.marker_files import write_c3d_file, write_cameras, write_trc_file
from studio.results.export.mot_file import write_mot
from studio.results.export.nwb_writing import write_nwb
from studio.results.export.options import ExportOptions
from studio.results.export.overlay_video import write_videos
from studio.results.export.sleap_writing import write_sleap
from studio.results.export.table_files import write_csv, write_npz, write_parquet
from studio.results.export.task import Writer
from studio.results.export.usd_writing import write_usd

FRAMES = ("track", "first", "last", "fps", "lost")
POINTS = (*FRAMES, "unit", "up", "names")


@dataclass(frozen=True, slots=True)
class ExportFormat:
    """One format.

    name : as in `--to FILE.name`.
    opens : a line on what opens it.
    takes : names of the options that mean something here.
    write : makes the file; None for a scene's recording, which the room of the scene writes.
    unit, up : what "auto" stands for.
    what : "motion", "video", "scene" or "cameras".
    """

    name: str
    title: str
    opens: str
    takes: tuple[str, ...]
    write: Annotated[Writer | None, Web(left_out=True)]
    unit: str = ""
    up: str = ""
    what: str = "motion"
    media_type: str = "application/octet-stream"


_OWN = (
    ExportFormat(
        "bvh",
        "BVH skeleton animation",
        "Opens in Blender, Maya, MotionBuilder and Unity add-ons; the body as joints with rotations.",
        (*POINTS, "rest", "euler"),
        write_bvh,
        unit="m",
        up="y",
        media_type="text/plain; charset=utf-8",
    ),
    ExportFormat(
        "glb",
        "GLB animated body",
        "Opens in Blender, Unity, Godot, three.js and Windows' 3D viewer; skeleton, cones and motion in one file.",
        (*FRAMES, "names", "rest"),
        write_glb,
        unit="m",
        up="y",
        media_type="model/gltf-binary",
    ),
    ExportFormat(
        "usd",
        "USD animated body",
        "Opens in Houdini, Omniverse, Unreal, Blender and usdview; skeleton, cones and motion. Needs the extra usd.",
        (*FRAMES, "names", "rest"),
        write_usd,
        unit="m",
        up="y",
        media_type="model/vnd.usd",
    ),
    ExportFormat(
        "trc",
        "TRC markers",
        "Opens in OpenSim and Pose2Sim; points over time, gaps left blank.",
        POINTS,
        write_trc_file,
        unit="m",
        up="y",
        media_type="text/plain; charset=utf-8",
    ),
    ExportFormat(
        "mot",
        "OpenSim motion",
        "Opens in OpenSim beside the TRC: the body's joint angles in degrees over time, places in m.",
        FRAMES,
        write_mot,
        media_type="text/plain; charset=utf-8",
    ),
    ExportFormat(
        "c3d",
        "C3D markers",
        "Opens in Vicon Nexus, Qualisys, Mokka, Visual3D and OpenSim; points over time, gaps marked.",
        (*POINTS, "split"),
        write_c3d_file,
        unit="mm",
        up="z",
    ),
    ExportFormat(
        "csv",
        "CSV table",
        "Opens in any spreadsheet, R and pandas; a row a frame with every angle and point. Or as DeepLabCut and anipose"
        " write points (layout).",
        (*POINTS, "angles", "layout"),
        write_csv,
        unit="mm",
        up="z",
        media_type="text/csv; charset=utf-8",
    ),
    ExportFormat(
        "parquet",
        "Parquet table",
        "Opens in pandas, polars, R and DuckDB; a row a point and frame, with confidence.",
        POINTS,
        write_parquet,
        unit="mm",
        up="z",
    ),
    ExportFormat(
        "npz",
        "NPZ arrays",
        "Opens with numpy.load: poses, points, joints and confidence as arrays.",
        POINTS,
        write_npz,
        unit="mm",
        up="z",
    ),
    ExportFormat(
        "nwb",
        "NWB pose estimates",
        "Opens in movement, pynwb and DANDI (ndx-pose); points, skeleton and confidence. Needs the extra labs.",
        POINTS,
        write_nwb,
        unit="mm",
        up="z",
        media_type="application/x-hdf5",
    ),
    ExportFormat(
        "h5",
        "SLEAP analysis file",
        "Opens in movement and keypoint-moseq, as SLEAP's analysis.h5 with three coordinates; or in pandas, as"
        " DeepLabCut's points in space (layout). Needs the extra labs.",
        (*POINTS, "layout"),
        write_sleap,
        unit="mm",
        up="z",
        media_type="application/x-hdf5",
    ),
    ExportFormat(
        "mp4",
        "Overlay video",
        "Plays anywhere; each camera's footage with the body drawn over it.",
        ("track", "first", "last", "camera", "height"),
        write_videos,
        what="video",
        media_type="video/mp4",
    ),
    ExportFormat(
        "viser",
        "Scene recording",
        "Plays in viser's own browser client: the 3-D scene with body and cameras, to be viewed from any side.",
        ("track", "first", "last", "lost"),
        None,
        what="scene",
    ),
    ExportFormat(
        "html",
        "Scene page",
        "Opens in any browser, nothing installed: the same scene as one page, played and turned with the mouse.",
        ("track", "first", "last", "lost"),
        None,
        what="scene",
        media_type="text/html; charset=utf-8",
    ),
    ExportFormat(
        "toml",
        "Calibration TOML",
        "Opens in Pose2Sim, anipose, FreeMoCap and Caliscope; the cameras of the run.",
        ("calibration",),
        write_cameras,
        what="cameras",
        media_type="application/toml",
    ),
    ExportFormat(
        "yml",
        "OpenCV calibration",
        "Opens with OpenCV's FileStorage; the cameras of the run.",
        ("calibration",),
        write_cameras,
        what="cameras",
        media_type="application/yaml",
    ),
)


def _check(form: ExportFormat) -> None:
    """Raise ExportError where there is no writer, or an option that exports do not have."""
    if form.write is None:
        raise ExportError("it has no writer")
    for option in form.takes:
        if option not in (entry.name for entry in knobs_of(ExportOptions)):
            raise ExportError(f"exports have no option '{option}'")


FORMATS: Registry[ExportFormat] = Registry("export format", "studio.exports", ExportFormat, _OWN, _check)


def format_of(name: str) -> ExportFormat:
    """A format by its name or a file's ending. Raises SettingsError."""
    return FORMATS[name.lower().removeprefix(".")]


def format_of_file(path: Path) -> ExportFormat:
    """The format that a file's ending names. Raises ExportError, SettingsError."""
    if not path.suffix:
        raise ExportError(
            f"'{path.name}' has no ending that names a format.", f"End it in one of .{', .'.join(FORMATS)}."
        )
    return format_of(path.suffix)
