"""Live runs in the studio: ticked in the form of a new run, told in the status line, tracked while a browser draws."""

import json
import os
import re
from pathlib import Path

import pytest
from playwright.sync_api import Browser
from studio_page import StudioPage
from studio_server import StudioServer
from toy_session import make_session

from studio.garden.benchmarks.live_footage import learn_walk, make_footage
from studio.garden.benchmarks.live_stages import CHANGES, TRACKER, WEIGHTING, live_figures
from studio.runs.live.live_summary import summary_of
from studio.sessions.workspace import Workspace

pytestmark = pytest.mark.browser

RUNS = "/api/sessions/toy/runs"
LINE = re.compile(r"^live · \d+\.\d fps · latency \d+ ms · \d+ dropped$")
FRAMES = 360
# All that the status line says from now on.
LISTEN = """() => {
  window.said = [];
  const listen = () => said.push(document.getElementById("state-text").textContent);
  const all = { subtree: true, childList: true, characterData: true };
  new MutationObserver(listen).observe(document.getElementById("header"), all);
}"""


@pytest.fixture(scope="module")
def workspace(workspace: Path) -> Path:
    """With six seconds of the toy arm."""
    make_session(Workspace(workspace).place_for("toy"), FRAMES)
    return workspace


@pytest.mark.slow
def test_a_live_run_is_ticked_and_says_how_it_keeps_up(browser: Browser, studio: StudioServer) -> None:
    window = StudioPage(browser, studio, open_at=f"{studio.address}&session=toy", with_scene=False)
    page = window.page
    page.evaluate(LISTEN)
    page.locator(".session.open .new-run").click()
    page.locator("dialog form [name=name]").fill("now")
    page.locator("dialog form [name=live]").check()
    page.locator("dialog form").get_by_role("button", name="Track", exact=True).click()
    window.until("get('run') === 'now' && get('work')?.live && get('work').state === 'finished'")
    words = page.locator("#state-text", has_text="finished (live)")
    words.wait_for()
    said = page.evaluate("said")
    assert any(LINE.match(line) for line in said), said
    assert re.match(r"finished \(live\) · \d+ dropped$", words.inner_text())
    found = studio.get(f"{RUNS}/now/live")
    assert found["tracked"] + len(found["dropped"]) <= FRAMES
    assert words.inner_text().endswith(f"{len(found['dropped'])} dropped")
    runs = {run["name"]: run for run in studio.get(RUNS)["runs"]}
    assert runs["now"]["status"] == "finished"
    window.close()


@pytest.mark.slow
def test_what_a_browser_that_draws_in_software_costs(
    browser: Browser, tmp_path_factory: pytest.TempPathFactory, artefacts: Path
) -> None:
    """Show 6's run with Chromium drawing the scene on the same cores: measured, not promised."""
    place = tmp_path_factory.mktemp("chromium") / "workspace"
    workspace = Workspace(place)
    seconds = 10.0
    session = make_footage(workspace.place_for("live-walk"), seconds)
    (place / "models").mkdir()
    learn_walk(place / "models" / "walk.behaviour")
    studio = StudioServer("serve", place)
    request = {
        "name": "drawn",
        "tracker": TRACKER,
        "weighting": WEIGHTING,
        "live": True,
        "settings": dict(CHANGES),
    }
    studio.post("/api/sessions/live-walk/runs", {**request, "behaviour": "walk"})
    window = StudioPage(browser, studio, open_at=f"{studio.address}&session=live-walk&run=drawn")
    window.scene.locator("canvas").first.wait_for()
    studio.post("/api/sessions/live-walk/runs/drawn/start")
    window.until("get('work')?.state === 'finished'")
    found = live_figures(summary_of(session.run("drawn")))
    artefacts.mkdir(parents=True, exist_ok=True)
    response = {"cores": os.cpu_count(), "seconds": seconds, **found}
    (artefacts / "live-with-chromium.json").write_text(json.dumps(response, indent=2))
    assert found["tracked"] > 0  # pyright: ignore[reportOperatorIssue]
    window.close()
    studio.stop()
