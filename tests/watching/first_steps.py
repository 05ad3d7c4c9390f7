"""The survival rate moved in the demo's first steps, by the keyboard: when its clouds and charts are drawn.

Each move anneals the prepared frame again, whose layers begin to stand in scene and chart as they come.
"""

from pathlib import Path

from playwright.sync_api import Browser
from scene_wire import until
from studio_page import StudioPage
from studio_server import StudioServer

from watching.drawing import Drawing, cloud_sizes, watched
from watching.figures import Figures

MOVES = 20
VIEWS = {"variance": "Variance reduction", "schedule": "Schedule"}
PARTICLES, LIMBS, LAYERS = 50, 5, 10
WATCH = """() => {
  const watch = (window.__said = { keys: [], said: [] });
  const now = () => performance.timeOrigin + performance.now();
  addEventListener("keydown", (event) => watch.keys.push(performance.timeOrigin + event.timeStamp), true);
  // A figure says its numbers as it is drawn.
  const readout = document.querySelector("#panel-views .readout");
  const observer = new MutationObserver(() => watch.said.push(now()));
  observer.observe(readout, { childList: true, characterData: true, subtree: true });
}"""
CLEAR = "() => { window.__said.keys.length = 0; window.__said.said.length = 0; }"


def measure_first_steps(browser: Browser, folder: Path, moves: int = MOVES) -> Figures:
    """Move the rate so many times with each of both views open, each time when all of the last move is drawn."""
    found = Figures()
    with StudioServer("demo", folder / "workspace") as studio:
        window = StudioPage(watched(browser), studio)
        try:
            page = window.page
            page.get_by_role("button", name="Next", exact=True).click()
            window.until("get('view') === 'schedule'")
            slider = page.locator(".first-knob input:enabled")
            slider.wait_for()
            # The step plays the layers once they are shown; they stand still while it is measured.
            window.until("get('plays') === 'layers'")
            page.evaluate("async () => (await import('/assets/js/studio/layer_playback.js')).scrubTo(4)")
            window.until("get('plays') === null && get('layer') === 4")
            page.evaluate(WATCH)
            # The first move opens the second scene, and compiles what none later has to.
            slider.focus()
            page.keyboard.press("ArrowRight")
            window.until(f"get('whatIf')?.length === {LAYERS} && get('trial')")
            sizes = cloud_sizes(PARTICLES * LIMBS)
            drawing = Drawing(window)
            until(page, lambda: bool(drawing.uploads(sizes)))
            drawing.settled(sizes)
            for view, name in VIEWS.items():
                window.show_view(view)
                until(page, window.charts_drawn)
                clouds, charts = list[float](), list[float]()
                with found.loaded():
                    for number in range(moves):
                        slider.focus()
                        drawing.clear()
                        page.evaluate(CLEAR)
                        page.keyboard.press("ArrowRight" if number % 2 else "ArrowLeft")
                        drawn = drawing.settled(sizes)
                        window.until(
                            f"get('whatIf')?.length === {LAYERS} && get('work')?.state !== 'reannealing'"
                        )
                        told = page.evaluate("() => window.__said")
                        if not told["said"]:
                            found.wrong.append(f"{name} did not change with move {number + 1}")
                            continue
                        clouds.append(drawn[0] - told["keys"][0])
                        charts.append(told["said"][0] - told["keys"][0])
                found.times(f"survival moved to its cloud drawn, {name} open", clouds)
                found.times(f"survival moved to {name} drawn anew", charts)
        finally:
            window.close()
    return found
