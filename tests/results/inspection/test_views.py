"""The views' numbers against the store's and the likelihood's, each computed here in another way."""

import csv
import io
from collections import Counter
from contextlib import closing

import numpy as np
import pytest
from planted_runs import LAYERS, PARTICLES
from scipy import stats

from studio.body.forward_kinematics import marker_points
from studio.foundations.errors import NotFoundError, RunError, WorkCancelledError
from studio.operations.inspecting import tables_csv
from studio.results.inspection.clouds import density, weighted_quantiles
from studio.results.inspection.comparing import compare_stored
from studio.results.inspection.genealogy import first_lines, living
from studio.results.inspection.landscape import line_of
from studio.results.inspection.likelihoods import evaluation_of, let_evaluations_rest, source_of
from studio.results.inspection.modes import exchanged_in, modes_of
from studio.results.inspection.reading import InspectedFrame, InspectedRun
from studio.results.inspection.reference import body_points, limbs_of_points, true_points, true_pose
from studio.results.inspection.retracking import Change, Retracking
from studio.results.inspection.seeds import search_seeds
from studio.results.inspection.tables import Cell, Selection, Viewed
from studio.results.inspection.views import VIEWS, look, look_over
from studio.results.inspection.weights import fitted_shape, pareto_k
from studio.runs.problem_source import ProblemSource
from studio.runs.tracks import RAW, read_track
from studio.search.trackers.side_exchange import kinds_of
from studio.search.trackers.tracker import NO_PARENT

NOTHING = Selection()


def records(viewed: Viewed, name: str) -> list[dict[str, Cell]]:
    """The rows of a table by key."""
    return viewed.table(name).records()


@pytest.mark.parametrize("name", VIEWS)
def test_every_table_is_as_the_registry_says(run: InspectedRun, name: str) -> None:
    for viewed, kinds in (
        (look(run, 3, name, NOTHING), VIEWS[name].frame_tables),
        (look_over(run, name, Selection(parameter="left_knee_ry")), VIEWS[name].run_tables),
    ):
        assert [table.name for table in viewed.tables] == [kind.name for kind in kinds]
        for table, kind in zip(viewed.tables, kinds, strict=True):
            more = len(run.names) if kind.each else 0
            assert len(table.columns) == len(kind.columns) + more
            assert all(len(row) == len(table.columns) for row in table.rows)
            assert table.rows or kind.name in ("plane", "samples", "parts") or VIEWS[name].is_job


def test_the_last_layers_weights_are_those_that_the_search_ended_with(frame: InspectedFrame) -> None:
    particles = frame.result.carried.particles
    assert np.allclose(frame.log_weights(LAYERS - 1), particles.log_weights, atol=1e-12)


def test_each_layers_survival_is_the_recorded_one(frame: InspectedFrame) -> None:
    for layer, record in enumerate(frame.layers):
        weights = frame.weights(layer)
        assert 1.0 / np.sum(weights**2) / len(weights) == pytest.approx(record.alpha_reached, abs=1e-9)


def test_children_are_counted_from_the_stored_parents(run: InspectedRun, frame: InspectedFrame) -> None:
    rows = records(look(run, 3, "genealogy", NOTHING), "particles")
    by_place = {(row["layer"], row["particle"]): row for row in rows}
    assert len(rows) == LAYERS * PARTICLES
    for layer in range(LAYERS - 1):
        first, second = frame.layers[layer].parents
        counted = Counter([*first.tolist(), *second[second != NO_PARENT].tolist()])
        for at in range(PARTICLES):
            assert by_place[layer, at]["children"] == counted[at]
            assert by_place[layer + 1, at]["parent"] == first[at]
    assert any(row["second_parent"] is not None for row in rows)
    assert all(row["survives"] for row in rows if row["layer"] == LAYERS - 1)


