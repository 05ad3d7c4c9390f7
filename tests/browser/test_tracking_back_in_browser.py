"""The guided set-up where the start pose is in the middle: tracked on and back from there; leaps are named; an export
that is older than its track is called old.
"""

import dataclasses
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from page_watch import PageWatch
from playwright.sync_api import Browser, Page, expect
from sample_walk import copy_of_walk
from studio_server import StudioServer

from studio.operations.jobs.batch import track_to_end
from studio.runs.new_run import prepare_run
from studio.runs.setup.start_pose_file import keep_start_pose
from studio.runs.tracks import read_track, write_track
from studio.sessions.provenance import note
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace

pytestmark = [pytest.mark.browser, pytest.mark.slow]

PATIENCE = 60_000
START, LAST = 4, 10
QUICK = {"particles": 60, "layers": 4}


@pytest.fixture(scope="module")
def workspace(workspace: Path) -> Path:
    """With the walk, a start pose of frame 4 and a run from there."""
    session = copy_of_walk(Workspace(workspace).place_for("walk"))
    before = prepare_run(session, name="before", last=START + 1, knobs=QUICK)
    track_to_end(session, before, lambda *_: None)
    keep_start_pose(session, session.body(), read_track(before).poses[-1], START)
    late = prepare_run(session, name="late", last=LAST, knobs=QUICK)
    track_to_end(session, late, lambda *_: None)
    return workspace


@pytest.fixture
def page(browser: Browser, studio: StudioServer) -> Iterator[Page]:
    """A window on the guided set-up."""
    context = browser.new_context(viewport={"width": 1280, "height": 800}, color_scheme="dark")
    context.set_default_timeout(PATIENCE)
    opened = context.new_page()
    watch = PageWatch(opened, studio.origin)
    # A calibration in doubt is not tracked at the first click.
    watch.allow(422, "/api/sessions/walk/runs")
    opened.goto(studio.address)
    yield opened
    context.close()
    watch.check()


def step(page: Page, studio: StudioServer, name: str) -> None:
    page.goto(f"{studio.origin}/way?session=walk&step={name}")
    page.locator(f"#stepper [data-step={name}][aria-current=step]").wait_for()


def test_tracking_begins_at_the_start_pose_and_goes_back(
    page: Page, studio: StudioServer, artefacts: Path
) -> None:
    step(page, studio, "start-pose")
    expect(page.get_by_label("Frame", exact=True)).to_have_value(str(START))
    expect(page.get_by_text(f"The session has a start pose, of frame {START}.")).to_be_visible()
    step(page, studio, "track")
    page.get_by_text("Track again").first.click()
    expect(page.get_by_label("First frame")).to_have_value(str(START))
    expect(page.get_by_text(f"The start pose is of frame {START}: tracking begins there.")).to_be_visible()
    expect(page.get_by_text(f"(from frame {START} on)")).to_be_visible()
    artefacts.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=artefacts / "setup-track-from-the-middle.png")
    page.get_by_role("button", name="Track back to frame 0").click()
    expect(page.get_by_role("button", name="Track back to frame 0")).to_have_count(0)
    track = page.locator("#stepper [data-step=track]")
    expect(track).to_contain_text(f"{LAST} of {LAST} frames")
    made = Session(studio.workspace / "walk").runs()[-1]
    assert (made.record.first, made.record.made_from) == (0, "late")
    assert read_track(made).frames.tolist() == list(range(LAST))


def test_leaps_are_called_out_and_an_old_export_is(page: Page, studio: StudioServer, artefacts: Path) -> None:
    session = Session(studio.workspace / "walk")
    run = session.runs()[-1]
    track = read_track(run)
    poses = track.poses.copy()
    arm = next(at for at, entry in enumerate(run.body().parameters) if entry.limb == "left arm")
    poses[5:, arm] += 1.0
    leaping = dataclasses.replace(
        track, name="smoothed", poses=poses, made_by={"verb": "smooth", "from": "raw"}
    )
    write_track(run, leaping)
    step(page, studio, "check")
    page.get_by_role("button", name="Check the motion").click()
    chip = page.get_by_role("button", name=re.compile("^5 left arm$"))
    chip.click()
    expect(chip).to_have_attribute("aria-current", "true")
    expect(page.locator("#aside")).to_contain_text("frame 5")
    expect(page.locator("#stepper [data-step=check]")).to_contain_text("frame 5, left arm")
    page.screenshot(path=artefacts / "setup-check-jumps.png")
    step(page, studio, "export")
    page.get_by_role("button", name="Export", exact=True).click()
    expect(page.locator(".export-files li")).to_have_count(1)
    export = page.locator("#stepper [data-step=export]")
    expect(export).to_have_attribute("data-state", "done")
    write_track(run, dataclasses.replace(leaping, poses=np.asarray(track.poses)), replace=True)
    step(page, studio, "export")
    expect(export).to_have_attribute("data-state", "stale")
    expect(page.locator(".stale-file")).to_contain_text("written before track 'smoothed' changed")
    page.get_by_role("button", name="Export", exact=True).click()
    expect(page.locator(".stale-file")).to_have_count(0)
    expect(export).to_have_attribute("data-state", "done")


def test_a_doubted_calibration_is_tracked_only_if_requested(
    page: Page, studio: StudioServer, artefacts: Path
) -> None:
    doubt = "Cameras cam1 and cam3 seem to carry each other's names. Exchange them."
    session = Session(studio.workspace / "walk")
    made = len(session.runs())
    note(session, "background", "in doubt", good=False, stops=(doubt,))
    step(page, studio, "track")
    calibration = page.locator("#stepper [data-step=calibration]")
    expect(calibration).to_have_attribute("data-state", "stale")
    expect(calibration).to_contain_text(doubt)
    page.get_by_text("Track again").first.click()
    expect(page.locator("form .notice")).to_contain_text(doubt)
    page.get_by_label("Last frame").fill(str(START + 1))
    page.screenshot(path=artefacts / "setup-track-doubted.png")
    track = page.get_by_role("button", name="Track again", exact=True)
    track.click()
    expect(page.locator("form .wrong")).to_contain_text("contradicts its calibration")
    assert len(session.runs()) == made
    page.get_by_label("track all the same").check()
    track.click()
    expect(page.locator("#stepper [data-step=track]")).to_contain_text("2 of 2 frames")
    assert f"Tracked despite: {doubt}" in session.runs()[-1].record.notes
