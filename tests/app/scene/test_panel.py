"""The panel: made from declarations, reporting what a person does and nothing else, showing what the model says."""

import asyncio
import dataclasses
import math
import threading
import time
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any, cast

import pytest
from scene_fakes import SOMEBODY, Posted, by_hand, press, settle_viser
from swaying_session import FPS, swaying_pose

from studio.app.scene import model as scene
from studio.app.scene.controls import Control, take_out
from studio.app.scene.guarded_server import GuardedServer
from studio.app.scene.model import Knobs, Model
from studio.app.scene.opened_run import Moment
from studio.app.scene.panel import clock, mark_html, search_html, status_html
from studio.app.scene.pose_edit import begun, edit_of, moved
from studio.app.scene.pose_panel import PosePanel
from studio.app.scene.settings_panel import NO_PRESET, SettingsPanel, knob_value, since_in_words, slider_range
from studio.app.scene.show_panel import ShowPanel, legend_html
from studio.body.dragging import Dragger
from studio.body.model import BodyModel
from studio.foundations.knobs import Value, knobs_of
from studio.operations.jobs.events import RunState, StateChanged
from studio.runs.drawing.colour_tokens import colour_tokens
from studio.search.settings import DEFAULT_WEIGHTING, all_knobs, changed_settings, default_settings, values
from studio.search.trackers.catalogue import TRACKERS, presets
from studio.search.trackers.settings import AnnealedSettings

DEFAULTS = values(default_settings())
STATE = StateChanged("walk", "run 7", RunState.TRACKING, 128, 3, 0, 450, 128, 41.234, 8.2)


def model_of(body: BodyModel) -> Model:
    """Run "run 7" of "walk", with the default settings."""
    subject = scene.Subject(body, (), (0, 450), FPS, Dragger(body), None)
    edit = edit_of(swaying_pose(body, 0))
    return scene.opened(Model(STATE), "walk", "run 7", subject, range(128), default_settings(), edit)


@pytest.fixture
def posted(human: BodyModel) -> Posted:
    return Posted(model_of(human))


class Settings:
    """A settings panel and what it requests."""

    def __init__(self, server: GuardedServer, posted: Posted) -> None:
        self.server, self.posted, self.requests = server, posted, []
        tabs = [server.gui.add_tab_group().add_tab(name) for name in ("Search", "Likelihood", "Masks")]
        self.panel = SettingsPanel(server.gui, *tabs, posted.post, self.request)
        self.show(Knobs(default_settings()))

    def request(self, model: Model, changes: Mapping[str, Value]) -> Model:
        self.requests.append(dict(changes))
        return model

    def show(self, knobs: Knobs) -> None:
        self.panel.show(knobs)
        settle_viser(self.server)

    def move(self, name: str, value: object) -> None:
        by_hand(self.panel.inputs[name].handle, value)
        self.posted.happen()


@pytest.fixture
def settings(server: GuardedServer, posted: Posted) -> Settings:
    return Settings(server, posted)


def test_a_control_reports_a_person_and_shows_the_model(server: GuardedServer, posted: Posted) -> None:
    moves: list[float] = []

    def change(model: Model, value: float) -> Model:
        moves.append(value)
        return model

    handle = server.gui.add_slider("a", 0.0, 1.0, 0.1, 0.5)
    control = Control(handle, posted.post, change)
    control.show(0.3)
    settle_viser(server)
    assert (handle.value, posted.waiting) == (0.3, []), "what is shown is reported by nobody"
    # While a move waits to be decided on, nothing is put back under the hand, whatever else is drawn.
    by_hand(handle, 0.7)
    control.show(0.3)
    by_hand(handle, 0.8)
    control.show(0.3)
    settle_viser(server)
    assert (handle.value, moves) == (0.8, []), "nothing is decided in viser's thread"
    posted.happen()
    assert moves == [0.7, 0.8]
    control.show(0.3)
    settle_viser(server)
    assert handle.value == 0.3, "refused: put back"


def test_a_value_shown_just_then_does_not_take_a_persons_change_away(
    server: GuardedServer, posted: Posted
) -> None:
    handle = server.gui.add_checkbox("a", False)
    control = Control(handle, posted.post, lambda model, value: model)

    async def between() -> None:
        handle._impl.value = True
        drawing = threading.Thread(target=control.show, args=(False,))
        drawing.start()
        drawing.join()
        for callback in handle._impl.update_cb:
            await cast("Any", callback)(SimpleNamespace(target=handle, client_id=SOMEBODY))

    asyncio.run_coroutine_threadsafe(between(), server.get_event_loop()).result(5)
    settle_viser(server)
    assert [values for _, values in posted.waiting] == [(True,)]
    assert handle.value is True