def test_lines_and_ancestors_of_a_small_tree() -> None:
    # Layer 0 has four particles; 0 and 3 are drawn, one child has both; then all come from child 2.
    parents = [
        np.array([[0, 0, 3, 3], [NO_PARENT, 3, NO_PARENT, NO_PARENT]]),
        np.array([[2, 2, 2, 1], [NO_PARENT] * 4]),
        np.zeros((2, 0), dtype=np.int64),
    ]
    assert [mask.tolist() for mask in living(parents, [4, 4, 4])] == [
        [True, False, False, True],
        [False, True, True, False],
        [True] * 4,
    ]
    assert [line.tolist() for line in first_lines(parents, [4, 4, 4])] == [
        [0, 1, 2, 3],
        [0, 0, 3, 3],
        [3, 3, 3, 0],
    ]


@pytest.mark.parametrize("shape", [-0.3, 0.2, 0.7, 1.2])
def test_the_shape_of_a_pareto_tail_is_found(shape: float) -> None:
    drawn = np.sort(stats.genpareto.rvs(shape, scale=2.5, size=4000, random_state=3))
    assert fitted_shape(drawn) == pytest.approx(shape, abs=0.08)
    maximum_likelihood = stats.genpareto.fit(drawn, floc=0.0)[0]
    assert fitted_shape(drawn) == pytest.approx(maximum_likelihood, abs=0.03)


def test_k_tells_even_weights_from_one_that_holds_all() -> None:
    rng = np.random.default_rng(0)
    # Weights of a uniform importance sample of a normal are bounded; 1 / u^1.5 has a tail of shape 1.5.
    assert pareto_k(-0.5 * rng.uniform(-3.0, 3.0, 4000) ** 2) < 0.3
    assert pareto_k(-1.5 * np.log(rng.random(4000))) == pytest.approx(1.5, abs=0.3)
    assert np.isnan(pareto_k(np.zeros(50)))
    assert np.isnan(pareto_k(np.array([0.0, -1.0, -np.inf])))


def test_correlations_are_numpys(run: InspectedRun, frame: InspectedFrame) -> None:
    rows = records(look(run, 3, "coupling", Selection(layer=1)), "matrix")
    known = np.corrcoef(
        np.repeat(frame.layers[1].poses, np.round(frame.weights(1) * 1e5).astype(int), axis=0).T
    )
    for row in rows:
        one, other = run.parameter(str(row["first"])), run.parameter(str(row["second"]))
        assert row["correlation"] == pytest.approx(known[one, other], abs=2e-3)


def test_quantiles_of_whole_weights_are_those_of_repeated_values() -> None:
    rng = np.random.default_rng(1)
    values, counts = rng.normal(size=200), rng.integers(0, 6, 200)
    repeated = np.repeat(values, counts)
    found = weighted_quantiles(values, counts.astype(float), (0.05, 0.5, 0.9))
    assert np.allclose(found, np.quantile(repeated, [0.05, 0.5, 0.9], method="inverted_cdf"))


def test_a_density_is_that_of_scipys_kernels() -> None:
    rng = np.random.default_rng(2)
    values, weights = rng.normal(size=300), rng.random(300)
    weights /= weights.sum()
    places, heights = density(values, weights, 200.0)
    assert np.trapezoid(heights, places) == pytest.approx(1.0, abs=5e-3)
    deviation = np.sqrt(np.cov(values, aweights=weights))
    low, high = weighted_quantiles(values, weights, (0.25, 0.75))
    biased = np.sqrt(weights @ (values - weights @ values) ** 2)
    width = 0.9 * min(biased, (high - low) / 1.349) * 200.0**-0.2
    known = stats.gaussian_kde(values, bw_method=width / deviation, weights=weights)(places)
    assert np.allclose(heights, known, rtol=1e-6)


def test_survivors_are_those_that_have_children(run: InspectedRun, frame: InspectedFrame) -> None:
    viewed = look(run, 3, "survivors", Selection(layer=0))
    alive = {int(at) for at in frame.layers[0].parents.ravel() if at != NO_PARENT}
    assert {row["particle"] for row in records(viewed, "particles") if row["survives"]} == alive
    poses = frame.layers[0].poses
    dead = [at for at in range(PARTICLES) if at not in alive]
    for row in records(viewed, "difference"):
        at = run.parameter(str(row["parameter"]))
        assert row["survivors"] == pytest.approx(poses[sorted(alive), at].mean())
        assert row["dead"] == pytest.approx(poses[dead, at].mean())


