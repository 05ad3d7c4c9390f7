"""Bundled recipes of footage, made small."""

import tomllib
from pathlib import Path

import tomli_w

from studio.results.drawing_footage.recipe_file import find_recipe


def small(folder: Path, name: str, **changes: object) -> Path:
    """A bundled recipe with few, small frames. Keys of tables are written table__key."""
    entries = tomllib.loads(find_recipe(name).read_text())
    settings = {"frames": 4, "picture__samples": 1, "picture__empty_frames": 3} | changes
    if entries["motion"] != "arm":
        settings = {"picture__width": 160, "picture__height": 120} | settings
    for key, value in settings.items():
        table, _, entry = key.rpartition("__")
        (entries.setdefault(table, {}) if table else entries)[entry] = value
    path = folder / f"{name}.toml"
    path.write_text(tomli_w.dumps(entries))
    return path
