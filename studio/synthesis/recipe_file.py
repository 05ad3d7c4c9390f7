"""What footage is to be made: the entries of a recipe file (TOML), checked, and the recipes that come
along.
"""

import tomllib
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import tomli_w

from studio.errors import StudioError
from studio.geometry.camera import Camera
from studio.synthesis.cameras import RIGS, placed_camera
from studio.synthesis.damage import Damage
from studio.synthesis.joined_clips import Clip
from studio.synthesis.person import Proportions
from studio.synthesis.rooms import ROOMS, is_room
from studio.synthesis.wardrobes import MATERIALS, WARDROBES
from studio.typed_decoding import decode_toml

RECIPES = Path(__file__).parent / "recipe_files"
SUFFIX = ".toml"
RECORDED, JOINED = "recorded", "joined"
LIKE, LONGEST_CHAIN = "like", 5


class Picture(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Pictures. noise : standard deviation of the sensor's noise at mid grey, levels. samples : rays along
    a pixel's side. quality : x264's constant rate factor of the footage. empty_frames : length of the
    empty clip.
    """

    width: int = 640
    height: int = 480
    noise: float = 2.0
    samples: int = 2
    quality: float = 24.0
    empty_frames: int = 12


class Placed(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A camera put down by hand: mm, degrees, pixels."""

    name: str
    position: tuple[float, float, float]
    look_at: tuple[float, float, float]
    focal_px: float
    roll_degrees: float = 0.0
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)


