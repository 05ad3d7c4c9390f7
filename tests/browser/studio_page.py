"""The studio's page as a person uses it, and the page's own state to wait on."""

import re
from pathlib import Path

from page_watch import PageWatch
from playwright.sync_api import Browser, BrowserContext, FrameLocator, Locator, Page, expect
from scene_wire import SceneWire
from studio_server import StudioServer

PATIENCE = 60_000
DRAWN = """figures => figures.filter((figure) => figure.clientWidth).every((figure) =>
  figure.dataset.drawn?.endsWith(` ${document.documentElement.dataset.theme} ${figure.clientWidth}`))"""
READ = "async (name) => (await import('/assets/js/state.js')).get(name)"


class StudioPage:
    """A browser window on a studio. with_scene : False leaves the 3-D scene blank (it takes long to draw). beside : the
    window whose browser it is opened in, else one of its own.
    """

    def __init__(
        self,
        browser: Browser,
        studio: StudioServer,
        *,
        open_at: str = "",
        with_scene: bool = True,
        beside: "StudioPage | None" = None,
    ) -> None:
        self.studio = studio
        self._beside = beside
        self.context: BrowserContext = (
            beside.context
            if beside is not None
            else browser.new_context(
                viewport={"width": 1280, "height": 800}, color_scheme="dark", accept_downloads=True
            )
        )
        self.context.set_default_timeout(PATIENCE)
        self.page: Page = self.context.new_page()
        self.watch = PageWatch(self.page, studio.origin)
        self.wire = SceneWire(self.page)
        self.tried_wire = SceneWire(self.page, of_trials=True)
        if not with_scene:
            self.page.route(
                re.compile(r"^https?://[^/]+/scene/"),
                lambda route: route.fulfill(body="", content_type="text/html"),
            )
        self.page.goto(open_at or studio.address)

    @property
    def scene(self) -> FrameLocator:
        """viser's own page."""
        return self.page.frame_locator("#scene")

    @property
    def name(self) -> str:
        """The window's name, by which the studio knows its scene."""
        return self.page.evaluate("async () => (await import('/assets/js/window.js')).windowName")

    def get(self, name: str) -> object:
        """An entry of the page's state."""
        return self.page.evaluate(READ, name)

    def until(self, condition: str) -> None:
        """Wait until an expression over `get(name)` of the page's state is true."""
        for _ in range(PATIENCE // 50):
            if self.page.evaluate(
                f"async () => {{ const {{ get }} = await import('/assets/js/state.js'); return Boolean({condition}); }}"
            ):
                return
            self.page.wait_for_timeout(50)
        state = {name: self.get(name) for name in ("session", "run", "frame", "layer", "work", "connected")}
        said = "\n".join(self.studio.faults())
        raise AssertionError(f"never came about: {condition}; the state is {state}\n{said}")

    def see_scene(self) -> None:
        """Wait until the scene is drawn and has its panel; the warning of software rendering is closed."""
        self.scene.locator("canvas").first.wait_for()
        self.scene.get_by_text("survival rate").first.wait_for(state="attached")
        toast = self.scene.locator("#webgl-software-rendering button")
        if toast.count():
            toast.dispatch_event("click")
            toast.wait_for(state="detached")

    def slider(self, label: str) -> Locator:
        """A slider of viser's panel by its label; a narrow scene shows the panel where it is asked to."""
        knobs = self.page.get_by_role("button", name="Knobs", exact=True)
        if knobs.count() and knobs.get_attribute("aria-pressed") == "false":
            knobs.click()
        row = self.scene.locator("label", has_text=label).locator(
            "xpath=ancestor::*[.//*[@role='slider']][1]"
        )
        return row.get_by_role("slider").first

    def key(self, name: str) -> None:
        """Press a key on the page itself."""
        self.page.evaluate("document.activeElement.blur()")
        self.page.keyboard.press(name)

    def choose(self, button: Locator, entry: str) -> None:
        """Choose an entry of a menu."""
        button.click()
        self.page.get_by_role("menuitem", name=entry, exact=True).click()

    def chart(self, name: str) -> str:
        """The picture of a panel's figure as text, to see whether it changed."""
        drawn = self.page.locator(f"#panel-{name} .figure-chart canvas")
        return drawn.evaluate_all("layers => layers.map((canvas) => canvas.toDataURL()).join()")

    def charts_drawn(self) -> bool:
        """Whether every figure that is seen was drawn for its size and the theme."""
        return self.page.locator(".figure-body").evaluate_all(DRAWN)

    def show_view(self, name: str) -> None:
        """Show one of the views by its entry in the list."""
        self.page.click("[data-panel=views]")
        self.page.click(f".view-entry[data-key={name}]")
        body = self.page.locator("#panel-views .figure-body")
        expect(body).to_have_attribute("data-drawn", re.compile(rf"{name} "), timeout=PATIENCE)

    def shoot(self, path: Path, part: str = "") -> None:
        """Keep a picture of the page, or of a part of it."""
        path.parent.mkdir(parents=True, exist_ok=True)
        if part:
            self.page.locator(part).screenshot(path=path)
        else:
            self.page.screenshot(path=path)

    def close(self) -> None:
        """Close the window; nothing went wrong in it."""
        if self._beside is None:
            self.context.close()
        else:
            self.page.close()
        self.watch.check()
