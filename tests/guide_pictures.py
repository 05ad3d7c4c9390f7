"""The pictures of the guide and the README, taken of the running program: `make pictures`.

STUDIO_PICTURES names a workspace to use again, else a new one is made. The course's runs are made first where they are
not there.
"""

import os
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests"), str(ROOT / "tests" / "browser")]

from conftest import ARGUMENTS, chromium  # noqa: E402
from playwright.sync_api import Page, sync_playwright  # noqa: E402
from studio_page import StudioPage  # noqa: E402
from studio_server import StudioServer  # noqa: E402

GUIDE = ROOT / "web_assets" / "guide"
PANEL, SCENE = "#panels", "#scene"
SMOOTH = "document.onreadystatechange = () => { document.documentElement.dataset.drawing = 'card'; }"
WITHOUT_PANEL = 0.69
"""Share of the scene's width that its panel leaves free."""
PATIENCE_SECONDS = 900.0
SETTLED_MILLISECONDS, MOST_LOOKS = 2500, 12
"""A picture is taken once two looks at the page are the same."""


@dataclass(frozen=True, slots=True)
class Picture:
    """file : in the guide's folder. state : query of the address. part : of the page, "" for all of it. size : of
    the window, pixels. page : its path.
    """

    file: str
    state: str
    part: str = ""
    size: tuple[int, int] = (1280, 860)
    page: str = "/"


WALK = "session=walk&run="
PICTURES = (
    Picture("course-particles.jpg", f"{WALK}course-annealed&frame=9&layer=0&panel=views&view=weights", SCENE),
    Picture("course-one-layer.jpg", f"{WALK}course-one-layer&frame=9&panel=why", PANEL),
    Picture("course-schedule.jpg", f"{WALK}course-annealed&frame=9&panel=views&view=schedule", PANEL),
    Picture(
        "course-variance.jpg", f"{WALK}course-annealed&frame=9&panel=views&view=variance", PANEL, (1280, 1180)
    ),
    Picture("course-swarm.jpg", f"{WALK}course-swarm&frame=9&panel=views&view=variance", PANEL, (1280, 1180)),
    Picture("bodies.jpg", "body=mouse", page="/bodies"),
    Picture("first-seen.jpg", f"{WALK}ten-layers&frame=10&layer=1&panel=views&view=variance"),
    Picture("first-survival.jpg", f"{WALK}ten-layers&frame=10&layer=4&panel=views&view=schedule&step=2"),
    Picture("first-failing.jpg", f"{WALK}one-layer&frame=13&panel=compare&compared=walk/ten-layers&step=3"),
    Picture(
        "studio.jpg", f"{WALK}ten-layers&frame=10&layer=1&panel=views&view=variance&step=4", "", (1440, 960)
    ),
    # The last: a window that the course was docked in shows it from then on.
    Picture("course-docked.jpg", "course=arm"),
)


def make_runs(studio: StudioServer) -> None:
    """The course's runs, made where they are not there."""
    if any(not run["there"] for run in studio.get("/api/course")["runs"]):
        studio.post("/api/course")
    deadline = time.monotonic() + PATIENCE_SECONDS
    while any(not run["there"] for run in studio.get("/api/course")["runs"]):
        assert time.monotonic() < deadline, studio.get("/api/course")
        time.sleep(1.0)


def take(page: Page, window: StudioPage, picture: Picture) -> None:
    """Open the state, wait until it is drawn, keep the picture."""
    page.set_viewport_size({"width": picture.size[0], "height": picture.size[1]})
    page.goto(f"{window.studio.origin}{picture.page}?{picture.state}")
    is_studio = picture.page == "/"
    scene = page.frame_locator("iframe")
    scene.locator("canvas").first.wait_for()
    if is_studio:
        # A narrow scene has its panel, but hides it.
        scene.get_by_role("tab", include_hidden=True).first.wait_for(state="attached")
    warning = scene.locator("#webgl-software-rendering button")
    for _ in range(60):
        page.wait_for_timeout(500)
        if warning.count():
            warning.dispatch_event("click")
        is_drawn = not is_studio or (window.charts_drawn() and window.get("detail"))
        if is_drawn and not warning.count():
            break
    before = b""
    for _ in range(MOST_LOOKS):
        page.wait_for_timeout(SETTLED_MILLISECONDS)
        now = page.screenshot()
        if now == before and not page.locator("[aria-busy=true]").count():
            break
        before = now
    place = GUIDE / picture.file
    if picture.part == SCENE:
        box = page.locator(SCENE).bounding_box()
        clip = {**box, "width": WITHOUT_PANEL * box["width"]}
        page.screenshot(path=place, type="jpeg", quality=82, clip=clip)  # pyright: ignore[reportArgumentType]
    elif picture.part:
        page.locator(picture.part).screenshot(path=place, type="jpeg", quality=82)
    else:
        page.screenshot(path=place, type="jpeg", quality=82)
    print(f"{place.relative_to(ROOT)}: {place.stat().st_size // 1000} kB")


def main() -> None:
    """Take all pictures, or those whose files are named."""
    chosen = [one for one in PICTURES if not sys.argv[1:] or one.file in sys.argv[1:]]
    workspace = Path(os.environ.get("STUDIO_PICTURES") or tempfile.mkdtemp(prefix="studio-pictures-"))
    studio = StudioServer("serve", workspace)
    try:
        if any(one.page == "/" for one in chosen):
            make_runs(studio)
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(
                executable_path=chromium(playwright), headless=True, args=ARGUMENTS
            )
            window = StudioPage(browser, studio)
            window.page.evaluate("localStorage.setItem('theme', 'light')")
            # Drawn by the processor, but as smooth as a graphics card would.
            window.page.add_init_script(SMOOTH)
            for picture in chosen:
                take(window.page, window, picture)
            browser.close()
    finally:
        studio.stop()


if __name__ == "__main__":
    main()
