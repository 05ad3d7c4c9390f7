"""The command `studio`."""

import ast
import functools
import gc
import importlib
import os
import re

import click

from studio.foundations.package import package_folder, software_version

# Read when NumPy is loaded. Matrices are as small as a body has parameters: on busy cores threads of BLAS wait for one
# another, 40 times as long as one thread needs.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A command's module is imported when the command is called, so that no other waits for it: here is the module in this
# room, and the function whose docstring says what the command does.
COMMANDS = {
    "demo": ("serving_commands", "cli.serving_commands.demo_command"),
    "serve": ("serving_commands", "cli.serving_commands.serve_command"),
    "import": ("footage_commands", "operations.footage.import_footage"),
    "new": ("footage_commands", "operations.footage.new_session"),
    "add-footage": ("footage_commands", "operations.footage.add_footage"),
    "workflow": ("session_commands", "operations.opening.workflow"),
    "synchronise": ("footage_commands", "operations.footage.synchronise"),
    "calibrate": ("camera_commands", "operations.cameras.calibrate"),
    "board": ("camera_commands", "operations.cameras.board"),
    "background": ("mask_commands", "operations.masks.background"),
    "subjects": ("person_commands", "operations.subjects.subjects"),
    "together": ("person_commands", "operations.subjects.together"),
    "align": ("camera_commands", "operations.cameras.align"),
    "level": ("camera_commands", "operations.cameras.level"),
    "subject": ("person_commands", "operations.person.subject"),
    "fit-subject": ("person_commands", "operations.person.fit_subject"),
    "initialise": ("person_commands", "operations.person.initialise"),
    "landmarks": ("person_commands", "operations.person.landmarks"),
    "track": ("tracking_commands", "operations.tracking.track"),
    "batch": ("remote_commands", "operations.remote.batch"),
    "live": ("tracking_commands", "operations.tracking.live"),
    "record": ("footage_commands", "operations.footage.record"),
    "evaluate": ("result_commands", "operations.results.evaluate"),
    "check": ("result_commands", "operations.results.check"),
    "view": ("inspection_commands", "operations.inspecting.view"),
    "why": ("inspection_commands", "operations.inspecting.why"),
    "seeds": ("inspection_commands", "operations.inspecting.seeds"),
    "split-error": ("inspection_commands", "operations.inspecting.split_error"),
    "uncertainty": ("inspection_commands", "operations.inspecting.uncertainty"),
    "rig": ("inspection_commands", "operations.rigs.rig"),
    "compare-runs": ("inspection_commands", "operations.inspecting.compare_runs"),
    "refine": ("result_commands", "operations.results.refine"),
    "smooth": ("result_commands", "operations.results.smooth"),
    "correct": ("tracking_commands", "operations.tracking.correct"),
    "branch": ("tracking_commands", "operations.tracking.branch"),
    "compare": ("comparison_commands", "operations.comparing.compare"),
    "sweep": ("comparison_commands", "operations.comparing.sweep"),
    "arena": ("arena_commands", "cli.arena_commands.arena_command"),
    "learn": ("behaviour_commands", "operations.behaviours.learn"),
    "models": ("behaviour_commands", "operations.behaviours.models"),
    "note": ("note_commands", "operations.notes.note"),
    "notes": ("note_commands", "operations.notes.notes"),
    "export": ("result_commands", "operations.results.export_run"),
    "share": ("result_commands", "operations.sharing.share"),
    "synthesize": ("footage_commands", "operations.footage.synthesize"),
    "course": ("result_commands", "operations.course.course"),
    "reproduce": ("reproduction_commands", "cli.reproduction_commands.reproduce_command"),
    "gallery": ("session_commands", "operations.gallery.gallery"),
    "bodies": ("session_commands", "operations.opening.bodies"),
    "edit-body": ("session_commands", "operations.own_bodies.edit_body"),
    "body-from-film": ("session_commands", "operations.filmed_bodies.body_from_film"),
    "carry-clicks": ("session_commands", "operations.filmed_bodies.carry_clicks"),
    "runs": ("session_commands", "cli.session_commands.runs_command"),
    "upload": ("remote_commands", "operations.remote.upload"),
    "download": ("remote_commands", "operations.remote.download"),
    "inspect": ("session_commands", "operations.foreign.inspect"),
    "verify": ("result_commands", "operations.results.verify"),
    "doctor": ("doctor_commands", "cli.self_check.doctor"),
    "diagnostics": ("doctor_commands", "cli.diagnostics_archive.diagnostics"),
    "bench": ("bench_commands", "cli.bench_commands.bench_command"),
}
NO_MEMORY = re.compile(r"failed to map segment|cannot allocate memory", re.IGNORECASE)
"""What the system's loader says of a library that does not fit."""


def load(name: str) -> click.Command:
    module, _ = COMMANDS[name]
    # What is imported stays: to look for garbage in it meanwhile is a sixth of the time.
    gc.disable()
    try:
        return getattr(importlib.import_module(f"studio.cli.{module}"), f"{name.replace('-', '_')}_command")
    except (ImportError, MemoryError) as error:
        if not (isinstance(error, MemoryError) or NO_MEMORY.search(str(error))):
            raise
        raise click.UsageError(
            "There is not enough memory to load the studio. Close other programs, or raise the limit (ulimit -v)."
        ) from None
    finally:
        gc.enable()


def summary(name: str) -> str:
    """What a command does, to the first stop of the docstring: read from the source, which is not imported for it."""
    module, _, function = COMMANDS[name][1].rpartition(".")
    about = _docstrings(module)[function].split("\n\n")[0]
    return re.split(r"[.;:](?:\s|$)", " ".join(about.split()), maxsplit=1)[0] + "."


@functools.cache
def _docstrings(module: str) -> dict[str, str]:
    tree = ast.parse((package_folder() / f"{module.replace('.', '/')}.py").read_text("utf-8"))
    return {one.name: ast.get_docstring(one) or "" for one in tree.body if isinstance(one, ast.FunctionDef)}


class _Commands(click.Group):
    """A group whose members are imported when they are used."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        return load(cmd_name) if cmd_name in COMMANDS else None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, summary(name)) for name in COMMANDS])


@click.group(
    cls=_Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110}
)
@click.version_option(software_version(), prog_name="studio")
def main() -> None:
    """Recover the motion of an articulated body from calibrated cameras, and watch the search do it.

    Start with `studio demo`. A SESSION is named by its path or by its name in the workspace
    (STUDIO_WORKSPACE, or your user data folder).
    """
