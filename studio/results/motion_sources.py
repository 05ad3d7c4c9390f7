"""Where recorded motion comes from: files, folders of them, runs of the workspace, recipes of footage."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from studio.body.model import BodyModel
from studio.body.person import sampled
from studio.foundations.errors import StudioError
from studio.foundations.progress import Progress, no_progress
from studio.results.drawing_footage.recipe_file import recipe_names
from studio.results.drawing_footage.recipes import person_of_recipe
from studio.runs.learning.recordings import (
    FEWEST_FRAMES,
    FPS,
    MOTION_FILES,
    Recording,
    fitted_person,
    read_file,
    read_run,
)
from studio.runs.learning.resampling import frame_times
from studio.runs.learning.targets import skeleton_of_body
from studio.sessions.manifest import FILE_NAME as SESSION_FILE
from studio.sessions.run_record import FILE_NAME as RUN_FILE
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace

RECIPE = ".toml"


def read_sources(
    sources: Sequence[str | Path],
    body: BodyModel,
    skeleton: Path | None = None,
    *,
    fps: float = FPS,
    workspace: Workspace | None = None,
    progress: Progress = no_progress,
) -> tuple[Recording, ...]:
    """The recordings of all sources in order, folders expanded. Raises StudioError."""
    names = [name for source in sources for name in expand(source)]
    if not names:
        raise StudioError("There is no recording to learn from.", "Name motion files or runs.")
    recordings: list[Recording] = []
    for number, name in enumerate(names, start=1):
        words = f"{Path(name).name} ({number} of {len(names)})"

        def report(_step: str, done: int, total: int, words: str = words) -> None:
            progress(words, done, total)

        recordings.append(read_source(name, body, skeleton, fps=fps, workspace=workspace, progress=report))
    return tuple(recordings)


def read_source(
    source: str | Path,
    body: BodyModel,
    skeleton: Path | None = None,
    *,
    fps: float = FPS,
    workspace: Workspace | None = None,
    progress: Progress = no_progress,
) -> Recording:
    """The motion of a source on `body`, at `fps`.

    source : a motion file, a recipe's file or name, a run's folder, or SESSION/RUN of the workspace. skeleton : the
    ASF of an .amc; by default NN.asf beside NN_MM.amc. Raises StudioError for what cannot be read, bodies without a
    person's markers, and motion of fewer than FEWEST_FRAMES frames.
    """
    path = Path(source).expanduser()
    if path.is_file() and path.suffix.lower() != RECIPE:
        recording = read_file(path, body, skeleton, fps, progress)
    elif path.is_file() or str(source) in recipe_names():
        recording = recipe_recording(path if path.is_file() else source, body, fps=fps, progress=progress)
    else:
        recording = read_run(_find_run(str(source), workspace or Workspace()), body, fps, progress)
    if recording.frame_count < FEWEST_FRAMES:
        raise StudioError(
            f"'{recording.name}' has {recording.frame_count} frames at {fps:g} frames a second.",
            f"Give motion of at least {FEWEST_FRAMES} frames.",
        )
    return recording


def expand(source: str | Path) -> tuple[str, ...]:
    """The sources of a name: a folder's motion files in order, else the name itself.

    Raises StudioError for a folder without motion, and a session's folder, naming its runs.
    """
    path = Path(source).expanduser()
    if not path.is_dir() or (path / RUN_FILE).is_file():
        return (str(source),)
    if (path / SESSION_FILE).is_file():
        raise _runs_of(path)
    files = tuple(str(entry) for entry in sorted(path.iterdir()) if entry.suffix.lower() in MOTION_FILES)
    if not files:
        raise StudioError(
            f"Folder '{path.name}' holds no motion.", f"Motion files end in {', '.join(MOTION_FILES)}."
        )
    return files


def recipe_recording(
    recipe: str | Path,
    body: BodyModel,
    *,
    fps: float = FPS,
    options: Mapping[str, float] | None = None,
    frames: int | None = None,
    progress: Progress = no_progress,
) -> Recording:
    """The motion of a footage's recipe (a file or a bundled name) on the body's own proportions; nothing is rendered.

    options : of the motion, in place of the recipe's ({"performance": 2} is the second performance of joined clips).
    frames : instead of the recipe's, at its rate. Raises StudioError, for a recipe without a person too.
    """
    motion = person_of_recipe(recipe, skeleton_of_body(body), options=options, frames=frames)
    times = frame_times((motion.frame_count - 1) / motion.fps, fps)
    return fitted_person(sampled(motion, times, fps), body, Path(recipe).stem, progress)


def _find_run(source: str, workspace: Workspace) -> StoredRun:
    """A run by its folder, or as SESSION/RUN. Raises StudioError that lists the kinds of source."""
    folder = Path(source).expanduser()
    if (folder / RUN_FILE).is_file():
        return StoredRun(folder.absolute())
    session, slash, run = source.rpartition("/")
    if slash and folder.suffix.lower() not in (*MOTION_FILES, RECIPE):
        try:
            return workspace.resolve(session).run(run)
        except StudioError as problem:
            raise StudioError(f"Source '{source}': {problem.message}", problem.hint) from None
    raise StudioError(
        f"There is no motion '{source}'.",
        f"Give a file ending in {', '.join(MOTION_FILES)}, a recipe, or a run as SESSION/RUN.",
    )


def _runs_of(folder: Path) -> StudioError:
    runs = sorted(entry.parent.name for entry in folder.glob(f"runs/*/{RUN_FILE}"))
    return StudioError(
        f"'{folder.name}' is a session, not a motion.",
        f"Name one of its runs: {', '.join(f'{folder.name}/{run}' for run in runs) or 'there is none yet'}.",
    )
