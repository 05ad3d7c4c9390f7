"""The pictures of the gallery's cards that are rendered at a click, a frame of each: `make gallery-pictures`."""

import sys
import tempfile
from pathlib import Path

import cv2
import msgspec
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT)]

from studio.footage.capture.calibration_files import read_calibration  # noqa: E402
from studio.foundations.geometry.camera import Camera  # noqa: E402
from studio.operations.gallery import CARDS, GALLERY_PICTURES  # noqa: E402
from studio.results.drawing_footage.body_footage import render_body  # noqa: E402
from studio.results.drawing_footage.person_footage import recipe_renderer  # noqa: E402
from studio.results.drawing_footage.real_data import located  # noqa: E402
from studio.results.drawing_footage.recipe_file import (  # noqa: E402
    KEYS,
    Recipe,
    find_recipe,
    read_recipe,
    recipe_cameras,
)
from studio.results.drawing_footage.recipes import (  # noqa: E402
    RenderedPerson,
    dressed,
    people_beside,
    recipe_motion,
    recipe_person,
)
from studio.sessions.session import jpeg  # noqa: E402


def cameras_of(recipe: Recipe, folder: Path, rng: np.random.Generator) -> tuple[Camera, ...]:
    """Those that the recipe's footage is rendered for."""
    if recipe.cameras.calibration:
        return read_calibration(located(recipe.cameras.calibration, folder)).cameras
    return recipe_cameras(recipe, rng)


def person_picture(recipe: Recipe, folder: Path) -> np.ndarray:
    """The middle frame of a recipe's first camera."""
    rng = np.random.default_rng(recipe.seed)
    skeleton, _ = recipe_person(recipe, folder, rng)
    # A renderer draws the empty room of every camera that it has.
    cameras = cameras_of(recipe, folder, rng)[:1]
    motion = recipe_motion(recipe, folder, skeleton)
    beside = [
        RenderedPerson(other, person.girth, dressed(person.wardrobe, person.colours))
        for person, other in people_beside(recipe, folder)
    ]
    renderer = recipe_renderer(recipe, motion, cameras, beside)
    middle = motion.frame_count // 2
    seen = renderer.picture(0, middle, renderer.shadow(middle))[0]
    return np.rot90(seen, -cameras[0].quarter_turns)


def body_picture(recipe: Recipe, folder: Path) -> np.ndarray:
    """The first frame of a body that is no person's."""
    bare = msgspec.structs.replace(
        recipe, include=msgspec.structs.replace(recipe.include, background="none", masks=False)
    )
    cameras = cameras_of(recipe, folder, np.random.default_rng(recipe.seed))[:1]
    with tempfile.TemporaryDirectory() as made:
        render_body(bare, folder, cameras, Path(made), lambda *_: None, 1)
        video = next(path for path in sorted(Path(made).rglob("*.mp4")) if path.parent.name == "videos")
        return cv2.VideoCapture(str(video)).read()[1]


def main(names: list[str]) -> None:
    """Take those that are named, else all."""
    GALLERY_PICTURES.mkdir(exist_ok=True)
    for card in CARDS:
        if card.kind != "recipe" or (names and card.name not in names):
            continue
        path = find_recipe(card.recipe or card.name)
        recipe = read_recipe(path)
        picture = (body_picture if recipe.motion == KEYS else person_picture)(recipe, path.parent)
        content = jpeg(picture)
        (GALLERY_PICTURES / f"{card.name}.jpg").write_bytes(content)
        print(f"{card.name}: {len(content)} bytes", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
