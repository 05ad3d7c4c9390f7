"""The scene's model: plain functions of what is shown and what happened."""

import dataclasses
import math

import numpy as np
import pytest
from swaying_session import FPS, LAYERS, cloud_record, frame_result, swaying_pose

from studio.app.scene import model as scene
from studio.app.scene.controller import is_annealed_again
from studio.app.scene.model import LiveSearch, Model, Playback, Selection, ViewOptions
from studio.app.scene.pose_edit import edit_of
from studio.body.dragging import Dragger
from studio.body.mirroring import Mirror
from studio.body.model import BodyModel
from studio.operations.jobs.events import (
    Event,
    FrameFinished,
    LayerFinished,
    RunState,
    SettingsApplied,
    StateChanged,
)
from studio.search.settings import changed_settings, default_settings

FRAMES = tuple(range(5))
NOTHING = StateChanged("", "", RunState.IDLE, 0, 0, 0, 0, 0, math.nan, math.nan)
TRACKING = StateChanged("s", "r", RunState.TRACKING, 4, 0, 0, 6, 5, math.nan, math.nan)
PAUSED = dataclasses.replace(TRACKING, state=RunState.PAUSED)


@pytest.fixture
def shown(human: BodyModel) -> Model:
    """Run "r" of session "s", frames 0 to 4 of 6, paused."""
    subject = scene.Subject(human, ("cam1", "cam2"), (0, 6), FPS, Dragger(human), Mirror(human))
    edit = edit_of(swaying_pose(human, 0))
    return scene.opened(Model(PAUSED), "s", "r", subject, FRAMES, default_settings(), edit)


def layer(body: BodyModel, frame: int, number: int, reannealed: bool = False) -> LayerFinished:
    return LayerFinished("s", "r", cloud_record(body, frame, number), reannealed)


def finished(body: BodyModel, frame: int, reannealed: bool = False, shift: float = 0.0) -> FrameFinished:
    return FrameFinished("s", "r", frame_result(body, frame, shift), reannealed)


def after(model: Model, *events: Event) -> Model:
    for event in events:
        model = scene.hear(model, event, model.frames)
    return model


def live_after(*events: LayerFinished | FrameFinished) -> LiveSearch:
    live = LiveSearch()
    for event in events:
        live = scene.searched_on(live, event)
    return live


def knob(model: Model, name: str = "survival") -> object:
    return model.knobs.shown[name]


# What is selected.


def test_how_the_search_of_another_run_goes_is_not_drawn(shown: Model) -> None:
    elsewhere = [dataclasses.replace(TRACKING, run="other", done=done) for done in (1, 2)]
    one = scene.opened(after(shown, elsewhere[0]), "s", "r", shown.subject, FRAMES, default_settings())
    assert scene.same_drawing(one, after(one, elsewhere[1]))
    assert not scene.same_drawing(one, after(one, PAUSED)), "its own run was opened"
    assert not scene.same_drawing(shown, after(shown, TRACKING))
    assert not scene.same_drawing(one, after(one, dataclasses.replace(elsewhere[1], state=RunState.LOST)))
    assert not scene.same_drawing(one, scene.select(after(one, elsewhere[1]), frame=0))


def test_a_run_is_opened_at_its_newest_frame(shown: Model) -> None:
    assert shown.selection == Selection("s", "r", 4)
    moved = scene.select(scene.set_playback(shown, True), follow=False, layer=2, look_through="cam1")
    again = scene.opened(moved, "s", "other", shown.subject, (), default_settings())
    assert again.selection == Selection("s", "other", None, follow=False)
    assert not again.playback.playing


def test_a_particle_goes_with_its_frame_and_layer_and_the_rest_of_the_selection_stays(shown: Model) -> None:
    chosen = scene.select(shown, layer=1, particle=7, limb="head", parameter="left_knee", camera="cam2")
    assert chosen.selection.particle == 7
    moved = scene.show_frame(chosen, 2)
    wanted = dataclasses.replace(chosen.selection, frame=2, particle=None)
    assert moved.selection == wanted
    assert scene.select(chosen, layer=2).selection.particle is None
    assert scene.show_frame(chosen, 4).selection.particle == 7, "the frame that is shown already"
    assert scene.select(chosen, layer=1) is not shown
    assert scene.select(shown, follow=True) is shown, "what is so already changes nothing"


@pytest.mark.parametrize(("wanted", "found"), [(2, 2), (99, 4), (-1, 0), (None, 4)])
def test_a_frame_that_is_not_stored_is_the_nearest(shown: Model, wanted: int | None, found: int) -> None:
    assert scene.show_frame(shown, wanted).selection.frame == found
    assert scene.show_frame(Model(NOTHING), wanted).selection.frame is None


