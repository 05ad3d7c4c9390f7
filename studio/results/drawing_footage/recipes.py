"""From a recipe to a session: footage rendered with truth, and imported like any footage."""

import tempfile
from collections.abc import Mapping
from pathlib import Path

import msgspec
import numpy as np

from studio.body.catalogue import load_body
from studio.body.inverse_kinematics import known_markers, pose_from_markers
from studio.body.motion_files.reading import read_recording
from studio.body.motion_files.recorded_motion import RecordedMotion
from studio.body.motion_files.trc import MarkerMotion, write_trc
from studio.body.person import PersonMotion, Skeleton, first_frames, marker_motion
from studio.body.subject import Subject, fit_subject, write_subject
from studio.footage.capture.calibration_files import read_calibration, write_calibration
from studio.foundations.errors import BodyError, SessionError, StudioError
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress, no_progress
from studio.results.drawing_footage.arm_footage import render_arm
from studio.results.drawing_footage.body_footage import TRUE_POSES, render_body
from studio.results.drawing_footage.damage import cameras_left, misplaced
from studio.results.drawing_footage.motions import make_motion
from studio.results.drawing_footage.person import (
    marker_lengths,
    proportioned,
    skeleton_of_height,
    skeleton_of_subject,
    subject_of_file,
    with_hands_and_feet,
)
from studio.results.drawing_footage.person_footage import recipe_renderer, render_person
from studio.results.drawing_footage.real_data import located
from studio.results.drawing_footage.recipe_file import (
    JOINED,
    KEYS,
    RECORDED,
    Recipe,
    find_recipe,
    named_recipe,
    read_recipe,
    recipe_cameras,
)
from studio.results.drawing_footage.recorded_clips import joined_person, recorded_person
from studio.results.drawing_footage.renderer import RenderedPerson, Renderer
from studio.results.drawing_footage.wardrobes import dressed
from studio.sessions.importers.bodytrack import RATE, read_numbers
from studio.sessions.importers.importing import ImportOptions, import_source
from studio.sessions.manifest import read_manifest, write_manifest
from studio.sessions.named_rows import write_pose, write_sigma
from studio.sessions.session import BESIDE

ARM = "arm"
RECIPE_COPY = "recipe.toml"
SUBJECT_OF_SHAPE, SUBJECT_OF_HEIGHT, SIGMA_NAME = "subject_shape.toml", "subject_height.toml", "sigma.csv"


def synthesize(
    recipe: Path | str, into: Path, progress: Progress = no_progress, frames: int | None = None
) -> Path:
    """Render a recipe's footage and make a session of it; returns the session's folder.

    recipe : a TOML file or the name of a bundled recipe. into : the session folder to be made. progress : called
    with (step, done, total). frames : only this many first frames of a moving person or body. The same
    recipe gives the same pictures on any number of threads. Raises StudioError for an impossible recipe and the errors
    of `import_source`.
    """
    path = find_recipe(recipe)
    parsed = read_recipe(path)
    if into.exists():
        raise SessionError(f"'{into}' exists already.", "Give the folder of a new session.")
    with tempfile.TemporaryDirectory(prefix="studio-synthesis-") as folder:
        source = Path(folder) / into.name
        source.mkdir()
        render_source(parsed, path.parent, source, progress, frames)
        import_source(source, into, ImportOptions(fps=parsed.fps), progress=progress)
        for other in (SUBJECT_OF_SHAPE, SUBJECT_OF_HEIGHT, TRUE_POSES):
            if (source / other).exists():
                (into / other).write_bytes((source / other).read_bytes())
        for number, (person, motion) in enumerate(people_beside(parsed, path.parent, frames), 1):
            _write_beside(person, motion, into / BESIDE / str(number))
    manifest = read_manifest(into)
    changed = msgspec.structs.replace(
        manifest, title=parsed.title, weighting=parsed.weighting, imported_from=f"recipe {path.name}"
    )
    write_manifest(into, changed)
    (into / RECIPE_COPY).write_bytes(path.read_bytes())
    return into


