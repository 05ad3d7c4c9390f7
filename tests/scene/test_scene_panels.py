"""The panel: made from declarations, asking once, never echoing, putting back what is refused."""

import asyncio
import math
from types import SimpleNamespace
from typing import cast

import pytest

from studio.body.model import BodyModel
from studio.errors import RunError, StudioError
from studio.knobs import knobs_of
from studio.runs.colour_tokens import colour_tokens
from studio.scene.guarded_server import GuardedServer
from studio.scene.knob_input import knob_value, slider_range
from studio.scene.run_panel import RunPanel, Transport, clock, status_html
from studio.scene.settings_panel import SettingsPanel, SettingsTabs
from studio.scene.show_panel import ShowPanel
from studio.scene.view_options import ViewOptions
from studio.scene.wishes import Wishes
from studio.settings import all_knobs, changed_settings, default_settings, values
from studio.tracking.catalogue import TRACKERS, presets
from studio.tracking.settings import AnnealedSettings
from studio.worker.events import SettingsApplied, StateChanged

DEFAULTS = values(default_settings())
SURVIVAL = DEFAULTS["survival"]


class Asked:
    """Remembers what a settings panel asks for."""

    def __init__(self) -> None:
        self.wishes: list[dict[str, object]] = []
        self.refusals: list[StudioError] = []
        self.unable: StudioError | None = None

    def change(self, changes: dict) -> str:
        if self.unable is not None:
            raise self.unable
        self.wishes.append(dict(changes))
        return f"wish-{len(self.wishes)}"


@pytest.fixture
def asked() -> Asked:
    return Asked()


@pytest.fixture
def panel(server: GuardedServer, asked: Asked) -> SettingsPanel:
    tabs = server.gui.add_tab_group()
    names = SettingsTabs(tabs.add_tab("Search"), tabs.add_tab("Weighting"), tabs.add_tab("Masks"))
    made = SettingsPanel(server.gui, names, asked.change, asked.refusals.append)
    made.show_settings(default_settings())
    return made


def move(panel: SettingsPanel, name: str, value: object) -> None:
    """What happens when a person moves a control: the handle holds the value, its callbacks are awaited."""
    handle = panel.inputs[name].handle
    handle._impl.value = value
    for callback in handle._impl.update_cb:
        asyncio.run(callback(SimpleNamespace(target=handle)))


def settle(server: GuardedServer) -> None:
    """Wait until viser's loop has run what was handed to it, however often that hands on."""
    for _ in range(3):
        asyncio.run_coroutine_threadsafe(asyncio.sleep(0), server.get_event_loop()).result(5)


def test_every_knob_has_a_control_that_says_what_it_is(panel: SettingsPanel) -> None:
    declared = all_knobs(default_settings())
    assert set(panel.inputs) == {knob.name for knob in declared}
    for knob in declared:
        handle = panel.inputs[knob.name].handle
        assert knob.help in handle.hint
        assert knob.takes_effect in handle.hint
        assert handle.label.startswith(knob.label)
        assert handle.disabled == (knob.takes_effect == "new run")
        assert handle.value == knob.default


def test_moving_a_slider_asks_once(panel: SettingsPanel, asked: Asked, server: GuardedServer) -> None:
    move(panel, "survival", 0.7)
    assert asked.wishes == [{"survival": 0.7}]
    assert panel.inputs["survival"].handle.label.startswith("• ")
    assert panel.inputs["survival"].reset.visible
    panel.settle("wish-1", True)
    panel.show_applied(SettingsApplied("s", "r", 2, 128, 2, {"survival": 0.7, "layers": 12}, ("survival",)))
    settle(server)
    assert asked.wishes == [{"survival": 0.7}], "what is shown is no wish"
    assert panel.inputs["layers"].handle.value == 12
    assert "frame 128, layer 3" in panel._in_use.content  # pyright: ignore[reportOptionalMemberAccess]


