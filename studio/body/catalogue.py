"""The available bodies: those of the package and those of a user's folders."""

from importlib import resources
from pathlib import Path

from studio.body.model import BodyModel
from studio.body.reader import parse_body, read_body
from studio.errors import BodyError

SUFFIX = ".toml"


def list_bodies(extra_folders: tuple[Path, ...] = ()) -> tuple[str, ...]:
    """The names of all bodies, sorted. extra_folders : folders with further body files, or none."""
    names = set(_packaged())
    for folder in extra_folders:
        names.update(path.stem for path in folder.glob(f"*{SUFFIX}"))
    return tuple(sorted(names))


def load_body(name_or_path: str, extra_folders: tuple[Path, ...] = ()) -> BodyModel:
    """The body of a name (a user's folder goes before the package) or of a path ending in .toml.

    Raises BodyError when there is none of that name, or when its file is wrong.
    """
    if name_or_path.endswith(SUFFIX):
        return read_body(Path(name_or_path))
    for folder in extra_folders:
        path = folder / f"{name_or_path}{SUFFIX}"
        if name_or_path == path.stem and path.is_file():
            return read_body(path)
    if name_or_path in _packaged():
        file = f"{name_or_path}{SUFFIX}"
        text = (resources.files("studio.body") / "models" / file).read_text(encoding="utf-8")
        return parse_body(text, name_or_path, file)
    known = ", ".join(list_bodies(extra_folders))
    hint = f"Known: {known}; or give the path of a {SUFFIX} file."
    raise BodyError(f"There is no body '{name_or_path}'.", hint)


def _packaged() -> tuple[str, ...]:
    files = (resources.files("studio.body") / "models").iterdir()
    return tuple(sorted(entry.name.removesuffix(SUFFIX) for entry in files if entry.name.endswith(SUFFIX)))
