"""The timeline's marks of lost and found: named in its legend, told at the pointer, reached by the keyboard."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser
from store_records import layer_of, result_of
from studio_page import StudioPage
from studio_server import StudioServer

from studio.sessions.results_store import ResultsWriter
from studio.sessions.workspace import Workspace
from studio.tracking.tracker import LOST, NO_EVIDENCE, RECOVERED, TRACKED

pytestmark = pytest.mark.browser

WENT = [TRACKED] * 2 + [LOST] * 3 + [RECOVERED] + [TRACKED] * 2 + [NO_EVIDENCE] * 3 + [RECOVERED, TRACKED]
MARKS = [2, 5, 8, 11]


@pytest.fixture
def studio(tmp_path: Path) -> Iterator[StudioServer]:
    """`studio serve` with the sample and a run that was thrown off twice."""
    made = StudioServer("serve", tmp_path / "workspace")
    made.post("/api/samples", {"name": "walk"})
    made.post("/api/sessions/walk/runs", {"name": "thrown", "last": len(WENT)})
    run = Workspace(tmp_path / "workspace").session("walk").run("thrown")
    size = len(run.record.parameters)
    with ResultsWriter(run.folder) as writer:
        for frame, tracking in enumerate(WENT):
            result = dataclasses.replace(result_of(frame, size=size, layers=1), tracking=tracking)
            writer.write_frame(result, [layer_of(frame, 0, size=size)])
    yield made
    made.stop()


def test_the_marks_are_named_told_and_reached_by_keys(
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
        assert track.get_attribute("aria-valuetext") == f"frame {frame}, {WENT[frame]}"
        assert WENT[frame] in page.locator("#frame-label").inner_text()
    window.key("n")
    page.get_by_text("No mark after this frame.").wait_for()
    for frame in reversed(MARKS[:-1]):
        window.key("p")
        window.until(f"get('frame') === {frame}")
    box = track.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 6 + 9 / (len(WENT) - 1) * (box["width"] - 12), box["y"] + 20)
    assert track.get_attribute("title") == "frame 9: no evidence – nothing to be seen: the pose is held"
    window.shoot(artefacts / "timeline-marks-dark.png", part=".timeline")
    window.key("?")
    page.get_by_text("next mark: lost, a limb lost, no evidence, recovered").wait_for()
    window.close()
