"""The guided set-up in a browser as a person goes through it, from raw files to a file of motion."""

import json
import time
from pathlib import Path

from playwright.sync_api import Locator, Page, expect
from studio_page import StudioPage
from studio_server import StudioServer

PATIENCE = 900_000
"""Milliseconds until a step's work is done."""
LOADED = "() => [...document.querySelectorAll('figure.picture img')].every((one) => one.naturalWidth > 0)"
MASKED = "() => document.querySelectorAll('.masks .picture.waiting').length === 0"
SIZES = (("light", 1280, 800), ("dark", 1920, 1080))


class GuidedSetup:
    """One window that goes through it all, and how long its steps take."""

    def __init__(self, window: StudioPage, folder: Path) -> None:
        """folder : for the pictures of the steps, and their seconds."""
        self.page: Page = window.page
        self.studio: StudioServer = window.studio
        self.folder = folder
        self.seconds: dict[str, float] = {}
        folder.mkdir(parents=True, exist_ok=True)
        window.context.set_default_timeout(PATIENCE)
        self.page.goto(f"{self.studio.origin}/way?new")
        self._since = time.monotonic()

    def shoot(self, name: str) -> None:
        """Keep a step as it looks, in both themes and sizes, once its pictures are there; nothing is cut off."""
        self.seconds[name] = round(time.monotonic() - self._since, 1)
        for theme, width, height in SIZES:
            self.page.set_viewport_size({"width": width, "height": height})
            self.page.evaluate("theme => { document.documentElement.dataset.theme = theme; }", theme)
            self.page.wait_for_function(LOADED)
            self.page.wait_for_function(MASKED)
            self.page.screenshot(path=self.folder / f"{len(self.seconds):02d}-{name}-{theme}.png")
            assert self.page.evaluate("document.documentElement.scrollWidth <= innerWidth"), name
        (self.folder / "seconds.json").write_text(json.dumps(self.seconds, indent=2))
        print(f"{name}: {self.seconds[name]} s")
        self._since = time.monotonic()

    def to(self, step: str) -> None:
        """Go on with a step by the list at the left."""
        self._entry(step).click()
        expect(self._entry(step)).to_have_attribute("aria-current", "step")

    def stands(self, step: str, state: str) -> None:
        """Wait until a step stands so."""
        expect(self._entry(step)).to_have_attribute("data-state", state)

    def words(self, step: str) -> str:
        """What the list at the left says of a step."""
        return " ".join(self._entry(step).inner_text().split())

    def press(self, name: str) -> None:
        """Press a button of the step."""
        self.page.locator("#step").get_by_role("button", name=name, exact=True).click()

    def agreement(self) -> list[float]:
        """The shares of agreement that the page shows, one for each of the four cameras."""
        shown = self.page.locator("ul.agree .figure")
        expect(shown).to_have_count(4)
        return [float(text.removesuffix("%")) / 100.0 for text in shown.all_inner_texts()]

    def download(self, folder: Path) -> Path:
        """The first file that the step Export offers, as the browser saves it."""
        with self.page.expect_download() as waiting:
            self.page.locator(".export-files a").first.click()
        file = folder / waiting.value.suggested_filename
        waiting.value.save_as(file)
        return file

    def _entry(self, step: str) -> Locator:
        return self.page.locator(f"#stepper [data-step={step}]")
