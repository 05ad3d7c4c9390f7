"""The guided set-up in a real browser, from raw files to an exported motion."""

import shutil
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect
from studio_server import StudioServer

from studio.sessions.samples import sample_folder

pytestmark = pytest.mark.browser

PATIENCE = 120_000
LAST = 11


@pytest.fixture(scope="module")
def raw(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bundled walk's parts as raw files: videos, empty clips, calibration, and who was there."""
    folder = tmp_path_factory.mktemp("raw") / "take"
    sample = sample_folder("walk")
    for part in ("videos", "background", "calibration"):
        shutil.copytree(sample / part, folder / part)
    for part in ("subject.toml", "start_pose.csv"):
        shutil.copyfile(sample / part, folder / part)
    return folder


@pytest.fixture(scope="module")
def footage(raw: Path) -> Path:
    """The raw files may be read."""
    return raw.parent


def state_of(page: Page, step: str, state: str) -> None:
    """Wait until a step stands so."""
    expect(page.locator(f"#stepper [data-step={step}]")).to_have_attribute(
        "data-state", state, timeout=PATIENCE
    )


def test_from_raw_files_to_an_exported_motion(
    page: Page, studio: StudioServer, raw: Path, artefacts: Path
) -> None:
    artefacts.mkdir(exist_ok=True)
    page.goto(f"{studio.origin}/way?new")
    page.fill("dialog input[name=name]", "mine")
    page.click("dialog button.primary")
    state_of(page, "footage", "ready")
    state_of(page, "calibration", "blocked")

    page.fill("input[name=source]", str(raw))
    page.locator(".footage-form button.primary").click()
    state_of(page, "footage", "done")
    state_of(page, "calibration", "done")
    expect(page.locator("figure.picture img")).to_have_count(4)
    loaded = "() => [...document.querySelectorAll('figure.picture img')].every((one) => one.naturalWidth > 0)"
    page.wait_for_function(loaded)
    page.screenshot(path=artefacts / "setup-footage.png")
    state_of(page, "background", "done")
    state_of(page, "start-pose", "done")

    page.locator("#stepper [data-step=start-pose]").click()
    page.keyboard.press("j")
    expect(page.locator("#stepper [data-step=track]")).to_have_attribute("aria-current", "step")
    page.fill("input[name=last]", str(LAST))
    page.select_option("select[name=evaluations]", "1000")
    page.locator("#stepper [data-step=track]").focus()
    page.keyboard.press("Enter")
    state_of(page, "track", "done")
    assert studio.get("/api/sessions/mine")["runs"][0]["done"] == LAST + 1
    page.wait_for_function(loaded)
    page.screenshot(path=artefacts / "setup-track.png")

    page.keyboard.press("ArrowDown")
    page.locator("#step button.primary", has_text="Check the motion").click()
    state_of(page, "check", "done")
    expect(page.locator(".share-strip button")).to_have_count(2)
    response = studio.get("/api/sessions/mine/runs/run-1/check")["check"]
    assert response["inside_mean"] > 0.8
    assert response["turned"] == []
    page.get_by_role("button", name="Smooth in time").click()
    expect(page.locator("input[value=smoothed]")).to_be_checked(timeout=PATIENCE)
    page.screenshot(path=artefacts / "setup-check.png")

    page.locator("#stepper [data-step=export]").click()
    page.locator(".export-actions button.primary").click()
    state_of(page, "export", "done")
    with page.expect_download() as waiting:
        page.locator(".export-files a").first.click()
    assert waiting.value.suggested_filename == "mine-run-1-smoothed.bvh"
    page.screenshot(path=artefacts / "setup-export.png")


def test_a_change_of_the_footage_makes_the_rest_stale(page: Page, studio: StudioServer) -> None:
    page.goto(f"{studio.origin}/way?session=mine&step=footage")
    page.get_by_label("Offset of cam2, frames").fill("2")
    page.get_by_role("button", name="Apply").click()
    state_of(page, "track", "stale")
    expect(page.locator("#stepper [data-step=track] .why")).to_contain_text("offsets")
    state_of(page, "start-pose", "stale")
    assert studio.get("/api/sessions/mine/footage")["stale_runs"] == ["run-1"]


def test_an_empty_session_breaks_no_page(page: Page, studio: StudioServer) -> None:
    studio.post("/api/sessions", {"name": "nothing"})
    page.goto(f"{studio.origin}/?session=nothing")
    expect(page.locator("#invitation")).to_contain_text("no footage yet")
    page.locator("#invitation button").click()
    expect(page.locator("#step h1")).to_have_text("Footage")
    state_of(page, "footage", "ready")
