"""`studio track`."""

import csv
import dataclasses
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import click

from studio.body.subject import read_subject
from studio.cli.arguments import frame_range
from studio.cli.knob_options import chosen_changes, given, knob_options
from studio.cli.output import MemberChoice, command, note, notes_once, progress
from studio.errors import RunError
from studio.progress import Progress
from studio.runs.new_run import DESPITE, RunRequest, prepare_run
from studio.runs.sides import exchanged_sides, in_words
from studio.runs.start_pose_file import frame_of_file, start_pose_from_file
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace
from studio.settings import DEFAULT_WEIGHTING, knob_table
from studio.tracking.catalogue import TRACKERS
from studio.tracking.tracker import LIMB_LOST, LOST, NO_EVIDENCE, RECOVERED
from studio.weighting.catalogue import WEIGHTINGS
from studio.worker.batch import BatchResult, track_to_end

F = TypeVar("F", bound=Callable[..., object])

DESPITE_OPTION = click.option(
    "--despite-findings", is_flag=True, help="Track although the footage speaks against the calibration."
)
OPTION_KNOBS = ("particles", "layers", "survival", "crossover")


def own_options(function: F) -> F:
    """The options of the knobs that have one of their own."""
    declared = {entry.name: entry for entry in reversed(knob_table())}
    return knob_options([declared[name] for name in OPTION_KNOBS], with_defaults=False)(function)


def say_run_notes(run: StoredRun) -> None:
    """A run's notes: what holds for the session once, what was accepted for this run always."""
    accepted = [line for line in run.record.notes if line.startswith(DESPITE)]
    notes_once(run.folder.parent.parent, [line for line in run.record.notes if line not in accepted])
    for line in accepted:
        note(line)


@contextmanager
def tracking_shown(run: StoredRun, standing: Callable[[], str]) -> Iterator[Progress]:
    """A run's notes, then how far it is; what earlier commands said of the session is not said again. standing : in
    words how far it came, said when somebody interrupts it.
    """
    where = f"{run.session_name} / {run.name}"
    say_run_notes(run)
    try:
        with progress(where) as report:
            yield report
    except KeyboardInterrupt:
        note(f"{where}: {standing()}")
        raise


def told_run(run: StoredRun) -> dict[str, object]:
    """What `--json` says of any run: which it is."""
    record = run.record
    return {
        "session": run.session_name,
        "run": run.name,
        "tracker": record.tracker,
        "weighting": record.weighting,
        "body": record.body,
        "seed": record.seed,
    }


