"""A film of a scene is refused where there is nothing to film."""

from web_doubles import Studio

from studio.app.scene.model import Selection
from studio.runs.new_run import prepare_run
from studio.sessions.session import Session


def test_a_run_without_frames_makes_no_film(studio: Studio, session: Session) -> None:
    run = prepare_run(session, name="bare")
    studio.scenes.plain.shown = Selection(session=session.name, run=run.name)
    answer = studio.post("/api/scene/films", {"of": "frames"}, code=404)
    assert "no frames" in answer["message"]


def test_a_scene_that_shows_no_run_makes_no_film(studio: Studio) -> None:
    answer = studio.post("/api/scene/films", {"of": "layers"}, code=404)
    assert "Open a run" in answer["hint"]