def test_the_landscape_is_the_likelihood(run: InspectedRun, frame: InspectedFrame) -> None:
    chosen = Selection(parameter="left_hip_ry", second="right_knee_ry", layer=2)
    viewed = look(run, 3, "landscape", chosen)
    with closing(ProblemSource(run.session, run.body, run.run.cameras())) as source:
        problem = source.problem(3, run.settings(3))
        base = frame.estimate()
        for name in ("slice", "plane"):
            rows = records(viewed, name)
            poses = np.repeat(base[None], len(rows), axis=0)
            poses[:, run.parameter("left_hip_ry")] = [float(str(row["at"])) for row in rows]
            if name == "plane":
                poses[:, run.parameter("right_knee_ry")] = [float(str(row["second"])) for row in rows]
            known = problem.log_likelihood(poses)
            assert np.allclose([float(str(row["log_weight"])) for row in rows], known, atol=1e-12)
    sums: dict[Cell, float] = {}
    for row in records(viewed, "terms"):
        sums[row["at"]] = sums.get(row["at"], 0.0) + float(str(row["value"]))
    assert [row["log_weight"] for row in records(viewed, "slice")] == pytest.approx(list(sums.values()))
    beta = frame.layers[1].beta
    heights = [row["density"] for row in records(viewed, "tempered") if row["layer"] == 1]
    values = np.array([float(str(row["log_weight"])) for row in records(viewed, "slice")])
    assert heights == pytest.approx(np.exp(beta * (values - values.max())).tolist())


def test_a_way_leads_from_the_estimate_to_the_truth(run: InspectedRun, frame: InspectedFrame) -> None:
    truth = true_pose(run, 3)
    line = line_of(frame, Selection(towards="truth"))
    at = {round(float(place), 6): pose for place, pose in zip(line.places, line.poses, strict=True)}
    assert np.allclose(at[0.0], frame.estimate())
    assert np.allclose(at[1.0], truth.pose)
    with pytest.raises(NotFoundError):
        look(run, 3, "landscape", Selection(towards="particle", particle=10_000))


def test_blame_adds_up_to_the_stored_log_weight(run: InspectedRun, frame: InspectedFrame) -> None:
    evaluation = evaluation_of(frame)
    for record in frame.layers:
        shares = evaluation.shares(record.poses)
        assert np.allclose(shares.values.sum(axis=(1, 2)), record.log_weights, atol=1e-9)
    rows = records(look(run, 3, "blame", NOTHING), "matrix")
    whole = [row for row in rows if row["limb"] == "whole body"]
    total = sum(float(str(row["value"])) for row in whole)
    assert total == pytest.approx(float(evaluation.log_weights(frame.searched()[None])[0]))
    left = records(look(run, 3, "blame", NOTHING), "left_out")
    preference = float(str(left[0]["preference"]))
    for row in left[1:]:
        own = [one for one in whole if one["camera"] == row["camera"] or one["term"] == row["term"]]
        less = (1.0 - float(str(row["factor"]))) * sum(float(str(one["difference"])) for one in own)
        assert row["preference"] == pytest.approx(preference - less)


def test_pulls_are_the_likelihoods_slopes(run: InspectedRun, frame: InspectedFrame) -> None:
    rows = records(look(run, 3, "blame", NOTHING), "pulls")
    at = run.parameter("pelvis_z")
    pose, step = frame.searched(), np.zeros(len(run.names))
    step[at] = 0.25 * run.run.record.sigma[at]
    ahead, behind = evaluation_of(frame).log_weights(np.stack([pose + step, pose - step]))
    total = sum(float(str(row["pull"])) for row in rows if row["parameter"] == "pelvis_z")
    assert total == pytest.approx(float(ahead - behind) / 0.5, abs=1e-9)


