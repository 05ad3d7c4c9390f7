"""Steps Check and Export of the guided set-up: long notes of a track fit the page; a better track that is being made is
named where one is exported; what is no person is not called one.
"""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Route, expect
from store_records import store_run
from studio_page import StudioPage
from studio_server import StudioServer
from toy_session import make_session

from studio.runs.sides import EXCHANGED
from studio.runs.tracks import RAW, SIDES, SOURCE, SOURCE_DIGEST, Track, read_track, track_digest, write_track
from studio.sessions.workspace import Workspace

pytestmark = pytest.mark.browser

FRAMES = 6
NOTES = [
    f"frames {at} to {at + 4}: left haunch put where the frames before and after lead" for at in range(14)
]
JOB = {
    "identifier": "made", "state": "running", "verb": "refine", "session": "toy", "run": "first", "track": "",
    "step": "refining first", "done": 3, "total": 6, "seconds_left": 120.0, "kind": "track",
    "at": "/api/track-jobs/made",
}  # fmt: skip


@pytest.fixture(scope="module")
def workspace(workspace: Path) -> Path:
    """With one tracked run that was corrected in many places."""
    session = make_session(Workspace(workspace).place_for("toy"))
    run = store_run(session, "first", FRAMES)
    raw = read_track(run, RAW)
    made_by = {"verb": SIDES, SOURCE: RAW, SOURCE_DIGEST: track_digest(raw), EXCHANGED: NOTES}
    write_track(run, Track(SIDES, raw.frames, np.array(raw.poses), raw.confidence, raw.states, made_by))
    return workspace


@pytest.fixture
def window(browser: Browser, studio: StudioServer) -> Iterator[StudioPage]:
    opened = StudioPage(browser, studio, with_scene=False)
    yield opened
    opened.close()


def test_what_was_corrected_is_folded_and_fits_the_page(window: StudioPage) -> None:
    page = window.page
    page.goto(f"{window.studio.origin}/way?session=toy&step=check")
    corrected = page.locator("details.corrections")
    for width in (1400, 390):
        page.set_viewport_size({"width": width, "height": 900})
        expect(corrected.locator("summary")).to_have_text(f"corrected in {len(NOTES)} places")
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    corrected.locator("summary").click()
    expect(corrected.locator("li").first).to_be_visible()
    assert corrected.locator("li").all_inner_texts() == NOTES
    for width in (1400, 390):
        page.set_viewport_size({"width": width, "height": 900})
        table = page.locator("#step table").bounding_box()
        step = page.locator("#step").bounding_box()
        assert table["x"] + table["width"] <= step["x"] + step["width"]
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_every_frame_is_looked_at(window: StudioPage) -> None:
    """Every tenth frame is compared with the masks; one slides through all of them."""
    page = window.page
    page.goto(f"{window.studio.origin}/way?session=toy&step=check")
    slider = page.get_by_label("Checked frame")
    slider.focus()
    for frame in range(1, FRAMES):
        with page.expect_request(f"**/runs/first/frames/{frame}/views/*"):
            slider.press("ArrowRight")
        expect(slider).to_have_value(str(frame))
    slider.press("ArrowRight")
    expect(slider).to_have_value(str(FRAMES - 1))


def test_a_better_track_that_is_being_made_is_named_where_one_is_exported(window: StudioPage) -> None:
    page = window.page

    def answer(route: Route) -> None:
        found = {"jobs": [JOB]} if "/api/jobs" in route.request.url else JOB
        route.fulfill(body=json.dumps(found), content_type="application/json")

    page.route("**/api/jobs?kind=track*", answer)
    page.route("**/api/track-jobs/made", answer)
    page.goto(f"{window.studio.origin}/way?session=toy&step=export")
    words = page.locator(".export-form .notice")
    expect(words).to_contain_text('Track "refined" of this run is still being made')
    expect(words).to_contain_text("50 %")
    expect(words).to_contain_text('"best" is "sides"')
    page.unroute_all()
    page.reload()
    page.get_by_role("button", name="Export", exact=True).wait_for()
    expect(words).to_have_count(0)


def test_what_is_no_person_is_not_called_one(window: StudioPage) -> None:
    page = window.page
    page.goto(f"{window.studio.origin}/way?session=toy&step=background")
    page.get_by_text("Pictures of the empty place: 0 of").wait_for()
    page.goto(f"{window.studio.origin}/way?session=toy&step=calibration")
    page.locator(".rig-picture").wait_for()
    expect(page.locator(".rig-picture .person")).to_have_count(0)
    expect(page.locator(".rig-picture figcaption")).not_to_contain_text("person")
