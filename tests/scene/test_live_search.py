"""The search as events tell it, and what it makes of a moment."""

from pathlib import Path

import numpy as np
from scene_fakes import FakeControl
from swaying_session import LAYERS, cloud_record, frame_result, swaying_pose

from studio.body.model import BodyModel
from studio.scene.live_search import LiveSearch
from studio.scene.moment import moment_of
from studio.scene.opened_run import OpenedRun
from studio.scene.wishes import Wishes
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.worker import commands
from studio.worker.events import Acknowledged, FrameFinished, LayerFinished


def after(*events: LayerFinished | FrameFinished) -> LiveSearch:
    live = LiveSearch()
    for event in events:
        live = live.after(event)
    return live


def layer(body: BodyModel, frame: int, number: int, reannealed: bool = False) -> LayerFinished:
    return LayerFinished("s", "r", cloud_record(body, frame, number), reannealed)


def test_layers_collect_until_another_search_begins(human: BodyModel) -> None:
    first = after(layer(human, 3, 0), layer(human, 3, 1))
    assert [record.layer for record in first.records] == [0, 1]
    np.testing.assert_array_equal(first.pose, swaying_pose(human, 3))
    again = first.after(layer(human, 3, 0))
    assert [record.layer for record in again.records] == [0], "the first frame is searched several times"
    asked = first.after(layer(human, 3, 2, reannealed=True))
    assert asked.reannealed
    assert [record.layer for record in asked.records] == [2]
    assert after(layer(human, 3, 0), layer(human, 4, 1)).frame == 4


def test_a_result_keeps_the_layers_it_came_from(human: BodyModel) -> None:
    done = after(layer(human, 3, 0), FrameFinished("s", "r", frame_result(human, 3, 50.0)))
    assert len(done.records) == 1
    assert done.pose is not None
    assert done.pose[4] == swaying_pose(human, 3)[4] + 50.0
    assert after(layer(human, 2, 0), FrameFinished("s", "r", frame_result(human, 3))).records == ()


def test_moments(stored: tuple[Session, StoredRun], human: BodyModel) -> None:
    opened = OpenedRun(*stored)
    plain = moment_of(opened, 2, LiveSearch())
    np.testing.assert_array_equal(plain.pose, swaying_pose(human, 2))
    assert (plain.beside, plain.layer_count, len(plain.records)) == (None, LAYERS, LAYERS)
    assert plain.truth is not None
    assert opened.truth_at(99) is None
    asked = after(layer(human, 2, 0, True), FrameFinished("s", "r", frame_result(human, 2, 80.0), True))
    beside = moment_of(opened, 2, asked)
    np.testing.assert_array_equal(beside.beside, swaying_pose(human, 2))
    assert moment_of(opened, 1, asked).beside is None
    making = moment_of(opened, 5, after(layer(human, 5, 1)), layers=7)
    assert (len(making.records), making.layer_count) == (1, 7)
    edited = moment_of(opened, 2, asked, edited=human.neutral)
    np.testing.assert_array_equal(edited.pose, human.neutral)
    assert len(edited.records) == 0
    opened.close()


def test_only_answers_to_own_commands_are_taken() -> None:
    control = FakeControl("s", "r", "paused")
    wishes = Wishes(control)
    identifier = wishes.change_settings({"survival": 0.3}, Path("s"), Path("r"), None)
    assert [type(command) for command in control.commands] == [commands.ChangeSettings]
    assert wishes.settled(Acknowledged("s", "r", "another", "Start", False, "No.", "")) is None
    answer = wishes.settled(Acknowledged("s", "r", identifier, "ChangeSettings", False, "No.", "Yes."))
    assert answer is not None
    assert answer[0] == identifier
    assert str(answer[1]) == "No. Yes."
    assert wishes.settled(Acknowledged("s", "r", identifier, "ChangeSettings", True)) is None


def test_a_frame_is_not_selected_while_tracking() -> None:
    control = FakeControl("s", "r", "tracking")
    Wishes(control).change_settings({"survival": 0.3}, Path("s"), Path("r"), 4)
    assert [type(command) for command in control.commands] == [commands.ChangeSettings]
