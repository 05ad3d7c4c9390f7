"""`studio record` and `studio live --camera`, on streams from loopback."""

from pathlib import Path

import pytest
from command_line import answer_of, refusal_of
from mjpeg_streams import served
from sample_walk import STREAM_FPS, copy_of_walk, streamed_pictures

from studio.sessions.session import Session


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Session:
    return copy_of_walk(tmp_path_factory.mktemp("recording") / "walk")


@pytest.fixture(scope="module")
def pictures(walk: Session) -> dict[str, list[bytes]]:
    return streamed_pictures(walk, 20)


def test_cameras_are_recorded_at_once(
    walk: Session, pictures: dict[str, list[bytes]], tmp_path: Path
) -> None:
    with served(pictures, STREAM_FPS) as streams:
        streams.going.set()
        cameras = [part for name in pictures for part in ("--camera", f"{name}={streams.address(name)}")]
        into = ("--into", str(tmp_path / "take"), "--calibration", str(walk.path))
        printed = answer_of("record", *cameras, "--seconds", "0.8", *into)
        assert set(printed["cameras"]) == {"cam1", "cam2"}
        assert printed["frames"] >= 10
        assert printed["spread_ms"]["median"] <= printed["spread_ms"]["worst"]
        made = Session(tmp_path / "take")
        assert made.manifest.frame_count == printed["frames"]
        assert "something at" in refusal_of("record", *cameras, *into)


@pytest.mark.slow
def test_live_cameras_are_tracked(walk: Session, pictures: dict[str, list[bytes]], tmp_path: Path) -> None:
    quick = ("--tracker", "annealed", "--weighting", "edge-region", "--particles", "30", "--layers", "2")
    with served(pictures, STREAM_FPS) as streams:
        cameras = [part for name in pictures for part in ("--camera", f"{name}={streams.address(name)}")]
        place = ("--into", tmp_path / "take", "--seconds", "1")
        printed = answer_of("live", walk.path, *cameras, *quick, *place)
        refusal_of("live", walk.path, *cameras, "--repeat")
    assert (printed["session"], printed["ended"]) == ("take", "its time was over")
    # A machine that does much else reads a camera late, and says so; none stays away.
    last = {notice["camera"]: notice["state"] for notice in printed["stopped"]}
    assert set(last.values()) <= {"running"}, printed["stopped"]
    assert printed["frames"] >= 1
    assert printed["frames"] + len(printed["dropped"]) <= printed["sets"]
    again = answer_of("live", tmp_path / "take", "--replay", printed["run"])
    assert (again["frames"], again["different"]) == (printed["frames"], [])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "No camera was given"),
        (("--camera", "cam1"), "without its name"),
        (("--camera", "cam1=file:///etc/passwd"), "cannot be reached by 'file'"),
        (("--camera", "cam1=/dev/video0", "--camera", "cam1=/dev/video1"), "given twice"),
        (("--camera", "left=/dev/video0"), "Camera left is not in"),
    ],
)
def test_what_cannot_be_recorded_is_said_at_once(
    walk: Session, tmp_path: Path, arguments: tuple[str, ...], said: str
) -> None:
    assert said in refusal_of("record", *arguments, "--into", tmp_path / "take", "--calibration", walk.path)
    assert not (tmp_path / "take").exists()
