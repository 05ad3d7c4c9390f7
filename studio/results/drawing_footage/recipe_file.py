"""Recipe files (TOML) of footage: their checked entries, and the bundled recipes."""

import itertools
import tomllib
from collections.abc import Iterable, Mapping
from operator import attrgetter
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import tomli_w

from studio.foundations.errors import StudioError
from studio.foundations.foreign_files import read_foreign_text
from studio.foundations.geometry.camera import Camera
from studio.foundations.typed_decoding import decode_toml, is_table
from studio.results.drawing_footage.cameras import RIGS, placed_camera
from studio.results.drawing_footage.damage import Damage
from studio.results.drawing_footage.person import Proportions
from studio.results.drawing_footage.recorded_clips import Clip
from studio.results.drawing_footage.rooms import ROOMS, is_room
from studio.results.drawing_footage.wardrobes import MATERIALS, WARDROBES

RECIPES = Path(__file__).parent / "recipe_files"
SUFFIX = ".toml"
RECORDED, JOINED, KEYS = "recorded", "joined", "keys"
HAND = "hand"
LIKE, LONGEST_CHAIN = "like", 5


class Picture(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Pictures. noise : standard deviation of the sensor's noise at mid grey, levels. samples : rays along a pixel's
    side. quality : x264's constant rate factor of the footage. empty_frames : length of the empty clip.
    """

    width: int = 640
    height: int = 480
    noise: float = 2.0
    samples: int = 2
    quality: float = 24.0
    empty_frames: int = 12


class Placed(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A camera placed by hand: mm, degrees, pixels."""

    name: str
    position: tuple[float, float, float]
    look_at: tuple[float, float, float]
    focal_px: float
    roll_degrees: float = 0.0
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)


