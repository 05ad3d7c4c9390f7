"""Files for other programs."""

from pathlib import Path

from studio.export.exporting import ExportReport
from studio.export.exporting import export_run as write_run
from studio.export.formats import format_of_file
from studio.notebook.opening import RunName, open_run, session_of
from studio.notebook.progress import Told, told
from studio.scene.recording import record_scene


def export_run(run: RunName, to: str | Path, *, progress: Told = None, **options: object) -> ExportReport:
    """Write the motion to a file that other programs open; its ending is the format.

    .bvh .trc .mot .c3d .glb .csv .parquet .npz .mp4 .viser. options : as of the command, such as track="raw" (default
    the best there is; the answer's .track names it), fps=30, unit="m", names="mixamo". The file is read back before it
    takes its place. Raises ExportError, SettingsError.
    """
    place = Path(to)
    stored, form = open_run(run), format_of_file(place)
    with told(progress, f"{stored.session_name} / {stored.name}: {form.title}") as report:
        return write_run(
            session_of(stored), stored, form, options, place, progress=report, record_scene=record_scene
        )