def test_nothing_is_written_to_an_input_that_is_being_taken_out(
    server: GuardedServer, posted: Posted, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The browser knows it no longer once its folder is gone."""
    folder = server.gui.add_folder("a")
    with folder:
        control = Control(server.gui.add_checkbox("b", False), posted.post, lambda model, value: model)
    wire, sent = control.handle._impl.gui_api._websock_interface, list[str]()
    queue = wire.queue_message

    def slowly(message: object) -> None:
        sent.append(type(message).__name__)
        queue(message)
        if sent == ["GuiRemoveMessage"]:
            control.show(True)
            time.sleep(0.3)

    monkeypatch.setattr(wire, "queue_message", slowly)
    take_out(folder)
    settle_viser(server)
    assert "GuiRemoveMessage" in sent
    assert "GuiUpdateMessage" not in sent


def test_a_change_that_fails_frees_its_control(server: GuardedServer, posted: Posted) -> None:
    def fail(model: Model, value: float) -> Model:
        raise ZeroDivisionError

    handle = server.gui.add_slider("a", 0.0, 1.0, 0.1, 0.5)
    control = Control(handle, posted.post, fail)
    by_hand(handle, 0.7)
    with pytest.raises(ZeroDivisionError):
        posted.happen()
    control.show(0.5)
    settle_viser(server)
    assert handle.value == 0.5


def test_every_knob_has_a_labelled_control(settings: Settings) -> None:
    declared = all_knobs(default_settings())
    assert set(settings.panel.inputs) == {knob.name for knob in declared}
    for knob in declared:
        handle = settings.panel.inputs[knob.name].handle
        assert knob.help in handle.hint
        assert knob.takes_effect in handle.hint
        assert handle.label.startswith(knob.label)
        assert handle.disabled == (knob.takes_effect == "new run")
        assert handle.value == knob.default


def test_a_slider_requests_and_a_changed_value_is_marked(settings: Settings) -> None:
    settings.move("survival", 0.7000000000000001)
    assert settings.requests == [{"survival": 0.7}]
    knob = settings.panel.inputs["survival"]
    settings.show(Knobs(default_settings(), requested={"one": {"survival": 0.7}}))
    assert (knob.handle.label[:2], knob.reset.visible) == ("• ", True)
    press(knob.reset, "reset")
    settings.posted.happen()
    assert settings.requests[1:] == [{"survival": DEFAULTS["survival"]}]
    settings.show(Knobs(changed_settings(default_settings(), {"layers": 12}), since=(128, 2)))
    assert settings.panel.inputs["layers"].handle.value == 12
    assert (knob.handle.value, knob.handle.label[:2]) == (DEFAULTS["survival"], "su")
    assert "frame 128, layer 3" in settings.panel.since.content
    assert "from the start of the run" in since_in_words(Knobs(default_settings()))
    assert len(settings.requests) == 2


def test_presets_and_resets_are_one_request(settings: Settings) -> None:
    careful = next(preset for preset in presets() if preset.name == "careful")
    by_hand(settings.panel.preset.handle, "careful")
    settings.posted.happen()
    assert settings.requests == [dict(careful.values)]
    settings.show(Knobs(changed_settings(default_settings(), careful.values)))
    assert settings.panel.preset.handle.value == NO_PRESET
    button, declared = settings.panel._resets[0]
    assert (button.visible, button.label) == (True, "Reset 2 to their defaults")
    press(button)
    settings.posted.happen()
    assert settings.requests[1] == {knob.name: knob.default for knob in declared}
    assert not any(knob.takes_effect == "new run" for knob in declared)


def test_another_tracker_gets_other_controls_and_presets(settings: Settings) -> None:
    for tracker in TRACKERS.values():
        for preset in tracker.presets:
            weighting = preset.weighting or DEFAULT_WEIGHTING
            assert changed_settings(default_settings(tracker.name, weighting), preset.values) is not None

    def offered(tracker: str, weighting: str = DEFAULT_WEIGHTING) -> tuple[str, ...]:
        settings.show(Knobs(default_settings(tracker, weighting)))
        preset = settings.panel.preset
        return () if preset is None else tuple(preset.handle.options[1:])

    assert offered("swarm") == ()
    assert offered("swarm", "edge-silhouette") == ("paper, swarm",)
    whole = tuple(preset.name for preset in TRACKERS["annealed"].presets)
    assert offered("annealed", "edge-region") == whole
    # A paper's tracker is offered beside its own likelihood alone.
    assert offered("annealed") == tuple(name for name in whole if not name.startswith("paper"))
    assert offered("condensation") == ()
    assert "survival" not in settings.panel.inputs
    assert "scale_survival" in settings.panel.inputs


def test_sliders_begin_at_round_numbers_and_hold_every_default() -> None:
    for knob in knobs_of(AnnealedSettings):
        if knob.kind in (int, float) and knob.low is not None:
            low, high, step = slider_range(knob, knob.default)
            assert low <= knob.default <= high
            assert math.isclose((knob.default - low) / step, round((knob.default - low) / step), abs_tol=1e-6)
            assert knob_value(knob, low) >= knob.low


def test_a_slider_drawn_to_its_end_grows(settings: Settings) -> None:
    handle = settings.panel.inputs["particles"].handle
    assert handle.max == 1000
    for particles, most in ((1000, 2000), (20000, 20000)):
        settings.show(Knobs(changed_settings(default_settings(), {"particles": particles})))
        assert handle.max >= most
        assert handle.value == particles


def test_the_show_tab_changes_options_and_follows_them(server: GuardedServer, posted: Posted) -> None:
    panel = ShowPanel(server.gui, server.gui.add_tab_group().add_tab("Show"), posted.post)
    moment, tokens = Moment(0, None, None, (), 4, None), colour_tokens()

    def show() -> None:
        panel.show(posted.model, moment, tokens)
        settle_viser(server)

    show()
    assert panel.inputs["point_size"].handle.value == 12
    by_hand(panel.inputs["point_size"].handle, 20)
    by_hand(panel.inputs["truth"].handle, False)
    by_hand(panel.ticks["overlays", "mask"].handle, True)
    by_hand(panel.ticks["limbs", "head"].handle, False)
    options = posted.happen().options
    assert (options.point_size, options.truth, options.overlays) == (
        pytest.approx(0.02),
        False,
        ("outline", "mask"),
    )
    assert options.limbs is not None
    assert "head" not in options.limbs
    posted.model = scene.change_options(posted.model, {"limbs": None, "hull": True, "overlays": ()})
    show()
    assert panel.ticks["limbs", "head"].handle.value
    assert not panel.ticks["overlays", "outline"].handle.value
    assert panel.inputs["hull"].handle.value
    assert posted.waiting == [], "showing options asks for none"
    assert not panel.inputs["blobs"].handle.visible
    posted.model = dataclasses.replace(posted.model, knobs=Knobs(default_settings("annealed", "blobs")))
    show()
    assert panel.inputs["blobs"].handle.visible, "offered where the run is weighed by them"
    assert "layer 4" in panel.legend.content
    assert "truth" in legend_html(tokens, "weight", 4, truth=True)


def test_the_pose_tab_shows_degrees_and_requests_radians(
    server: GuardedServer, human: BodyModel, posted: Posted
) -> None:
    tab = server.gui.add_tab_group().add_tab("Pose")
    panel = PosePanel(server.gui, tab, posted.post, lambda model: model, lambda model: model)
    panel.show(posted.model)
    assert len(panel.sliders) == 31
    assert not panel.back.visible
    by_hand(panel.sliders[9].handle, -30.0)
    by_hand(panel.grip.handle, "left forearm")
    edit = posted.happen().edit
    assert (edit.active, edit.grip, edit.pose[9]) == (
        True,
        "left forearm",
        pytest.approx(math.radians(-30.0)),
    )
    pose = swaying_pose(human, 2)
    pose[4] += 123.0
    posted.model = scene.edit_pose(posted.model, lambda edit: moved(begun(edit), pose))
    panel.show(posted.model)
    settle_viser(server)
    assert posted.waiting == []
    assert panel.sliders[4].handle.value == pytest.approx(pose[4], abs=0.05)
    assert panel.back.visible
    assert not panel.save.disabled
    assert not panel.whole.visible, "a body without sides is not mirrored"
    by_hand(panel.grip.handle, "none")
    press(panel.back, "undo")
    edit = posted.happen().edit
    assert (edit.grip, edit.pose[9]) == ("", pytest.approx(math.radians(-30.0)))


def test_the_runs_status_in_words(posted: Posted) -> None:
    text = status_html(posted.model)
    assert "walk / run 7" in text
    assert "41.2 fps" in text
    assert "0:08 left" in text
    lost = dataclasses.replace(STATE, state=RunState.LOST, message="It died.", hint="Resume.")
    assert "It died." in search_html(lost)
    assert "No run" in search_html(dataclasses.replace(STATE, session="", run=""))
    assert f"frame {STATE.frame} ·" in search_html(STATE)
    finished = dataclasses.replace(
        STATE, state=RunState.FINISHED, frame=STATE.last, done=STATE.last - STATE.first
    )
    assert "frame " not in search_html(finished), "there is no frame after the last"
    other = dataclasses.replace(posted.model, search=dataclasses.replace(STATE, run="run 8"))
    assert "stored · 128 of 450 frames" in status_html(other)
    assert clock(3725) == "1:02:05"


def test_a_frame_that_did_not_simply_go_on_says_so(posted: Posted) -> None:
    tokens, moment = colour_tokens(), Moment(0, None, None, (), 4, None, tracking="limb lost")
    assert "a limb is off" in mark_html(posted.model, moment, tokens)
    assert mark_html(posted.model, dataclasses.replace(moment, tracking="tracked"), tokens) == ""
    found = scene.edit_pose(posted.model, lambda edit: begun(edit, confidence="confidence 92 %"))
    assert "confidence 92 %" in mark_html(found, moment, tokens)
