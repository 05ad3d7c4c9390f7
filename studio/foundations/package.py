"""The studio's own package: its version, its folder, and the pages' files that travel with it."""

from importlib import metadata
from pathlib import Path, PurePosixPath

DISTRIBUTION = "capture-studio"
INSTALLED_ASSETS = PurePosixPath("app/assets")
"""Where an installed package has the pages, below its own folder (`hatch_build.py` puts them there)."""


def software_version() -> str:
    try:
        return metadata.version(DISTRIBUTION)
    except metadata.PackageNotFoundError:
        return "not installed"


def package_folder() -> Path:
    return Path(__file__).resolve().parents[1]


def assets_folder() -> Path:
    """The folder of the pages' files: inside an installed package, `web_assets` in a checkout."""
    installed = package_folder() / INSTALLED_ASSETS
    return installed if installed.is_dir() else package_folder().parent / "web_assets"
