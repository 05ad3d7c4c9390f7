"""Capture studio: recover articulated motion from calibrated cameras by stochastic search, and watch the search.

For scripts and notebooks, the verbs of the command line as functions: `import studio`, then `studio.open_session`,
`studio.track` and so on (`dir(studio)` lists them, the guide has a page of examples). Each is imported on first
use, so that `import studio` costs nothing.
"""

import ast
import importlib
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from studio.diagnostics_archive import diagnostics as diagnostics
    from studio.errors import StudioError as StudioError
    from studio.operations.behaviours import learn as learn
    from studio.operations.behaviours import models as models
    from studio.operations.cameras import align as align
    from studio.operations.cameras import board as board
    from studio.operations.cameras import calibrate as calibrate
    from studio.operations.cameras import unalign as unalign
    from studio.operations.comparing import compare as compare
    from studio.operations.comparing import sweep as sweep
    from studio.operations.course import course as course
    from studio.operations.footage import add_footage as add_footage
    from studio.operations.footage import import_footage as import_footage
    from studio.operations.footage import new_session as new_session
    from studio.operations.footage import record as record
    from studio.operations.footage import synchronise as synchronise
    from studio.operations.footage import synthesize as synthesize
    from studio.operations.gallery import gallery as gallery
    from studio.operations.inspecting import compare_runs as compare_runs
    from studio.operations.inspecting import seeds as seeds
    from studio.operations.inspecting import view as view
    from studio.operations.inspecting import why as why
    from studio.operations.masks import background as background
    from studio.operations.masks import mask_quality as mask_quality
    from studio.operations.opening import bodies as bodies
    from studio.operations.opening import list_runs as list_runs
    from studio.operations.opening import list_sessions as list_sessions
    from studio.operations.opening import open_run as open_run
    from studio.operations.opening import open_session as open_session
    from studio.operations.opening import way as way
    from studio.operations.own_bodies import edit_body as edit_body
    from studio.operations.person import fit_subject as fit_subject
    from studio.operations.person import initialise as initialise
    from studio.operations.person import subject as subject
    from studio.operations.remote import batch as batch
    from studio.operations.remote import download as download
    from studio.operations.remote import upload as upload
    from studio.operations.results import check as check
    from studio.operations.results import evaluate as evaluate
    from studio.operations.results import export_run as export_run
    from studio.operations.results import list_tracks as list_tracks
    from studio.operations.results import markers as markers
    from studio.operations.results import read_track as read_track
    from studio.operations.results import refine as refine
    from studio.operations.results import smooth as smooth
    from studio.operations.results import verify as verify
    from studio.operations.sharing import share as share
    from studio.operations.subjects import subjects as subjects
    from studio.operations.subjects import together as together
    from studio.operations.tracking import correct as correct
    from studio.operations.tracking import go_on as go_on
    from studio.operations.tracking import live as live
    from studio.operations.tracking import new_run as new_run
    from studio.operations.tracking import replay as replay
    from studio.operations.tracking import resume_live as resume_live
    from studio.operations.tracking import track as track
    from studio.self_check import doctor as doctor


def _places() -> dict[str, str]:
    """The module of each verb, as the imports above name it: they are its one declaration, and are not run."""
    block = next(node for node in ast.parse(Path(__file__).read_bytes()).body if isinstance(node, ast.If))
    imports = [node for node in block.body if isinstance(node, ast.ImportFrom)]
    return {entry.name: str(node.module) for node in imports for entry in node.names}


_PLACE_OF = _places()


def __getattr__(name: str) -> object:
    """A verb, imported on first use."""
    if name not in _PLACE_OF:
        raise AttributeError(f"module 'studio' has no attribute '{name}'")
    found = getattr(importlib.import_module(_PLACE_OF[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    """The verbs."""
    return sorted(_PLACE_OF)
