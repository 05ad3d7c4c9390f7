"""The scene in a real browser, through the web application's own relay."""

import math
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import uvicorn
from fastapi import FastAPI
from playwright.sync_api import Browser, Page
from scene_fakes import FakeControl
from swaying_session import cloud_record

from studio.app.scene.scene_server import SceneServer
from studio.app.server.scene_relay import router
from studio.body.model import BodyModel
from studio.operations.jobs.commands import ChangeSettings
from studio.operations.jobs.events import LayerFinished, SettingsApplied
from studio.search.trackers.settings import AnnealedSettings

pytestmark = pytest.mark.browser

PATIENCE = 60.0


def until(page: Page, condition: Callable[[], object]) -> None:
    """Wait for a state, letting the browser draw meanwhile."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, "it never came about"
        page.wait_for_timeout(100)


@pytest.fixture
def address(stage: SceneServer) -> Iterator[str]:
    """Where the scene is served, by the web application's relay without its access guard."""
    app = FastAPI()
    app.include_router(router)
    app.state.studio = SimpleNamespace(scenes=SimpleNamespace(scene=lambda window, bare=False: stage))
    listening = socket.socket()
    listening.bind(("127.0.0.1", 0))
    listening.listen()
    server = uvicorn.Server(uvicorn.Config(app, log_level="error", ws="websockets-sansio"))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]}, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{listening.getsockname()[1]}/scene/a-window/?fixedDpr=1"
    server.should_exit = True
    thread.join(10.0)
    listening.close()


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    made = browser.new_page(viewport={"width": 1280, "height": 800})
    made.set_default_timeout(PATIENCE * 1000)
    yield made
    made.close()


def colours_of(path: Path) -> np.ndarray:
    """The scene's part of a screenshot, RGB."""
    picture = cv2.imread(str(path))
    return picture[160:, :900, ::-1].astype(int)


def close_to(picture: np.ndarray, hue: str) -> int:
    """How many pixels are clearly cyan, yellow or magenta."""
    red, green, blue = (picture[..., channel] for channel in range(3))
    low, high = {"cyan": (red, np.minimum(green, blue)), "yellow": (blue, np.minimum(red, green))}.get(
        hue, (green, np.minimum(red, blue))
    )
    return int(((high - low) > 30).sum())


def test_a_person_sees_the_run_and_moves_the_survival_rate(
    page: Page, address: str, stage: SceneServer, control: FakeControl, human: BodyModel, tmp_path: Path
) -> None:
    faults: list[str] = []
    page.on("pageerror", lambda fault: faults.append(str(fault)))
    stage.show_run("swaying", "run-1")
    page.goto(address)
    page.get_by_text("swaying / run-1").wait_for(timeout=PATIENCE * 1000)
    shots = Path(os.environ.get("STUDIO_ARTEFACTS", tmp_path))

    def seen(name: str) -> np.ndarray:
        page.screenshot(path=shots / f"{name}.png")
        return colours_of(shots / f"{name}.png")

    until(page, lambda: min(close_to(seen("scene-dark"), hue) for hue in ("cyan", "yellow", "magenta")) > 200)
    assert np.median(seen("scene-dark")) < 90

    sliders = page.get_by_role("slider")
    values = [sliders.nth(index).get_attribute("aria-valuenow") for index in range(sliders.count())]
    default = AnnealedSettings().survival
    sliders.nth(values.index(f"{default:g}")).focus()
    page.keyboard.press("ArrowRight")
    until(page, lambda: any(isinstance(command, ChangeSettings) for command in control.commands))
    change = next(command for command in control.commands if isinstance(command, ChangeSettings))
    assert math.isclose(float(change.changes["survival"]), default + 0.01)
    control.answer(change)
    control.emit(SettingsApplied("swaying", "run-1", 2, 4, 0, {"survival": default + 0.01}, ("survival",)))
    page.get_by_text("In use since frame 4, layer 1.").wait_for(timeout=PATIENCE * 1000)
    page.get_by_text("• survival rate").wait_for(timeout=PATIENCE * 1000)
    control.emit(LayerFinished("swaying", "run-1", cloud_record(human, 4, 0), True))
    clouds = stage._controller.views.particles
    until(page, lambda: [handle.visible for handle in clouds.handles] == [True, False, False, False])

    page.get_by_role("tab", name="Show").click()
    page.get_by_text("layer 4").first.wait_for(timeout=PATIENCE * 1000)
    stage.set_options(dark=False)
    until(page, lambda: np.median(seen("scene-light")) > 180)
    stage.look_through("cam1")
    until(page, lambda: stage.shown.look_through == "cam1" and abs(np.median(seen("scene-camera")) - 95) < 30)
    assert faults == []
