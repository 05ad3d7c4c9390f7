"""The suite against tuning: recipes whose person, clothes, room, cameras and stretch of motion are drawn from a seed.

Two halves hold the same kinds of difficulty with other draws: trackers are chosen by the first and reported on the
second. The drawn recipes are installed as files; a test draws them again.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import msgspec
import numpy as np
import tomli_w

from studio.body.person import PersonMotion, joint_points
from studio.foundations.arrays import Array
from studio.foundations.geometry.projection import project
from studio.foundations.typed_decoding import is_table
from studio.results.drawing_footage.damage import Damage
from studio.results.drawing_footage.person import Proportions
from studio.results.drawing_footage.recipe_file import (
    JOINED,
    RECIPES,
    RECORDED,
    Cameras,
    Include,
    Picture,
    Placed,
    Recipe,
    recipe_cameras,
)
from studio.results.drawing_footage.recipes import recipe_motion, recipe_person
from studio.results.drawing_footage.recorded_clips import Clip
from studio.results.drawing_footage.room import Room
from studio.results.drawing_footage.rooms import DRAWN, FLOOR_AND_WALLS, room_called
from studio.results.drawing_footage.wardrobes import MATERIALS

Colour = tuple[float, float, float]
WORN_LARGE = ("skin", "shirt", "trousers", "stripes")

CHOOSING, REPORTING = "choosing", "reporting"
HALVES = (CHOOSING, REPORTING)
SEEDS = {CHOOSING: 4100, REPORTING: 7300}

HEIGHT_MM, GIRTH, PROPORTION = (1540.0, 1930.0), (0.90, 1.18), 0.03
NOISE, QUALITY = (1.5, 3.5), (18.0, 23.0)
CAMERA_HEIGHT_MM, BELOW_CEILING_MM, OFF_WALL_MM = (1500.0, 2650.0), 200.0, 120.0
TURNED_ASIDE, PERSON_PX = 0.22, (195.0, 250.0)
LENS = (-0.24, -0.02)
AROUND_JOINTS_MM, MARGIN_PX = 120.0, 6.0
HARD_NOISE, HARD_CLUTTER, HARD_PX = 7.0, 6, 2.0
# Clothes are redrawn until their colours stand out from floor and walls: background subtraction, on which all trackers
# depend, drops pixels near the background's colour or that of its shadow.
DRAWS, ROOMS_TRIED = 400, 40
DIFFERENT_LEVELS, NOISE_TIMES = 21.0, 5.5
SHADOW_SHARE, SHADOW_COLOUR = (0.42, 1.06), 0.085
EXPOSED = 1.8
SURFACE_LIGHT = (0.55, 0.85)
"""Shares of the lamp's and of the ambient light on floor and walls."""
CLOTH_LIGHTS = ((0.0, 0.5), (0.2, 0.65), (0.5, 0.75), (0.85, 0.85))
"""The same for cloth, from its dark side to its bright one."""

FLOOR, WALL = "floor", "wall"
POORLY_SEEN: tuple[Mapping[str, str], ...] = (
    {"skin": FLOOR},
    {"shirt": WALL, "stripes": WALL},
    {"trousers": FLOOR},
    {"skin": FLOOR, "shirt": WALL},
    {"shirt": FLOOR, "trousers": FLOOR},
    {"shirt": WALL, "trousers": WALL},
)
"""What is worn in the colour of which surface; stripes that are not named keep theirs."""
ALIKE = (0.85, 1.15)
"""Brightness of such clothes, in shares of the surface's."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """A stretch of motion with random variation. file : recorded motion, "" for written motion. start_s, jitter_s :
    first moment, and its largest change by a draw. bends : greatest bend of the path, degrees. options : of the motion,
    each a number or two to draw between.
    """

    motion: str = JOINED
    file: str = ""
    start_s: float = 0.0
    jitter_s: float = 0.0
    bends: float = 0.0
    options: Mapping[str, float | tuple[float, float]] = field(
        default_factory=dict[str, float | tuple[float, float]]
    )


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of difficulty: `frames` frames at `fps` of a stretch a half, seen by `cameras` cameras (by half). damage :
    as in a recipe, a half; `missing` names the last camera where it is not empty. noise : of the sensor, 0 for a draw.
    like : a kind whose draw this one shares at another rate. worn : what has the colour of which surface, as in
    POORLY_SEEN.
    """

    title: str
    fps: float
    frames: int
    stretches: tuple[Stretch, Stretch] = (Stretch(), Stretch())
    cameras: tuple[int, int] = (4, 4)
    damage: tuple[Damage, Damage] = (Damage(), Damage())
    noise: float = 0.0
    like: str = ""
    worn: Mapping[str, str] = field(default_factory=dict[str, str])


