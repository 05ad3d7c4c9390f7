"""A swarm in the studio: knobs moved while it runs take effect as they say, and the page shows its sixty layers."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, expect
from scene_wire import until
from studio_page import PATIENCE, StudioPage
from studio_server import StudioServer

pytestmark = [pytest.mark.browser, pytest.mark.slow]

RUNS = "/api/sessions/walk/runs"
SEED = 3
# Seconds an iteration while a knob is moved: a frame takes more than a second, a page drawn in software keeps up.
PACE = 0.02
# Table 1 of Fleischmann et al. 2012.
FIRST_STAGE, SECOND_STAGE = 20, 40
PARTICLES, LATER_PARTICLES = 10, 20


@pytest.fixture(scope="module")
def studio(studio: StudioServer) -> StudioServer:
    """With the sample."""
    studio.post("/api/samples", {"name": "walk"})
    return studio


@pytest.fixture
def swarm(browser: Browser, studio: StudioServer, request: pytest.FixtureRequest) -> Iterator[StudioPage]:
    """The page before a run of a swarm that is held up after a few frames; nothing goes wrong in it."""
    name = request.node.name.replace("test_", "")[:40]
    run = f"{RUNS}/{name}"
    made = studio.post(RUNS, {"name": name, "tracker": "swarm", "seed": SEED})
    assert (made["tracker"], made["weighting"]) == ("swarm", "edge-region-silhouette")
    # The first frame is searched several times over, as fast as it can.
    studio.pace(0.0)
    studio.post(f"{run}/start")
    studio.until(lambda state: state["run"] == name and state["done"] >= 1)
    studio.pace(PACE)
    studio.until(lambda state: state["run"] == name and state["done"] >= 2)
    studio.post(f"{run}/pause")
    studio.until(lambda state: state["run"] == name and state["state"] == "paused")
    window = StudioPage(browser, studio, open_at=f"{studio.address}&session=walk&run={name}")
    window.until(f"get('run') === '{name}' && get('work')?.state === 'paused' && get('summary') !== null")
    window.scene.get_by_text("particles, stage 2").first.wait_for()
    toast = window.scene.locator("#webgl-software-rendering button")
    if toast.count():
        toast.dispatch_event("click")
    yield window
    studio.post(f"{run}/cancel")
    window.close()


def layers(window: StudioPage, frame: int, run: str = "") -> list[dict]:
    """A stored frame's layers."""
    return window.studio.get(f"{RUNS}/{run or window.get('run')}/frames/{frame}")["layers"]


def moved(window: StudioPage, label: str, knob: str, value: float) -> tuple[int, int]:
    """Move a slider of the scene by one step while the swarm runs: since which frame and layer it is in use."""
    slider = window.slider(label)
    done = len(window.get("summary")["frames"])  # pyright: ignore[reportIndexIssue, reportOptionalSubscript]
    window.page.click("#track-toggle")
    window.until(f"get('summary').frames.length > {done}")
    slider.press("ArrowRight")
    window.until(f"get('settings')?.values.{knob} === {value}")
    settings = window.get("settings")
    assert isinstance(settings, dict)
    frame, layer = settings["frame"], settings["layer"]
    assert frame >= done, "it was moved while the swarm ran"
    window.scene.get_by_text(f"In use since frame {frame}, layer {layer + 1}.").wait_for()
    window.until(f"get('summary').frames.at(-1).frame > {frame + 1}")
    return frame, layer


def test_the_second_stages_particles_change_with_the_next_frame(swarm: StudioPage) -> None:
    frame, layer = moved(swarm, "particles, stage 2", "stage2_particles", LATER_PARTICLES + 1)
    # The frame in progress keeps the number it began with.
    first = frame if layer == 0 else frame + 1
    for number in range(max(0, first - 2), first + 2):
        counts = [record["particles"] for record in layers(swarm, number)]
        later = LATER_PARTICLES + 1 if number >= first else LATER_PARTICLES
        searches = len(counts) // (FIRST_STAGE + SECOND_STAGE)
        assert counts == ([PARTICLES] * FIRST_STAGE + [later] * SECOND_STAGE) * searches, number