def test_going_back_while_tracking_stops_following(shown: Model) -> None:
    assert scene.show_frame(shown, 0).selection.follow, "nothing is tracked"
    tracked = after(shown, TRACKING)
    assert not scene.show_frame(tracked, 1).selection.follow
    assert scene.show_frame(tracked, 3).selection.follow, "one of the newest"


def test_cameras_are_looked_through_and_left(shown: Model) -> None:
    once = scene.camera_clicked(shown, "cam2")
    assert (once.selection.camera, once.selection.look_through) == ("cam2", None), "one click only chooses it"
    assert scene.camera_clicked(once, "cam2").selection.camera is None
    through = scene.camera_clicked(once, "cam2", twice=True)
    assert (through.selection.camera, through.selection.look_through) == ("cam2", "cam2")
    assert scene.camera_clicked(through, "cam2") is through, "its picture is the whole background then"
    assert scene.camera_clicked(through, "cam2", twice=True).selection.look_through is None
    assert scene.look_through(through, "no such camera") is through
    assert scene.look_through(through, None).selection.look_through is None


def test_options_change_one_by_one(shown: Model) -> None:
    light = scene.change_options(scene.change_options(shown, {"dark": False}), {"colour_by": "weight"})
    assert light.options == ViewOptions(dark=False, colour_by="weight")
    assert scene.change_options(light, {"dark": False}) is light
    added = scene.tick_listed(light, "overlays", "mask", True)
    assert added.options.overlays == ("outline", "mask")
    assert scene.tick_listed(added, "overlays", "outline", False).options.overlays == ("mask",)
    tips = shown.subject.listed("limbs", light.options)
    fewer = scene.tick_listed(light, "limbs", "head", False)
    assert fewer.options.limbs == tuple(name for name in tips if name != "head")
    assert set(shown.subject.listed("trail_markers", light.options)) >= {"LWrist", "Head"}
    assert len(shown.subject.chosen_limbs(fewer.options)) == len(tips) - 1


# Playing.


@pytest.mark.parametrize(("speed", "ticks", "frame"), [(1.0, 12, 6), (0.25, 48, 6), (4.0, 3, 6)])
def test_time_shows_frames_at_the_speed_and_nothing_is_lost_between_ticks(
    speed: float, ticks: int, frame: int
) -> None:
    playback, shown = Playback(True, speed), 0
    for _ in range(ticks):
        playback, shown = scene.played(playback, 0.5, shown, range(10))
    assert shown == frame


def test_the_end_starts_over_or_stops() -> None:
    assert scene.played(Playback(True, loop=True), 2.0, 9, range(10))[1] == 1
    held, frame = scene.played(Playback(True, loop=False), 2.0, 9, range(10))
    assert (held.playing, frame) == (False, 9)
    assert scene.played(Playback(True), 1.0, 2, [0, 2, 5])[1] == 5, "gaps are stepped over"
    assert scene.played(Playback(True), 1.0, None, []) == (Playback(True), None)


def test_playing_moves_the_frame(shown: Model) -> None:
    assert scene.advance(shown, 1.0) is shown
    playing = scene.set_playback(scene.show_frame(shown, 0), True, speed=0.5, loop=False)
    for _ in range(4):
        playing = scene.advance(playing, 1.0 / FPS)
    assert playing.selection.frame == 2
    stopped = scene.set_playback(playing, False)
    assert stopped.playback == Playback(False, 0.5, False)


# Playing layers.


def layers_shown(model: Model, times: int, seconds: float = 0.25, count: int = LAYERS) -> list[int | None]:
    shown = []
    for _ in range(times):
        model = scene.advance_layers(model, seconds, count)
        shown.append(model.selection.layer)
    return shown


def test_layers_are_played_one_after_another_and_start_over(shown: Model) -> None:
    assert scene.advance_layers(shown, 1.0, LAYERS) is shown
    playing = scene.set_layer_playback(shown, True, rate=4.0)
    assert layers_shown(playing, 6) == [0, 1, 2, 3, 0, 1]
    assert layers_shown(playing, 4, seconds=9.0) == [0, 1, 2, 3], "none is skipped, however late"
    assert layers_shown(playing, 6, count=2) == [0, 1, 0, 1, 0, 1], "of a frame in progress those so far"
    assert scene.advance_layers(playing, 1.0, 0) is playing
    # What is late with one layer is not lost for the next: ten layers take the time of ten.
    slow, moves = scene.set_layer_playback(playing, rate=10.0), 0
    before = slow.selection.layer
    for _ in range(60):
        slow = scene.advance_layers(slow, 1.0 / 30.0, LAYERS)
        moves += slow.selection.layer != before
        before = slow.selection.layer
    assert moves in (19, 20)


