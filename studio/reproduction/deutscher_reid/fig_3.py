"""Fig. 3: the particles' horizontal places over the ten layers of a frame, while a person walks in a circle."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.comparison.findings import Chart, Findings
from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.statistics import number, overall
from studio.comparison.tracked import Attempt, track
from studio.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.errors import TruthError
from studio.evaluation.errors import rows_of_frames
from studio.motion_files.trc import read_trc
from studio.reproduction.deutscher_reid.setting import BODY, CIRCLE, PLAIN, SOURCE, WEIGHTING, share_number
from studio.reproduction.drawing import layer_table, line, line_chart, places, seeds_and_mean
from studio.reproduction.experiment import Experiment
from studio.sessions.session import Session
from studio.tracking.tracker import LayerRecord

Array = NDArray[np.float64]

FRAMES, QUICK_FRAMES = 60, 20
KNOBS: Mapping[str, Any] = {**PLAIN, "layers": 10, "particles": 200}
PLACES = ("pelvis_x", "pelvis_y")
# The marker at the pelvis, whose place these parameters are.
ROOT_MARKER = "Hip"
# A cloud covers what lies within so many of its standard deviations.
COVERED = 3.0
DRAWN_LAYERS = (0, 1, 2, 6, 7, 9)


def trials(scale: Scale) -> tuple[Trial, ...]:
    """One a seed."""
    frames = QUICK_FRAMES if scale.quick else FRAMES
    return tuple(
        Trial(
            f"clouds, seed {seed}", Attempt(CIRCLE, "annealed", WEIGHTING, seed, KNOBS, last=frames).plain()
        )
        for seed in scale.seeds
    )


@kept_as("deutscher_reid.fig_3.measure")
def measure(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """The spread per layer (mm, of x and y together), whether the first cloud covers the true movement, how far the
    last one's middle is from the true place, means over the frames but the first; and the clouds of the middle frame.
    """
    attempt = Attempt.of_plain(arguments)
    session = shelf.session(attempt.footage)
    body = session.body(attempt.body or None)
    names = [entry.name for entry in body.parameters]
    columns = [names.index(name) for name in PLACES]
    records: list[LayerRecord] = []
    found = track(attempt, shelf, on_layer=records.append)
    truth = true_places(session, found.frames)
    spreads, covered, distances, clouds = [], [], [], []
    last = next(record for record in reversed(records) if record.frame == found.frames[0]).mean[columns]
    for row, frame in enumerate(found.frames[1:], start=1):
        layers = [record for record in records if record.frame == frame]
        places = [record.poses[:, columns] for record in layers]
        spreads.append([np.sqrt(cloud.var(axis=0).sum()) for cloud in places])
        covered.append(covers(places[0], last + truth[row] - truth[row - 1]))
        last = layers[-1].mean[columns]
        distances.append(np.linalg.norm(last - truth[row]))
        if row == len(found.frames) // 2:
            clouds = [np.round(places[layer] - truth[row], 2).tolist() for layer in DRAWN_LAYERS]
    return {
        "spreads": np.mean(spreads, axis=0).tolist(),
        "covered": float(np.mean(covered)),
        "distance": float(np.mean(distances)),
        "clouds": clouds,
    }


def true_places(session: Session, frames: Sequence[int]) -> Array:
    """(K, 2) where the pelvis truly is, x and y in mm. Raises TruthError where the session does not say."""
    if session.truth_path is None:
        raise TruthError(f"Session '{session.name}' has no truth.", "Take one made by 'studio synthesize'.")
    truth = read_trc(session.truth_path)
    if ROOT_MARKER not in truth.names:
        raise TruthError(f"The truth has no marker '{ROOT_MARKER}'.", "Take footage of a person.")
    rows = rows_of_frames(truth, session.manifest.fps)
    return truth.positions[[rows[frame] for frame in frames], truth.names.index(ROOT_MARKER), :2]


def covers(cloud: Array, place: Array) -> bool:
    """Whether a place (2,) lies within COVERED standard deviations of a cloud (N, 2)."""
    away = place - cloud.mean(axis=0)
    return bool(away @ np.linalg.solve(np.cov(cloud.T), away) <= COVERED**2)


def conclude(outcomes: Sequence[Outcome]) -> Findings:
    """The first cloud covers the movement, and the clouds draw together layer by layer."""
    spreads = np.array([outcome.measured["spreads"] for outcome in outcomes])
    layers = spreads.shape[1]
    falls = (np.diff(spreads, axis=1) < 0).sum(axis=1)
    numbers = (
        number(
            "first cloud covers the true movement", [o.measured["covered"] for o in outcomes], "of 1", 1.0
        ),
        number("layers with a smaller spread than the one before", falls.tolist(), f"of {layers - 1}"),
        share_number("the last cloud is the smallest", (spreads.argmin(axis=1) == layers - 1).tolist()),
        number("spread of the first cloud", spreads[:, 0].tolist(), "mm"),
        number("spread of the last cloud", spreads[:, -1].tolist(), "mm"),
        number("last cloud's middle from the true place", [o.measured["distance"] for o in outcomes], "mm"),
    )
    first, last = numbers[3].ours, numbers[4].ours
    as_shown = overall(entry.verdict for entry in numbers) != "not reproduced"
    words = (
        f"The first cloud of a frame is {first:.0f} mm wide and covers the person's true movement since "
        "the last frame in "
        f"{numbers[0].ours:.1%} of the frames (within {COVERED:g} standard deviations); over ten layers "
        "it draws together "
        f"to {last:.1f} mm, in {numbers[1].ours:.1f} of the {layers - 1} steps from layer to layer: "
        f"{'as' if as_shown else 'not wholly as'} Fig. 3 shows. Its middle is {numbers[5].ours:.0f} mm "
        "from the true place: "
        "the person who was rendered is not made of cones, and a layer of Eq. 13 first spreads more than it selects."
    )
    clouds = tuple(
        line(f"layer {layer + 1}", *np.array(cloud).T)
        for layer, cloud in zip(DRAWN_LAYERS, outcomes[0].measured["clouds"], strict=True)
    )
    fall = seeds_and_mean("spread", places(layers, first=1), spreads)
    charts = (
        Chart("Particles of one frame around the true place", "points", "x (mm)", "y (mm)", clouds),
        line_chart("Spread over the layers", "layer", "spread (mm)", fall, log_y=True),
    )
    table = layer_table("Mean spread", ("mm",), spreads.mean(axis=0)[:, None], digits=2)
    settings = {"footage": CIRCLE, "body": BODY, "weighting": WEIGHTING, **KNOBS}
    return Findings(overall(entry.verdict for entry in numbers), words, numbers, (table,), charts, settings)


EXPERIMENT = Experiment(
    name="deutscher-fig-3",
    title="Particles over ten layers",
    source=f"{SOURCE}, Fig. 3",
    claim="The first cloud covers the expected movement; over ten layers it is annealed to a cluster "
    "around the maximum "
    "of the weighting function.",
    trials=trials,
    measure=measure,
    conclude=conclude,
    footage=(CIRCLE,),
)
