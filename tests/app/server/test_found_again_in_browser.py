"""Reload, Back, a second window and a copied link lead to the same: of a job, of the set-up, of what is not there."""

import re
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from playwright.sync_api import Browser, BrowserContext, Page, WebSocketRoute, expect
from waiting import until
from web_doubles import TOKEN, Studio, state_of

from studio.app.server import background_routes, run_routes, track_routes
from studio.body.model import BodyModel
from studio.body.motion_files.trc import MarkerMotion, write_trc
from studio.foundations.errors import RunError
from studio.foundations.progress import Progress
from studio.operations import person
from studio.operations.jobs.commands import Start
from studio.runs.moved_knobs import keep_moved, stored_settings
from studio.runs.new_run import prepare_run
from studio.runs.refining import MadeTrack
from studio.runs.setup.subject_fitting import FitRequest, FittedSize, FittedSubject
from studio.runs.tracks import RAW, read_track, write_track
from studio.search.settings import values as settings_values
from studio.sessions.manifest import write_manifest
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import begin_session

pytestmark = pytest.mark.browser

PATIENCE = 60_000
STEP = "[data-step={}][aria-current=step]"


@dataclass
class HeldFit:
    """A fit of the subject that goes on as long as it is held. begun : how many there were."""

    go: threading.Event = field(default_factory=threading.Event)
    begun: int = 0

    def __call__(
        self,
        session: Session,
        request: FitRequest,
        progress: Progress,
        shown: Callable[[BodyModel, tuple[int, ...], np.ndarray], None],
    ) -> FittedSubject:
        self.begun += 1
        body, known = session.body(), session.subject()
        assert known is not None
        shown(body, (3,), body.neutral[None])
        while not self.go.wait(0.05):
            progress("2 of 3, fitting lengths and radii", 30, 100)
        size = FittedSize("thigh_length", "length", ("left_thigh_length",), 400.0, 425.0, 4.0)
        poses = np.stack([body.neutral] * 2)
        return FittedSubject(
            known, body, (size,), (1, 3), poses, np.full(2, 0.8), np.full(2, 0.9), "run r", 9
        )


