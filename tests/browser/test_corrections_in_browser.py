"""A frame put right by hand on the page, tracked on and backwards; tracks made from the run's menu and chosen."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser
from studio_page import StudioPage
from studio_server import StudioServer
from toy_session import FRAMES, true_poses

pytestmark = pytest.mark.browser

RUN = "/api/sessions/toy/runs"
QUICK = {"particles": 40, "layers": 4, "start_repeats": 1, "recovery": "off"}


@pytest.fixture
def studio(toy_studio: StudioServer) -> StudioServer:
    """The toy arm, with a run that is tracked to its end."""
    start = (true_poses()[0] + [1.2, -2.0, 1.8, -1.5]).tolist()
    toy_studio.track("toy", "one", start_pose=start, settings={**QUICK, "refine_frames": False})
    return toy_studio


def opened(browser: Browser, studio: StudioServer) -> StudioPage:
    window = StudioPage(browser, studio, open_at=f"{studio.address}&session=toy&run=one", with_scene=False)
    window.until(f"get('run') === 'one' && get('summary')?.frames.length === {FRAMES}")
    return window


def edited(window: StudioPage, wanted: Callable[[dict], bool]) -> None:
    """Wait until the editor of the window's scene is as wanted."""
    deadline = time.monotonic() + 30.0
    while not wanted(response := window.studio.get("/api/scene/edit", window=window.name)):
        assert time.monotonic() < deadline, response
        time.sleep(0.02)


def put_right(window: StudioPage, studio: StudioServer, run: str, frame: int) -> None:
    """Correct the shown frame: what a person drags in the scene comes over the API here."""
    window.until(f"get('frame') === {frame}")
    window.page.locator("#correct").click()
    window.page.locator("#correcting").wait_for()
    edited(window, lambda response: response["frame"] == frame)
    request = {"session": "toy", "run": run, "frame": frame, "pose": true_poses()[frame].tolist()}
    studio.post("/api/scene/edit", request, window=window.name)
    edited(window, lambda response: response["moved"])


def poses_of(studio: StudioServer, run: str) -> np.ndarray:
    rows = studio.text(f"{RUN}/{run}/poses.csv").splitlines()[1:]
    return np.array([[float(value) for value in row.split(",")[1:]] for row in rows])


def test_a_corrected_frame_is_tracked_on_and_backwards(
    browser: Browser, studio: StudioServer, artefacts: Path
) -> None:
    window = opened(browser, studio)
    before = poses_of(studio, "one")
    window.key("Home")
    for _ in range(4):
        window.key("ArrowRight")
    put_right(window, studio, "one", 4)
    window.shoot(artefacts / "correcting-dark.png")
    window.page.get_by_role("button", name="Track on from here").click()
    window.until(
        f"get('run') !== 'one' && get('summary')?.corrected === 4 && get('summary').frames.length === {FRAMES}"
    )
    made = str(window.get("run"))
    after, truth = poses_of(studio, made), true_poses()
    np.testing.assert_array_equal(after[:4], before[:4])
    assert np.abs(after[4:] - truth[4:]).mean() < np.abs(before[4:] - truth[4:]).mean()
    np.testing.assert_array_equal(poses_of(studio, "one"), before)
    assert window.page.locator("#correcting").is_hidden()
    window.key("Home")
    window.key("n")
    window.until("get('frame') === 4")
    window.page.get_by_text("is unchanged").wait_for()
    window.shoot(artefacts / "corrected-timeline-dark.png", part=".timeline")
    studio.until(lambda state: state["state"] == "finished")
    put_right(window, studio, made, 4)
    window.page.get_by_label("Backwards to frame").fill("1")
    window.page.get_by_role("button", name="Track backwards to").click()
    window.until(f"!['one', '{made}'].includes(get('run')) && get('summary')?.backwards_to === 1")
    back = poses_of(studio, str(window.get("run")))
    np.testing.assert_array_equal(back[0], before[0])
    np.testing.assert_array_equal(back[5:], after[5:])
    assert np.abs(back[1:5] - truth[1:5]).mean() < np.abs(before[1:5] - truth[1:5]).mean()
    window.close()


@pytest.mark.slow
def test_a_correction_goes_on_after_a_reload_and_leaving_it_changes_nothing(
    browser: Browser, studio: StudioServer
) -> None:
    window = opened(browser, studio)
    window.key("Home")
    put_right(window, studio, "one", 0)
    # It goes on after a reload; Undo and Escape do what they say.
    window.page.reload()
    window.page.locator("#correcting").wait_for()
    edited(window, lambda response: response["moved"])
    window.page.get_by_role("button", name="Undo").click()
    edited(window, lambda response: not response["moved"])
    assert window.page.locator("#correcting").is_visible()
    window.key("Escape")
    window.page.locator("#correcting").wait_for(state="hidden")
    edited(window, lambda response: not response["editing"])
    assert len(studio.get(RUN)["runs"]) == 1
    window.close()


@pytest.mark.slow
def test_tracks_are_made_and_chosen(browser: Browser, studio: StudioServer, artefacts: Path) -> None:
    window = opened(browser, studio)
    assert window.page.locator("#track-choice").is_hidden()
    for entry, made in (("Refine", "refined"), ("Smooth", "smoothed")):
        window.choose(window.page.get_by_label("More for one"), f"{entry}…")
        window.page.get_by_role("heading", name=f"{entry} one").wait_for()
        window.shoot(artefacts / f"{made}-form-dark.png")
        window.page.locator("#dialog").get_by_role("button", name=entry, exact=True).click()
        window.until(f"get('track') === '{made}'")
        window.page.locator("#dialog").wait_for(state="hidden")
    choice = window.page.locator("#track-choice")
    assert choice.input_value() == "smoothed"
    assert choice.locator("option").count() == 3
    assert [line["name"] for line in studio.get(f"{RUN}/one/tracks")["tracks"]] == [
        "raw",
        "refined",
        "smoothed",
    ]
    window.page.get_by_role("tab", name="Cameras").click()
    picture = window.page.get_by_alt_text("View of front")
    window.page.wait_for_function(
        "image => image.src.includes('track=smoothed')", arg=picture.element_handle()
    )
    choice.select_option("raw")
    window.until("get('track') === 'raw'")
    window.page.wait_for_function("image => !image.src.includes('track=')", arg=picture.element_handle())
    window.close()
