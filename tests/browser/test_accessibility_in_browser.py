"""No page, in no state, has a fault that the accessibility checker (axe) calls serious or critical, light or dark; and
all of each fits into its window, from a telephone's width to a large screen's.
"""

from collections.abc import Iterator, Mapping, Sequence

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, expect
from scene_wire import until
from studio_page import StudioPage
from studio_server import StudioServer

pytestmark = pytest.mark.browser

RUN = "/api/sessions/walk/runs/seen"
FRAMES = 4
SETTINGS = {"layers": 3, "particles": 40, "recovery": "off"}
GRAVE = ("serious", "critical")
# The themes differ in colours alone: everything is checked in the dark one, colours in both.
RULES = {"dark": {}, "light": {"runOnly": ["color-contrast"]}}
# Views that have more than a figure.
OWN_CONTROLS = ("seeds", "landscape")
IN_DARK = {"dark": RULES["dark"]}
# The scene's page is viser's.
WITHOUT = [["#scene"], ["iframe"]]
PANELS = ("why", "views", "compare", "cameras", "log", "export")
STEPS = ("footage", "calibration", "background", "subject", "start-pose", "track", "check", "export")
PAGES = {
    "/recording": ".bar",
    "/comparisons?session=walk&name=small": ".trials",
    "/comparisons?new&session=walk": ".compare-form",
    "/behaviours": "#content",
    "/bodies": ".parts",
    "/bodies?session=walk&body=mouse": ".parts",
    "/gallery": ".gallery-card",
    "/reports": "#findings .lead",
    "/arena": "#findings .lead",
    "/rig": ".nothing",
    "/rig?session=walk&run=seen": ".rig-page .words",
    "/guide": "main",
    "/guide/verbs": "main",
}
USUAL = {"width": 1280, "height": 800}
# Of a page as it opens, and of its other states. At 1280 all are opened.
WIDTHS, FEW_WIDTHS = (390, 900, 2560), (390,)
# What sticks out of the window and cannot be scrolled to by what it stands in; the page itself must not scroll
# sideways. A closed drawer waits beside the window.
STICKING_OUT = """() => {
  const right = innerWidth + 1;
  const holds = (place) => {
    const { overflowX } = getComputedStyle(place);
    return overflowX !== "visible" && place.getBoundingClientRect().right <= right;
  };
  const isHeld = (one) => {
    for (let up = one.parentElement; up && up !== document.body; up = up.parentElement) if (holds(up)) return true;
    return false;
  };
  const out = [...document.body.querySelectorAll("*")].filter((one) => {
    if (!one.checkVisibility({ visibilityProperty: true }) || one.closest(".skip")) return false;
    const box = one.getBoundingClientRect();
    return box.width && box.height && (box.right > right || box.left < -1) && !isHeld(one);
  });
  const wide = document.documentElement.scrollWidth;
  const scrolled = wide > innerWidth ? [`the page is ${wide} wide`] : [];
  return [...scrolled, ...out.map((one) => one.cloneNode(false).outerHTML.slice(0, 160))];
}"""
USE_THEME = "async (name) => (await import('/assets/js/theme.js')).useTheme(name)"
PALE = """() => {
  const words = Object.assign(document.createElement("p"), { id: "pale", textContent: "pale" });
  Object.assign(words.style, { color: "#ddd", background: "#fff" });
  document.body.prepend(words);
}"""
SET = "async (changes) => (await import('/assets/js/state.js')).set(changes)"


@pytest.fixture(scope="module")
def studio(studio: StudioServer) -> StudioServer:
    """With the sample, a run of it and a comparison."""
    studio.post("/api/samples", {"name": "walk"})
    studio.track("walk", "seen", last=FRAMES, settings=SETTINGS)
    studio.post(
        "/api/comparisons",
        {
            "session": "walk",
            "name": "small",
            "trackers": [{"name": "annealed"}, {"name": "condensation"}],
            "evaluations": 60,
            "layers": 3,
            "seeds": 2,
            "last": 3,
        },
    )
    return studio


@pytest.fixture(scope="module")
def window(browser: Browser, studio: StudioServer) -> Iterator[StudioPage]:
    """A dark window, in which nothing moves."""
    opened = StudioPage(browser, studio, with_scene=False)
    opened.watch.allow(404, "/api/sessions/walk/thumbnail.jpg")
    opened.page.emulate_media(reduced_motion="reduce", color_scheme="dark")
    opened.page.evaluate(USE_THEME, "dark")
    yield opened
    opened.close()


def check(
    window: StudioPage,
    *where: str,
    widths: Sequence[int] = FEW_WIDTHS,
    rules: Mapping[str, Mapping[str, object]] = RULES,
) -> None:
    """The checker finds nothing grave on the page as it is, in both themes, and the page fits. Otherwise rule, weight
    and place of what it finds.
    """
    page = window.page
    # A state is there once what is going on has ended.
    page.wait_for_timeout(100)
    grave = []
    for theme, which in rules.items():
        page.evaluate(USE_THEME, theme)
        options = {"resultTypes": ["violations"], **which}
        found = Axe().run(page, context={"exclude": WITHOUT}, options=options).response["violations"]
        grave += [
            f"{theme}: {rule['id']} ({rule['impact']}) {node['target']}: {node['html'][:160]}"
            for rule in found
            if rule["impact"] in GRAVE
            for node in rule["nodes"]
        ]
    page.evaluate(USE_THEME, "dark")
    assert not grave, "\n".join([" ".join(where), *grave])
    fits(window, *where, widths=widths)


