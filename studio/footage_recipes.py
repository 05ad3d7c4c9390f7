"""Recipes of footage by name: the five functions that the studio uses of the room `synthesis`.

Making footage is a leaf: no room of the product imports it. These functions load the room on first use, like a
command's module.
"""

import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from studio.body.person import PersonMotion, Skeleton
from studio.progress import Progress, unheard


def recipe_names() -> tuple[str, ...]:
    """The recipes that come with the studio."""
    return _synthesis("recipe_file").recipe_names()


def person_of_recipe(
    recipe: str | Path,
    skeleton: Skeleton,
    *,
    options: Mapping[str, float] | None = None,
    frames: int | None = None,
) -> PersonMotion:
    """The motion of a recipe (a file or a bundled name) on a skeleton; nothing is rendered.

    options, frames : in place of the recipe's own. Raises StudioError, for a recipe without a person too.
    """
    return _synthesis("recipes").person_of_recipe(recipe, skeleton, options, frames)


def missing_data(recipe: str | Path) -> str:
    """Why a recipe cannot be rendered here: the first file of the real data that it names and that is not there; ""
    where all are. Raises StudioError for a recipe that cannot be read.
    """
    return _synthesis("real_data").missing_data(_synthesis("recipe_file").find_recipe(recipe))


def real_footage(place: str) -> Path | None:
    """Footage that cannot be shipped, by its place in the folder of the real data; None where it is not there."""
    return _synthesis("real_data").real_footage(place)


def synthesize(
    recipe: str | Path, into: Path, progress: Progress = unheard, frames: int | None = None
) -> Path:
    """Render a recipe's footage and make a session of it in the new folder `into`; returns it.

    frames : only the first so many. Raises StudioError.
    """
    return _synthesis("recipes").synthesize(recipe, into, progress, frames)


def _synthesis(module: str) -> Any:  # noqa: ANN401 - a module
    return importlib.import_module(f"studio.synthesis.{module}")