HARD = Damage(clutter=HARD_CLUTTER, calibration_px=HARD_PX)
GONE = Damage(missing=("last",))
BLURRED = Damage(shutter=0.7)

ANY_WAY = (0.0, 360.0)
TURNING = {"speed_mm_s": (850.0, 1050.0), "cadence": (1.8, 2.1), "start_degrees": ANY_WAY}
RUNNING = Stretch(
    "run",
    options={
        "radius_mm": (950.0, 1200.0),
        "speed_mm_s": (1900.0, 2300.0),
        "cadence": (2.6, 2.9),
        "start_degrees": ANY_WAY,
    },
)
WALKING = Stretch(
    "walk",
    options={
        "radius_mm": (600.0, 900.0),
        "sway_mm": (20.0, 70.0),
        "speed_mm_s": (800.0, 1100.0),
        "cadence": (1.75, 2.05),
        "start_degrees": ANY_WAY,
    },
)
CROUCHING = Stretch(
    "crouch",
    options={
        "depth": (0.46, 0.56),
        "down_s": (0.5, 0.65),
        "hold_s": (0.05, 0.15),
        "up_s": (0.5, 0.6),
        "heading_degrees": ANY_WAY,
        "stance": (0.15, 0.22),
        "swing": (0.1, 0.5),
    },
)
BOX = Stretch(
    "box", options={"height_mm": (90.0, 150.0), "speed_mm_s": (900.0, 1100.0), "before_mm": (750.0, 850.0)}
)


def _sitting(down_s: tuple[float, float], **options: float) -> Stretch:
    drawn = {"seat_mm": (400.0, 470.0), "down_s": down_s, **options}
    return Stretch("sit", options={**drawn, "heading_degrees": ANY_WAY, "stance": (0.14, 0.2)})


def _shown(file: str, start_s: float, jitter_s: float, bends: float = 0.0) -> Stretch:
    return Stretch(JOINED, file, start_s, jitter_s, bends)