def person_of_recipe(
    recipe: Path | str, skeleton: Skeleton, options: Mapping[str, float] | None, frames: int | None
) -> PersonMotion:
    """The motion of a recipe on a skeleton, nothing rendered. options, frames : in place of the recipe's own.

    Raises StudioError, for a recipe without a person too.
    """
    path = find_recipe(recipe)
    parsed = read_recipe(path)
    if parsed.motion in (ARM, KEYS):
        raise StudioError(f"Recipe '{path.name}' moves no person.", "Choose a recipe of a person.")
    changed = msgspec.structs.replace(
        parsed, options={**parsed.options, **(options or {})}, frames=frames or parsed.frames
    )
    return recipe_motion(changed, path.parent, skeleton)


def person_renderer(recipe: Recipe, folder: Path) -> tuple[Renderer, tuple[Camera, ...], int]:
    """What draws the person of a recipe into its pictures, the cameras, the number of frames. folder : the recipe
    file's. Raises StudioError.
    """
    rng = np.random.default_rng(recipe.seed)
    skeleton, _ = recipe_person(recipe, folder, rng)
    cameras = cameras_left(_cameras(recipe, folder, rng), recipe.damage.missing)
    motion = recipe_motion(recipe, folder, skeleton)
    return recipe_renderer(recipe, motion, cameras), cameras, motion.frame_count


def render_source(
    recipe: Recipe,
    recipe_folder: Path,
    source: Path,
    progress: Progress = no_progress,
    frames: int | None = None,
) -> None:
    """Write a folder for `import`: videos, background, masks, calibration, truth, subject, start pose.

    recipe_folder : where a relative `cameras.calibration` starts. source : an empty folder. frames : as in
    `synthesize`.
    """
    rng = np.random.default_rng(recipe.seed)
    if recipe.motion == ARM:
        cameras = _cameras(recipe, recipe_folder, rng)
        truth = render_arm(recipe, cameras[0], source, progress)
        cameras, subject = cameras[:1], Subject(body=recipe.body)
    elif recipe.motion == KEYS:
        cameras, count = _cameras(recipe, recipe_folder, rng), min(frames or recipe.frames, recipe.frames)
        truth, subject = render_body(recipe, recipe_folder, cameras, source, progress, count)
        cameras = misplaced(cameras, recipe.damage.calibration_px, recipe.seed)
    else:
        skeleton, shape = recipe_person(recipe, recipe_folder, rng)
        cameras = _cameras(recipe, recipe_folder, rng)
        motion = first_frames(recipe_motion(recipe, recipe_folder, skeleton), frames)
        truth, subject = marker_motion(motion), person_subject(recipe, motion)
        if shape is not None:
            subject = with_hands_and_feet(shape, skeleton)
            if recipe.include.subject:
                write_subject(shape, source / SUBJECT_OF_SHAPE)
        elif recipe.include.subject:
            write_subject(Subject(body=recipe.body, height_mm=recipe.height_mm), source / SUBJECT_OF_HEIGHT)
        if recipe.sigma:
            _write_sigma(recipe, located(recipe.sigma, recipe_folder), source / SIGMA_NAME)
        beside = [
            RenderedPerson(other, person.girth, dressed(person.wardrobe, person.colours))
            for person, other in people_beside(recipe, recipe_folder, frames)
        ]
        render_person(recipe, motion, cameras, source, progress, beside)
        cameras = misplaced(cameras, recipe.damage.calibration_px, recipe.seed)
    (source / "calibration").mkdir()
    write_calibration(cameras, source / "calibration" / "rendered.toml")
    if recipe.include.truth and len(truth.names):
        (source / "truth").mkdir(exist_ok=True)
        write_trc(source / "truth" / f"{recipe.motion}.trc", truth)
    if recipe.include.subject:
        write_subject(subject, source / "subject.toml")
    if recipe.include.start_pose and recipe.motion not in (ARM, KEYS):
        _write_start_pose(recipe, subject, truth, rng, source / "start_pose.csv")


def people_beside(
    recipe: Recipe, recipe_folder: Path, frames: int | None = None
) -> list[tuple[Recipe, PersonMotion]]:
    """The other people in a recipe's room: recipes and motions. Raises StudioError, also for other frames."""
    people: list[tuple[Recipe, PersonMotion]] = []
    for name in recipe.beside:
        path = named_recipe(name, recipe_folder)
        person = read_recipe(path)
        if person.motion in (ARM, KEYS) or (person.frames, person.fps) != (recipe.frames, recipe.fps):
            raise StudioError(
                f"Recipe '{path.name}' cannot be beside: it is not a person over {recipe.frames} frames at"
                f" {recipe.fps:g} Hz.",
                "Give both recipes the same frames and fps.",
            )
        skeleton, _ = recipe_person(person, path.parent, np.random.default_rng(person.seed))
        people.append((person, first_frames(recipe_motion(person, path.parent, skeleton), frames)))
    return people


