"""The page of live cameras: two MJPEG streams from loopback and two replayed videos, looked at, tracked, one stops."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from mjpeg_streams import Streams, served
from playwright.sync_api import Browser, Page, expect
from sample_walk import STREAM_FPS, copy_of_walk, streamed_pictures
from studio_server import StudioServer

from studio.sessions.session import Session

pytestmark = pytest.mark.browser

FRAMES = 70
PATIENCE = 60_000
SECRET = "geheim"


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Session:
    return copy_of_walk(tmp_path_factory.mktemp("live") / "workspace" / "walk")


@pytest.fixture(scope="module")
def streams(walk: Session) -> Iterator[Streams]:
    with served(streamed_pictures(walk, FRAMES), STREAM_FPS) as made:
        yield made


@pytest.fixture(scope="module")
def workspace(walk: Session) -> Path:
    """Where the walk is."""
    return walk.path.parent


@pytest.fixture(scope="module")
def footage(workspace: Path) -> Path:
    """What is in the workspace may be read."""
    return workspace


@pytest.fixture(scope="module")
def page(browser: Browser, studio: StudioServer) -> Iterator[Page]:
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    opened = context.new_page()
    opened.goto(studio.address)
    opened.goto(f"{studio.origin}/recording?session=walk")
    yield opened
    context.close()


@pytest.mark.slow
def test_cameras_are_looked_at_and_what_they_see_is_tracked(
    page: Page, streams: Streams, walk: Session, studio: StudioServer, artefacts: Path
) -> None:
    address = streams.address("cam1").replace("http://", f"http://root:{SECRET}@")
    places = [address, streams.address("cam2"), *(str(walk.path / "videos" / f"cam{k}.mp4") for k in (3, 4))]
    for number, place in enumerate(places):
        page.locator(".camera-address").nth(number).fill(place)
    page.get_by_role("button", name="Show cameras").click()
    for name in ("cam1", "cam2", "cam3", "cam4"):
        card = page.locator(f'.camera-card[data-name="{name}"]')
        expect(card.locator(".badge")).to_have_text("running", timeout=PATIENCE)
        expect(card.locator("img")).to_be_visible(timeout=PATIENCE)
        expect(card.locator(".camera-facts")).to_contain_text("fps")
    expect(page.locator(".spread")).to_contain_text("ms apart", timeout=PATIENCE)
    artefacts.mkdir(exist_ok=True)
    page.screenshot(path=artefacts / "recording-preview.png")
    page.get_by_label("Becomes session").fill("take-9")
    page.get_by_label("Track while recording").check()
    page.get_by_role("button", name="Record").click()
    expect(page.locator(".recording-line")).to_contain_text("recording · ", timeout=PATIENCE)
    streams.going.set()
    streams.silent.add("cam2")
    expect(page.locator('.camera-card[data-name="cam2"] .badge')).to_contain_text("stopped", timeout=PATIENCE)
    expect(page.locator(".recording-line")).to_contain_text("cam2: stopped", timeout=PATIENCE)
    page.screenshot(path=artefacts / "recording-stopped.png")
    page.get_by_role("button", name="Stop").click()
    link = page.get_by_role("link", name="Open take-9")
    expect(link).to_be_visible(timeout=PATIENCE)
    expect(page.locator(".words")).to_contain_text("Camera cam2 stopped")
    page.get_by_role("button", name="Light or dark").click()
    page.screenshot(path=artefacts / "recording-done.png")
    until = time.monotonic() + 60.0
    while (run := studio.get("/api/sessions/take-9/runs")["runs"][0])["status"] != "finished":
        assert time.monotonic() < until, run
        page.wait_for_timeout(100)
    assert run["name"] == "run-1"
    assert studio.get("/api/sessions/take-9/runs/run-1/live")["tracked"]
    assert SECRET not in page.content()
    assert all(SECRET not in path.read_text() for path in (walk.path.parent / ".studio").rglob("*.log"))


@pytest.mark.slow
def test_the_page_says_what_is_no_camera(page: Page, studio: StudioServer) -> None:
    page.reload()
    for place, said in (
        ("file:///etc/passwd", "cannot be reached by 'file'"),
        (f"{studio.origin}/api/sessions", "is no camera"),
        ("/etc/hostname.mp4", "does not lie in a folder"),
    ):
        page.locator(".camera-address").first.fill(place)
        page.get_by_role("button", name="Show cameras").click()
        expect(page.locator("#toasts")).to_contain_text(said, timeout=PATIENCE)