KINDS: Mapping[str, Kind] = {
    "walk": Kind(
        "Walk, 60 Hz",
        60,
        118,
        (_shown("05_01.amc", 0.35, 0.15, bends=50.0), _shown("05_01.amc", 2.75, 0.15, bends=50.0)),
    ),
    "walk-20hz": Kind("The same walk, 20 Hz", 20, 40, like="walk"),
    "turns": Kind(
        "Walk with turns, 30 Hz",
        30,
        75,
        (
            Stretch("turning_walk", options={"start_s": (0.5, 0.9), **TURNING}),
            Stretch("turning_walk", options={"start_s": (3.2, 3.7), **TURNING}),
        ),
        (4, 5),
    ),
    "dance": Kind(
        "Dance, 30 Hz",
        30,
        75,
        (_shown("05_02.amc", 3.6, 0.6), _shown("05_11.amc", 1.2, 0.6)),
        (5, 6),
        (Damage(), GONE),
    ),
    "kick": Kind(
        "High kick, 60 Hz", 60, 75, (_shown("05_09.amc", 6.55, 0.1), _shown("05_10.amc", 2.75, 0.1)), (5, 4)
    ),
    "leap": Kind(
        "Leap, 60 Hz", 60, 75, (_shown("CMU_01_01.bvh", 6.1, 0.1), _shown("05_06.amc", 3.25, 0.1)), (6, 5)
    ),
    "cartwheel": Kind(
        "Cartwheel, 60 Hz",
        60,
        75,
        (_shown("amp_humanoid_cartwheel.npz", 2.9, 0.05), _shown("amp_humanoid_cartwheel.npz", 0.1, 0.05)),
        (5, 6),
    ),
    "hard": Kind(
        "Walk with noise, clutter in front and calibration 2 px off, 60 Hz",
        60,
        70,
        (WALKING, WALKING),
        damage=(HARD, HARD),
        noise=HARD_NOISE,
    ),
    "crouch": Kind("Crouch", 60, 75, (CROUCHING, CROUCHING), (3, 8)),
    "sit": Kind(
        "Sitting down on a stool",
        60,
        75,
        (_sitting((0.8, 1.0)), _sitting((0.45, 0.55), start_s=0.02)),
        (5, 4),
        (GONE, Damage()),
    ),
    "arms": Kind(
        "Arms overhead",
        60,
        75,
        (_shown("05_09.amc", 4.7, 0.1), _shown("05_10.amc", 0.75, 0.1)),
        (4, 3),
        (BLURRED, Damage()),
    ),
    "run": Kind(
        "Run",
        60,
        70,
        (
            RUNNING,
            Stretch(
                RECORDED,
                "amp_humanoid_run.npz",
                0.1833,
                options={
                    "cycle_s": 0.7667,
                    "speed": (0.75, 0.85),
                    "radius_mm": (1050.0, 1250.0),
                    "bank": 0.5,
                },
            ),
        ),
        (8, 5),
        (Damage(), BLURRED),
    ),
    "fast-cameras": Kind(
        "Stepping over a box, 120 Hz",
        120,
        90,
        (BOX, replace(RUNNING, options={**RUNNING.options, "radius_mm": (950.0, 1150.0)})),
    ),
    "skin-on-floor": Kind(
        "Dance, skin of the floor's colour, 30 Hz",
        30,
        60,
        (_shown("05_03.amc", 0.3, 0.1), _shown("05_02.amc", 0.5, 0.2)),
        worn={"skin": FLOOR},
    ),
    "shirt-on-wall": Kind(
        "Walk with turns, shirt of a wall's colour, 30 Hz",
        30,
        60,
        (
            Stretch("turning_walk", options={"start_s": (2.2, 2.6), **TURNING}),
            Stretch("turning_walk", options={"start_s": (1.4, 1.8), **TURNING}),
        ),
        worn={"shirt": WALL, "stripes": WALL},
    ),
    "trousers-on-floor": Kind(
        "Run, trousers of the floor's colour, 60 Hz",
        60,
        60,
        (RUNNING, replace(RUNNING, options={**RUNNING.options, "radius_mm": (900.0, 1150.0)})),
        worn={"trousers": FLOOR},
    ),
}


def clip_name(half: str, kind: str) -> str:
    """The name of a kind's recipe in a half."""
    return f"{half}-{kind}"


def clip_names(half: str) -> tuple[str, ...]:
    """The names of a half's recipes, in the order of KINDS."""
    return tuple(clip_name(half, kind) for kind in KINDS)


