"""The timeline's marks of lost and found: named in its legend, told at the pointer, reached by the keyboard."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser
from store_records import layer_of, result_of
from studio_page import StudioPage
from studio_server import StudioServer

from studio.search.trackers.tracker import LOST, NO_EVIDENCE, RECOVERED, TRACKED
from studio.sessions.results_store import ResultsWriter
from studio.sessions.workspace import Workspace

pytestmark = pytest.mark.browser

WENT = [TRACKED] * 2 + [LOST] * 3 + [RECOVERED] + [TRACKED] * 2 + [NO_EVIDENCE] * 3 + [RECOVERED, TRACKED]
MARKS = [2, 5, 8, 11]
NAMES = {LOST: "search lost", NO_EVIDENCE: "no evidence", RECOVERED: "found again"}


@pytest.fixture
def studio(tmp_path: Path) -> Iterator[StudioServer]:
    """`studio serve` with the sample and a run that was thrown off twice."""
    with StudioServer("serve", tmp_path / "workspace") as made:
        made.post("/api/samples", {"name": "walk"})
        made.post("/api/sessions/walk/runs", {"name": "thrown", "last": len(WENT)})
        run = Workspace(tmp_path / "workspace").session("walk").run("thrown")
        size = len(run.record.parameters)
        with ResultsWriter(run.folder) as writer:
            for frame, tracking in enumerate(WENT):
                result = dataclasses.replace(result_of(frame, size=size, layers=1), tracking=tracking)
                writer.write_frame(result, [layer_of(frame, 0, size=size)])
        yield made


def test_the_marks_are_named_reported_and_reached_by_keys(
    browser: Browser, studio: StudioServer, artefacts: Path
) -> None:
    opened = f"{studio.address}&session=walk&run=thrown"
    window = StudioPage(browser, studio, open_at=opened, with_scene=False)
    window.until(f"get('run') === 'thrown' && get('summary')?.frames.length === {len(WENT)}")
    page, track = window.page, window.page.locator("#track")
    window.key("Home")
    window.until("get('frame') === 0")
    for frame in MARKS:
        window.key("n")
        window.until(f"get('frame') === {frame}")
        words = track.get_attribute("aria-valuetext") or ""
        assert words.startswith(f"frame {frame}, {NAMES[WENT[frame]]} · limb lost (truth): ")
        assert NAMES[WENT[frame]] in page.locator("#frame-label").inner_text()
    window.key("n")
    page.get_by_text("No mark after this frame.").wait_for()
    for frame in reversed(MARKS[:-1]):
        window.key("p")
        window.until(f"get('frame') === {frame}")
    box = track.bounding_box()
    page.mouse.move(box["x"] + 6 + 9 / (len(WENT) - 1) * (box["width"] - 12), box["y"] + 20)
    title = track.get_attribute("title") or ""
    assert title.startswith("frame 9: no evidence – nothing to be seen: the pose is held; limb lost (truth)")
    window.shoot(artefacts / "timeline-marks-dark.png", part=".timeline")
    window.key("?")
    page.get_by_text("next mark of the timeline: search lost, a limb off, limb lost (truth)").wait_for()
    window.close()