def test_an_older_answer_does_not_pull_the_slider_back(panel: SettingsPanel) -> None:
    move(panel, "survival", 0.7)
    move(panel, "survival", 0.4)
    panel.settle("wish-1", True)
    panel.show_applied(SettingsApplied("s", "r", 2, 1, 0, {"survival": 0.7}))
    assert panel.inputs["survival"].handle.value == 0.4
    panel.settle("wish-2", True)
    panel.show_applied(SettingsApplied("s", "r", 3, 1, 0, {"survival": 0.4}))
    assert panel.inputs["survival"].accepted == 0.4


def test_a_refused_value_is_put_back(panel: SettingsPanel, asked: Asked, server: GuardedServer) -> None:
    move(panel, "survival", 0.7)
    panel.settle("wish-1", False)
    settle(server)
    assert panel.inputs["survival"].handle.value == SURVIVAL
    assert not panel.inputs["survival"].handle.label.startswith("•")
    move(panel, "survival", 99.0)
    assert "99" in str(asked.refusals[-1])
    assert panel.inputs["survival"].handle.value == SURVIVAL
    asked.unable = RunError("No run is open.", "Open one.")
    move(panel, "crossover", 0.2)
    assert asked.refusals[-1] is asked.unable
    assert panel.inputs["crossover"].handle.value == DEFAULTS["crossover"]
    assert len(asked.wishes) == 1


def test_half_written_text_stays(panel: SettingsPanel, asked: Asked) -> None:
    move(panel, "survival_per_layer", "0.6, 0.")
    panel.settle("wish-1", False)
    assert panel.inputs["survival_per_layer"].handle.value == "0.6, 0."


def test_presets_and_resets_are_one_wish(panel: SettingsPanel, asked: Asked, server: GuardedServer) -> None:
    careful = next(preset for preset in presets() if preset.name == "careful")
    panel.ask_all(careful.values)
    assert asked.wishes == [{"layers": 15, "particles": 400}], "only what differs is asked for"
    panel.settle("wish-1", True)
    panel.ask_all({name: entry.knob.default for name, entry in panel.inputs.items()})
    assert asked.wishes[1] == {name: DEFAULTS[name] for name in ("layers", "particles")}
    settle(server)
    assert len(asked.wishes) == 2


def test_every_preset_is_allowed_and_offered_where_its_knobs_exist(panel: SettingsPanel) -> None:
    for tracker in TRACKERS.values():
        for preset in tracker.presets:
            assert changed_settings(default_settings(tracker.name), preset.values) is not None

    def offered(tracker: str) -> list[str]:
        panel.show_settings(default_settings(tracker))
        return [preset.name for preset in panel._presets]

    assert offered("swarm") == ["paper, swarm"]
    assert offered("annealed") == [preset.name for preset in TRACKERS["annealed"].presets]
    assert offered("condensation") == []


def test_another_run_does_not_show_since_when_the_one_before_used_its_settings(panel: SettingsPanel) -> None:
    panel.show_applied(SettingsApplied("s", "r", 3, 128, 2, {"survival": 0.7}))
    panel.show_settings(default_settings())
    assert "as the run began" in panel._in_use.content  # pyright: ignore[reportOptionalMemberAccess]
    assert panel.inputs["survival"].accepted == default_settings().tracker.survival


def test_another_tracker_gets_other_controls(panel: SettingsPanel) -> None:
    panel.show_settings(default_settings("condensation", "bodytrack"))
    assert "survival" not in panel.inputs
    assert "scale_survival" in panel.inputs
    assert panel.preset is None


def test_sliders_begin_at_round_numbers_and_hold_every_default() -> None:
    for knob in knobs_of(AnnealedSettings):
        if knob.kind in (int, float) and knob.low is not None:
            low, high, step = slider_range(knob, knob.default)
            assert low <= knob.default <= high
            assert math.isclose((knob.default - low) / step, round((knob.default - low) / step), abs_tol=1e-6)
            assert knob_value(knob, low) >= knob.low


def test_a_slider_drawn_to_its_end_grows(panel: SettingsPanel) -> None:
    handle = panel.inputs["particles"].handle
    assert handle.max == 1000
    move(panel, "particles", 1000)
    assert handle.max == 2000
    panel.show_settings(changed_settings(default_settings(), {"particles": 20000}))


