"""Behaviour models: `learn`, `models`."""

import math
from dataclasses import asdict

import click

from studio.cli.deriving import Call, command_of
from studio.operations.behaviours import LearntModel, learn, models
from studio.runs.behaviour_models import ModelSummary


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


@command_of(learn, cls=_Sources)
def learn_command(call: Call) -> dict[str, object]:
    done: LearntModel = call()
    learnt = done.learnt
    read = [
        {
            "name": entry.name,
            "frames": entry.frame_count,
            "rms_mm": round(entry.rms_mm, 2),
            "bad_frames": list(entry.bad_frames),
        }
        for entry in done.recordings
    ]
    lines = [f"{entry['name']:24} {entry['frames']} frames, {entry['rms_mm']:.1f} mm off" for entry in read]
    lines += [
        f"{learnt.frames} frames of training made of {learnt.recorded_frames}, {learnt.test_frames} of test",
        f"{learnt.clusters} clusters, {learnt.states} states",
        f"entropy {learnt.entropy_train:.3f} nats a frame in training, {_entropy(learnt.entropy_test)} in the test",
        f"Model {done.name} in {done.path}",
    ]
    return {
        "model": done.name,
        "path": str(done.path),
        "body": done.model.space.body,
        "fps": call.given["fps"],
        "frames": learnt.frames,
        "clusters": learnt.clusters,
        "states": learnt.states,
        "entropy_train": learnt.entropy_train,
        "entropy_test": _or_none(learnt.entropy_test),
        "recorded_frames": learnt.recorded_frames,
        "test_frames": learnt.test_frames,
        "sources": read,
        "text": "\n".join(lines),
    }


@command_of(models)
def models_command(call: Call) -> dict[str, object]:
    summaries: tuple[ModelSummary, ...] = call()
    result = [
        asdict(model)
        | {"entropy_train": _or_none(model.entropy_train), "entropy_test": _or_none(model.entropy_test)}
        for model in summaries
    ]
    lines = [_line(model) for model in summaries]
    return {"models": result, "text": "\n".join(lines) or "No models yet; 'studio learn' makes them."}


def _or_none(value: float) -> float | None:
    return None if math.isnan(value) else value


def _entropy(value: float) -> str:
    return "none" if math.isnan(value) else f"{value:.3f}"


def _line(model: ModelSummary) -> str:
    if model.problem:
        return f"{model.name:20} {model.problem}"
    return (
        f"{model.name:20} {model.body}, {model.clusters} clusters, {model.states} states, memory {model.memory}, "
        f"{model.frames} frames at {model.fps:g}, entropy {model.entropy_train:.3f} / {_entropy(model.entropy_test)}"
    )