def test_two_answers_are_two_modes_and_a_wide_cloud_is_one(run: InspectedRun) -> None:
    rng, body, truth = np.random.default_rng(5), run.body, true_pose(run, 3)
    legs = next(kind for kind in kinds_of(body) if "leg" in kind.what)
    small = 0.02 * np.array([entry.kind == "angle" for entry in body.parameters])
    both = np.concatenate(
        [np.repeat(truth.pose[None], 70, axis=0), np.repeat(legs.offered(truth.pose)[None], 30, axis=0)]
    )
    found = modes_of(body, both + small * rng.standard_normal(both.shape), np.full(100, 0.01))
    assert [round(mode.mass, 6) for mode in found] == [0.7, 0.3]
    assert set(found[1].members.tolist()) == set(range(70, 100))
    assert exchanged_in(body, found[0].pose, found[1].pose) == legs.what
    wide = np.repeat(truth.pose[None], 200, axis=0)
    wide[:, run.parameter("pelvis_x")] += np.linspace(-500.0, 500.0, 200)
    assert len(modes_of(body, wide, np.full(200, 1 / 200))) == 1


def test_coverage_ranks_the_truth_in_the_stored_set(run: InspectedRun, frame: InspectedFrame) -> None:
    viewed = look_over(run, "coverage", NOTHING)
    truth = true_points(run, 3)
    points, weights = marker_points(run.body, frame.layers[-1].poses), frame.weights(LAYERS - 1)
    names = [marker.name for marker in run.body.markers]
    own = [names.index(name) for name in ("LHip", "LKnee", "LAnkle")]
    spreads = [
        np.sqrt(sum(np.cov(points[:, at, axis], aweights=weights, ddof=0) for axis in range(3))) for at in own
    ]
    errors = np.linalg.norm(marker_points(run.body, frame.estimate()[None])[0][own] - truth[own], axis=1)
    [row] = [one for one in records(viewed, "frames") if one["frame"] == 3 and one["limb"] == "left leg"]
    assert row["spread"] == pytest.approx(np.mean(spreads))
    assert row["error"] == pytest.approx(errors.mean())
    ranks: list[float] = []
    for number in run.frames():
        other, goal = run.frame(number), true_points(run, number)
        below = marker_points(run.body, other.layers[-1].poses)[:, own] < goal[own]
        ranks += [
            min(float(other.weights(LAYERS - 1) @ column), 1.0) for column in below.reshape(PARTICLES, -1).T
        ]
    counts, _ = np.histogram(ranks, 10, (0.0, 1.0))
    shares = [row["count"] for row in records(viewed, "pit") if row["limb"] == "left leg"]
    assert shares == pytest.approx((counts / len(ranks)).tolist())


def test_tracking_a_stretch_again_gives_the_stored_poses(run: InspectedRun) -> None:
    with run.run.results() as results:
        stored = np.stack([results.result(number).estimate.pose for number in (2, 3, 4)])
    again = Retracking(run, 2, 4)
    assert np.array_equal(again.poses(Change({})), stored)
    assert not np.array_equal(again.poses(Change({}, 1)), stored)


def test_seeds_are_compared_by_their_spread(run: InspectedRun) -> None:
    assert "No other seed" in look(run, 2, "seeds", NOTHING).notes[0]
    heard: list[tuple[str, int, int]] = []

    def hear(step: str, done: int, total: int) -> None:
        heard.append((step, done, total))

    found = search_seeds(run, 2, 3, hear)
    assert heard[-1] == ("seeds", 3, 3)
    assert [one.seed for one in found] == [5, 6, 7]
    names = [marker.name for marker in run.body.markers]
    own = [names.index(name) for name in ("RShoulder", "RElbow", "RWrist")]
    estimates = marker_points(run.body, np.stack([one.estimate for one in found]))[:, own]
    between = np.mean([np.trace(np.cov(estimates[:, at].T)) for at in range(3)])
    viewed = look(run, 2, "seeds", NOTHING)
    [row] = [one for one in records(viewed, "limbs") if one["limb"] == "right arm"]
    assert row["between"] == pytest.approx(np.sqrt(between))
    assert row["error"] == pytest.approx(np.sqrt(between / 3))
    totals: dict[Cell, float] = {}
    for one in records(viewed, "ranks"):
        if one["parameter"] == "head_rx":
            totals[one["seed"]] = totals.get(one["seed"], 0.0) + float(str(one["count"]))
    assert totals == pytest.approx({5: 1.0, 6: 1.0, 7: 1.0})


