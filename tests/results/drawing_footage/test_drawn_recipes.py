"""The suite against tuning: draws are reproducible, its halves share nothing, and all kinds are included."""

import os
from collections.abc import Mapping
from pathlib import Path

import msgspec
import numpy as np
import pytest

from studio.body.person import joint_points
from studio.foundations.geometry.projection import project
from studio.garden.drawn_recipes import (
    CHOOSING,
    HALVES,
    KINDS,
    POORLY_SEEN,
    REPORTING,
    clip_names,
    poorly_seen,
    recipe_text,
)
from studio.results.drawing_footage.recipe_file import (
    RECIPES,
    RECORDED,
    Recipe,
    find_recipe,
    read_recipe,
    recipe_cameras,
    recipe_names,
)
from studio.results.drawing_footage.recipes import recipe_motion, recipe_person
from studio.results.drawing_footage.rooms import room_called


def half(name: str) -> dict[str, Recipe]:
    return {clip: read_recipe(find_recipe(clip)) for clip in clip_names(name)}


def test_all_drawn_recipes_are_bundled() -> None:
    assert {name for side in HALVES for name in clip_names(side)} <= set(recipe_names())


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.parametrize("side", HALVES)
def test_drawing_again_gives_the_bundled_files(
    real_data: Path, monkeypatch: pytest.MonkeyPatch, side: str
) -> None:
    monkeypatch.setenv("STUDIO_REAL_DATA", os.fspath(real_data))
    for kind in KINDS:
        assert recipe_text(side, kind) == (RECIPES / f"{side}-{kind}.toml").read_text(encoding="utf-8"), kind


def test_the_halves_share_no_person_room_camera_or_stretch_of_motion() -> None:
    one, other = (list(half(side).values()) for side in HALVES)
    assert not {recipe.seed for recipe in one} & {recipe.seed for recipe in other}
    assert not {recipe.room for recipe in one} & {recipe.room for recipe in other}
    assert not {(r.height_mm, r.girth) for r in one} & {(r.height_mm, r.girth) for r in other}
    assert not {r.cameras.placed[0].position for r in one} & {r.cameras.placed[0].position for r in other}

    def stretches(recipes: list[Recipe]) -> list[tuple[str, float, float]]:
        found = []
        for recipe in recipes:
            seconds = recipe.frames / recipe.fps
            found += [(clip.file, clip.start_s, clip.start_s + seconds) for clip in recipe.clips]
            if recipe.motion == RECORDED:
                start = recipe.options["start_s"]
                found.append((recipe.motion_file, start, start + seconds))
        return found

    for file, begin, end in stretches(one):
        for theirs, first, last in stretches(other):
            assert file != theirs or end < first or last < begin, file


@pytest.mark.parametrize("side", HALVES)
def test_a_half_holds_every_kind_of_difficulty(side: str) -> None:
    recipes = half(side)
    counts = {len(recipe.cameras.placed) - len(recipe.damage.missing) for recipe in recipes.values()}
    assert {3, 8} <= counts <= set(range(3, 9))
    assert {recipe.fps for recipe in recipes.values()} == {20.0, 30.0, 60.0, 120.0}
    damages = [recipe.damage for recipe in recipes.values()]
    assert any(damage.shutter > 0.0 for damage in damages)
    assert any(damage.missing for damage in damages)
    hard = recipes[f"{side}-hard"]
    assert hard.damage.clutter > 0
    assert hard.damage.calibration_px == pytest.approx(2.0)
    assert hard.picture.noise >= 2.0 * max(r.picture.noise for r in recipes.values() if r is not hard)
    assert not any(recipe.include.masks for recipe in recipes.values())


@pytest.mark.parametrize("side", HALVES)
def test_the_walk_is_the_same_at_both_rates(side: str) -> None:
    recipes = half(side)
    quick, slow = recipes[f"{side}-walk"], recipes[f"{side}-walk-20hz"]
    same = msgspec.structs.replace(slow, title=quick.title, fps=quick.fps, frames=quick.frames)
    assert same == quick
    assert quick.frames - 1 == 3 * (slow.frames - 1)


@pytest.mark.real_data
@pytest.mark.parametrize("name", [*clip_names(CHOOSING), *clip_names(REPORTING)])
def test_people_stand_on_the_floor_inside_every_view(
    real_data: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv("STUDIO_REAL_DATA", os.fspath(real_data))
    recipe = read_recipe(find_recipe(name))
    skeleton, _ = recipe_person(recipe, RECIPES, np.random.default_rng(recipe.seed))
    motion = recipe_motion(recipe, RECIPES, skeleton)
    joints = np.stack(list(joint_points(motion).values()), axis=1)
    lowest = joints[..., 2].min(axis=1)
    # Soles sink in by less than their cushion; only leaps leave the floor for long.
    assert lowest.min() > -10.0
    assert np.median(lowest) < (120.0 if "leap" in name else 60.0)
    room = room_called(recipe.room)
    assert np.all(np.abs(joints[..., :2]) < np.array(room.half) - 300.0)
    for camera in recipe_cameras(recipe, np.random.default_rng(0)):
        assert np.all(np.abs(camera.centre[:2]) < room.half)
        pixels, depth = project(camera, joints.reshape(-1, 3))
        assert depth.min() > 700.0
        assert np.all((pixels > 0.0) & (pixels < [recipe.picture.width, recipe.picture.height]))


@pytest.mark.slow
@pytest.mark.real_data
def test_the_20_hz_walk_has_every_third_frame_of_the_60_hz_one(
    real_data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STUDIO_REAL_DATA", os.fspath(real_data))
    roots = []
    for name in ("choosing-walk", "choosing-walk-20hz"):
        recipe = read_recipe(find_recipe(name))
        skeleton, _ = recipe_person(recipe, RECIPES, np.random.default_rng(recipe.seed))
        roots.append(recipe_motion(recipe, RECIPES, skeleton).root)
    np.testing.assert_allclose(roots[0][::3], roots[1], atol=2.0)


@pytest.mark.parametrize("worn", POORLY_SEEN)
def test_who_is_poorly_seen_wears_the_colours_of_floor_and_walls(worn: dict[str, str]) -> None:
    recipe = read_recipe(find_recipe("choosing-arms"))
    changed = poorly_seen(recipe, worn)
    assert changed == poorly_seen(recipe, worn)
    assert {name for name in changed.colours if changed.colours[name] != recipe.colours[name]} == set(worn)
    check_alike(changed, worn)


@pytest.mark.parametrize("side", HALVES)
def test_a_half_has_people_in_the_colours_of_their_rooms(side: str) -> None:
    kinds = {kind: made.worn for kind, made in KINDS.items() if made.worn}
    assert {material for worn in kinds.values() for material in worn} >= {"skin", "shirt", "trousers"}
    for kind, worn in kinds.items():
        check_alike(half(side)[f"{side}-{kind}"], worn)


def check_alike(recipe: Recipe, worn: Mapping[str, str]) -> None:
    """The clothes have a surface's colour, up to its brightness."""
    floor, *walls = room_called(recipe.room).blocks[:5]
    for material, surface in worn.items():
        blocks = [floor] if surface == "floor" else walls
        surfaces = np.array([side for block in blocks for side in (block.colour, block.second)])
        colour = np.array(recipe.colours[material])
        shares = (surfaces @ colour) / (surfaces**2).sum(axis=1)
        away = np.linalg.norm(colour - shares[:, None] * surfaces, axis=1)
        assert ((away < 0.06) & (shares > 0.8) & (shares < 1.2)).any(), material