class Cameras(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Which cameras: a made-up rig ("corners": four; "five", around a hall), a calibration file or folder (in the real
    data after "data:"), or `placed` ones."""

    rig: str = ""
    calibration: str = ""
    placed: tuple[Placed, ...] = ()


class Include(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What goes into the session beside footage and calibration.

    background : "clip", "picture" or "none". start_pose_noise_mm : how far the markers are moved (normal,
    each coordinate) before the start pose is fitted.
    """

    background: str = "clip"
    masks: bool = False
    truth: bool = True
    subject: bool = True
    start_pose: bool = True
    start_pose_noise_mm: float = 2.0


class Recipe(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Footage to be made.

    motion : "walk", "run", "box", "handstand", "stand", "circuit" and others (`motions.py`); or "arm", which shows
    `body` itself, seen by one camera, as in Deutscher & Reid 6.1; or "recorded", the motion of `motion_file` (.amc,
    .bvh, .npz; `skeleton_file` for an .amc whose ASF is not beside it); or "joined", several `clips` of such motion one
    after the other (`joined_clips.py`). options : numbers of the motion. weighting : what runs of the session use by
    default. An entry `like` in the file names another recipe, bundled or beside it, whose entries count where this
    one has none of its own.

    height_mm : of a person with published proportions. shape : instead, a file of `body`'s dimensions, whose lengths
    the person's bones have; the session's subject has these dimensions, radii included, and those of the rendered
    hands and shoes; `subject_shape.toml` beside it has the file's dimensions alone. girth : how much stouter than
    usual the flesh is. proportions : of the bones, where they differ from the published ones. wardrobe : "striped" or
    "plain" clothes, which hardly stand out in the "office". colours : other ones for some of what is worn, RGB 0...1.
    room : "office", "furnished", "hall", or "drawn-" and a number, which furnishes a room by chance. damage : what went
    wrong with the take.
    sigma : a file whose first numbers are the session's σ0, one for each parameter of `body`, from frame to frame at
    60 Hz. Files count from the recipe's folder, or lie in the real data after "data:" (`real_data.py`).
    """

    title: str
    motion: str
    motion_file: str = ""
    skeleton_file: str = ""
    clips: tuple[Clip, ...] = ()
    frames: int
    fps: float = 60.0
    seed: int = 1
    body: str = "human31"
    height_mm: float = 1760.0
    shape: str = ""
    girth: float = 1.0
    proportions: Proportions = Proportions()
    wardrobe: str = "striped"
    colours: dict[str, tuple[float, float, float]] = {}
    room: str = "furnished"
    sigma: str = ""
    weighting: str = ""
    options: dict[str, float] = {}
    cameras: Cameras = Cameras()
    picture: Picture = Picture()
    include: Include = Include()
    damage: Damage = Damage()


def find_recipe(name_or_path: str | Path) -> Path:
    """The recipe's file: a path, or the name of one that comes along. Raises StudioError listing those."""
    path = Path(name_or_path)
    if path.is_file():
        return path
    bundled = RECIPES / f"{name_or_path}{SUFFIX}"
    if bundled.parent == RECIPES and bundled.is_file():
        return bundled
    raise StudioError(
        f"There is no recipe '{name_or_path}'.",
        f"Give a TOML file or one of {', '.join(recipe_names())}.",
    )


def recipe_names() -> tuple[str, ...]:
    """The recipes that come along."""
    return tuple(sorted(path.stem for path in RECIPES.glob(f"*{SUFFIX}")))


def read_recipe(path: Path) -> Recipe:
    """The recipe in a file. Raises StudioError naming file, entry and remedy."""
    try:
        recipe = decode_toml(tomli_w.dumps(_entries(path, LONGEST_CHAIN)), Recipe)
    except OSError as problem:
        raise StudioError(
            f"Recipe '{path}' cannot be read ({problem.strerror}).", "Check the path."
        ) from None
    except (msgspec.DecodeError, tomllib.TOMLDecodeError, UnicodeDecodeError) as problem:
        cause = f"Recipe '{path.name}': {str(problem).replace('`', chr(39))}."
        raise StudioError(cause, "Correct the entry; the bundled recipes are examples.") from None
    problem = _problem(recipe)
    if problem:
        raise StudioError(f"Recipe '{path.name}': {problem}.", "Correct the entry.")
    return recipe


def _entries(path: Path, chain: int) -> dict[str, Any]:
    """The entries of a file, those of the recipe that it is like included. Raises StudioError for an endless chain."""
    own = tomllib.loads(path.read_text(encoding="utf-8"))
    base = own.pop(LIKE, None)
    if base is None:
        return own
    if chain == 0 or not isinstance(base, str):
        raise StudioError(
            f"Recipe '{path.name}': 'like' does not lead to a whole recipe.", "Correct the entry."
        )
    beside = path.with_name(base)
    whole = _entries(beside if beside.is_file() else find_recipe(base), chain - 1)
    # Cameras are one choice of several: they are taken as a whole.
    merged = {
        name: {**whole[name], **entry}
        if isinstance(entry, dict) and isinstance(whole.get(name), dict) and name != "cameras"
        else entry
        for name, entry in own.items()
    }
    return {**whole, **merged}


def recipe_cameras(recipe: Recipe, rng: np.random.Generator) -> tuple[Camera, ...]:
    """The cameras that are made up or put down by hand (those of a calibration file are read by the
    caller).
    """
    size = (recipe.picture.width, recipe.picture.height)
    if recipe.cameras.placed:
        return tuple(
            placed_camera(
                entry.name,
                entry.position,
                entry.look_at,
                size=size,
                focal_px=entry.focal_px,
                roll=float(np.radians(entry.roll_degrees)),
                distortion=entry.distortion,
            )
            for entry in recipe.cameras.placed
        )
    return RIGS[recipe.cameras.rig](size, rng)


def _problem(recipe: Recipe) -> str:
    """What is wrong with a recipe whose entries have the right types, "" when nothing is."""
    picture, include, cameras = recipe.picture, recipe.include, recipe.cameras
    checks = (
        (not 1 <= recipe.frames <= 100_000, f"frames is {recipe.frames}, not 1 to 100000"),
        (not 1.0 <= recipe.fps <= 1000.0, f"fps is {recipe.fps:g}, not 1 to 1000"),
        (not 300.0 <= recipe.height_mm <= 3000.0, f"height_mm is {recipe.height_mm:g}, not 300 to 3000"),
        (
            not is_room(recipe.room),
            f"room is '{recipe.room}', not one of {', '.join(ROOMS)}, or 'drawn-' and a number",
        ),
        (
            recipe.wardrobe not in WARDROBES,
            f"wardrobe is '{recipe.wardrobe}', not one of {', '.join(WARDROBES)}",
        ),
        (
            not set(recipe.colours) <= set(MATERIALS),
            f"colours are of {', '.join(MATERIALS)}, not of {', '.join(sorted(set(recipe.colours) - set(MATERIALS)))}",
        ),
        (
            not all(0.0 <= value <= 1.0 for colour in recipe.colours.values() for value in colour),
            "colours are RGB from 0 to 1",
        ),
        (not 0.5 <= recipe.girth <= 2.0, f"girth is {recipe.girth:g}, not 0.5 to 2"),
        (
            not all(0.7 <= value <= 1.4 for value in msgspec.structs.astuple(recipe.proportions)),
            "proportions are factors from 0.7 to 1.4",
        ),
        (bool(recipe.shape) and recipe.proportions != Proportions(), "proportions belong to no shape file"),
        (
            recipe.motion == "arm" and recipe.damage != Damage(),
            "damage is done to footage of a person, not to motion 'arm'",
        ),
        (not 0 <= recipe.damage.clutter <= 24, f"damage.clutter is {recipe.damage.clutter}, not 0 to 24"),
        (
            not 0.0 <= recipe.damage.calibration_px <= 50.0,
            f"damage.calibration_px is {recipe.damage.calibration_px:g}, not 0 to 50",
        ),
        (
            not 0.0 <= recipe.damage.shutter <= 1.0,
            f"damage.shutter is {recipe.damage.shutter:g}, not 0 to 1",
        ),
        (
            recipe.motion == "arm" and bool(recipe.shape or recipe.sigma),
            "shape and sigma belong to a person, not to motion 'arm'",
        ),
        (not 16 <= picture.width <= 8192, f"picture.width is {picture.width}, not 16 to 8192"),
        (not 16 <= picture.height <= 8192, f"picture.height is {picture.height}, not 16 to 8192"),
        (bool(picture.width % 2 or picture.height % 2), "picture sides must be even for H.264"),
        (not 0.0 <= picture.noise <= 40.0, f"picture.noise is {picture.noise:g}, not 0 to 40"),
        (not 1 <= picture.samples <= 4, f"picture.samples is {picture.samples}, not 1 to 4"),
        (not 0.0 <= picture.quality <= 51.0, f"picture.quality is {picture.quality:g}, not 0 to 51"),
        (
            (recipe.motion == RECORDED) != bool(recipe.motion_file),
            f"motion '{RECORDED}' and an entry motion_file belong together",
        ),
        ((recipe.motion == JOINED) != bool(recipe.clips), f"motion '{JOINED}' and [[clips]] belong together"),
        (picture.empty_frames < 1, "picture.empty_frames must be 1 or more"),
        (cameras.rig not in ("", *RIGS), f"cameras.rig is '{cameras.rig}', not one of {', '.join(RIGS)}"),
        (
            sum(map(bool, (cameras.rig, cameras.calibration, cameras.placed))) != 1,
            "[cameras] must hold one of rig, calibration, placed",
        ),
        (
            include.background not in ("clip", "picture", "none"),
            f"include.background is '{include.background}', not clip, picture or none",
        ),
    )
    return next((words for wrong, words in checks if wrong), "")