def fits(window: StudioPage, *where: str, widths: Sequence[int]) -> None:
    """At every width all of the page is inside the window, or in something inside it that scrolls."""
    page = window.page
    out = [*page.evaluate(STICKING_OUT)]
    for width in widths:
        page.set_viewport_size({"width": width, "height": USUAL["height"]})
        # Charts take their new size with the next picture.
        page.wait_for_timeout(60)
        out += [f"{width}: {one}" for one in page.evaluate(STICKING_OUT)]
    page.set_viewport_size(USUAL)
    assert not out, "\n".join([" ".join(where), *out])


def test_the_checker_sees_a_fault(window: StudioPage) -> None:
    window.page.evaluate("document.body.insertAdjacentHTML('beforeend', '<button id=bare></button>')")
    with pytest.raises(AssertionError, match="button-name"):
        check(window)
    window.page.evaluate("document.getElementById('bare').remove()")


def test_the_checker_sees_pale_words_in_the_light_theme(window: StudioPage) -> None:
    window.page.evaluate(PALE)
    with pytest.raises(AssertionError, match="light: color-contrast"):
        check(window)
    window.page.evaluate("document.getElementById('pale').remove()")


def test_what_does_not_fit_is_seen(window: StudioPage) -> None:
    window.page.evaluate(
        "document.body.insertAdjacentHTML('beforeend', '<div id=wide style=width:3000px>wide</div>')"
    )
    with pytest.raises(AssertionError, match=r"2560: .*wide"):
        fits(window, widths=WIDTHS)
    window.page.evaluate("document.getElementById('wide').remove()")


def show_view(window: StudioPage, name: str) -> None:
    window.page.evaluate(SET, {"panel": "views", "view": name, "layer": 1, "parameter": "pelvis_rz"})
    until(window.page, lambda: not window.page.locator("[aria-busy=true]").count())


@pytest.mark.slow
def test_every_view(window: StudioPage, studio: StudioServer) -> None:
    """What differs from view to view is drawn on a canvas, which the checker does not look into, but for words."""
    page = window.page
    page.goto(f"{studio.origin}/?session=walk&run=seen&frame=2")
    window.until(f"get('summary')?.frames.length === {FRAMES} && get('detail')?.frame === 2")
    for name in [
        *(one["name"] for one in studio.get("/api/views")["views"] if one["name"] != "why"),
        "frames",
    ]:
        show_view(window, name)
        check(window, "view", name, rules=IN_DARK)


@pytest.mark.slow
def test_every_panel_and_dialog_of_the_studio(window: StudioPage, studio: StudioServer) -> None:
    page = window.page
    page.goto(f"{studio.origin}/?session=walk&run=seen&frame=2")
    window.until(f"get('summary')?.frames.length === {FRAMES} && get('detail')?.frame === 2")
    check(window, "the studio", widths=WIDTHS)
    for panel in PANELS:
        page.click(f"[data-panel={panel}]")
        until(page, lambda: not page.locator("[aria-busy=true]").count())
        check(window, "panel", panel)
    for name in OWN_CONTROLS:
        show_view(window, name)
        check(window, "view", name)
    window.key("t")
    page.locator("#panel-views table").first.wait_for()
    check(window, "a view as a table")
    window.key("t")
    studio.patch(f"{RUN}/settings?frame=2", {"survival": 0.55})
    page.locator("#trial .outcome").wait_for()
    check(window, "a frame annealed again")
    page.get_by_role("button", name="Put back", exact=True).click()
    page.locator("#trial").wait_for(state="hidden")

    dialog = page.locator("dialog[open]")
    row = page.locator('.run[data-key="walk/seen"]')
    for words, act in (
        ("palette", lambda: page.keyboard.press("Control+k")),
        ("keys", lambda: window.key("?")),
        ("new run", lambda: page.locator(".session.open .new-run").click()),
        ("compare with", lambda: window.choose(row.locator(".more"), "Compare with…")),
        ("refine", lambda: window.choose(row.locator(".more"), "Refine…")),
        ("import", lambda: page.click("#import-open")),
    ):
        row.hover()
        act()
        dialog.wait_for()
        check(window, words)
        page.keyboard.press("Escape")
        dialog.wait_for(state="hidden")
    row.hover()
    row.locator(".more").click()
    check(window, "menu")
    page.keyboard.press("ArrowUp")
    expect(page.get_by_role("menuitem", name="Delete…")).to_be_focused()
    page.keyboard.press("Escape")
    expect(row.locator(".more")).to_be_focused()


@pytest.mark.slow
def test_every_step_of_the_guided_set_up(window: StudioPage, studio: StudioServer) -> None:
    for step in STEPS:
        window.page.goto(f"{studio.origin}/way?session=walk&step={step}")
        window.page.locator(f"#stepper [data-step={step}][aria-current=step]").wait_for()
        check(window, "step", step, widths=WIDTHS if step == STEPS[0] else FEW_WIDTHS)
    window.page.goto(f"{studio.origin}/way?new")
    window.page.locator("form").first.wait_for()
    check(window, "a new session")


def test_every_other_page(window: StudioPage, studio: StudioServer) -> None:
    done = "/api/comparisons/walk/small"
    until(window.page, lambda: studio.get(done)["comparison"]["status"] == "done", 120.0)
    for address, part in PAGES.items():
        window.page.goto(f"{studio.origin}{address}")
        window.page.locator(part).first.wait_for()
        check(window, address, widths=WIDTHS)


def test_a_choice_with_long_words_stays_in_its_card(window: StudioPage, studio: StudioServer) -> None:
    page = window.page
    page.goto(f"{studio.origin}/reports")
    choice = page.get_by_label("Experiment", exact=True)
    choice.wait_for()
    page.set_viewport_size({"width": 390, "height": USUAL["height"]})
    try:
        assert choice.evaluate(
            "one => one.getBoundingClientRect().right < one.closest('.card-box').getBoundingClientRect().right"
        )
    finally:
        page.set_viewport_size(USUAL)
