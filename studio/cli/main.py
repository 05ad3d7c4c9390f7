"""The command line's front door."""

import importlib
import importlib.metadata

import click

# A command's module is imported when the command is asked for, so that none waits for what it does not use.
COMMANDS = {
    "demo": (
        "serving_commands",
        "demo",
        "Track the bundled walk in the browser: prints the address to open.",
    ),
    "serve": ("serving_commands", "serve", "Open the studio on a workspace: prints the address to open."),
    "import": ("footage_commands", "import_command", "Make a session from footage and calibration."),
    "new": ("footage_commands", "new_command", "Make an empty session."),
    "add-footage": ("footage_commands", "add_footage_command", "Add footage to a session that is there."),
    "way": ("session_commands", "way_command", "Tell how far a session is, and what is next."),
    "synchronise": (
        "footage_commands",
        "synchronise_command",
        "Put a session's cameras in step and turn them: estimated, by hand, by times.",
    ),
    "calibrate": (
        "camera_commands",
        "calibrate_command",
        "Solve cameras from footage of a printed board.",
    ),
    "board": ("camera_commands", "board_command", "Make a calibration board to print, as PDF."),
    "background": (
        "mask_commands",
        "background_command",
        "Choose where a session's masks come from, and see how well its views agree.",
    ),
    "align": (
        "camera_commands",
        "align_command",
        "Turn cameras a little so that the silhouettes of all views agree.",
    ),
    "subject": (
        "person_commands",
        "subject_command",
        "Write down who is in front of the cameras: a height, lengths.",
    ),
    "fit-subject": (
        "person_commands",
        "fit_subject_command",
        "Find limb lengths and radii on the silhouettes of a few frames.",
    ),
    "initialise": (
        "person_commands",
        "initialise_command",
        "Find the pose in a frame, and with it a start pose.",
    ),
    "track": ("tracking_commands", "track_command", "Track a session and store the run."),
    "live": (
        "tracking_commands",
        "live_command",
        "Track a session as its pictures come, dropping what comes too fast.",
    ),
    "record": ("footage_commands", "record_command", "Record live cameras all at once into a session."),
    "evaluate": ("result_commands", "evaluate_command", "Measure a run against the true markers."),
    "check": ("result_commands", "check_command", "Tell how well a run fits its pictures, frame by frame."),
    "refine": (
        "result_commands",
        "refine_command",
        "Refine a run's poses on the silhouettes, kept beside them.",
    ),
    "smooth": ("result_commands", "smooth_command", "Smooth a run's poses in time, fill short gaps."),
    "correct": (
        "tracking_commands",
        "correct_command",
        "Give a run the right pose in a frame and track on from it.",
    ),
    "compare": (
        "comparison_commands",
        "compare_command",
        "Compare trackers fairly on a session with a truth.",
    ),
    "learn": ("behaviour_commands", "learn_command", "Learn what a body tends to do from recorded motion."),
    "models": ("behaviour_commands", "models_command", "List the behaviour models."),
    "export": (
        "result_commands",
        "export_command",
        "Write a run's motion to BVH, C3D, TRC, GLB, video and more.",
    ),
    "synthesize": ("footage_commands", "synthesize_command", "Render footage with exact truth."),
    "reproduce": (
        "reproduction_commands",
        "reproduce_command",
        "Rerun the papers' experiments: numbers, charts and verdicts.",
    ),
    "bodies": ("session_commands", "bodies_command", "List the bodies."),
    "runs": ("session_commands", "runs_command", "List the runs."),
    "verify": (
        "result_commands",
        "verify_command",
        "Compare all that is stored with its checksums; repair frames.",
    ),
    "doctor": (
        "doctor_commands",
        "doctor_command",
        "Try all that the studio stands on, and say what to do.",
    ),
    "bench": ("bench_commands", "bench", "Measure kernels, hulls, a slider's answer and live tracking."),
}


class _Commands(click.Group):
    """A group whose members are imported when they are used."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module, name, _ = COMMANDS[cmd_name]
        return getattr(importlib.import_module(f"studio.cli.{module}"), name)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, summary) for name, (_, _, summary) in COMMANDS.items()])


@click.group(
    cls=_Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110}
)
@click.version_option(importlib.metadata.version("capture-studio"), prog_name="studio")
def main() -> None:
    """Recover the motion of an articulated body from calibrated cameras, and watch the search do it.

    Start with `studio demo`. A SESSION is named by its path or by its name in the workspace
    (STUDIO_WORKSPACE, or your user data folder).
    """
