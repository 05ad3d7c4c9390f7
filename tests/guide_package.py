"""The guide's example package, laid out as an installation would leave it."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "web_assets" / "guide" / "adding.md").read_text(encoding="utf-8")
FILES = dict(re.findall(r"^```(?:toml|python)\n# (\S+)\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE))


def lay_out(folder: Path, files: dict[str, str], name: str, points: dict[str, dict[str, str]]) -> None:
    """What installing a package leaves: its modules, and its entry points beside them."""
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")
    about = folder / f"{name.replace('-', '_')}-1.0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", encoding="utf-8")
    lines = [
        f"[{group}]\n" + "".join(f"{k} = {v}\n" for k, v in kept.items()) for group, kept in points.items()
    ]
    (about / "entry_points.txt").write_text("\n".join(lines), encoding="utf-8")


def install_guide_package(folder: Path) -> None:
    """The package of the guide's page, as it stands there."""
    project = tomllib.loads(FILES["pyproject.toml"])["project"]
    modules = {path: text for path, text in FILES.items() if path.startswith("my_capture/")}
    lay_out(folder, modules, project["name"], project["entry-points"])
