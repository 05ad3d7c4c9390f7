"""Real data used by recipes (calibrations, body shapes, recorded motion); never part of the project.

Its folder is given by the environment variable STUDIO_REAL_DATA, by default ../shared/data beside the
working folder. A recipe names a file in it as "data:lee-walk/CALIB".
"""

import os
import re
from pathlib import Path

from studio.foundations.errors import StudioError

VARIABLE = "STUDIO_REAL_DATA"
PREFIX = "data:"
DEFAULT = Path("..") / "shared" / "data"


def real_data_folder() -> Path:
    """The folder of the real data, whether or not it exists."""
    return Path(os.environ.get(VARIABLE, "") or DEFAULT)


def located(reference: str, recipe_folder: Path) -> Path:
    """The path of a file that a recipe names: in the real data after "data:", else relative to the recipe.

    Raises StudioError where it does not exist.
    """
    if not reference.startswith(PREFIX):
        path = recipe_folder / reference
        hint = "Check the recipe's path; it is relative to the recipe's own folder."
    else:
        path = real_data_folder() / reference.removeprefix(PREFIX)
        hint = f"Set {VARIABLE} to the folder that holds the real data; see the README."
    if not path.exists():
        raise StudioError(f"'{path}' does not exist.", hint)
    return path


def real_footage(place: str) -> Path | None:
    """A folder of the real data, by its place in it; None where it is missing."""
    path = real_data_folder() / place
    return path if path.is_dir() else None


def missing_data(recipe: Path) -> str:
    """Which file of the real data that a recipe names is missing, in words; "" for none."""
    for reference in re.findall(rf"[\"']({PREFIX}[^\"']+)[\"']", recipe.read_text(encoding="utf-8")):
        try:
            located(reference, recipe.parent)
        except StudioError as problem:
            return f"{problem.message} {problem.hint}"
    return ""
