"""From recordings to a behaviour model: training and test material, learning, and the result in numbers."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studio.body.model import BodyModel
from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError
from studio.foundations.progress import Progress, no_progress
from studio.runs.learning.oversampling import OversamplingSettings, oversampled
from studio.runs.learning.recordings import Recording
from studio.search.behaviour.model import BehaviourModel
from studio.search.behaviour.model_learning import learn_model
from studio.search.behaviour.settings import LearningSettings

TEST_SHARE = 0.2
FEWEST_FOR_A_TEST = 20


@dataclass(frozen=True, slots=True)
class Learnt:
    """The result of learning. frames : of training, oversampled. recorded_frames, test_frames : as read.

    entropy_train, entropy_test : Eq. 2 of Caillette et al. in nats a frame; the test's is NaN without a test.
    """

    frames: int
    recorded_frames: int
    test_frames: int
    clusters: int
    states: int
    entropy_train: float
    entropy_test: float


def parted(recordings: Sequence[Recording]) -> tuple[tuple[Recording, ...], tuple[Recording, ...]]:
    """Training and test: the last fifth of each recording is the test, where it is long enough."""
    training, test = list[Recording](), list[Recording]()
    for recording in recordings:
        at = recording.frame_count - round(TEST_SHARE * recording.frame_count)
        if recording.frame_count < FEWEST_FOR_A_TEST:
            at = recording.frame_count
        training.append(_stretch(recording, 0, at))
        if at < recording.frame_count:
            test.append(_stretch(recording, at, recording.frame_count))
    return tuple(training), tuple(test)


def learn(
    recordings: Sequence[Recording],
    body: BodyModel,
    settings: LearningSettings | None = None,
    material: OversamplingSettings | None = None,
    test: Sequence[Recording] | None = None,
    *,
    seed: int = 0,
    progress: Progress = no_progress,
) -> tuple[BehaviourModel, Learnt]:
    """The behaviour of recordings on one body, all at one rate.

    test : recordings that the entropy is measured on; None takes the last fifth of each recording from the training
    for that. The same seed gives the same model. Raises BehaviourError as `learn_model` does.
    """
    settings, material = settings or LearningSettings(), material or OversamplingSettings()
    training, tested = parted(recordings) if test is None else (tuple(recordings), tuple(test))
    rates = {recording.fps for recording in (*training, *tested)}
    if len(rates) != 1:
        raise StudioError("The recordings have different frame rates.", "Read all of them at one rate.")
    rng = np.random.default_rng(seed)
    sequences: list[Array] = []
    names: list[str] = []
    for recording in training:
        made = oversampled(body, recording.poses, recording.fps, material, rng)
        sequences += made
        names += [recording.name] * len(made)
    model = learn_model(sequences, body, rates.pop(), settings, rng, progress, names)
    measured = model.entropy([recording.poses for recording in tested]) if tested else float("nan")
    model = dataclasses.replace(model, making=dataclasses.replace(model.making, entropy_test=measured))
    learnt = Learnt(
        frames=model.making.frames,
        recorded_frames=sum(recording.frame_count for recording in training),
        test_frames=sum(recording.frame_count for recording in tested),
        clusters=model.clusters,
        states=model.states,
        entropy_train=model.making.entropy_train,
        entropy_test=measured,
    )
    return model, learnt


def _stretch(recording: Recording, first: int, last: int) -> Recording:
    bad = tuple(frame - first for frame in recording.bad_frames if first <= frame < last)
    return dataclasses.replace(recording, poses=recording.poses[first:last], bad_frames=bad)
