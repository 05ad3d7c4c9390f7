"""The guided set-up's start pose: made better from the page, edited by hand, shown in every view."""

import re

import numpy as np
import pytest
from playwright.sync_api import Browser, expect
from scene_wire import until
from studio_page import StudioPage
from studio_server import StudioServer
from toy_session import true_poses

from studio.sessions.provenance import note
from studio.sessions.workspace import Workspace

pytestmark = pytest.mark.browser

POSE = "/api/sessions/toy/start-pose"


@pytest.fixture
def studio(toy_studio: StudioServer) -> StudioServer:
    """The toy arm, whose start pose is a little off."""
    off = true_poses()[0] + np.array([0.12, -0.1, 0.1, -0.08])
    toy_studio.put(POSE, {"pose": off.tolist()})
    return toy_studio


def test_a_start_pose_is_made_better_and_edited(browser: Browser, studio: StudioServer) -> None:
    window = StudioPage(browser, studio, with_scene=False)
    page = window.page
    page.goto(f"{studio.origin}/way?session=toy&step=start-pose")
    page.get_by_text("The session has a start pose, of frame 0.").wait_for()
    picture = page.get_by_alt_text("front, frame 0, start pose")
    picture.wait_for()
    # It opens large, as it is stored, by a click and by Enter, and Escape leads back to it.
    until(page, lambda: picture.evaluate("image => image.naturalHeight > 0"))
    large = page.locator("dialog.large-view img")
    for act in (picture.click, lambda: page.keyboard.press("Enter")):
        act()
        until(page, lambda: large.evaluate("image => image.naturalHeight > 0"))
        assert "height=" not in str(large.get_attribute("src"))
        page.keyboard.press("Escape")
        large.wait_for(state="detached")
        expect(picture).to_be_focused()
    assert page.url.endswith("step=start-pose")
    before = studio.get(POSE)["pose"]
    page.get_by_role("button", name="Refine from here").click()
    page.get_by_text("Improved:").wait_for()
    better = studio.get(POSE)["pose"]
    assert better != before
    page.get_by_role("button", name="Edit by hand").click()
    use = page.get_by_role("button", name="Use this pose")
    use.wait_for()
    wanted = true_poses()[0].tolist()
    studio.post("/api/scene/edit", {"session": "toy", "frame": 0, "pose": wanted}, window=window.name)
    for _ in range(500):
        response = studio.get("/api/scene/edit", window=window.name)
        if response["editing"] and response["pose"] == wanted:
            break
        page.wait_for_timeout(20)
    use.click()
    use.wait_for(state="detached")
    assert studio.get(POSE)["pose"] == pytest.approx(wanted)
    window.close()


def test_a_frame_that_is_typed_is_shown_with_its_masks(browser: Browser, studio: StudioServer) -> None:
    window = StudioPage(browser, studio, with_scene=False)
    page = window.page
    page.goto(f"{studio.origin}/way?session=toy&step=start-pose")
    captions = page.locator("figure.picture figcaption")
    expect(captions.first).to_contain_text("frame 0, start pose")
    with page.expect_request(lambda request: "/frames/3/views/" in request.url) as asked:
        page.get_by_role("spinbutton", name="Frame").press_sequentially("3")
    assert "show=mask" in asked.value.url
    assert "pose=" not in asked.value.url
    expect(captions.first).to_contain_text("frame 3, masks")
    page.get_by_role("button", name="Show frame 0").click()
    expect(captions.first).to_contain_text("frame 0, start pose")
    window.close()


def test_a_pose_in_doubt_has_no_tick_until_it_is_tracked_from(browser: Browser, studio: StudioServer) -> None:
    note(
        Workspace(studio.workspace).session("toy"),
        "start-pose",
        "found in frame 0, confidence 3 %",
        good=False,
    )
    window = StudioPage(browser, studio, with_scene=False)
    page = window.page
    page.goto(f"{studio.origin}/way?session=toy&step=start-pose")
    entry = page.locator("#stepper [data-step=start-pose]")
    expect(entry).to_have_attribute("data-doubt", "")
    expect(page.locator(".step-head .notice")).to_contain_text("It may face the other way")
    page.get_by_role("button", name=re.compile("^Yes, track")).click()
    expect(entry).to_contain_text("confirmed")
    expect(entry).not_to_have_attribute("data-doubt", "")
    window.close()