@pytest.fixture
def held(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> Iterator[HeldFit]:
    """The session has a subject by height; fits are held."""
    studio.put("/api/sessions/take1/subject", {"height_mm": 1800})
    fit = HeldFit()
    monkeypatch.setattr(person, "fit_session_subject", fit)
    yield fit
    fit.go.set()


@pytest.fixture
def context(browser: Browser, studio: Studio) -> Iterator[BrowserContext]:
    """A browser that opened the printed address; the scene stays blank."""
    made = browser.new_context(viewport={"width": 1280, "height": 800})
    made.set_default_timeout(PATIENCE)
    made.route(f"{studio.base}/scene/**", lambda route: route.fulfill(body="", content_type="text/html"))
    page = made.new_page()
    page.goto(f"{studio.base}/?token={TOKEN}")
    page.close()
    yield made
    made.close()


def opened(context: BrowserContext, studio: Studio, address: str) -> Page:
    page = context.new_page()
    page.goto(f"{studio.base}{address}")
    return page


@pytest.mark.slow
def test_a_fit_is_found_again_wherever_it_is_looked_for(
    context: BrowserContext, studio: Studio, held: HeldFit
) -> None:
    address = "/way?session=take1&step=subject"
    page = opened(context, studio, address)
    page.get_by_role("button", name="Fit the subject").click()
    bar = page.locator(".subject-fit .step-progress")
    expect(bar).to_contain_text("2 of 3, fitting lengths and radii · 30 %")
    # The poses so far are drawn over the frames.
    expect(page.get_by_alt_text("Frame 3, cam1")).to_be_visible()

    page.reload()
    expect(bar).to_contain_text("fitting lengths and radii · 30 %")
    page.locator("#stepper [data-step=track]").click()
    page.wait_for_selector(STEP.format("track"))
    page.go_back()
    expect(bar).to_contain_text("fitting lengths and radii")
    expect(page.locator("#work-list button").first).to_have_text("1 job 30 %")

    # Another window, on the studio's own page, looks into it and stops it.
    other = opened(context, studio, "/?session=take1")
    other.locator("#work-list button").first.click()
    line = other.locator(".work-lines li")
    expect(line).to_contain_text("take1")
    line.get_by_role("button", name="Cancel the fit of the subject").click()
    expect(line).to_have_attribute("data-state", "cancelled")
    expect(page.get_by_role("button", name="Fit the subject")).to_be_visible()

    # What is found while nobody looks is there when somebody does, until it is saved.
    page.get_by_role("button", name="Fit the subject").click()
    expect(bar).to_be_visible()
    page.close()
    held.go.set()
    expect(line.first).to_have_attribute("data-state", "done")
    line.first.get_by_role("link", name="Open").click()
    save = other.get_by_role("button", name="Save as the subject")
    expect(save).to_be_visible()
    other.reload()
    expect(other.locator(".subject-fit")).to_contain_text("overlap by 90 % (80 % before), in frames 1 and 3")
    save.click()
    expect(other.locator(".subject-fit")).to_contain_text("Saved.")
    assert held.begun == 2


@pytest.mark.slow
def test_a_job_is_heard_and_asked_for_again_only_after_the_socket_was_lost(
    context: BrowserContext, studio: Studio, held: HeldFit
) -> None:
    sockets: list[WebSocketRoute] = []
    is_cut = False

    def connect(socket: WebSocketRoute) -> None:
        if is_cut:
            socket.close()
        else:
            socket.connect_to_server()
            sockets.append(socket)

    context.route_web_socket("**/api/events**", connect)
    page = opened(context, studio, "/way?session=take1&step=subject")
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))

    def times() -> int:
        return sum("/api/subject-fits/" in url and "/frames/" not in url for url in asked)

    page.get_by_role("button", name="Fit the subject").click()
    bar = page.locator(".subject-fit .step-progress")
    expect(bar).to_contain_text("2 of 3, fitting lengths and radii · 30 %")
    page.wait_for_timeout(1500)
    assert times() == 1, "once, when it is begun to be followed"

    # The studio is away: that is said, and the job ends meanwhile.
    is_cut = True
    context.set_offline(True)
    for socket in sockets:
        socket.close()
    expect(bar).to_contain_text("the studio does not answer")
    held.go.set()
    until(lambda: not studio.client.get("/api/jobs").json()["jobs"][0]["state"].endswith("ing"))
    is_cut = False
    context.set_offline(False)
    expect(page.get_by_role("button", name="Save as the subject")).to_be_visible()


