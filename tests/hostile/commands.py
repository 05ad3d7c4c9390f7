"""The commands that are tried on a hostile session, and those that are not."""

from collections.abc import Sequence

from hostile.makers import NAME, RUN

SESSION_COMMANDS: dict[str, Sequence[Sequence[str]]] = {
    "runs": (("runs",), ("runs", NAME)),
    "workflow": (("workflow", NAME),),
    "verify": (("verify", NAME), ("verify", NAME, "--repair")),
    "inspect": (("inspect", NAME),),
    "subject": (("subject", NAME),),
    "background": (("background", NAME),),
    "bodies": (("bodies", NAME),),
    "evaluate": (("evaluate", f"{NAME}/{RUN}"),),
    "why": (("why", f"{NAME}/{RUN}", "--frame", "1"),),
    "view": (("view", f"{NAME}/{RUN}", "variance"),),
    "smooth": (("smooth", f"{NAME}/{RUN}"),),
    "export": (("export", f"{NAME}/{RUN}", "--as", "csv", "--out", "{out}/motion.csv"),),
    "upload": (("upload", NAME, "--to", "{out}/put"),),
    "diagnostics": (("diagnostics", NAME, "--out", "{out}/diagnostics.zip"),),
    "share": (("share", f"{NAME}/{RUN}", "--out", "{out}/page.html"),),
    "synchronise": (("synchronise", NAME),),
    "check": (("check", f"{NAME}/{RUN}"),),
    "notes": (("notes", f"{NAME}/{RUN}"),),
    "note": (("note", f"{NAME}/{RUN}", "--frame", "1"),),
    "import": (("import", "{session}", "--into", "again"),),
    "add-footage": (("add-footage", NAME, "{session}"),),
}

OTHERS = {
    "demo": "serves",
    "serve": "serves",
    "new": "makes a session",
    "calibrate": "of footage; minutes",
    "board": "no session",
    "subjects": "minutes",
    "together": "minutes",
    "align": "minutes",
    "fit-subject": "minutes",
    "initialise": "minutes",
    "track": "minutes",
    "batch": "minutes",
    "live": "a clock",
    "record": "cameras",
    "seeds": "minutes",
    "compare-runs": "reads as view does",
    "refine": "minutes",
    "correct": "minutes",
    "branch": "tracks",
    "compare": "minutes",
    "sweep": "minutes",
    "learn": "minutes",
    "models": "no session",
    "synthesize": "makes a session",
    "course": "minutes",
    "reproduce": "minutes",
    "gallery": "makes a session",
    "edit-body": "bodies of the workspace",
    "download": "from a store",
    "doctor": "no session",
    "bench": "minutes",
}
"""Commands that are not tried, and why."""
