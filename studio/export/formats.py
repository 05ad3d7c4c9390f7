"""The formats that a run can be exported to, what opens them, and which options each takes."""

from dataclasses import dataclass
from pathlib import Path

from studio.errors import ExportError

FRAMES = ("track", "first", "last", "fps", "lost")
POINTS = (*FRAMES, "unit", "up", "names")


@dataclass(frozen=True, slots=True)
class ExportFormat:
    """One format.

    name : as in `--to FILE.name`. opens : a line on what opens it. takes : names of the options that mean something
    here. unit, up : what "auto" stands for. what : "motion", "video", "scene" or "cameras".
    """

    name: str
    title: str
    opens: str
    takes: tuple[str, ...]
    unit: str = ""
    up: str = ""
    what: str = "motion"
    media_type: str = "application/octet-stream"


def _named(*formats: ExportFormat) -> dict[str, ExportFormat]:
    return {entry.name: entry for entry in formats}


FORMATS = _named(
    ExportFormat(
        "bvh",
        "BVH skeleton animation",
        "Opens in Blender, Maya, MotionBuilder and Unity add-ons; the body as joints with rotations.",
        (*POINTS, "rest", "euler"),
        unit="m",
        up="y",
        media_type="text/plain; charset=utf-8",
    ),
    ExportFormat(
        "glb",
        "GLB animated body",
        "Opens in Blender, Unity, Godot, three.js and Windows' 3D viewer; skeleton, cones and motion in one file.",
        (*FRAMES, "names", "rest"),
        unit="m",
        up="y",
        media_type="model/gltf-binary",
    ),
    ExportFormat(
        "trc",
        "TRC markers",
        "Opens in OpenSim and Pose2Sim; points over time, gaps left blank.",
        POINTS,
        unit="m",
        up="y",
        media_type="text/plain; charset=utf-8",
    ),
    ExportFormat(
        "mot",
        "OpenSim motion",
        "Opens in OpenSim beside the TRC: the body's joint angles in degrees over time, places in m.",
        FRAMES,
        media_type="text/plain; charset=utf-8",
    ),
    ExportFormat(
        "c3d",
        "C3D markers",
        "Opens in Vicon Nexus, Qualisys, Mokka, Visual3D and OpenSim; points over time, gaps marked.",
        (*POINTS, "split"),
        unit="mm",
        up="z",
    ),
    ExportFormat(
        "csv",
        "CSV table",
        "Opens in any spreadsheet, R and pandas; a row a frame with every angle and point.",
        (*POINTS, "angles"),
        unit="mm",
        up="z",
        media_type="text/csv; charset=utf-8",
    ),
    ExportFormat(
        "parquet",
        "Parquet table",
        "Opens in pandas, polars, R and DuckDB; a row a point and frame, with confidence.",
        POINTS,
        unit="mm",
        up="z",
    ),
    ExportFormat(
        "npz",
        "NPZ arrays",
        "Opens with numpy.load: poses, points, joints and confidence as arrays.",
        POINTS,
        unit="mm",
        up="z",
    ),
    ExportFormat(
        "mp4",
        "Overlay video",
        "Plays anywhere; each camera's footage with the body drawn over it.",
        ("track", "first", "last", "camera", "height"),
        what="video",
        media_type="video/mp4",
    ),
    ExportFormat(
        "viser",
        "Scene recording",
        "Plays in viser's own browser client: the 3-D scene with body and cameras, to be looked at from any side.",
        ("track", "first", "last", "lost"),
        what="scene",
    ),
    ExportFormat(
        "html",
        "Scene page",
        "Opens in any browser, nothing installed: the same scene as one page, played and turned with the mouse.",
        ("track", "first", "last", "lost"),
        what="scene",
        media_type="text/html; charset=utf-8",
    ),
    ExportFormat(
        "toml",
        "Calibration TOML",
        "Opens in Pose2Sim, anipose, FreeMoCap and Caliscope; the cameras of the run.",
        ("calibration",),
        what="cameras",
        media_type="application/toml",
    ),
    ExportFormat(
        "yml",
        "OpenCV calibration",
        "Opens with OpenCV's FileStorage; the cameras of the run.",
        ("calibration",),
        what="cameras",
        media_type="application/yaml",
    ),
)


def format_of(name: str) -> ExportFormat:
    """A format by its name or a file's ending. Raises ExportError."""
    found = FORMATS.get(name.lower().removeprefix("."))
    if found is None:
        raise ExportError(f"There is no export to '{name[:40]}'.", f"Choose one of {', '.join(FORMATS)}.")
    return found


def format_of_file(path: Path) -> ExportFormat:
    """The format that a file's ending names. Raises ExportError."""
    if not path.suffix:
        raise ExportError(
            f"'{path.name}' has no ending that names a format.", f"End it in one of .{', .'.join(FORMATS)}."
        )
    return format_of(path.suffix)