@click.command()
@click.argument("session")
@click.option("--tracker", type=MemberChoice(TRACKERS), help="Default: the session's own, else annealed.")
@click.option(
    "--weighting",
    type=MemberChoice(WEIGHTINGS),
    help=f"Default: the session's own, else {DEFAULT_WEIGHTING}.",
)
@click.option(
    "--body", default="", metavar="NAME", help="Kinematic tree; the session's subject still scales it."
)
@click.option(
    "--subject", type=click.Path(path_type=Path), help="subject.toml to use instead of the session's."
)
@click.option(
    "--start-pose", type=click.Path(path_type=Path), help="A CSV row, or a TRC met by inverse kinematics."
)
@click.option(
    "--behaviour",
    default="",
    metavar="MODEL",
    help="Behaviour model, by name or file, for tracker behaviour or --set prediction=behaviour.",
)
@own_options
@click.option(
    "--frames",
    metavar="A:B",
    default=":",
    help="Half open, from 0; default: from the frame of the start pose to the end.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="The same seed gives the same run.")
@DESPITE_OPTION
@click.option(
    "--fit-shape/--keep-shape",
    default=True,
    show_default=True,
    help="Begin with the radii, hands, feet and head that the first frames show; bone lengths are kept.",
)
@click.option(
    "--set", "changes", multiple=True, metavar="KNOB=VALUE", help="Any other knob; the guide lists them."
)
@click.option("--poses", type=click.Path(path_type=Path), help="Write the poses as CSV.")
@click.option("--name", default="", help="Name of the run (letters, digits, - and _); default: numbered.")
@click.option(
    "--resume", metavar="RUN", help="Track a stored run on, as it was asked for; same result as unbroken."
)
@command
def track(
    session: str,
    tracker: str | None,
    weighting: str | None,
    body: str,
    subject: Path | None,
    start_pose: Path | None,
    behaviour: str,
    frames: str,
    seed: int,
    despite_findings: bool,
    fit_shape: bool,
    changes: tuple[str, ...],
    poses: Path | None,
    name: str,
    resume: str | None,
    **knobs: str | None,
) -> dict[str, object]:
    """Track a SESSION and store the run; Ctrl-C cancels, what was tracked stays."""
    opened = Workspace().resolve(session)
    if poses:
        _check_place(poses)
    if resume:
        run = opened.run(resume)
    else:
        first, last = frame_range(frames)
        measures = read_subject(subject) if subject else None
        request = RunRequest(
            tracker=tracker or "",
            weighting=weighting or "",
            body=body,
            subject=measures,
            first=first,
            last=last,
            seed=seed,
            changes=chosen_changes(changes) | given(knobs),
            name=name,
            behaviour=behaviour,
            despite_findings=despite_findings,
            fit_shape=fit_shape,
        )
        run = _prepared(opened, _with_start_pose(request, opened, start_pose))

    def done() -> int:
        return opened.run(run.name).summary().done

    try:
        with tracking_shown(run, lambda: f"{done()} of {run.record.frame_count} frames tracked.") as report:
            result = track_to_end(opened, run, report)
    except KeyboardInterrupt:
        if poses and done():
            _write_poses(run, poses)
        raise
    if poses:
        _write_poses(run, poses)
    text = (
        f"{opened.name} / {run.name}: {run.record.frame_count} frames in {result.seconds:.1f} s, "
        f"seed {run.record.seed}{_how_it_went(run)}"
    )
    if exchanged := exchanged_sides(run):
        text += f"\n{in_words(exchanged)}"
    return {**_told(run, result), "text": text}


def _with_start_pose(request: RunRequest, session: Session, path: Path | None) -> RunRequest:
    """The request with the start pose of a file; as it is without one."""
    if path is None:
        return request
    scaled = session.body(request.body or None, request.subject)
    first = frame_of_file(path) if request.first is None else request.first
    pose, source = start_pose_from_file(path, scaled, first, session.manifest.fps)
    return dataclasses.replace(request, first=first, start_pose=pose, start_source=source)


def _prepared(session: Session, request: RunRequest) -> StoredRun:
    """The run, with progress where its start pose has to be found or its shape fitted first."""
    with progress(f"{session.name}: preparing") as report:
        return prepare_run(session, request, report)


def _went(run: StoredRun) -> dict[str, int]:
    """How many frames were lost, without evidence, and found again after."""
    with run.results() as results:
        states = results.timeline().tracking
    return {
        "frames_lost": states.count(LOST),
        "frames_with_a_limb_lost": states.count(LIMB_LOST),
        "frames_without_evidence": states.count(NO_EVIDENCE),
        "times_recovered": states.count(RECOVERED),
    }


def _how_it_went(run: StoredRun) -> str:
    """The same in words, nothing where all frames were tracked."""
    went = _went(run)
    words = (
        f"{went['frames_lost']} frames lost",
        f"{went['frames_with_a_limb_lost']} with a limb lost",
        f"{went['frames_without_evidence']} without evidence",
        f"found again {went['times_recovered']} times",
    )
    return f"; {', '.join(words)}" if any(went.values()) else ""


def _told(run: StoredRun, result: BatchResult) -> dict[str, object]:
    """What `--json` prints of a run."""
    record = run.record
    told: dict[str, object] = {
        **told_run(run),
        "frames": record.frame_count,
        "evaluations_per_frame": result.evaluations_per_frame,
        "seconds": round(result.seconds, 3),
        "start_pose": record.start_source,
        **_went(run),
        "damaged": run.damage(),
    }
    if exchanged := exchanged_sides(run):
        told["exchanged"] = list(exchanged)
    if record.behaviour:
        told["behaviour"] = record.behaviour
    if TRACKERS[record.tracker].scales_likelihood:
        told["likelihood_scale"] = result.last_beta
    return told


def _check_place(poses: Path) -> None:
    """Refuse, before anything is tracked, a file that could not be written afterwards. Raises RunError."""
    if poses.is_dir() or not os.access(poses if poses.exists() else poses.parent, os.W_OK):
        raise RunError(
            f"The poses cannot be written to '{poses}'.", "Choose a file in a folder that can be written to."
        )


def _write_poses(run: StoredRun, path: Path) -> None:
    """CSV: frame, then one column a parameter in the body's order, radians and mm."""
    reader = run.results()
    try:
        frames, rows = reader.poses()
    finally:
        reader.close()
    try:
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(["frame", *run.record.parameters])
            writer.writerows(
                [int(frame), *map(repr, map(float, row))] for frame, row in zip(frames, rows, strict=True)
            )
    except OSError as error:
        raise RunError(
            f"'{path}' cannot be written ({error.strerror}).", "Choose another place; the run is stored."
        ) from None
