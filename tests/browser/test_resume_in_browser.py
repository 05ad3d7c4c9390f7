"""The tracking process is killed in mid-run: the page says so, and resuming gives the unbroken run's poses."""

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser
from studio_page import StudioPage
from studio_server import StudioServer

pytestmark = [pytest.mark.browser, pytest.mark.slow]

RUNS = "/api/sessions/walk/runs"
FRAMES, SEED = 14, 5
KNOBS = {"start_repeats": 2}
# Seconds a layer until the process is killed: a frame a second, so that it dies in mid-run.
PACE = 0.1


@pytest.fixture
def studio(tmp_path: Path) -> Iterator[StudioServer]:
    """`studio serve` with the sample and two runs that differ in nothing but their name."""
    with StudioServer("serve", tmp_path / "workspace") as made:
        made.post("/api/samples", {"name": "walk"})
        for name in ("unbroken", "broken"):
            made.post(RUNS, {"name": name, "seed": SEED, "last": FRAMES, "settings": KNOBS})
        yield made


def test_a_killed_process_is_said_and_the_run_resumes_bit_for_bit(
    browser: Browser, studio: StudioServer, artefacts: Path
) -> None:
    window = StudioPage(
        browser, studio, open_at=f"{studio.address}&session=walk&run=broken", with_scene=False
    )
    window.until("get('run') === 'broken' && get('connected') === true && get('summary') !== null")
    studio.pace(PACE)
    window.page.click("#track-toggle")
    studio.until(lambda state: state["run"] == "broken" and 2 <= state["done"] < FRAMES - 2)
    studio.worker().send_signal(signal.SIGKILL)

    window.until("get('work').state === 'lost'")
    card = window.page.locator("#curtain .card")
    card.get_by_role("heading", name="The tracking process ended").wait_for()
    assert "tracking process lost" in window.page.locator("#state-text").inner_text()
    done = len(studio.get(f"{RUNS}/broken/frames")["frames"])
    assert 2 <= done < FRAMES
    window.shoot(artefacts / "page-worker-lost-dark-1280x800.png")

    card.get_by_role("button", name="Resume", exact=True).click()
    # The pace came back with the process.
    window.until(f"get('work').state === 'tracking' && get('work').seconds_a_layer === {PACE}")
    studio.pace(0.0)
    window.until("get('work').state === 'finished'")
    window.page.locator("#curtain").wait_for(state="hidden")
    window.until(f"get('summary').frames.length === {FRAMES}")

    studio.post(f"{RUNS}/unbroken/start")
    studio.until(lambda state: state["run"] == "unbroken" and state["state"] == "finished")
    broken, unbroken = (studio.text(f"{RUNS}/{name}/poses.csv") for name in ("broken", "unbroken"))
    assert broken == unbroken
    assert len(broken.splitlines()) == 1 + FRAMES
    window.close()
