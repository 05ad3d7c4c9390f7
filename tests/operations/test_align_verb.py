"""`studio.align` and `studio.unalign` on a session with a nudged camera."""

import pytest
from nudged_camera import NUDGED, make_nudged_session

import studio
from studio.runs.setup.workflow import background_step
from studio.sessions.session import CAMERAS_PATH, Session
from studio.sessions.workspace import Workspace


@pytest.mark.slow
def test_cameras_are_turned_reported_and_turned_back() -> None:
    session = make_nudged_session(Workspace().place_for("nudged"))
    before = (session.path / CAMERAS_PATH).read_bytes()
    steps: list[str] = []
    looked = studio.align("nudged", keep=False, progress=lambda step, done, total: steps.append(step))
    assert looked.needed
    assert looked.better
    assert not looked.changed
    assert (session.path / CAMERAS_PATH).read_bytes() == before
    assert max(looked.before, key=lambda name: looked.before[name]) == NUDGED
    assert set(steps) == {"reading silhouettes"}
    studio.mask_quality("nudged")
    turned = studio.align("nudged")
    assert turned.changed
    # What the masks are worth is known of the cameras that the session uses now.
    assert background_step(Session(session.path)).state != "stale"
    assert turned.after[NUDGED] < 0.4 * turned.before[NUDGED]
    assert studio.align("nudged", keep=False).needed is False
    studio.unalign("nudged")
    assert background_step(Session(session.path)).state != "stale"
    assert (session.path / CAMERAS_PATH).read_bytes() == before
    with pytest.raises(studio.StudioError, match="were not turned"):
        studio.unalign("nudged")
