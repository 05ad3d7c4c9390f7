"""`studio learn`, `studio models`."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeVar

import click

from studio.behaviour.settings import LearningSettings
from studio.body.catalogue import load_body
from studio.cli.knob_options import given, knob_options
from studio.cli.output import command, note, progress
from studio.knobs import changed, knobs_of
from studio.sessions.session import BODIES_NAME
from studio.sessions.workspace import Workspace
from studio.training.learning import Learnt, learn, read_sources
from studio.training.model_shelf import ModelSummary, keep_model, list_models, place_for_model
from studio.training.oversampling import OversamplingSettings
from studio.training.sources import FPS, Recording

SHOWN_BAD_FRAMES = 12
SKELETON_HELP = "ASF file of the .amc sources; default: NN.asf beside NN_MM.amc."
TEST_HELP = "A source for the test entropy, again for more; default: the last fifth of each source."


class _Sources(click.Command):
    """Takes all words after --test, up to the next option, as its sources."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        spread: list[str] = []
        testing = False
        for word in args:
            if word == "--test":
                testing = True
                continue
            testing = testing and not word.startswith("-")
            spread += ["--test", word] if testing else [word]
        if args and args[-1] == "--test":
            spread.append("--test")
        return super().parse_args(ctx, spread)


@click.command("learn", cls=_Sources)
@click.argument("sources", nargs=-1, required=True)
@click.option(
    "--body",
    default="",
    metavar="NAME",
    help="Body of the model's poses; default: the workspace's sessions' own.",
)
@click.option("--into", required=True, metavar="MODEL", help="Name in the workspace's models, or a path.")
@click.option("--skeleton", type=click.Path(path_type=Path), metavar="FILE.asf", help=SKELETON_HELP)
@click.option("--test", "tests", multiple=True, metavar="SOURCES...", help=TEST_HELP)
@click.option(
    "--fps", type=click.FloatRange(5.0, 240.0), default=FPS, show_default=True, help="Frames per second."
)
@knob_options([*knobs_of(LearningSettings), *knobs_of(OversamplingSettings)])
@click.option("--seed", type=int, default=0, show_default=True, help="The same seed gives the same model.")
@click.option("--force", is_flag=True, help="Replace a model of that name.")
@command
def learn_command(
    sources: tuple[str, ...],
    body: str,
    into: str,
    skeleton: Path | None,
    tests: tuple[str, ...],
    fps: float,
    seed: int,
    force: bool,
    **knobs: str | None,
) -> dict[str, object]:
    """Learn what a body tends to do from recorded motion.

    SOURCES are motion files (.amc with its .asf, .bvh, .npz, .c3d, .trc), folders of them, earlier runs as
    SESSION/RUN, or recipes of `studio synthesize` (their motion alone). They are put on the body, oversampled with
    varied smoothing, clustered, and their order is learnt. Nothing is written before the model is whole.
    """
    workspace = Workspace()
    model_body = load_body(body or workspace.usual_body(), (workspace.root / BODIES_NAME,))
    place = place_for_model(into, workspace, replace=force)
    asked = given(knobs)
    learning, material = _settings(LearningSettings, asked), _settings(OversamplingSettings, asked)
    with progress("Reading motion") as report:
        recordings = read_sources(
            sources, model_body, skeleton, fps=fps, workspace=workspace, progress=report
        )
        tested = (
            read_sources(tests, model_body, skeleton, fps=fps, workspace=workspace, progress=report)
            if tests
            else None
        )
    for recording in (*recordings, *(tested or ())):
        _note_misfits(recording)
    with progress("Learning") as report:
        model, learnt = learn(recordings, model_body, learning, material, tested, seed=seed, progress=report)
    keep_model(model, place)
    return _told(place, model_body.name, fps, learnt, recordings)


