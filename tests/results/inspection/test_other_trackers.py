"""Every view answers for other trackers and likelihoods; `why` knows what the refinement has put right."""

from pathlib import Path

import pytest
from drawn_people import ring_of_cameras
from planted_runs import drawn_session, person_poses, planted
from tracked_runs import finish

from studio.results.inspection.limbs import errors_of
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.tables import Selection
from studio.results.inspection.views import VIEWS, look, look_over
from studio.results.inspection.why import WRONG_MM, Case, rows
from studio.runs.new_run import prepare_run
from studio.sessions.session import Session


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    return drawn_session(
        tmp_path_factory.mktemp("others") / "drawn", person_poses("run", 30, 3, 3), ring_of_cameras(4)
    )


@pytest.mark.parametrize(
    ("tracker", "weighting", "knobs"),
    [
        ("swarm", "", {}),
        ("condensation", "", {"particles": 60, "refine_frames": False}),
        ("tempered", "", {"particles": 30, "layers": 6, "refine_frames": False}),
        ("annealed", "blobs", {"particles": 20, "layers": 3, "refine_frames": False}),
        ("annealed", "bodytrack", {"particles": 10, "layers": 3}),
    ],
)
def test_every_view_answers(session: Session, tracker: str, weighting: str, knobs: dict[str, object]) -> None:
    made = prepare_run(
        session, tracker=tracker, weighting=weighting, knobs=knobs, fit_shape=False, allow_inconsistent=True
    )
    finish(session, made)
    run = InspectedRun(session, made)
    for name in VIEWS:
        for table in look(run, 2, name, Selection(camera="cam1")).tables:
            assert all(len(row) == len(table.columns) for row in table.rows), (name, table.name)
        look_over(run, name, Selection(parameter="pelvis_x"))
    if tracker == "swarm":
        assert "no β" in look(run, 2, "schedule", Selection()).notes[0]
        assert look(run, 2, "schedule", Selection()).table("layers").column("beta")[0] is None
    layers = look(run, 2, "schedule", Selection()).table("layers")
    evidence = look_over(run, "schedule", Selection()).table("frames").column("log_evidence")
    for name in ("temper", "acceptance", "log_evidence"):
        assert (layers.column(name)[-1] is not None) == (tracker == "tempered")
    assert all((value is not None) == (tracker == "tempered") for value in evidence)
    if tracker == "tempered":
        assert evidence[2] == layers.column("log_evidence")[-1]


@pytest.mark.slow
def test_what_the_refinement_put_right_is_said(tmp_path: Path) -> None:
    poses = person_poses("walk", 20, 18, 2)
    session, made = planted(
        tmp_path / "mended", "particles", poses, poses, seed=7, refine_frames=True, particles=4
    )
    run = InspectedRun(session, made)
    errors, found = errors_of(run), []
    for number in run.frames():
        case = Case(run.frame(number), "")
        if case.wrong and max(errors[number].values()) < WRONG_MM:
            found.append(rows(run.frame(number), Selection()))
    assert found, "no frame was mended"
    assert "The refinement after the search put it right" in found[0].findings[0].words