def drawn_recipe(half: str, kind: str) -> Recipe:
    """The recipe of a kind in one of the HALVES. Raises StudioError where recorded motions are missing."""
    chosen = KINDS[kind]
    if chosen.like:
        shared = drawn_recipe(half, chosen.like)
        return msgspec.structs.replace(
            shared, title=_title(half, chosen), fps=chosen.fps, frames=chosen.frames
        )
    index, seed = HALVES.index(half), SEEDS[half] + list(KINDS).index(kind)
    rng = np.random.default_rng(seed)
    recipe = _with_motion(_person(half, chosen, index, seed, rng), chosen.stretches[index], rng)
    skeleton, _ = recipe_person(recipe, RECIPES, np.random.default_rng(seed))
    motion = recipe_motion(recipe, RECIPES, skeleton)
    cameras = _cameras(recipe, motion, chosen.cameras[index], rng)
    damage = chosen.damage[index]
    if damage.missing:
        damage = msgspec.structs.replace(damage, missing=(cameras[-1].name,))
    recipe = msgspec.structs.replace(recipe, cameras=Cameras(placed=cameras), damage=damage)
    return poorly_seen(recipe, chosen.worn) if chosen.worn else recipe


def poorly_seen(recipe: Recipe, worn: Mapping[str, str]) -> Recipe:
    """The recipe with clothes in the colours of its drawn room's floor or of a wall. worn : one of POORLY_SEEN."""
    rng = np.random.default_rng((recipe.seed, len(worn)))
    floor, *walls = room_called(recipe.room).blocks[:FLOOR_AND_WALLS]
    colours = dict(recipe.colours)
    for material, surface in worn.items():
        block = floor if surface == FLOOR else walls[int(rng.integers(len(walls)))]
        behind = np.array(block.colour if rng.random() < 0.5 else block.second)
        alike = np.clip(behind * rng.uniform(*ALIKE) + rng.normal(0.0, 0.01, 3), 0.03, 0.9)
        red, green, blue = (round(float(value), 3) for value in alike)
        colours[material] = (red, green, blue)
    return msgspec.structs.replace(recipe, colours=colours)


def recipe_text(half: str, kind: str) -> str:
    """The recipe's file (TOML), without entries at their defaults."""
    entries = _unusual(msgspec.to_builtins(drawn_recipe(half, kind)), _USUAL)
    return f"# Drawn by drawn_recipes.py, the half for {half}.\n{tomli_w.dumps(entries)}"


def write_recipes() -> None:
    """Write the files of all drawn recipes over the installed ones."""
    for half in HALVES:
        for kind in KINDS:
            (RECIPES / f"{clip_name(half, kind)}.toml").write_text(recipe_text(half, kind), encoding="utf-8")


def _title(half: str, kind: Kind) -> str:
    return f"{kind.title} (drawn, {half})"


def _person(half: str, kind: Kind, index: int, seed: int, rng: np.random.Generator) -> Recipe:
    """A recipe with a drawn person, clothes and room; motion and cameras are not drawn yet."""
    factors = np.exp(rng.normal(0.0, PROPORTION, len(Proportions.__struct_fields__)))
    names = Proportions.__struct_fields__
    noise = kind.noise or round(float(rng.uniform(*NOISE)), 1)
    room, clothes = _room_and_clothes(seed, noise, rng)
    proportions = Proportions(
        **{name: round(float(value), 3) for name, value in zip(names, factors, strict=True)}
    )
    return Recipe(
        title=_title(half, kind),
        motion=kind.stretches[index].motion,
        frames=kind.frames,
        fps=kind.fps,
        seed=seed,
        height_mm=round(float(rng.uniform(*HEIGHT_MM)), 0),
        girth=round(float(rng.uniform(*GIRTH)), 3),
        proportions=proportions,
        colours=clothes,
        room=room,
        picture=Picture(samples=1, noise=noise, quality=round(float(rng.uniform(*QUALITY)), 0)),
        include=Include(start_pose_noise_mm=4.0),
    )