def test_the_show_tab_changes_options_and_follows_them(server: GuardedServer, human: BodyModel) -> None:
    seen: list[dict[str, object]] = []
    layers: list[int | None] = []
    tab = server.gui.add_tab_group().add_tab("Show")
    panel = ShowPanel(server.gui, tab, seen.append, layers.append)
    panel.show_body(human)
    handle, _ = panel.inputs["point_size"]
    handle.value = 20
    settle(server)
    assert seen == [{"point_size": pytest.approx(0.02)}]
    panel.show_options(ViewOptions(truth=False))
    settle(server)
    assert panel.inputs["truth"][0].value is False
    assert len(seen) == 1, "showing options asks for none"
    panel.show_layers(4, 2)
    settle(server)
    assert panel.layer.value == "layer 3"
    panel.layer.value = "layer 1"
    settle(server)
    assert layers[-1] == 0
    panel.show_legend(colour_tokens(), 4, truth=True)
    assert "layer 4" in panel.legend.content
    assert "truth" in panel.legend.content


class RunWishes:
    """What the run's panel asks of the tracking process about its pace."""

    def __init__(self) -> None:
        self.paces: list[float] = []
        self.unable: StudioError | None = None

    def set_pace(self, seconds_a_layer: float) -> None:
        if self.unable is not None:
            raise self.unable
        self.paces.append(seconds_a_layer)


def choose_pace(panel: RunPanel, label: str) -> None:
    panel.pace._impl.value = label
    for callback in panel.pace._impl.update_cb:
        asyncio.run(callback(SimpleNamespace(target=panel.pace)))


def test_the_searchs_pace_is_chosen_and_followed(server: GuardedServer) -> None:
    wishes, refusals = RunWishes(), []
    panel = RunPanel(
        server.gui, server.gui.add_folder("run"), cast(Wishes, wishes), cast(Transport, None), refusals.append
    )
    assert panel.pace.options == ("full speed", "10 layers/s", "3 layers/s", "1 layer/s")
    assert panel.pace.value == "full speed"
    choose_pace(panel, "3 layers/s")
    assert wishes.paces == [pytest.approx(1.0 / 3.0)]

    # What the process says is shown and not asked for again, also a speed that is none of the choices.
    for seconds, words in ((wishes.paces[0], "3 layers/s"), (0.05, "20 layers/s"), (0.0, "full speed")):
        panel.show_pace(seconds)
        settle(server)
        assert panel.pace.value == words
        assert words in panel.pace.options
    assert len(panel.pace.options) == 4
    assert len(wishes.paces) == 1

    # Refused: told, and put back.
    wishes.unable = RunError("The tracking process has died.", "Resume.")
    choose_pace(panel, "1 layer/s")
    assert refusals == [wishes.unable]
    assert panel.pace.value == "full speed"


def test_the_runs_status_in_words() -> None:
    state = StateChanged("walk", "run 7", "tracking", 128, 3, 0, 450, 128, 41.234, 8.2)
    text = status_html(state)
    assert "walk / run 7" in text
    assert "41.2 fps" in text
    assert "0:08 left" in text
    lost = StateChanged(
        "walk", "run 7", "lost", 128, 3, 0, 450, 128, math.nan, math.nan, "It died.", "Resume."
    )
    assert "It died." in status_html(lost)
    assert "No run" in status_html(None)
    assert clock(3725) == "1:02:05"


def test_tracks_are_offered_where_there_are_more_than_the_search_found(server: GuardedServer) -> None:
    tab, wishes = server.gui.add_tab_group().add_tab("Show"), []
    panel = ShowPanel(server.gui, tab, wishes.append, lambda _: None)
    panel.offer_tracks(("raw",))
    assert not panel.track.visible
    panel.offer_tracks(("raw", "refined", "smoothed"))
    assert panel.track.visible
    assert panel.track.options == ("raw", "refined", "smoothed")
    panel.track._impl.value = "smoothed"
    for callback in panel.track._impl.update_cb:
        asyncio.run(callback(SimpleNamespace(target=panel.track)))
    assert wishes == [{"track": "smoothed"}]
    panel.offer_tracks(("raw", "refined"))
    assert panel.track.value == "raw"
