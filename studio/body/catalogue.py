"""The available bodies: those of the package and those of a user's folders, robots' files among them."""

from importlib import resources
from pathlib import Path

from studio.body.model import BodyModel
from studio.body.reader import parse_body, read_body
from studio.body.robots import ROBOT_SUFFIXES, is_robot, read_robot
from studio.body.writing import body_text
from studio.foundations.errors import BodyError

SUFFIX = ".toml"


def list_bodies(extra_folders: tuple[Path, ...] = ()) -> tuple[str, ...]:
    """The names of all bodies, sorted. extra_folders : folders with further body files, or none."""
    names = set(packaged_bodies())
    for folder in extra_folders:
        names.update(path.stem for path in body_files(folder))
    return tuple(sorted(names))


def body_files(folder: Path) -> tuple[Path, ...]:
    """The files of a folder that are bodies by their names, sorted; of several of one name, TOML goes first."""
    files: dict[str, Path] = {}
    for suffix in (SUFFIX, *ROBOT_SUFFIXES):
        for path in folder.glob(f"*{suffix}"):
            files.setdefault(path.stem, path)
    return tuple(sorted(files.values()))


def load_body(name_or_path: str, extra_folders: tuple[Path, ...] = ()) -> BodyModel:
    """The body of a name (searched in a user's folder first, then in the package) or of a path (.toml, .urdf, .xml,
    .mjcf).

    Raises BodyError for an unknown name or a wrong file.
    """
    path = body_path(name_or_path, extra_folders)
    if path is not None:
        return read_robot(path) if is_robot(path) else read_body(path)
    if name_or_path in packaged_bodies():
        return parse_body(_packaged_text(name_or_path), name_or_path, f"{name_or_path}{SUFFIX}")
    known = ", ".join(list_bodies(extra_folders))
    hint = f"Known: {known}; or give the path of a file that ends in {', '.join((SUFFIX, *ROBOT_SUFFIXES))}."
    raise BodyError(f"There is no body '{name_or_path}'.", hint)


def body_file_text(name_or_path: str, extra_folders: tuple[Path, ...] = ()) -> str:
    """The text (TOML) of the file of a body, made of a robot's. Raises like `load_body`."""
    path = body_path(name_or_path, extra_folders)
    if path is None and name_or_path in packaged_bodies():
        return _packaged_text(name_or_path)
    if path is None or is_robot(path):
        return body_text(load_body(name_or_path, extra_folders))
    return path.read_text(encoding="utf-8")


def body_path(name_or_path: str, extra_folders: tuple[Path, ...] = ()) -> Path | None:
    """The file of a path, or of a name in a user's folder; None for other names."""
    if Path(name_or_path).suffix in (SUFFIX, *ROBOT_SUFFIXES):
        return Path(name_or_path)
    for folder in extra_folders:
        for path in body_files(folder):
            if name_or_path == path.stem:
                return path
    return None


def _packaged_text(name: str) -> str:
    return (resources.files("studio.body") / "models" / f"{name}{SUFFIX}").read_text(encoding="utf-8")


def packaged_bodies() -> tuple[str, ...]:
    """The names of the bodies that are shipped, sorted."""
    files = (resources.files("studio.body") / "models").iterdir()
    return tuple(sorted(entry.name.removesuffix(SUFFIX) for entry in files if entry.name.endswith(SUFFIX)))
