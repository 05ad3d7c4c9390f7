"""A person chooses a tracker and a likelihood of another package in the form of a new run."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from guide_package import install_guide_package
from playwright.sync_api import Browser
from studio_page import StudioPage
from studio_server import StudioServer
from toy_session import make_session

pytestmark = pytest.mark.browser


@pytest.fixture
def studio(tmp_path: Path) -> Iterator[StudioServer]:
    """`studio serve` with the planar arm, and the guide's package beside the studio."""
    install_guide_package(tmp_path / "site")
    make_session(tmp_path / "workspace" / "toy")
    with StudioServer("serve", tmp_path / "workspace", beside=tmp_path / "site") as made:
        yield made


@pytest.mark.slow
def test_a_run_with_both_is_begun_from_the_form(browser: Browser, studio: StudioServer) -> None:
    window = StudioPage(browser, studio, with_scene=False)
    window.until("get('session') === 'toy'")
    window.page.locator(".session .new-run").first.click()
    form = window.page.locator("dialog form")
    form.locator("[name=tracker]").select_option(label="Random search")
    form.locator("[name=weighting]").select_option(label="Inside the silhouettes")
    form.locator("[name=name]").fill("own")
    form.locator("[name=last]").fill("2")
    for box in ("find", "shape"):
        form.locator(f"[name={box}]").uncheck()
    form.get_by_role("button", name="Track", exact=True).click()
    window.until("get('run') === 'own' && get('summary')?.frames.length === 3")
    assert window.get("summary")["describe"] == "random 300 · inside"  # pyright: ignore[reportIndexIssue, reportOptionalSubscript]
    assert studio.get("/api/sessions/toy/runs/own/settings")["values"]["reach"] == 1.0
    window.close()