def test_a_ping_pong_turns_back_at_both_ends(shown: Model) -> None:
    playing = scene.set_layer_playback(shown, True, rate=4.0, mode="pingpong")
    assert layers_shown(playing, 12) == [0, 1, 2, 3, 3, 2, 1, 0, 0, 1, 2, 3]
    phases = []
    for _ in range(2 * LAYERS * 5):
        playing = scene.advance_layers(playing, 0.05, LAYERS)
        phases.append((playing.selection.layer or 0) + playing.layers.phase)
    steps = np.abs(np.diff(phases))
    assert steps.max() < 0.21, "the particles go back the way that they came"
    assert (
        layers_shown(scene.set_layer_playback(shown, True, rate=4.0, mode="pingpong"), 3, count=1) == [0] * 3
    )


def test_a_layer_chosen_by_hand_stops_the_layers_and_other_choices_do_not(shown: Model) -> None:
    playing = scene.advance_layers(scene.set_layer_playback(shown, True), 0.1, LAYERS)
    assert playing.layers.playing
    assert playing.layers.phase == pytest.approx(0.0)
    scrubbed = scene.scrub(playing, 2)
    assert (scrubbed.selection.layer, scrubbed.layers.playing, scrubbed.layers.phase) == (2, False, 1.0)
    assert scene.show_frame(playing, 2).layers.playing, "another frame's layers are played on"
    assert scene.select(playing, limb="head").layers.playing
    stopped = scene.set_layer_playback(playing, False)
    assert (stopped.selection.layer, stopped.layers.phase) == (0, 1.0)
    assert not scene.opened(playing, "s", "q", shown.subject, FRAMES, default_settings()).layers.playing
    assert scene.set_layer_playback(stopped, False) is stopped


def test_layers_that_are_played_pass_panel_and_pictures_by(shown: Model) -> None:
    playing = scene.advance_layers(scene.set_layer_playback(shown, True), 0.1, LAYERS)
    further = scene.advance_layers(playing, 0.1, LAYERS)
    assert scene.only_phase_differs(playing, further)
    assert not scene.same_drawing(playing, further)
    moved = scene.advance_layers(further, 1.0, LAYERS)
    assert moved.selection.layer == 1
    assert not scene.only_phase_differs(further, moved)
    assert scene.same_panel(playing, moved)
    assert scene.same_pictures(playing, moved)
    for other in (scene.show_frame(moved, 2), scene.change_options(moved, {"shells": False})):
        assert not scene.same_panel(moved, other)
    assert not scene.same_pictures(moved, scene.stop_layers(moved)), "one layer's clouds are on them then"
    assert playing.is_looking_at_layers
    assert not scene.scrub(playing, None).is_looking_at_layers


def test_frames_and_layers_are_not_played_at_once(shown: Model) -> None:
    layers = scene.set_layer_playback(scene.set_playback(shown, True), True)
    assert (layers.playback.playing, layers.layers.playing) == (False, True)
    frames = scene.set_playback(layers, True)
    assert (frames.playback.playing, frames.layers.playing) == (True, False)


# What is tracked.


def test_layers_collect_until_another_search_begins(human: BodyModel) -> None:
    first = live_after(layer(human, 3, 0), layer(human, 3, 1))
    assert [record.layer for record in first.records] == [0, 1]
    np.testing.assert_array_equal(first.pose, swaying_pose(human, 3))
    again = scene.searched_on(first, layer(human, 3, 0))
    assert [record.layer for record in again.records] == [0], "the first frame is searched several times"
    what_if = scene.searched_on(first, layer(human, 3, 2, reannealed=True))
    assert what_if.reannealed
    assert [record.layer for record in what_if.records] == [2]
    assert live_after(layer(human, 3, 0), layer(human, 4, 1)).frame == 4


def test_a_result_keeps_the_layers_it_came_from(human: BodyModel) -> None:
    done = live_after(layer(human, 3, 0), finished(human, 3, shift=50.0))
    assert len(done.records) == 1
    assert done.pose[4] == swaying_pose(human, 3)[4] + 50.0
    assert live_after(layer(human, 2, 0), finished(human, 3)).records == ()
    whole = live_after(*(layer(human, 3, number) for number in range(LAYERS)), finished(human, 3))
    assert [LiveSearch().is_whole, done.is_whole, whole.is_whole] == [False, False, True]


