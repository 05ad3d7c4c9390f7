"""The commands that are tried on a hostile session, and those that are not."""

from collections.abc import Sequence

from hostile.makers import NAME, RUN

ABOUT_RUN = (NAME, RUN)
SESSION_COMMANDS: dict[str, Sequence[Sequence[str]]] = {
    "runs": (("runs",), ("runs", NAME)),
    "workflow": (("workflow", NAME),),
    "verify": (("verify", NAME), ("verify", NAME, "--repair")),
    "inspect": (("inspect", NAME),),
    "subject": (("subject", NAME),),
    "background": (("background", NAME),),
    "bodies": (("bodies",),),
    "evaluate": (("evaluate", *ABOUT_RUN),),
    "why": (("why", *ABOUT_RUN, "--frame", "1"),),
    "view": (("view", *ABOUT_RUN, "--view", "variance", "--frame", "1"),),
    "notes": (("notes", *ABOUT_RUN),),
    "note": (("note", *ABOUT_RUN, "--frame", "1"),),
    "check": (("check", *ABOUT_RUN),),
    "smooth": (("smooth", *ABOUT_RUN),),
    "refine": (("refine", *ABOUT_RUN),),
    "export": (
        ("export", *ABOUT_RUN, "--to", "{out}/motion.csv"),
        ("export", *ABOUT_RUN, "--to", "{out}/motion.bvh"),
    ),
    "share": (("share", *ABOUT_RUN, "--to", "{out}/page.html"),),
    "track": (
        (
            "track",
            NAME,
            "--particles",
            "20",
            "--layers",
            "2",
            "--frames",
            "0:1",
            "--name",
            "again",
            "--keep-shape",
        ),
    ),
    "upload": (("upload", NAME, "--to", "{out}/put"),),
    "diagnostics": (("diagnostics", "--out", "{out}/diagnostics.zip"),),
    "synchronise": (("synchronise", NAME, "--rotate", "front=180"),),
    "import": (("import", "{session}", "--into", "again"),),
    "add-footage": (("add-footage", NAME, "{session}", "--replace"),),
}
"""All of them end well on the session as it is."""

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
    "landmarks": "minutes",
    "batch": "minutes",
    "level": "a session of several cameras",
    "live": "a clock",
    "record": "cameras",
    "seeds": "minutes",
    "split-error": "minutes",
    "uncertainty": "minutes",
    "rig": "minutes",
    "compare-runs": "reads as view does",
    "correct": "minutes",
    "branch": "tracks",
    "compare": "minutes",
    "arena": "no session, but for export, which reads as split-error does; minutes",
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
