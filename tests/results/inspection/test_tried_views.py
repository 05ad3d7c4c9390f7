"""A trial stands in the place of its frame: the tables of every view are those of its own layers and result."""

from dataclasses import replace

import numpy as np
import pytest
from planted_runs import FEWER_PARTICLES, FRAME, LAYERS, MORE_LAYERS, PARTICLES

from studio.foundations.errors import NotFoundError
from studio.operations.jobs.events import FrameFinished, LayerFinished, SettingsApplied
from studio.operations.jobs.tried_frames import MOST_OF_A_RUN, TriedFrames
from studio.results.inspection.likelihoods import evaluation_of
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.reference import body_points, true_points
from studio.results.inspection.schedule import effective_number
from studio.results.inspection.seeds import search_seeds
from studio.results.inspection.tables import Cell, Selection
from studio.results.inspection.views import VIEWS, look, look_over
from studio.runs.reannealing import Reannealing
from studio.search.settings import values

NOTHING = Selection()


def rows(run: InspectedRun, view: str, name: str, **chosen: object) -> list[dict[str, Cell]]:
    """A table of the tried frame, by key."""
    return look(run, FRAME, view, Selection(**chosen)).table(name).records()  # type: ignore[arg-type]


def test_every_view_shows_another_frame_than_the_stored_one(run: InspectedRun, tried: InspectedRun) -> None:
    for one in (run, tried):
        search_seeds(one, FRAME, 2, lambda *_: None)
    for name, view in VIEWS.items():
        if view.frame_tables and name != "coverage":
            stored, found = (look(one, FRAME, name, NOTHING) for one in (run, tried))
            assert any(
                list(one.rows) != list(other.rows)
                for one, other in zip(stored.tables, found.tables, strict=True)
            ), name
        if view.run_tables and name != "why":
            stored, found = (look_over(one, name, NOTHING) for one in (run, tried))
            table, other = stored.tables[0].records(), found.tables[0].records()
            changed = {row["frame"] for row, new in zip(table, other, strict=True) if row != new}
            assert changed <= {FRAME}, name
            # What was measured of the run beside it stays as it is.
            assert name in ("modes", "uncertainty") or changed, name


def test_variance_and_schedule_are_the_trial_s_layers(search: Reannealing, tried: InspectedRun) -> None:
    assert len(search.layers) == MORE_LAYERS > LAYERS
    variances = rows(tried, "variance", "layers")
    schedule = rows(tried, "schedule", "layers")
    assert [row["layer"] for row in schedule] == list(range(MORE_LAYERS))
    for row in variances:
        record = search.layers[int(str(row["layer"]))]
        at = tried.parameter(str(row["parameter"]))
        assert (row["weighed"], row["before"], row["after"]) == (
            record.variance_weighed[at],
            record.variance_resampled[at],
            record.variance_diffused[at],
        )
    for row, record in zip(schedule, search.layers, strict=True):
        assert (row["beta"], row["alpha_wanted"], row["alpha_reached"]) == (
            record.beta,
            record.alpha_wanted,
            record.alpha_reached,
        )
        assert row["alpha_wanted"] == 0.7
        assert row["particles"] == FEWER_PARTICLES < PARTICLES


def test_particles_are_those_of_the_trial(search: Reannealing, tried: InspectedRun) -> None:
    frame, last = tried.frame(FRAME), len(search.layers) - 1
    genealogy = rows(tried, "genealogy", "particles")
    for layer in range(last):
        own = {row["particle"]: row for row in genealogy if row["layer"] == layer + 1}
        parents = search.layers[layer].parents[0]
        assert [own[at]["parent"] for at in range(len(parents))] == parents.tolist()
    weights = [row["weight"] for row in rows(tried, "weights", "sorted")]
    assert weights == pytest.approx(np.sort(frame.weights(last))[::-1].tolist())
    concentration = rows(tried, "weights", "layers")
    assert [row["effective"] for row in concentration] == pytest.approx(
        [effective_number(frame.log_weights(at)) for at in range(last + 1)]
    )
    clouds = rows(tried, "clouds", "summary", parameter="left_knee_ry")
    at = tried.parameter("left_knee_ry")
    means = {row["layer"]: row["mean"] for row in clouds if row["weighted"]}
    assert means[last] == pytest.approx(float(frame.weights(last) @ search.layers[last].poses[:, at]))
    assert {row["layer"] for row in clouds} == set(range(MORE_LAYERS))
    survivors = rows(tried, "survivors", "particles", layer=2)
    alive = set(search.layers[2].parents[search.layers[2].parents >= 0].tolist())
    assert {row["particle"] for row in survivors if row["survives"]} == alive
    coupled = rows(tried, "coupling", "particles", layer=1)
    assert [row["left_knee_ry"] for row in coupled] == search.layers[1].poses[:, at].tolist()