@pytest.fixture
def refining(tracked: StoredRun, monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """Refining goes on until this is set; then it makes the track."""
    go = threading.Event()

    def refines(run: StoredRun, *, progress: Progress, **_: object) -> MadeTrack:
        while not go.wait(0.05):
            progress("frame 30", 30, 100)
        raw = read_track(run, RAW)
        made = replace(raw, name="refined", made_by={"verb": "refine", "from": RAW})
        write_track(run, made)
        return MadeTrack(made, moved=2, jitter_before=3.0, jitter_after=1.5)

    monkeypatch.setattr(track_routes, "refine", refines)
    yield go
    go.set()


@pytest.mark.slow
def test_a_run_s_refinement_is_found_again_and_shown_where_it_was_begun(
    context: BrowserContext, studio: Studio, refining: threading.Event
) -> None:
    address = "/?session=take1&run=first"
    page, other = opened(context, studio, address), opened(context, studio, address)
    page.get_by_label("More for first").click()
    page.get_by_role("menuitem", name="Refine…").click()
    page.locator("#dialog").get_by_role("button", name="Refine", exact=True).click()
    expect(page.locator("#dialog")).not_to_be_visible()
    for one in (page, other):
        expect(one.locator("#track-work")).to_contain_text("Refining of first: frame 30 · 30 %")
    page.reload()
    expect(page.locator("#track-work")).to_contain_text("30 %")
    # On a page that is a document, too; from there back.
    page.get_by_role("link", name="Bodies").click()
    expect(page.locator("#work-list button").first).to_have_text("1 job 30 %")
    page.go_back()
    expect(page.locator("#track-work")).to_contain_text("30 %")

    # It ends while the window that began it shows another page.
    page.get_by_role("link", name="Bodies").click()
    expect(page.locator("#work-list")).to_contain_text("1 job")
    refining.set()
    expect(other.locator("#track-work")).to_be_empty()
    expect(other.locator("#track-choice")).to_have_value(RAW)
    page.go_back()
    expect(page.locator("#toasts")).to_contain_text(
        "Track refined of first is made: 2 frames moved, jitter 3.0 → 1.5 mm a frame²."
    )
    expect(page.locator("#track-choice")).to_have_value("refined")
    page.reload()
    expect(page.locator("#track-choice")).to_have_value("refined")
    expect(page.locator("#toasts")).to_be_empty()


@pytest.mark.slow
def test_refining_is_cancelled_from_another_window(
    context: BrowserContext, studio: Studio, refining: threading.Event
) -> None:
    begun = studio.post("/api/sessions/take1/runs/first/refine", {}, code=202)
    page = opened(context, studio, "/?session=take1&run=first")
    page.locator("#track-work").get_by_role("button", name="Cancel").click()
    expect(page.locator("#track-work")).to_be_empty()
    state = studio.get(f"/api/track-jobs/{begun['identifier']}")
    assert state["state"] == "cancelled"


def test_a_link_says_what_is_not_there(context: BrowserContext, studio: Studio, tracked: StoredRun) -> None:
    page = opened(context, studio, "/?session=gone&run=first&frame=1")
    card = page.locator(".missing")
    for _ in range(2):
        expect(card).to_contain_text("Session “gone” is not here")
        assert "session=gone" in page.url
        page.reload()
    card.get_by_role("button", name="Open take1").click()
    expect(page.locator("#crumbs")).to_contain_text("take1 / first")
    expect(card).to_have_count(0)

    page.goto(f"{studio.base}/?session=take1&run=other")
    expect(card).to_contain_text("Run “take1 / other” is not here")
    expect(page.locator("#crumbs")).to_have_text("take1")
    assert "run=other" in page.url
    card.get_by_role("button", name="Open first").click()
    expect(page.locator("#crumbs")).to_contain_text("take1 / first")
    page.go_back()
    expect(card).to_contain_text("Run “take1 / other” is not here")

    said = page.locator("#toasts .toast p").first
    page.goto(f"{studio.base}/?session=take1&run=first&frame=9999")
    expect(said).to_have_text("There is no frame 9999: first goes from frame 0 to 3. Frame 1 is shown.")
    page.wait_for_url("**frame=1**")
    page.goto(f"{studio.base}/?session=take1&run=first&frame=3")
    expect(said).to_have_text("Frame 3 of first is not tracked. Frame 1 is shown.")

    page.goto(f"{studio.base}/way?session=gone&step=track")
    expect(page.locator("#step")).to_contain_text("Session “gone” is not here")


@pytest.mark.slow
def test_the_header_tells_how_the_open_run_stands(
    context: BrowserContext, studio: Studio, tracked: StoredRun
) -> None:
    prepare_run(studio.workspace.session("take1"), name="second", seed=4)
    # The tracking process was at another run last, which it finished.
    studio.control.say(state_of("elsewhere", "whole", "finished"))
    page = opened(context, studio, "/?session=take1&run=second")
    words, dot = page.locator("#state-text"), page.locator("#state")
    expect(words).to_have_text("not tracked yet")
    expect(dot).to_have_attribute("data-state", "idle")
    page.goto(f"{studio.base}/?session=take1&run=first")
    expect(words).to_have_text("2 of 4 frames")
    page.goto(f"{studio.base}/?session=take1&run=")
    expect(words).to_have_text("no run")
    expect(dot).to_have_attribute("data-state", "idle")


def test_the_set_up_goes_back_step_by_step_and_tracks_when_it_says_so(
    context: BrowserContext, studio: Studio, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = opened(context, studio, "/way?session=take1&step=subject")
    page.wait_for_selector(STEP.format("subject"))
    page.locator("#stepper [data-step=start-pose]").click()
    page.wait_for_selector(STEP.format("start-pose"))
    pictures = page.locator("#aside img")
    expect(pictures).to_have_count(2)
    page.reload()
    page.wait_for_selector(STEP.format("start-pose"))
    page.go_back()
    page.wait_for_selector(STEP.format("subject"))
    page.go_forward()
    page.wait_for_selector(STEP.format("start-pose"))

    real, go = run_routes.new_run, threading.Event()

    def slow_run(session: Session, **request: object) -> StoredRun:
        assert go.wait(60.0)
        return real(session, **request)

    monkeypatch.setattr(run_routes, "new_run", slow_run)
    page.get_by_role("button", name="Yes, track all frames from here").click()
    page.wait_for_selector(STEP.format("track"))
    expect(page.locator(".track-status")).to_contain_text("starting…")
    expect(page.get_by_role("button", name="Starting…")).to_be_disabled()
    assert not studio.workspace.session("take1").runs()
    go.set()
    expect(page.locator(".track-status")).to_contain_text("compiling the kernels")
    [started] = [one for one in studio.control.commands if isinstance(one, Start)]
    assert started.session.endswith("/take1")
    [made] = studio.workspace.session("take1").runs()
    assert started.run == str(made.folder)


def test_old_masks_are_not_shown_while_new_ones_are_cut(
    context: BrowserContext, studio: Studio, monkeypatch: pytest.MonkeyPatch
) -> None:
    go = threading.Event()

    def sets_up(*_: object, progress: Progress, **__: object) -> None:
        while not go.wait(0.05):
            progress("cutting out", 1, 4)
        raise RunError("It was let go.", "Again.")

    monkeypatch.setattr(background_routes, "set_background", sets_up)
    page = opened(context, studio, "/way?session=take1&step=background")
    first = page.locator("#aside .masks img").first
    expect(first).to_have_attribute("src", re.compile("show=mask"))
    page.get_by_role("button", name="Set up the background").click()
    for _ in range(2):
        expect(page.locator(".masks.cutting")).to_be_visible(timeout=PATIENCE)
        expect(first).to_have_attribute("src", re.compile("show=&|footage"))
        expect(page.locator(".background-make .step-progress")).to_contain_text("cutting out")
        page.reload()
    go.set()
    expect(page.locator(".background-make .wrong")).to_contain_text("It was let go.")
    expect(first).to_have_attribute("src", re.compile("show=mask"))


@pytest.mark.slow
def test_moved_knobs_and_the_chosen_layer_are_found_again(
    context: BrowserContext, studio: Studio, tracked: StoredRun
) -> None:
    version, stored = stored_settings(tracked)
    assert settings_values(stored)["survival"] == 0.77
    keep_moved(tracked, version, {"survival": 0.5})
    address = "/?session=take1&run=first&frame=1&layer=2"
    page = opened(context, studio, address)
    for one in (page, opened(context, studio, address)):
        for _ in range(2):
            expect(one.locator("#trial")).to_contain_text("survival rate 0.77 → 0.5")
            one.wait_for_function("async () => (await import('/assets/js/state.js')).get('layer') === 2")
            one.reload()


def test_find_knows_frames_knobs_limbs_formats_pages_and_help(
    context: BrowserContext, studio: Studio, tracked: StoredRun
) -> None:
    page = opened(context, studio, "/?session=take1&run=first&frame=1")
    expect(page.locator("#crumbs")).to_contain_text("take1 / first")
    page.wait_for_function("async () => Boolean((await import('/assets/js/state.js')).get('parameters'))")
    field, entries = page.locator(".palette input"), page.locator(".palette-list li")

    def found(wanted: str, kind: str) -> None:
        page.keyboard.press("Control+k")
        field.fill(wanted)
        expect(entries.filter(has=page.locator(".kind", has_text=kind)).first).to_be_visible()

    for wanted, kind in (
        ("survival", "Knob"), ("bvh", "Export"), ("gallery", "Page"), ("dark", "Theme"), ("lost and", "Help"),
        ("head", "Limb"), (str(tracked.record.parameters[0]).replace("_", " "), "Parameter"),
    ):  # fmt: skip
        if kind == "Help":
            wanted = "what the charts show"
        found(wanted, kind)
        page.keyboard.press("Escape")
    found("0", "Frame")
    page.keyboard.press("Enter")
    page.wait_for_url("**frame=0**")
    found("light", "Theme")
    page.keyboard.press("Enter")
    expect(page.locator("html")).to_have_attribute("data-theme", "light")


@pytest.mark.slow
def test_a_note_is_written_on_a_frame_and_seen_in_every_window(
    context: BrowserContext, studio: Studio, tracked: StoredRun
) -> None:
    page = opened(context, studio, "/?session=take1&run=first&frame=1")
    other = opened(context, studio, "/?session=take1&run=first&frame=0")
    writer = page.get_by_role("button", name="Write a note on this frame")
    writer.click()
    page.get_by_label("Note", exact=True).fill("the arm is hidden")
    page.keyboard.press("Control+Enter")
    flag = other.get_by_label("Note on frame 1: the arm is hidden")
    flag.click()
    expect(other.get_by_role("button", name="Note on this frame")).to_be_visible()
    other.reload()
    expect(flag).to_have_count(1)
    # A bookmark by its key, and away by the same.
    page.goto(f"{studio.base}/?session=take1&run=first&frame=0")
    expect(page.locator(".note-flag")).to_have_count(1)
    page.keyboard.press("b")
    expect(page.get_by_label("Note on frame 0: bookmark")).to_have_count(1)
    page.keyboard.press("b")
    expect(page.locator(".note-flag")).to_have_count(1)


DROP = """(files) => {
  const data = new DataTransfer();
  for (const [name, text] of files) data.items.add(new File([text], name));
  for (const type of ["dragenter", "dragover", "drop"])
    document.body.dispatchEvent(new DragEvent(type, { dataTransfer: data, bubbles: true, cancelable: true }));
}"""


def test_videos_are_dropped_on_the_page(context: BrowserContext, studio: Studio) -> None:
    page = opened(context, studio, "/?session=take1")
    expect(page.locator("#crumbs")).to_contain_text("take1")
    page.evaluate(DROP, [["left.mp4", "no video"], ["right.mp4", "none either"]])
    dialog = page.locator("dialog[open]")
    expect(dialog).to_contain_text("2 files, 0.0 MB were dropped: left.mp4, right.mp4.")
    dialog.get_by_label("Session name").fill("dropped")
    dialog.get_by_role("button", name="Import").click()
    # They arrived, and are no videos.
    expect(dialog.locator(".wrong")).to_be_visible()
    expect(dialog.locator(".wrong")).not_to_have_text("")


def test_a_session_without_a_run_shows_its_footage(context: BrowserContext, studio: Studio) -> None:
    page = opened(context, studio, "/?session=take1&run=")
    views = page.locator("#panel-cameras .view img")
    expect(views).to_have_count(2)
    slider = page.get_by_label("Frame of the footage")
    slider.fill("2")
    expect(views.first).to_have_attribute("src", re.compile("/frames/2/views/cam1"))
    page.goto(f"{studio.base}/comparisons?session=take1")
    page.wait_for_url("**/comparisons?new*")


def test_a_truth_that_fits_no_marker_empties_no_page(
    context: BrowserContext, studio: Studio, tracked: StoredRun
) -> None:
    place = tracked.folder.parents[1] / "truth"
    place.mkdir()
    write_trc(
        place / "points.trc", MarkerMotion(("EarL",), np.arange(2) / 25.0, np.ones((2, 1, 3)), "mm", 25.0)
    )
    page = opened(context, studio, "/way?session=take1&step=check")
    expect(page.get_by_role("button", name="Check the motion")).to_be_visible()
    expect(page.get_by_label("Show raw")).to_be_checked()
    expect(page.locator("#step table")).not_to_contain_text("from truth")
    expect(page.locator("#step .notice", has_text="The truth's markers (EarL")).to_have_count(1)
    page = opened(context, studio, "/?session=take1&run=first")
    expect(page.locator(".toast.warning")).to_contain_text("The truth's markers (EarL")
    expect(page.locator(".toast.error")).to_have_count(0)


def test_a_card_names_the_session_that_was_made_of_it_and_what_its_import_leaves(
    context: BrowserContext, studio: Studio, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("STUDIO_REAL_DATA", str(tmp_path))
    for footage in ("mouse-cylinder/three-a", "mouse-cylinder/five", "fly"):
        (tmp_path / footage).mkdir(parents=True)
    made = begin_session(studio.workspace.root / "cylinder")
    origin = str(tmp_path / "mouse-cylinder" / "three-a")
    write_manifest(made.path, msgspec.structs.replace(made.manifest, imported_from=origin))
    page = opened(context, studio, "/gallery")
    rearing, taken, fly = (page.locator(f"[data-card={name}]") for name in ("rearing", "cylinder", "fly"))
    expect(rearing).to_contain_text("in this workspace as cylinder")
    expect(rearing.get_by_role("link", name="Open")).to_have_attribute("href", re.compile("session=cylinder"))
    expect(taken).to_contain_text("Its name, 'cylinder', is taken in this workspace")
    expect(taken.get_by_role("link", name="Open")).to_have_count(0)
    expect(fly).to_contain_text("but what needs you: body-from-film, carry-clicks.")