class Cameras(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The cameras: a synthetic rig ("corners": four; "five", around a hall), a calibration file or folder (in the real
    data after "data:"), or `placed` ones."""

    rig: str = ""
    calibration: str = ""
    placed: tuple[Placed, ...] = ()


class Include(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Contents of the session besides footage and calibration.

    background : "clip", "picture" or "none". start_pose_noise_mm : standard deviation of the markers' noise (each
    coordinate) before the start pose is fitted; of a moving `body`, that of its lengths, `start_pose_noise_degrees`
    that of its angles.
    """

    background: str = "clip"
    masks: bool = False
    truth: bool = True
    subject: bool = True
    start_pose: bool = True
    start_pose_noise_mm: float = 2.0
    start_pose_noise_degrees: float = 2.0


class Key(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A pose of a body at a moment: parameter names to degrees or mm."""

    at_s: float
    pose: dict[str, float] = {}


class Recipe(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A recipe of footage.

    motion : "walk", "run", "box", "handstand", "stand", "circuit" and others (`motions.py`); or "arm", which shows
    `body` itself, seen by one camera, as in Deutscher & Reid 6.1; or "recorded", the motion of `motion_file` (.amc,
    .bvh, .npz; `skeleton_file` for an .amc whose ASF is not beside it); or "joined", several `clips` of such motion
    one after the other (`recorded_clips.py`); or "keys", which moves `body` (a name, or a body, URDF or MJCF file)
    through `keys` in the room (`body_footage.py`; option spread_degrees: the largest random change of a key's angles),
    rendered `magnify` times as large, its cones with flat ends whose edges are rounded by `edge_mm`, or by 0 with
    wholly rounded ones; or, with `flesh` "hand", in the flesh of `hand_flesh.py` around the joints of body hand25.
    sizes : dimensions of the moved body that differ from its file's, which the session does not tell. options :
    numbers of the motion. weighting : what runs of the session use by default. An entry `like` in the file names
    another recipe, bundled or beside it, whose entries are the defaults of this one.

    height_mm : of a person with published proportions. shape : instead, a file of `body`'s dimensions, whose lengths
    the person's bones have; the session's subject has these dimensions, radii included, and those of the rendered
    hands and shoes; `subject_shape.toml` beside it has the file's dimensions alone. girth : factor on the usual girths
    of the flesh. proportions : of the bones, where they differ from the published ones. wardrobe : "striped" or
    "plain" clothes, which hardly stand out in the "office". colours : replacements for some clothes, RGB 0...1. room :
    "office", "furnished", "hall", "cell", "tabletop", or "drawn-" and a number for a randomly furnished room. damage :
    faults of the footage. sigma : a file whose first numbers are the session's σ0, one for each parameter of `body`,
    from frame to frame at 60 Hz. beside : recipes (bundled or beside this one) whose people are in the room, too, over
    the same frames; their motion, build and clothes count, nothing else. Files are relative to the recipe's folder, or
    in the real data after "data:" (`real_data.py`).
    """

    title: str
    motion: str
    motion_file: str = ""
    skeleton_file: str = ""
    clips: tuple[Clip, ...] = ()
    keys: tuple[Key, ...] = ()
    magnify: float = 1.0
    edge_mm: float = 0.0
    flesh: str = ""
    sizes: dict[str, float] = {}
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
    beside: tuple[str, ...] = ()
    cameras: Cameras = Cameras()
    picture: Picture = Picture()
    include: Include = Include()
    damage: Damage = Damage()


def find_recipe(name_or_path: str | Path) -> Path:
    """The recipe's file: a path, or the name of a bundled one. Raises StudioError listing those."""
    path = Path(name_or_path)
    if path.is_file():
        return path
    bundled = RECIPES / f"{name_or_path}{SUFFIX}"
    if bundled.parent == RECIPES and bundled.is_file():
        return bundled
    raise StudioError(
        f"There is no recipe '{name_or_path}'.", f"Give a TOML file or one of {', '.join(recipe_names())}."
    )


def named_recipe(name: str, folder: Path) -> Path:
    """The file of a recipe that another one in `folder` names: beside it, else bundled. Raises StudioError."""
    own = folder / name
    return own if own.is_file() else find_recipe(name)


def recipe_names() -> tuple[str, ...]:
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
    """The entries of a file, with those of its `like` recipe. Raises StudioError for an endless chain."""
    own = tomllib.loads(read_foreign_text(path))
    base = own.pop(LIKE, None)
    if base is None:
        return own
    if chain == 0 or not isinstance(base, str):
        raise StudioError(
            f"Recipe '{path.name}': 'like' does not lead to a complete recipe.", "Correct the entry."
        )
    whole = _entries(named_recipe(base, path.parent), chain - 1)
    # Cameras are one choice of several: they are replaced as a whole.
    merged = {
        name: {**whole[name], **entry}
        if is_table(entry) and is_table(whole.get(name)) and name != "cameras"
        else entry
        for name, entry in own.items()
    }
    return {**whole, **merged}


def recipe_cameras(recipe: Recipe, rng: np.random.Generator) -> tuple[Camera, ...]:
    """The synthetic or placed cameras (those of a calibration file are read by the caller)."""
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


RANGES: Mapping[str, tuple[float, float]] = {
    "frames": (1, 100_000),
    "fps": (1, 1000),
    "height_mm": (300, 3000),
    "girth": (0.5, 2),
    "magnify": (0.05, 50),
    "edge_mm": (0, 100),
    "damage.clutter": (0, 24),
    "damage.calibration_px": (0, 50),
    "damage.shutter": (0, 1),
    "picture.width": (16, 8192),
    "picture.height": (16, 8192),
    "picture.noise": (0, 40),
    "picture.samples": (1, 4),
    "picture.quality": (0, 51),
}
CHOICES: Mapping[str, Iterable[str]] = {
    "wardrobe": WARDROBES,
    "cameras.rig": ("", *RIGS),
    "flesh": ("", HAND),
    "include.background": ("clip", "picture", "none"),
}


def _problem(recipe: Recipe) -> str:
    """The fault of a recipe whose entries have the right types, "" without one."""
    for name, (low, high) in RANGES.items():
        value = attrgetter(name)(recipe)
        if not low <= value <= high:
            return f"{name} is {value:g}, not {low:g} to {high}"
    for name, known in CHOICES.items():
        if attrgetter(name)(recipe) not in known:
            return f"{name} is '{attrgetter(name)(recipe)}', not one of {', '.join(filter(None, known))}"
    picture, cameras, is_arm = recipe.picture, recipe.cameras, recipe.motion == "arm"
    strange = sorted(set(recipe.colours) - set(MATERIALS))
    checks = {
        f"room is '{recipe.room}', not one of {', '.join(ROOMS)}, or 'drawn-' and a number": (
            not is_room(recipe.room)
        ),
        f"colours are of {', '.join(MATERIALS)}, not of {', '.join(strange)}": bool(strange),
        "colours are RGB from 0 to 1": (
            not all(0.0 <= value <= 1.0 for colour in recipe.colours.values() for value in colour)
        ),
        "proportions are factors from 0.7 to 1.4": (
            not all(0.7 <= value <= 1.4 for value in msgspec.structs.astuple(recipe.proportions))
        ),
        "proportions belong to no shape file": bool(recipe.shape) and recipe.proportions != Proportions(),
        f"nobody is beside motion '{recipe.motion}'": recipe.motion in ("arm", KEYS) and bool(recipe.beside),
        "damage is done to footage of a person, not to motion 'arm'": is_arm and recipe.damage != Damage(),
        "shape and sigma belong to a person, not to motion 'arm'": is_arm
        and bool(recipe.shape or recipe.sigma),
        "picture sides must be even for H.264": bool(picture.width % 2 or picture.height % 2),
        f"motion '{RECORDED}' and an entry motion_file belong together": (
            (recipe.motion == RECORDED) != bool(recipe.motion_file)
        ),
        f"motion '{KEYS}' and [[keys]] belong together": (recipe.motion == KEYS) != bool(recipe.keys),
        "keys are in the order of their moments": any(
            not later.at_s > sooner.at_s for sooner, later in itertools.pairwise(recipe.keys)
        ),
        f"flesh and sizes belong to motion '{KEYS}'": recipe.motion != KEYS
        and bool(recipe.flesh or recipe.sizes),
        "shape, sigma and proportions belong to a person, not to motion 'keys'": recipe.motion == KEYS
        and bool(recipe.shape or recipe.sigma or recipe.proportions != Proportions()),
        f"motion '{JOINED}' and [[clips]] belong together": (recipe.motion == JOINED) != bool(recipe.clips),
        "picture.empty_frames must be 1 or more": picture.empty_frames < 1,
        "[cameras] must hold one of rig, calibration, placed": (
            sum(map(bool, (cameras.rig, cameras.calibration, cameras.placed))) != 1
        ),
    }
    return next((words for words, wrong in checks.items() if wrong), "")
