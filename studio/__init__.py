"""Capture studio: recover articulated motion from calibrated cameras by stochastic search, and watch the search.

For scripts and notebooks, the verbs of the command line as functions: `import studio`, then `studio.open_session`,
`studio.track` and so on (`dir(studio)` lists them, the guide has a page of examples). Each is imported on first
use, so that `import studio` costs nothing. `studio.arena` has the arena's.
"""

from studio.foundations.first_use import on_first_use

_VERBS = {
    "studio.cli.diagnostics_archive": ("diagnostics",),
    "studio.foundations.errors": ("StudioError",),
    "studio.operations.behaviours": ("learn", "models"),
    "studio.operations.cameras": ("align", "board", "calibrate", "level", "unalign"),
    "studio.operations.comparing": ("compare", "sweep"),
    "studio.operations.course": ("course",),
    "studio.operations.footage": (
        "add_footage",
        "import_footage",
        "new_session",
        "record",
        "synchronise",
        "synthesize",
    ),
    "studio.operations.foreign": ("inspect",),
    "studio.operations.gallery": ("gallery",),
    "studio.operations.inspecting": ("compare_runs", "seeds", "split_error", "uncertainty", "view", "why"),
    "studio.operations.masks": ("background", "mask_quality"),
    "studio.operations.notes": ("note", "notes"),
    "studio.operations.opening": (
        "bodies",
        "inference_data",
        "list_runs",
        "list_sessions",
        "open_run",
        "open_session",
        "workflow",
    ),
    "studio.operations.filmed_bodies": ("body_from_film", "carry_clicks"),
    "studio.operations.own_bodies": ("edit_body",),
    "studio.operations.person": ("fit_subject", "initialise", "landmarks", "subject"),
    "studio.operations.remote": ("batch", "download", "upload"),
    "studio.operations.results": (
        "check",
        "evaluate",
        "export_run",
        "list_tracks",
        "markers",
        "read_track",
        "refine",
        "smooth",
        "verify",
    ),
    "studio.operations.rigs": ("rig",),
    "studio.operations.sharing": ("share",),
    "studio.operations.subjects": ("subjects", "together"),
    "studio.operations.tracking": (
        "branch",
        "correct",
        "go_on",
        "live",
        "new_run",
        "replay",
        "resume_live",
        "track",
    ),
    "studio.cli.self_check": ("doctor",),
}
__getattr__, __dir__ = on_first_use(__name__, _VERBS, ("arena",))