def test_the_likelihood_is_asked_with_the_trial_s_settings(search: Reannealing, tried: InspectedRun) -> None:
    frame = tried.frame(FRAME)
    assert frame.settings == search.settings
    pose = search.result().estimate.pose
    [mark] = [row for row in rows(tried, "landscape", "marks") if row["name"] == "estimate"]
    assert mark["log_weight"] == pytest.approx(float(evaluation_of(frame).log_weights(pose[None])[0]))
    tempered = {row["layer"]: row["beta"] for row in rows(tried, "landscape", "tempered")}
    assert tempered == {at: record.beta for at, record in enumerate(search.layers)}
    whole = [row for row in rows(tried, "blame", "matrix") if row["limb"] == "whole body"]
    searched = frame.searched()
    assert sum(float(str(row["value"])) for row in whole) == pytest.approx(
        float(evaluation_of(frame).log_weights(searched[None])[0])
    )
    masses = [row for row in rows(tried, "modes", "layers") if row["layer"] == MORE_LAYERS - 1]
    assert sum(float(str(row["mass"])) for row in masses) == pytest.approx(1.0)
    assert sum(int(str(row["particles"])) for row in masses) == FEWER_PARTICLES


def test_errors_and_spread_are_those_of_the_trial_in_its_frame(
    search: Reannealing, run: InspectedRun, tried: InspectedRun
) -> None:
    truth = true_points(run, FRAME)
    away = np.linalg.norm(body_points(run.body, search.result().estimate.pose[None])[0] - truth, axis=1)
    names = [marker.name for marker in run.body.markers]
    own = [names.index(name) for name in ("LHip", "LKnee", "LAnkle")]
    for view, table in (("coverage", "frames"), ("why", "limbs")):
        found = look_over(tried, view, NOTHING).table(table).records()
        [row] = [one for one in found if (one["frame"], one["limb"]) == (FRAME, "left leg")]
        assert row["error"] == pytest.approx(float(away[own].mean())), view
        others = [one for one in found if one["frame"] != FRAME]
        stored = look_over(run, view, NOTHING).table(table).records()
        assert others == [one for one in stored if one["frame"] != FRAME]


def heard(
    kept: TriedFrames, search: Reannealing, version: int, survival: float, *, late: bool = False
) -> str:
    """What the tracking process says of a trial; the name that it is kept under."""
    used = {**values(search.settings), "survival": survival}
    kept.hear(SettingsApplied("drawn", "small", version, FRAME, 0, used))

    for record in search.layers[2 if late else 0 :]:
        kept.hear(LayerFinished("drawn", "small", replace(record, settings_version=version), True))
    result = replace(search.result(), settings_version=version)
    return kept.hear(FrameFinished("drawn", "small", result, True))


def test_trials_are_kept_by_their_settings(search: Reannealing, run: InspectedRun) -> None:
    kept = TriedFrames()
    first, second = heard(kept, search, 5, 0.7), heard(kept, search, 6, 0.8)
    assert first != second
    assert heard(kept, search, 7, 0.7) == first, "the same knobs are one trial"
    listed = kept.of_frame(run.run, "drawn", FRAME)
    assert [one.name for one in listed] == [second, first], "the newest last"
    again = kept.tried(run.run, "drawn", first)
    assert again.settings == search.settings
    assert all(one is not None for one in again.layers)
    assert np.array_equal(again.layers[-1].poses, search.layers[-1].poses)
    # One whose first layers did not come is not kept; nor are more than so many, nor what followed from a frame that
    # is another one now.
    assert heard(kept, search, 8, 0.9, late=True) == ""
    for number in range(MOST_OF_A_RUN):
        heard(kept, search, 9 + number, 0.1 + 0.01 * number)
    assert len(kept.of_frame(run.run, "drawn", FRAME)) == MOST_OF_A_RUN
    with pytest.raises(NotFoundError):
        kept.tried(run.run, "drawn", first)
    kept.hear(FrameFinished("drawn", "small", search.result()))
    assert kept.of_frame(run.run, "drawn", FRAME) == []
