"""Recipes: the bundled ones are sound, wrong ones are refused with a remedy."""

from pathlib import Path

import numpy as np
import pytest

from studio.foundations.errors import StudioError
from studio.results.drawing_footage.motions import MOTIONS
from studio.results.drawing_footage.recipe_file import find_recipe, read_recipe, recipe_cameras, recipe_names


@pytest.mark.parametrize("name", recipe_names())
def test_bundled_recipes_are_sound(name: str) -> None:
    recipe = read_recipe(find_recipe(name))
    assert recipe.motion in {*MOTIONS, "arm", "recorded", "joined", "keys"}
    if not recipe.cameras.calibration:
        cameras = recipe_cameras(recipe, np.random.default_rng(recipe.seed))
        assert len(cameras) == (len(recipe.cameras.placed) or {"corners": 4, "five": 5}[recipe.cameras.rig])
    # Five views make a hull to fit blobs to.
    wanted = {"walk-five-cameras": "blobs"}.get(name, "template" if recipe.motion == "arm" else "")
    assert recipe.weighting == wanted


def test_the_motions_of_the_issue_have_recipes() -> None:
    assert {"walk", "run", "box", "handstand", "planar_arm", "branched_arms"} <= set(recipe_names())


def test_an_unknown_recipe_is_named_with_the_known_ones(tmp_path: Path) -> None:
    for name in ("moonwalk", "../walk", str(tmp_path / "none.toml")):
        with pytest.raises(StudioError, match="no recipe") as refusal:
            find_recipe(name)
        assert "walk" in refusal.value.hint


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("frames = 150", "frames = 0"), "frames is 0"),
        (("frames = 150", 'frames = "many"'), "frames"),
        (("fps = 60", "fps = nan"), "fps is nan"),
        (("height_mm = 1760", "height_mm = 12"), "height_mm is 12"),
        (("width = 640", "width = 641"), "even"),
        (("noise = 2.5", "noise = -1"), "noise is -1"),
        (("samples = 2", "samples = 9"), "samples is 9"),
        (('rig = "corners"', 'rig = "ring"'), "ring"),
        (('rig = "corners"', ""), "rig, calibration, placed"),
        (('background = "clip"', 'background = "fog"'), "fog"),
        (("seed = 1", "seeds = 1"), "seeds"),
        (("[options]", "[options"), "Recipe"),
    ],
)
def test_a_wrong_entry_is_named(tmp_path: Path, change: tuple[str, str], words: str) -> None:
    text = find_recipe("walk").read_text()
    assert change[0] in text
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(*change))
    with pytest.raises(StudioError, match=words) as refusal:
        read_recipe(path)
    assert "mine.toml" in refusal.value.message
    assert refusal.value.hint


def test_a_recipe_like_another_differs_in_its_own_entries_alone(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('like = "walk"\nframes = 7\n[options]\nradius_mm = 500\n[picture]\nwidth = 64\n')
    mine, walk = read_recipe(path), read_recipe(find_recipe("walk"))
    assert (mine.frames, mine.picture.width, mine.options["radius_mm"]) == (7, 64, 500.0)
    assert (mine.title, mine.cameras, mine.picture.height) == (walk.title, walk.cameras, walk.picture.height)
    assert set(walk.options) <= set(mine.options)
    (tmp_path / "second.toml").write_text('like = "mine.toml"\nseed = 9\n')
    second = read_recipe(tmp_path / "second.toml")
    assert (second.frames, second.seed) == (7, 9)


@pytest.mark.parametrize("other", ['"mine.toml"', "5"])
def test_a_recipe_that_is_like_itself_or_like_no_recipe_is_refused(tmp_path: Path, other: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(f"like = {other}\n")
    with pytest.raises(StudioError, match=r"mine.toml.*like"):
        read_recipe(path)