def _room_and_clothes(seed: int, noise: float, rng: np.random.Generator) -> tuple[str, dict[str, Colour]]:
    """A room and clothes that stand out from its floor and walls."""
    for attempt in range(ROOMS_TRIED):
        name = f"{DRAWN}{ROOMS_TRIED * seed + attempt}"
        room = room_called(name)
        for _ in range(DRAWS // ROOMS_TRIED if attempt < ROOMS_TRIED - 1 else DRAWS):
            clothes = _clothes(rng)
            if all(stands_out(np.array(clothes[part]), room, noise) for part in WORN_LARGE):
                return name, clothes
    raise ValueError(f"No clothes stand out in the rooms of seed {seed}.")


def stands_out(colour: Array, room: Room, noise: float) -> bool:
    """Whether cloth of a colour differs from a drawn room's floor and walls in any light by more than the sensor's
    noise, and not only as a shadow.
    """
    lamp, around = room.lights[2], room.lights[3]
    for block in room.blocks[:FLOOR_AND_WALLS]:
        for surface in (np.array(block.colour), np.array(block.second)):
            behind = _pixel(surface * (SURFACE_LIGHT[0] * lamp + SURFACE_LIGHT[1] * around))
            for key, sky in CLOTH_LIGHTS:
                seen = _pixel(colour * (key * lamp + sky * around))
                if np.abs(seen - behind).max() < max(DIFFERENT_LEVELS, NOISE_TIMES * noise):
                    return False
                share = float(seen @ behind / (behind @ behind))
                off = float(np.linalg.norm(seen - share * behind) / np.linalg.norm(behind))
                if SHADOW_SHARE[0] < share < SHADOW_SHARE[1] and off < SHADOW_COLOUR:
                    return False
    return True


def _pixel(light: Array) -> Array:
    """Grey levels of linear light."""
    return 255.0 * (1.0 - np.exp(-EXPOSED * light))


def _clothes(rng: np.random.Generator) -> dict[str, Colour]:
    """Colours of all clothes; stripes of the shirt's own colour, or of another."""
    skin = rng.uniform(0.3, 0.85) * np.array([1.0, rng.uniform(0.60, 0.74), rng.uniform(0.44, 0.60)])
    shirt, trousers = _colour(rng, 0.10, 0.75, 0.14), _colour(rng, 0.05, 0.45, 0.10)
    shoes, hair = _colour(rng, 0.05, 0.6, 0.05), rng.uniform(0.05, 0.5) * np.array([1.0, 0.75, 0.5])
    stripes = shirt if rng.random() < 0.5 else _colour(rng, 0.15, 0.75, 0.14)
    colours: dict[str, Colour] = {}
    for name, colour in zip(MATERIALS, (skin, shirt, trousers, shoes, hair, stripes), strict=True):
        values = [round(float(value), 3) for value in np.clip(colour, 0.03, 0.9)]
        colours[name] = (values[0], values[1], values[2])
    return colours


def _colour(rng: np.random.Generator, low: float, high: float, spread: float) -> Array:
    return rng.uniform(low, high) + rng.normal(0.0, spread, 3)


def _with_motion(recipe: Recipe, stretch: Stretch, rng: np.random.Generator) -> Recipe:
    options: dict[str, Any] = {}
    for name, value in stretch.options.items():
        options[name] = round(float(rng.uniform(*value)), 3) if isinstance(value, tuple) else value
    start = round(stretch.start_s + float(rng.uniform(-1.0, 1.0)) * stretch.jitter_s, 3)
    turn, bend = round(float(rng.uniform(0.0, 360.0)), 1), round(float(rng.uniform(-1.0, 1.0)), 3)
    file = f"data:cmu-motion/{stretch.file}"
    if stretch.motion == JOINED:
        clips = (Clip(file, start_s=start, turn_degrees=bend * stretch.bends),)
        return msgspec.structs.replace(recipe, clips=clips, options={"turn_degrees": turn})
    if stretch.motion == RECORDED:
        options |= {"turn_degrees": turn, "start_s": start}
        return msgspec.structs.replace(recipe, motion_file=file, options=options)
    return msgspec.structs.replace(recipe, options=options)


def _cameras(
    recipe: Recipe, motion: PersonMotion, count: int, rng: np.random.Generator
) -> tuple[Placed, ...]:
    """`count` cameras along the walls around the person's path, each seeing the whole path."""
    room = room_called(recipe.room)
    inside = np.array(room.half) - OFF_WALL_MM
    middle: Array = 0.5 * (motion.root.min(axis=0) + motion.root.max(axis=0))
    start = float(rng.uniform(0.0, 2.0 * np.pi))
    cameras: list[Placed] = []
    for number in range(count):
        angle = start + 2.0 * np.pi * number / count + float(rng.uniform(-TURNED_ASIDE, TURNED_ASIDE))
        towards = np.array([np.cos(angle), np.sin(angle)])
        # From the middle of the path to the wall.
        free: Array = np.where(towards > 0.0, inside - middle[:2], inside + middle[:2]) / np.maximum(
            np.abs(towards), 1e-6
        )
        x, y = middle[:2] + float(free.min()) * towards
        z = float(rng.uniform(CAMERA_HEIGHT_MM[0], min(CAMERA_HEIGHT_MM[1], room.height - BELOW_CEILING_MM)))
        target = np.array([*middle[:2], 0.5 * recipe.height_mm]) + rng.normal(0.0, 60.0, 3)
        distance = float(np.linalg.norm(target - np.array([x, y, z])))
        camera = Placed(
            name=f"cam{number + 1}",
            position=(round(float(x)), round(float(y)), round(z)),
            look_at=(round(float(target[0])), round(float(target[1])), round(float(target[2]))),
            focal_px=round(float(rng.uniform(*PERSON_PX)) * distance / recipe.height_mm, 1),
            roll_degrees=round(float(rng.normal(0.0, 1.5)), 2),
            distortion=_lens(rng),
        )
        cameras.append(_wide_enough(recipe, motion, camera))
    return tuple(cameras)


def _lens(rng: np.random.Generator) -> tuple[float, float, float, float, float]:
    barrel = float(rng.uniform(*LENS))
    first, second = (round(float(value), 5) for value in rng.normal(0.0, 4e-4, 2))
    return round(barrel, 4), round(-0.35 * barrel, 4), first, second, 0.0


def _wide_enough(recipe: Recipe, motion: PersonMotion, camera: Placed) -> Placed:
    """The camera with a focal length at which the whole person stays in the picture throughout."""
    joints = np.concatenate(list(joint_points(motion).values()))
    size = (recipe.picture.width, recipe.picture.height)
    while True:
        only = msgspec.structs.replace(recipe, cameras=Cameras(placed=(camera,)))
        seen = recipe_cameras(only, np.random.default_rng(0))[0]
        pixels, depth = project(seen, joints)
        reach = seen.matrix[0, 0] * AROUND_JOINTS_MM / depth[:, None] + MARGIN_PX
        inside = (pixels - reach >= 0.0) & (pixels + reach <= np.array(size))
        if bool(inside.all()) or camera.focal_px < 0.35 * size[0]:
            return camera
        camera = msgspec.structs.replace(camera, focal_px=round(0.98 * camera.focal_px, 1))


def _unusual(entries: dict[str, Any], usual: Mapping[str, Any]) -> dict[str, Any]:
    """The entries that differ from the defaults."""
    unusual: dict[str, Any] = {}
    for name, value in entries.items():
        known = usual.get(name)
        if is_table(value) and is_table(known) and known:
            value = _unusual(value, known)
            if not value:
                continue
        elif value == known:
            continue
        unusual[name] = value
    if "clips" in unusual:
        unusual["clips"] = [_unusual(entry, _USUAL_CLIP) for entry in unusual["clips"]]
    return unusual


_USUAL_CLIP = {name: value for name, value in msgspec.to_builtins(Clip("")).items() if name != "file"}
_USUAL = {
    name: value
    for name, value in msgspec.to_builtins(Recipe(title="", motion="", frames=0)).items()
    if name not in ("title", "motion", "frames")
}