def _write_beside(person: Recipe, motion: PersonMotion, folder: Path) -> None:
    """Truth, measures and start pose of another person, as a session of that person alone would have them."""
    folder.mkdir(parents=True)
    truth, subject = marker_motion(motion), person_subject(person, motion)
    write_trc(folder / "truth.trc", truth)
    write_subject(subject, folder / "subject.toml")
    rng = np.random.default_rng((person.seed, 11))
    _write_start_pose(person, subject, truth, rng, folder / "start_pose.csv")


def recipe_motion(recipe: Recipe, recipe_folder: Path, skeleton: Skeleton) -> PersonMotion:
    """The written or recorded motion of a recipe. Raises StudioError, also for files."""
    if recipe.motion == JOINED:
        clips = [(clip, _recording(clip.file, clip.skeleton_file, recipe_folder)) for clip in recipe.clips]
        return joined_person(clips, skeleton, recipe.frames, recipe.fps, recipe.options)
    if recipe.motion == RECORDED:
        recorded = _recording(recipe.motion_file, recipe.skeleton_file, recipe_folder)
        return recorded_person(recorded, skeleton, recipe.frames, recipe.fps, recipe.options)
    return make_motion(recipe.motion, skeleton, recipe.frames, recipe.fps, recipe.options)


def _recording(motion_file: str, skeleton_file: str, recipe_folder: Path) -> RecordedMotion:
    own = located(skeleton_file, recipe_folder) if skeleton_file else None
    return read_recording(located(motion_file, recipe_folder), own)


def recipe_person(
    recipe: Recipe, recipe_folder: Path, rng: np.random.Generator
) -> tuple[Skeleton, Subject | None]:
    """The skeleton of a recipe's person, and the subject of its shape file where it has one.

    Raises BodyError for a shape that does not fit the recipe's body.
    """
    if not recipe.shape:
        return proportioned(skeleton_of_height(recipe.height_mm, rng), recipe.proportions), None
    subject = subject_of_file(located(recipe.shape, recipe_folder), recipe.body)
    return skeleton_of_subject(subject), subject


def person_subject(recipe: Recipe, motion: PersonMotion) -> Subject:
    """The rendered person as taped: height and the distances between neighbouring markers."""
    lengths = {pair: round(length, 1) for pair, length in marker_lengths(motion).items()}
    return Subject(body=recipe.body, height_mm=recipe.height_mm, lengths_mm=lengths)


def _cameras(recipe: Recipe, recipe_folder: Path, rng: np.random.Generator) -> tuple[Camera, ...]:
    """The synthetic cameras, or those of the recipe's calibration."""
    if recipe.cameras.calibration:
        return read_calibration(located(recipe.cameras.calibration, recipe_folder)).cameras
    return recipe_cameras(recipe, rng)


def _write_sigma(recipe: Recipe, given: Path, path: Path) -> None:
    """The first numbers of a file as σ0 of the recipe's body, at the rate of the data that they come from."""
    names = tuple(entry.name for entry in load_body(recipe.body).parameters)
    numbers = read_numbers(given)
    if numbers is None or len(numbers) < len(names):
        raise BodyError(
            f"'{given.name}' does not begin with the {len(names)} σ of body '{recipe.body}'.",
            "Name the file of that body's parameters, or leave sigma out.",
        )
    write_sigma(path, names, numbers[: len(names)], RATE)


def _write_start_pose(
    recipe: Recipe, subject: Subject, truth: MarkerMotion, rng: np.random.Generator, path: Path
) -> None:
    """The subject's pose in frame 0 with an annotator's error: inverse kinematics on the true markers, each coordinate
    moved by normal noise of `start_pose_noise_mm` (so it is close to the truth, not the truth).
    """
    body, _ = fit_subject(load_body(recipe.body), subject)
    kept, names = known_markers(body, truth.names)
    points = truth.positions[0, kept]
    points = points + rng.normal(0.0, recipe.include.start_pose_noise_mm, points.shape)
    pose, _ = pose_from_markers(body, names, points, body.neutral)
    write_pose(path, tuple(entry.name for entry in body.parameters), pose)
