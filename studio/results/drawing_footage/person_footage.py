"""A rendered person's footage as files: a video a camera, empty clips or plates, masks."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import cv2

from studio.body.person import PersonMotion
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress, no_progress
from studio.results.drawing_footage.clips import ClipWriter
from studio.results.drawing_footage.damage import cameras_left, clutter_in_front
from studio.results.drawing_footage.motions import stool
from studio.results.drawing_footage.recipe_file import Picture, Recipe
from studio.results.drawing_footage.renderer import RenderedPerson, Renderer
from studio.results.drawing_footage.room import Block
from studio.results.drawing_footage.rooms import room_called
from studio.results.drawing_footage.wardrobes import dressed

STEPPED_OVER, STEPPED_OVER_HEIGHT = "box", 120.0
SAT_ON = "sit"


def render_person(
    recipe: Recipe,
    motion: PersonMotion,
    cameras: tuple[Camera, ...],
    source: Path,
    progress: Progress = no_progress,
    beside: Sequence[RenderedPerson] = (),
) -> None:
    """Write videos/, and background/ and masks/ as the recipe includes them, into `source`; nothing for missing
    cameras. beside : who else is in the room; masks are of all.
    """
    cameras = cameras_left(cameras, recipe.damage.missing)
    renderer = recipe_renderer(recipe, motion, cameras, beside)
    write_footage(recipe, renderer, cameras, motion.frame_count, source, progress)


def write_footage(
    recipe: Recipe,
    renderer: Renderer,
    cameras: tuple[Camera, ...],
    frame_count: int,
    source: Path,
    progress: Progress,
) -> None:
    """Write what a renderer shows as the files of `render_person`."""
    picture = recipe.picture
    with ExitStack() as open_clips:
        footage = _writers(source / "videos", cameras, recipe.fps, picture.quality, open_clips)
        masks = (
            _writers(source / "masks", cameras, recipe.fps, 0.0, open_clips) if recipe.include.masks else []
        )
        for frame in range(frame_count):
            shadow = renderer.shadow(frame)
            for index in range(len(cameras)):
                seen, mask = renderer.picture(index, frame, shadow)
                footage[index].add(seen)
                if masks:
                    masks[index].add(mask)
            progress("rendering", frame + 1, frame_count)
    if recipe.include.background != "none":
        (source / "background").mkdir()
        for index, camera in enumerate(cameras):
            _write_background(
                renderer, index, camera, source / "background", recipe.include.background, picture
            )


def recipe_renderer(
    recipe: Recipe, motion: PersonMotion, cameras: tuple[Camera, ...], beside: Sequence[RenderedPerson] = ()
) -> Renderer:
    """The renderer of a recipe's room and person: the pictures of its footage, and their exact masks."""
    height = recipe.options.get("height_mm", STEPPED_OVER_HEIGHT) if recipe.motion == STEPPED_OVER else 0.0
    room = room_called(recipe.room, height)
    things: tuple[Block, ...] = (stool(motion.skeleton, recipe.options),) if recipe.motion == SAT_ON else ()
    things += clutter_in_front(recipe.damage.clutter, cameras, motion, recipe.seed)
    return Renderer(
        replace(room, blocks=room.blocks + things),
        cameras,
        motion,
        noise=recipe.picture.noise,
        samples=recipe.picture.samples,
        seed=recipe.seed,
        girth=recipe.girth,
        wardrobe=dressed(recipe.wardrobe, recipe.colours),
        shutter=recipe.damage.shutter,
        beside=beside,
    )


def _writers(
    folder: Path, cameras: tuple[Camera, ...], fps: float, quality: float, open_clips: ExitStack
) -> list[ClipWriter]:
    folder.mkdir()
    return [
        open_clips.enter_context(
            ClipWriter(folder / f"{camera.name}.mp4", (camera.width, camera.height), fps, quality)
        )
        for camera in cameras
    ]


def _write_background(
    renderer: Renderer, index: int, camera: Camera, folder: Path, kind: str, picture: Picture
) -> None:
    """The empty room: a short clip with the sensor's noise, or one picture."""
    if kind == "picture":
        cv2.imwrite(str(folder / f"{camera.name}.png"), renderer.empty(index, 0))
        return
    size = (camera.width, camera.height)
    with ClipWriter(folder / f"{camera.name}.mp4", size, 60.0, picture.quality) as clip:
        for frame in range(picture.empty_frames):
            clip.add(renderer.empty(index, frame))
