"""Capture studio: recover articulated motion from calibrated cameras by stochastic search, and watch the search.

For scripts and notebooks, the verbs of the command line as functions: `import studio`, then `studio.open_session`,
`studio.track` and so on (`dir(studio)` lists them, the guide has a page of examples). Each is imported on first
use, so that `import studio` costs nothing.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from studio.errors import StudioError as StudioError
    from studio.notebook.aligning import align as align
    from studio.notebook.aligning import unalign as unalign
    from studio.notebook.checking import check as check
    from studio.notebook.doctor import doctor as doctor
    from studio.notebook.exporting import export_run as export_run
    from studio.notebook.learning import learn as learn
    from studio.notebook.opening import list_runs as list_runs
    from studio.notebook.opening import list_sessions as list_sessions
    from studio.notebook.opening import open_run as open_run
    from studio.notebook.opening import open_session as open_session
    from studio.notebook.preparing import background as background
    from studio.notebook.preparing import fit_subject as fit_subject
    from studio.notebook.preparing import import_footage as import_footage
    from studio.notebook.preparing import initialise as initialise
    from studio.notebook.preparing import mask_quality as mask_quality
    from studio.notebook.preparing import subject as subject
    from studio.notebook.preparing import synthesize as synthesize
    from studio.notebook.recording import record as record
    from studio.notebook.results import evaluate as evaluate
    from studio.notebook.results import list_tracks as list_tracks
    from studio.notebook.results import markers as markers
    from studio.notebook.results import read_track as read_track
    from studio.notebook.solving_cameras import calibrate as calibrate
    from studio.notebook.tracking import correct as correct
    from studio.notebook.tracking import go_on as go_on
    from studio.notebook.tracking import refine as refine
    from studio.notebook.tracking import smooth as smooth
    from studio.notebook.tracking import track as track

_PLACES = {
    "errors": ("StudioError",),
    "notebook.opening": ("list_runs", "list_sessions", "open_run", "open_session"),
    "notebook.preparing": (
        "background", "fit_subject", "import_footage", "initialise", "mask_quality", "subject", "synthesize",
    ),
    "notebook.aligning": ("align", "unalign"),
    "notebook.checking": ("check",),
    "notebook.doctor": ("doctor",),
    "notebook.solving_cameras": ("calibrate",),
    "notebook.tracking": ("correct", "go_on", "refine", "smooth", "track"),
    "notebook.recording": ("record",),
    "notebook.exporting": ("export_run",),
    "notebook.results": ("evaluate", "list_tracks", "markers", "read_track"),
    "notebook.learning": ("learn",),
}  # fmt: skip
_PLACE_OF = {name: place for place, names in _PLACES.items() for name in names}


def __getattr__(name: str) -> object:
    """A verb, imported on first use."""
    if name not in _PLACE_OF:
        raise AttributeError(f"module 'studio' has no attribute '{name}'")
    found = getattr(importlib.import_module(f"studio.{_PLACE_OF[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    """The verbs."""
    return sorted(_PLACE_OF)
