"""A run that fails, from a link to what mends it: the cause in words, the limb's row, a remedy tried and discarded."""

import re
from collections.abc import Iterator

import pytest
from planted_runs import person_poses, planted
from playwright.sync_api import Browser, expect
from scene_wire import until
from studio_page import PATIENCE, StudioPage
from studio_server import StudioServer

from studio.results.inspection.limbs import errors_of
from studio.results.inspection.reading import InspectedRun

pytestmark = pytest.mark.browser

RUN = "/api/sessions/failed/runs/run-1"
OPTION = """async () => {
  const echarts = await import('/assets/vendor/echarts.esm.min.js');
  return echarts.getInstanceByDom(document.querySelector('#panel-why .figure-chart'))?.getOption(); }"""
PLACE = """async ([column, row]) => {
  const echarts = await import('/assets/vendor/echarts.esm.min.js');
  const chart = echarts.getInstanceByDom(document.querySelector('#panel-why .figure-chart'));
  return chart.convertToPixel({ gridIndex: 0 }, [column, row]); }"""


@pytest.fixture(scope="module")
def failed(tmp_path_factory: pytest.TempPathFactory) -> tuple[StudioServer, int, str]:
    """`studio serve` on a run whose survival rate is too low; its worst frame and the limb that is worst there."""
    workspace = tmp_path_factory.mktemp("why") / "workspace"
    workspace.mkdir()
    calm = person_poses("walk", 20, 18, 2)
    errors = errors_of(InspectedRun(*planted(workspace / "failed", "survival", calm, calm, seed=2)))
    frame = max(errors, key=lambda one: max(errors[one].values()))
    limb = max(errors[frame], key=lambda one: errors[frame][one])
    return StudioServer("serve", workspace), frame, limb


@pytest.fixture(scope="module")
def studio(failed: tuple[StudioServer, int, str]) -> Iterator[StudioServer]:
    yield failed[0]
    failed[0].stop()


@pytest.fixture(scope="module")
def window(
    browser: Browser, studio: StudioServer, failed: tuple[StudioServer, int, str]
) -> Iterator[StudioPage]:
    """A window opened by a link to the frame that fails."""
    link = f"{studio.address}&session=failed&run=run-1&frame={failed[1]}&panel=why"
    opened = StudioPage(browser, studio, open_at=link, with_scene=False)
    yield opened
    opened.close()


def test_the_cause_is_read_and_its_remedy_tried(
    window: StudioPage, studio: StudioServer, failed: tuple[StudioServer, int, str]
) -> None:
    page, (_, frame, limb) = window.page, failed
    words = page.locator(".why-words")
    words.get_by_role("heading", name=f"Why is frame {frame} as it is?").wait_for(timeout=2 * PATIENCE)
    chief = words.locator("li.chief button")
    expect(chief).to_have_text(re.compile("^The survival rate is too low: 0.02 of 100 particles"))
    wrong = words.locator("li button").first
    expect(wrong).to_contain_text(limb)

    # Its heat map has a row a limb, in its place the worst value of the frame; a click chooses both.
    until(page, lambda: bool((page.evaluate(OPTION) or {}).get("series")))
    option = page.evaluate(OPTION)
    [heat] = [one for one in option["series"] if one["type"] == "heatmap"]
    limbs = option["yAxis"][0]["data"]
    assert limb in limbs
    column = [
        (cell[2], limbs[cell[1]])
        for cell in heat["data"]
        if option["xAxis"][0]["data"][cell[0]] == str(frame) and cell[2] != "-"
    ]
    assert max(column)[1] == limb
    other = 3 if frame != 3 else 4
    x, y = page.evaluate(PLACE, [option["xAxis"][0]["data"].index(str(other)), limbs.index(limb)])
    page.locator("#panel-why .figure-chart").click(position={"x": x, "y": y})
    window.until(f"get('frame') === {other} && get('limb') === '{limb}'")
    page.evaluate("async (frame) => (await import('/assets/js/selection.js')).goTo(frame)", frame)
    window.until(f"get('frame') === {frame}")
    # The other frame's answer, which comes late, does not take this one's place.
    page.wait_for_timeout(3000)
    words.get_by_role("heading", name=f"Why is frame {frame} as it is?").wait_for()

    # What is tried is told over the scene: the error falls; nothing of it is stored.
    stored = studio.get(f"{RUN}/frames/{frame}")
    chief.wait_for()
    words.get_by_text("survival 0.3, survival per layer none").wait_for()
    tried = words.get_by_role("button", name=re.compile("^Try: .*survival rate of 0.3"))
    tried.click()
    page.locator("#trial .outcome").wait_for()
    trials = window.get("trials")
    assert isinstance(trials, dict)
    assert trials["frame"] == frame
    assert trials["trials"][-1]["error_mm"] < trials["stored"]["error_mm"]
    bar = page.locator("#trial")
    assert limb in bar.locator("th").all_inner_texts()
    bar.get_by_text("survival rate 0.02 → 0.3").wait_for()
    bar.get_by_role("button", name="Discard", exact=True).click()
    window.until("get('whatIf') === null && get('trial') === null")
    assert studio.get(f"{RUN}/frames/{frame}") == stored
    bar.get_by_role("button", name="Put back", exact=True).click()
    bar.wait_for(state="hidden")
    assert studio.get(f"{RUN}/settings")["moved"] == {}


def test_a_finding_leads_to_what_it_speaks_of(
    window: StudioPage, failed: tuple[StudioServer, int, str]
) -> None:
    page, (_, frame, limb) = window.page, failed
    page.evaluate(
        "async () => (await import('/assets/js/state.js')).set({ limb: null, layer: null, camera: null })"
    )
    page.locator(".why-words li button").first.click()
    window.until(f"get('limb') === '{limb}' && get('frame') === {frame}")

    # Where it began is a frame: the finding leads there, and back leads to where it was read.
    began = page.locator(".why-words li button", has_text="It began in frame")
    words = began.inner_text()
    before = int(re.findall(r"\d+", words)[0])
    assert before < frame
    began.click()
    window.until(f"get('frame') === {before}")
    assert str(window.get("limb")) in words
    page.locator(".why-words").get_by_role("heading", name=f"Why is frame {before} as it is?").wait_for(
        timeout=2 * PATIENCE
    )
