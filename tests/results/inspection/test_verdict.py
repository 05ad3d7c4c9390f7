"""Whether a frame fits is decided in one place: timeline, badge, heat map and Why say the same of it."""

import dataclasses
import math
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stored_verdicts
from hypothesis import given, settings
from hypothesis import strategies as st
from store_records import result_of
from stored_verdicts import check_that_all_agree
from toy_session import make_session
from tracked_runs import finish

from studio.operations import stored_frames
from studio.results.inspection import limbs, why
from studio.results.inspection.limbs import verdicts_on
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.tables import FrameFinding, Selection
from studio.results.inspection.verdict import limbs_off, verdict_on
from studio.results.inspection.why import rows
from studio.runs.new_run import prepare_run
from studio.runs.tracks import REFINED, Track, write_track
from studio.search.trackers.tracker import LIMB_LOST, LOST, NO_EVIDENCE, RECOVERED, TRACKED, TRACKING_STATES
from studio.sessions.results_store import ResultsWriter
from studio.sessions.samples import install_prepared_runs, install_sample
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace

OLD = Path(__file__).parents[2] / "old_sessions"
LIMBS = ("right arm", "left leg", "head", "trunk")
SHARES = st.dictionaries(st.sampled_from(LIMBS), st.floats(0.0, 1.0))
PLANTED = (
    {"tracking": LIMB_LOST, "overlap": 0.9, "disagreement": {"right arm": 0.267, "left leg": 0.01}},
    {"tracking": RECOVERED, "overlap": 0.9, "disagreement": {"left leg": 0.09}},
    {"tracking": TRACKED, "disagreement": {"right arm": 0.1}},
    {"tracking": LOST, "overlap": 0.2, "doubts": 3, "disagreement": {"right arm": 0.5, "head": 0.5}},
    {"tracking": NO_EVIDENCE, "overlap": 0.0},
)
"""What may be stored with a frame: the state, beside what the silhouettes say."""


@settings(deadline=None)
@given(
    st.sampled_from(TRACKING_STATES),
    st.sampled_from((math.nan, 0.9)),
    st.integers(0, 2),
    SHARES,
    SHARES,
    st.lists(st.sampled_from(LIMBS), unique=True),
)
def test_a_frame_with_a_lost_limb_never_fits(
    tracking: str,
    overlap: float,
    doubts: int,
    shares: dict[str, float],
    loss: dict[str, float],
    by_truth: list[str],
) -> None:
    result = dataclasses.replace(
        result_of(0), tracking=tracking, overlap=overlap, doubts=doubts, disagreement=shares, limb_loss=loss
    )
    found = verdict_on(result, by_truth)
    assert set(found.lost) == {*by_truth, *limbs_off(result)}
    assert not (found.fits and (found.lost or found.tracking in (LOST, NO_EVIDENCE, LIMB_LOST)))
    assert found.fits or found.lost or found.tracking != TRACKED
    assert {limb for limb in found.lost if found.lost_by(limb)} == set(found.lost)
    assert tracking in (TRACKED, RECOVERED) or found.tracking == tracking
    if tracking in (TRACKED, RECOVERED):
        assert (found.tracking == LIMB_LOST) == bool(found.by_silhouettes)


def test_a_tracked_run(run: InspectedRun) -> None:
    check_that_all_agree(run)


@pytest.fixture
def marked(run: InspectedRun, tmp_path: Path) -> InspectedRun:
    """The run without a truth, with each of PLANTED stored in a frame; its refined track changes nothing."""
    shutil.copytree(run.session.path, tmp_path / "marked")
    shutil.rmtree(tmp_path / "marked" / "truth")
    session = Session(tmp_path / "marked")
    stored = session.run(run.run.name)
    with stored.results() as results:
        numbers, poses = results.poses()
        known = [(results.result(frame), results.layers(frame)) for frame in numbers.tolist()]
    with ResultsWriter(stored.folder) as writer:
        for (result, layers), planted in zip(known, PLANTED, strict=True):
            writer.write_frame(dataclasses.replace(result, **planted), layers)
    write_track(stored, Track(REFINED, numbers, poses, np.ones(len(numbers)), (TRACKED,) * len(numbers)))
    return InspectedRun(session, stored)


