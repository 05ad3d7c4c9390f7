"""A first frame that is searched several times over: its searches are counted, in a frame and over the frames."""

from dataclasses import replace

import numpy as np
import pytest
from drawings import Drawings, clouds_of
from toy_session import make_session, true_poses
from tracked_runs import finish, opened

from studio.results.inspection.cloud_outlines import outline_of
from studio.results.inspection.reading import InspectedRun, TriedFrame
from studio.results.inspection.tables import Selection, Viewed
from studio.results.inspection.views import look, look_over
from studio.runs.new_run import prepare_run
from studio.runs.reannealing import Reannealing
from studio.search.settings import changed_settings
from studio.sessions.workspace import Workspace

LAYERS, MORE = 3, 5
LAYERED = ("variance", "schedule", "genealogy", "weights", "modes", "why")
"""Views with an axis of layers; those of `clouds` are rows."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> InspectedRun:
    """Two frames of the toy arm, the first of them searched twice."""
    session = make_session(Workspace(tmp_path_factory.mktemp("searches")).place_for("toy"))
    knobs = {"particles": 60, "layers": LAYERS, "start_repeats": 2, "refine_frames": False}
    made = prepare_run(session, start_pose=true_poses()[0], last=2, knobs=knobs)
    finish(session, made)
    return InspectedRun(session, made)


def test_the_searches_of_a_frame_are_counted_and_its_cloud_shrinks(run: InspectedRun) -> None:
    first, second = run.frame(0), run.frame(1)
    assert (first.search_layers, first.searches, len(first.layers)) == (LAYERS, 2, 2 * LAYERS)
    assert (second.search_layers, second.searches) == (LAYERS, 1)

    notes = [look(run, frame, "variance", Selection()).notes for frame in (0, 1)]
    assert notes[0][0] == (
        "The frame was searched several times over: layers 1 to 3 are the first search and layers 4 to 6 are the"
        " second search."
    )
    assert not any("several times" in note for note in notes[1])

    # Over the frames each row says of which search it is, so that a map needs no rows that one frame has alone.
    view = look_over(run, "variance", Selection(parameter=run.names[0]))
    (table,) = [one for one in view.tables if one.name == "parameter"]
    frames = [row[:3] for row in table.rows]
    assert frames[: 2 * LAYERS] == [(0, 1 + layer // LAYERS, layer) for layer in range(2 * LAYERS)]
    assert frames[2 * LAYERS :] == [(1, 1, layer) for layer in range(LAYERS)]

    # The outlines are those of the particles: one ellipse for the arm's only end, smaller layer by layer.
    camera = run.run.cameras()[0]
    outlines = [outline_of(run.body, camera, layer.poses, layer.mean) for layer in second.layers]
    sizes = [outline.ellipses[0][2] + outline.ellipses[0][4] for outline in outlines if outline]
    assert [len(outline.ellipses) for outline in outlines if outline] == [1] * LAYERS
    assert sizes[0] > sizes[-1] > 0.0
    assert len(outlines[0].figure) == len(run.body.drawn)  # pyright: ignore[reportOptionalMemberAccess]


def test_frames_are_compared_by_their_last_search(run: InspectedRun) -> None:
    first = run.frame(0)
    own = first.layers[LAYERS:]
    view = look_over(run, "schedule", Selection())
    [row, other] = view.table("frames").records()
    assert (row["beta_first"], row["beta_last"]) == (own[0].beta, own[-1].beta)
    assert row["beta_first"] != first.layers[0].beta
    assert row["least_alpha"] == min(layer.alpha_reached for layer in own)
    assert other["beta_first"] == run.frame(1).layers[0].beta
    assert view.notes == (
        "Frames that were searched several times over stand here with their last search: frame 0 by the second.",
    )
    drawn = look_over(run, "variance", Selection())
    assert drawn.table("first").rows[0][1:] == pytest.approx(np.float32(own[0].variance_weighed).tolist())
    assert drawn.notes == view.notes


@pytest.mark.browser
@pytest.mark.parametrize("view", LAYERED)
def test_the_searches_are_named_on_the_axes(drawings: Drawings, run: InspectedRun, view: str) -> None:
    both, alone = (
        drawings.draw(view, looked_at(run, view, frame), frame=frame, written=True) for frame in (0, 1)
    )
    assert axes_of_layers(both, 2 * LAYERS) == {("1", "2", "3", "1", "2", "3")}
    assert axes_of_layers(alone, LAYERS) == {("1", "2", "3")}
    for name in ("first", "second"):
        assert {name, f"{name} search"} & {*both["texts"]}
    assert not any("search" in text for text in alone["texts"])


@pytest.mark.browser
def test_a_frame_s_second_search_has_a_row_among_its_clouds(drawings: Drawings, run: InspectedRun) -> None:
    chosen = Selection(parameter=run.names[0])
    drawn = drawings.draw("clouds", clouds_of(run, 0, chosen), frame=0, selection=chosen, written=True)
    assert {"first search", "second search"} <= {*drawn["texts"]}
    assert [text for text in drawn["texts"] if text in ("drawn", "1", "2", "3", "4")].count("drawn") == 1


@pytest.mark.browser
def test_searches_of_different_lengths_stand_below_each_other(drawings: Drawings, run: InspectedRun) -> None:
    with opened(run.session, run.run) as tracking:
        again = Reannealing(tracking, 0, 5, changed_settings(run.settings(0), {"layers": MORE}))
        while not again.finished:
            again.step_layer()
        trial = TriedFrame("0-a", 0, again.settings, tuple(again.layers), again.result())
    tried = InspectedRun(run.session, run.run, trial)
    sides = [look(one, 0, "schedule", Selection()) for one in (run, tried)]
    drawn = drawings.draw("schedule", *sides, frame=0, selection=Selection(layer=2 * MORE - 1))
    assert axes_of_layers(drawn, 2 * MORE) == {tuple("1234512345")}
    stored, found = (one.table("layers").column("beta") for one in sides)
    lines = [one["data"] for one in drawn["series"] if one["type"] == "line"]
    assert [*stored[:LAYERS], None, None, *stored[LAYERS:], None, None] in lines
    assert found in lines
    # What is clicked is a layer of the trial, which is shown.
    assert 2 * MORE - 1 in drawn["layers"]
    assert drawn["words"].count("second search") == 2

    other = drawings.draw("schedule", sides[1], sides[0], frame=0, selection=Selection(layer=LAYERS))
    assert 2 * LAYERS - 1 in other["layers"]
    assert "layer 1 of the second search" in other["words"]


@pytest.mark.browser
def test_compared_runs_share_an_axis_of_one_search_s_layers(drawings: Drawings, run: InspectedRun) -> None:
    own = look(run, 0, "schedule", Selection())
    layers = own.table("layers")
    # A swarm's many layers have no effective number: they do not squeeze those of the others together.
    at = [column.key for column in layers.columns].index("effective")
    swarm = [tuple(None if place == at else cell for place, cell in enumerate(layers.rows[0]))]
    rows = [(layer, *swarm[0][1:]) for layer in range(57)]
    other = replace(own, tables=(replace(layers, rows=rows),), search_layers=57, searches=1)
    drawn = drawings.compare({"toy/one": own, "toy/swarm": other}, frame=0)
    assert drawn["axis"] == ["1", "2", "3"]
    assert drawn["lines"][0] == layers.column("effective")[LAYERS:]
    assert drawn["clicked"] == [3, 4, 5]


def looked_at(run: InspectedRun, view: str, frame: int) -> Viewed:
    """A view's tables as the page takes them together."""
    found = look(run, frame, view, Selection())
    of_run = look_over(run, view, Selection()).tables if view == "why" else ()
    return replace(found, tables=(*found.tables, *of_run))


def axes_of_layers(drawn: dict, count: int) -> set[tuple[str, ...]]:
    """The labels of the axes that have so many places."""
    return {tuple(axis) for axis in drawn["axes"] if axis is not None and len(axis) == count}
