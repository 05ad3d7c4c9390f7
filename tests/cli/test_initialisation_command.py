"""`studio initialise`, and what `studio track` says of runs that were lost."""

import pytest
from command_line import answer_of, call, refusal_of

from studio.foundations.errors import CalibrationError
from studio.runs import new_run
from studio.runs.setup.initialising import InitialPose
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace


@pytest.mark.slow
def test_a_start_pose_is_written_and_then_kept(session_on_disk: Session) -> None:
    printed = answer_of("initialise toy")
    assert (printed["session"], printed["frame"], printed["body"]) == ("toy", 0, "planar_arm4")
    assert printed["confidence"] > 0.8
    assert set(printed["pose"]) == {entry.name for entry in session_on_disk.body().parameters}
    stored = session_on_disk.start_pose()
    assert stored.tolist() == pytest.approx(list(printed["pose"].values()))
    second = call("initialise toy --frame 3 --seed 1")
    assert "start_pose-frame-3.csv" in second.stdout
    assert "confidence" in second.stdout
    assert answer_of("initialise toy --replace")["file"].endswith("start_pose.csv")
    assert (session_on_disk.path / "start_pose-before.csv").is_file()


@pytest.mark.parametrize(
    ("words", "cause"),
    [
        (["--frame", "99"], "Frames 99:100 do not lie"),
        (["--behaviour", "none-such"], "There is no behaviour model"),
        (["--body", "nobody"], "There is no body"),
    ],
)
def test_refusals(session_on_disk: Session, words: list[str], cause: str) -> None:
    assert cause in refusal_of("initialise toy", *words)
    assert not (session_on_disk.path / "start_pose.csv").exists()


def test_track_passes_on_why_no_start_pose_is_found(
    session_on_disk: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    def finds_none(*_: object, **__: object) -> InitialPose:
        raise CalibrationError("No two cameras see a common place.", "Check the calibration's unit.")

    monkeypatch.setattr(new_run, "initialise", finds_none)
    monkeypatch.setattr(new_run, "_has_limits", lambda _: False)
    said = refusal_of("track toy --frames :1")
    assert "none can be found: No two cameras see a common place." in said
    assert "remedy Check the calibration's unit." in said
    assert "--start-pose" not in said


def test_track_tells_how_it_went(session_on_disk: Session) -> None:
    printed = answer_of("track toy --frames :2 --particles 30 --layers 3")
    assert printed["frames_lost"] + printed["frames_without_evidence"] + printed["times_recovered"] <= 2
    assert len(Workspace().session("toy").runs()) == 1