def test_the_frame_in_progress_is_followed_and_a_what_if_ends_with_its_frame(
    shown: Model, human: BodyModel
) -> None:
    tracked = after(shown, TRACKING, layer(human, 5, 0))
    assert tracked.selection.frame == 5
    assert after(scene.select(shown, follow=False), layer(human, 5, 0)).selection.frame == 4
    done = scene.hear(tracked, finished(human, 5), (*FRAMES, 5))
    assert done.frames == (*FRAMES, 5)
    what_if = after(scene.show_frame(shown, 2), layer(human, 2, 0, True), finished(human, 2, True))
    assert what_if.frames == FRAMES
    assert what_if.live.reannealed
    assert not scene.show_frame(what_if, 3).live.reannealed
    assert scene.show_frame(what_if, 2).live.reannealed
    foreign = LayerFinished("s", "another", cloud_record(human, 1, 0))
    assert after(shown, foreign) is shown


def test_a_frame_is_annealed_again_from_the_moved_knob_on(shown: Model, human: BodyModel) -> None:
    asked = scene.request(shown, "one", {"survival": 0.7})
    first = after(shown, layer(human, 4, 0, True))
    whole = after(first, finished(human, 4, True))
    assert [is_annealed_again(one) for one in (shown, asked, first, whole)] == [False, True, True, True]
    assert not is_annealed_again(scene.show_frame(whole, 3))
    assert not is_annealed_again(after(asked, TRACKING)), "what is tracked is drawn as it comes"


def test_pictures_are_drawn_anew_for_results_and_not_for_layers(shown: Model, human: BodyModel) -> None:
    one = after(shown, layer(human, 4, 0))
    assert scene.same_pictures(shown, one)
    assert not scene.same_pictures(shown, after(one, finished(human, 4)))
    for other in (
        scene.show_frame(shown, 2),
        scene.change_options(shown, {"overlays": ()}),
        after(shown, SettingsApplied("s", "r", 2, 1, 0, {"survival": 0.7})),
    ):
        assert not scene.same_pictures(shown, other)


# Knobs.


def test_the_newest_request_is_shown_until_it_is_answered(shown: Model) -> None:
    default = knob(shown)
    requested = scene.request(scene.request(shown, "one", {"survival": 0.7}), "two", {"survival": 0.4})
    assert knob(requested) == 0.4
    taken = scene.settle(requested, "one", True)
    applied = after(taken, SettingsApplied("s", "r", 2, 1, 0, {"survival": 0.7}))
    assert knob(applied) == 0.4, "an older answer does not pull the slider back"
    assert knob(scene.settle(applied, "two", True)) == 0.4
    assert knob(scene.settle(applied, "two", False)) == 0.7
    assert knob(scene.settle(scene.settle(requested, "two", False), "one", False)) == default
    assert scene.settle(shown, "of another window", False) is shown


def test_half_written_text_stays_until_settings_are_applied(shown: Model) -> None:
    texts = {"survival_per_layer": "0.6, 0.", "survival": 0.7}
    refused = scene.settle(scene.request(shown, "one", texts), "one", False)
    assert knob(refused, "survival_per_layer") == "0.6, 0."
    assert knob(refused) == knob(shown)
    more = scene.request(refused, "two", {"survival_per_layer": "0.6, 0.5"})
    assert knob(scene.settle(more, "two", True), "survival_per_layer") == "0.6, 0.5"
    assert knob(after(refused, SettingsApplied("s", "r", 2, 1, 0, {})), "survival_per_layer") == ""


def test_what_is_in_use_and_since_when(shown: Model) -> None:
    applied = after(shown, SettingsApplied("s", "r", 2, 128, 2, {"survival": 0.7}, ("survival",)))
    assert applied.knobs.since == (128, 2)
    assert knob(applied) == 0.7
    other = scene.request(applied, "one", {"survival": 0.2})
    again = scene.opened(other, "s", "q", shown.subject, (), default_settings())
    assert again.knobs.since is None
    assert knob(again) == knob(shown), "what was requested was about the run before"
    assert "one" in again.knobs.requested, "its refusal is reported anyway"
    assert knob(after(other, dataclasses.replace(PAUSED, state=RunState.LOST))) == 0.7
    assert changed_settings(default_settings(), {"survival": 0.7}) == applied.knobs.settings


# Editing.


def test_editing_ends_when_the_shown_run_begins_to_be_tracked(shown: Model) -> None:
    def begun(model: Model) -> Model:
        return scene.edit_pose(model, lambda edit: dataclasses.replace(edit, active=True))

    editing = begun(shown)
    assert editing.selection.editing
    assert editing.edited_pose is not None
    assert after(editing, dataclasses.replace(TRACKING, run="another")).selection.editing
    ended = after(editing, TRACKING)
    assert not ended.selection.editing
    assert ended.edited_pose is None
    assert after(begun(ended), TRACKING).selection.editing, "whoever begins while it goes on is left to it"
    assert not scene.edit_pose(Model(NOTHING), lambda edit: edit).selection.editing