def test_a_search_with_seeds_ends_where_progress_raises(run: InspectedRun) -> None:
    def stop(step: str, done: int, total: int) -> None:
        if done:
            raise WorkCancelledError("stopped", "")

    with pytest.raises(WorkCancelledError):
        search_seeds(run, 1, 3, stop)
    assert "No other seed" in look(run, 1, "seeds", NOTHING).notes[0]


def test_frames_over_a_run_are_read_again_when_they_change(run: InspectedRun) -> None:
    rows = records(look_over(run, "variance", Selection(parameter="pelvis_x")), "parameter")
    at = run.parameter("pelvis_x")
    for row in rows:
        record = run.frame(int(str(row["frame"]))).layers[int(str(row["layer"]))]
        assert row["weighed"] == pytest.approx(record.variance_weighed[at], rel=1e-6)
        assert row["after"] == pytest.approx(record.variance_diffused[at], rel=1e-6)


def test_the_same_run_twice_is_not_compared(run: InspectedRun) -> None:
    with pytest.raises(RunError):
        compare_stored([run, run])


def test_runs_that_nobody_looks_at_are_closed(run: InspectedRun, frame: InspectedFrame) -> None:
    first = source_of(run)
    let_evaluations_rest(seconds=3600.0)
    assert source_of(run) is first
    let_evaluations_rest(seconds=-1.0)
    again = source_of(run)
    assert again is not first
    pose = frame.searched()[None]
    assert evaluation_of(frame).log_weights(pose).shape == (1,)


def test_readers_count_layers_from_one(run: InspectedRun, frame: InspectedFrame) -> None:
    table = look(run, 3, "schedule", NOTHING).tables[0]
    assert table.column("layer") == list(range(LAYERS))
    at = [column.key for column in table.columns].index("layer")
    read = table.for_readers()
    assert [row[at] for row in read] == list(range(1, LAYERS + 1))
    assert [[*row[:at], *row[at + 1 :]] for row in read] == [
        [*row[:at], *row[at + 1 :]] for row in table.rows
    ]
    lines = list(csv.reader(io.StringIO(tables_csv([table], ""))))[2:]
    assert [int(line[at]) for line in lines[1:]] == list(range(1, LAYERS + 1))
    assert f"<tr><td>{LAYERS}</td>" in table.as_html()
    with pytest.raises(NotFoundError, match=r"no layer 8\.") as refused:
        look(run, 3, "weights", Selection(layer=7))
    assert refused.value.hint == f"It has the layers 1 to {LAYERS}."


def test_a_limb_is_lost_where_one_of_its_markers_is(
    run: InspectedRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As an evaluation counts it: the mean of the limb may hide a hand that is far off."""
    track = read_track(run.run, RAW)
    owners = limbs_of_points(run.body)
    true = [true_points(run, number) for number in track.frames.tolist()]
    away = np.linalg.norm(
        body_points(run.body, track.poses) - np.stack([one for one in true if one is not None]), axis=2
    )
    owned = {limb: away[:, [owner == limb for owner in owners]] for limb in set(owners)}
    limb = max(owned, key=lambda name: float((owned[name].max(axis=1) - owned[name].mean(axis=1)).max()))
    at = int((owned[limb].max(axis=1) - owned[limb].mean(axis=1)).argmax())
    limit = float(owned[limb][at].max() + owned[limb][at].mean()) / 2
    monkeypatch.setattr("studio.results.inspection.limbs.lost_mm", lambda body: limit)
    told = {
        (row["frame"], row["limb"]): row["lost"] for row in records(look_over(run, "why", NOTHING), "limbs")
    }
    assert told[int(track.frames[at]), limb] is True
    assert told == {
        (int(number), name): bool((owned[name][row] > limit).any())
        for row, number in enumerate(track.frames)
        for name in owned
    }