def test_what_the_search_marked_is_marked_everywhere(marked: InspectedRun) -> None:
    check_that_all_agree(marked)
    found = rows(marked.frame(0), Selection())
    # The refined track has the limb where the search has it: that it is there tells nothing.
    assert "Lost by the silhouettes: the right arm (body and silhouettes disagree about 26.7 %" in (
        found.findings[0].words
    )
    assert found.remedies[-1].action == "correct" or found.findings[0].kind == "wrong limb"
    assert "had lost the body" in rows(marked.frame(3), Selection()).findings[0].words
    assert "No picture shows a body" in rows(marked.frame(4), Selection()).findings[0].words


def test_a_derived_track(marked: InspectedRun) -> None:
    check_that_all_agree(marked, REFINED, why=(0, 1))


def test_a_body_without_sides(tmp_path: Path) -> None:
    session = make_session(tmp_path / "toy")
    run = prepare_run(session, knobs={"layers": 2, "particles": 12}, seed=1, fit_shape=False)
    finish(session, run)
    check_that_all_agree(InspectedRun(session, run), why=(2,))


@pytest.mark.parametrize("name", ["before-checksums", "before-versions"])
def test_what_older_versions_stored(tmp_path: Path, name: str) -> None:
    with zipfile.ZipFile(OLD / f"{name}.zip") as packed:
        packed.extractall(tmp_path)
    session = Session(tmp_path / "toy")
    check_that_all_agree(InspectedRun(session, session.run("run-1")), why=(1,))


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """The walk with the runs that the demo opens on."""
    session = install_sample(Workspace(tmp_path_factory.mktemp("demo")), "walk")
    install_prepared_runs(session, "walk")
    return session


def test_the_runs_of_the_demo(demo: Session) -> None:
    for run in demo.runs():
        inspected = InspectedRun(demo, run)
        said = verdicts_on(inspected)
        lost = [frame for frame, verdict in said.items() if not verdict.fits]
        # The run with one layer loses the walker, the one with ten does not.
        assert bool(lost) == (run.name == "one-layer")
        check_that_all_agree(inspected, why=tuple(lost[-1:]))


def test_one_layer_is_blamed_and_ten_are_tried(demo: Session) -> None:
    run = InspectedRun(demo, demo.run("one-layer"))
    found = rows(run.frame(13), Selection())
    [cause] = [finding for finding in found.findings if finding.is_cause]
    assert cause.kind == "layers"
    assert dict(found.remedies[0].settings) == {"layers": 10, "particles": 50}
    # In the shown frame alone the knobs mend little: the failure began before it.
    assert found.remedies[0].frame is not None
    assert found.remedies[0].frame < 13
    [*_, tried] = [finding for finding in found.findings if finding.kind == "trial"]
    assert tried.numbers["after"] < 0.5 * tried.numbers["before"]
    # The frame where it began is lost nowhere, and is not called right.
    [began] = [finding for finding in found.findings if finding.kind == "began"]
    assert began.frame is not None
    first = rows(run.frame(began.frame), Selection()).findings[0]
    assert first.kind == "drifting"
    assert "fits" not in first.words


def twisted(kind: str) -> Callable[..., object]:
    """What says it, made to say another thing than the others."""
    if kind == "timeline":
        return lambda *given: _changed(
            stored_frames.frames_summary(*given), fits=True, tracking=TRACKED, limbs_off=()
        )
    if kind == "badge":
        return lambda *given: dataclasses.replace(stored_frames.frame_detail(*given), tracking=TRACKED)
    if kind == "heat map":
        return lambda *given: {"limbs": [(*row[:4], False, "") for row in limbs.limb_rows(*given)["limbs"]]}
    fits = FrameFinding("fits", "The frame fits.")
    return lambda *given: dataclasses.replace(why.rows(*given), findings=(fits,))


def _changed(answer: stored_frames.FramesSummary, **changes: Any) -> stored_frames.FramesSummary:  # noqa: ANN401
    lines = tuple(dataclasses.replace(line, **changes) for line in answer.frames)
    return dataclasses.replace(answer, frames=lines)


@pytest.mark.parametrize(
    ("kind", "name"),
    [("timeline", "frames_summary"), ("badge", "frame_detail"), ("heat map", "limb_rows"), ("why", "rows")],
)
def test_a_contradiction_is_noticed(
    marked: InspectedRun, monkeypatch: pytest.MonkeyPatch, kind: str, name: str
) -> None:
    monkeypatch.setattr(stored_verdicts, name, twisted(kind))
    with pytest.raises(AssertionError):
        check_that_all_agree(marked, why=(0,))