@click.command("models")
@command
def models_command() -> dict[str, object]:
    """List the behaviour models of the workspace."""
    models = list_models(Workspace())
    lines = [_line(model) for model in models]
    return {
        "models": [_summary(model) for model in models],
        "text": "\n".join(lines) if lines else "No models yet; 'studio learn' makes them.",
    }


S = TypeVar("S", LearningSettings, OversamplingSettings)


def _settings(kind: type[S], knobs: Mapping[str, str]) -> S:
    """The settings with the knobs that were given. Raises SettingsError."""
    names = {entry.name for entry in knobs_of(kind)}
    return changed(kind(), {name: value for name, value in knobs.items() if name in names})


def _note_misfits(recording: Recording) -> None:
    """Say which frames of a recording the body cannot follow."""
    bad = recording.bad_frames
    if bad:
        note(
            f"{recording.name}: {len(bad)} of {recording.frame_count} frames fit badly "
            f"({_ranges(bad)}); the others are {recording.rms_mm:.0f} mm off in the mean."
        )


def _ranges(frames: Sequence[int]) -> str:
    """Frame numbers as ranges: "3-5, 9"."""
    found: list[list[int]] = []
    for frame in frames:
        if found and frame == found[-1][1] + 1:
            found[-1][1] = frame
        else:
            found.append([frame, frame])
    words = [f"{first}-{last}" if first < last else f"{first}" for first, last in found]
    more = f", and {len(words) - SHOWN_BAD_FRAMES} more" if len(words) > SHOWN_BAD_FRAMES else ""
    return ", ".join(words[:SHOWN_BAD_FRAMES]) + more


def _told(
    place: Path, body: str, fps: float, learnt: Learnt, recordings: Sequence[Recording]
) -> dict[str, object]:
    read = [
        {
            "name": entry.name,
            "frames": entry.frame_count,
            "rms_mm": round(entry.rms_mm, 2),
            "bad_frames": list(entry.bad_frames),
        }
        for entry in recordings
    ]
    told: dict[str, object] = {
        "model": place.stem,
        "path": str(place),
        "body": body,
        "fps": fps,
        "frames": learnt.frames,
        "clusters": learnt.clusters,
        "states": learnt.states,
        "entropy_train": learnt.entropy_train,
        "entropy_test": None if math.isnan(learnt.entropy_test) else learnt.entropy_test,
        "recorded_frames": learnt.recorded_frames,
        "test_frames": learnt.test_frames,
        "sources": read,
    }
    lines = [f"{entry['name']:24} {entry['frames']} frames, {entry['rms_mm']:.1f} mm off" for entry in read]
    lines += [
        f"{learnt.frames} frames of training made of {learnt.recorded_frames}, {learnt.test_frames} of test",
        f"{learnt.clusters} clusters, {learnt.states} states",
        f"entropy {learnt.entropy_train:.3f} nats a frame in training, {_entropy(learnt.entropy_test)} in the test",
        f"Model {place.stem} in {place}",
    ]
    return {**told, "text": "\n".join(lines)}


def _entropy(value: float) -> str:
    return "none" if math.isnan(value) else f"{value:.3f}"


def _line(model: ModelSummary) -> str:
    if model.problem:
        return f"{model.name:20} {model.problem}"
    return (
        f"{model.name:20} {model.body}, {model.clusters} clusters, {model.states} states, memory {model.memory}, "
        f"{model.frames} frames at {model.fps:g}, entropy {model.entropy_train:.3f} / {_entropy(model.entropy_test)}"
    )


def _summary(model: ModelSummary) -> dict[str, object]:
    return {
        "name": model.name,
        "path": str(model.path),
        "body": model.body,
        "fps": model.fps,
        "frames": model.frames,
        "clusters": model.clusters,
        "states": model.states,
        "memory": model.memory,
        "epsilon": model.epsilon,
        "entropy_train": None if math.isnan(model.entropy_train) else model.entropy_train,
        "entropy_test": None if math.isnan(model.entropy_test) else model.entropy_test,
        "sources": list(model.sources),
        "problem": model.problem,
    }