def test_the_last_c_is_used_from_the_next_layer_on(swarm: StudioPage) -> None:
    run = str(swarm.get("run"))
    frame, layer = moved(swarm, "c at last", "c_last", 2.16)
    versions = [record["settings_version"] for record in layers(swarm, frame)]
    assert versions[layer:] == [versions[layer]] * (len(versions) - layer)
    assert all(version < versions[layer] for version in versions[:layer])
    assert {record["settings_version"] for record in layers(swarm, frame + 1)} == {versions[layer]}

    # The same search with the knob left alone is the same up to that layer, and another one after it.
    untouched = {"name": "untouched", "tracker": "swarm", "seed": SEED, "last": frame + 2}
    swarm.studio.post(f"{RUNS}/{run}/cancel")
    swarm.studio.pace(0.0)
    swarm.studio.post(RUNS, untouched)
    swarm.studio.post(f"{RUNS}/untouched/start")
    swarm.studio.until(lambda state: state["run"] == "untouched" and state["state"] == "finished")
    for number in range(frame):
        assert seen(layers(swarm, number, run)) == seen(layers(swarm, number, "untouched"))
    here, there = (seen(layers(swarm, frame, name)) for name in (run, "untouched"))
    assert here[: layer + 1] == there[: layer + 1]
    assert seen(layers(swarm, frame + 1, run)) != seen(layers(swarm, frame + 1, "untouched"))


def seen(records: list[dict]) -> list[tuple[float, ...]]:
    """What tells one layer's cloud from another's."""
    return [(record["best_log_weight"], *record["mean"]) for record in records]


def test_the_page_shows_sixty_layers(swarm: StudioPage, artefacts: Path) -> None:
    page = swarm.page
    swarm.key("Home")
    swarm.key("ArrowRight")
    swarm.until("get('frame') === 1 && get('detail')?.frame === 1")
    assert swarm.get("layerCount") == FIRST_STAGE + SECOND_STAGE
    until(page, lambda: len(swarm.wire.layers()) == FIRST_STAGE + SECOND_STAGE)
    swarm.key("Shift+ArrowLeft")
    page.locator("#layer-label", has_text="layer 60 of 60").wait_for()
    until(page, lambda: swarm.wire.layers().keys() == {59})
    swarm.key("Shift+ArrowRight")
    until(page, lambda: len(swarm.wire.layers()) == FIRST_STAGE + SECOND_STAGE)
    for view in ("schedule", "variance", "genealogy", "weights", "clouds", "coupling", "survivors", "modes"):
        swarm.show_view(view)
        swarm.shoot(artefacts / f"page-swarm-{view}-dark-1280x800.png")
    page.click("#theme")
    body = page.locator("#panel-views .figure-body")
    expect(body).to_have_attribute("data-drawn", re.compile("modes light"), timeout=PATIENCE)
    swarm.shoot(artefacts / "page-swarm-modes-light-1280x800.png")
    page.click("#theme")


def test_a_new_swarm_brings_its_weighting_and_presets(
    browser: Browser, studio: StudioServer, artefacts: Path
) -> None:
    window = StudioPage(browser, studio, with_scene=False)
    window.until("get('session') === 'walk'")
    page = window.page
    page.locator(".session.open .new-run").click()
    form = page.locator("dialog form")
    tracker, weighting, preset = (
        form.locator(f"[name={name}]") for name in ("tracker", "weighting", "preset")
    )
    assert tracker.input_value() == "annealed"
    assert {"edge-silhouette", "edge-region-silhouette"} <= set(values_of(weighting.locator("option")))
    # A paper's preset is its whole tracker: it brings tracker, likelihood and body.
    assert {"paper, swarm", "paper, Eq. 13"} <= set(values_of(preset.locator("option")))
    preset.select_option("paper, swarm")
    until(page, lambda: form.locator("[name=knob-stage1_particles]").count() == 1)
    body = form.locator("[name=body]")
    assert (tracker.input_value(), weighting.input_value()) == ("swarm", "edge-silhouette")
    assert (body.input_value(), preset.input_value()) == ("human31", "paper, swarm")
    assert not form.locator("[name=shape]").is_checked()
    window.shoot(artefacts / "page-new-swarm-dark-1280x800.png")
    # Another tracker is no longer the paper's.
    tracker.select_option("annealed")
    until(page, lambda: preset.input_value() == "")
    assert weighting.input_value() == "edge-silhouette"
    form.get_by_role("button", name="Cancel", exact=True).click()
    window.close()


def values_of(options: Locator) -> list[str]:
    """The values of a choice."""
    return options.evaluate_all("options => options.map((option) => option.value)")
