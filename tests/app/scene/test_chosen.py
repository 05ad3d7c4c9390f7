"""What is chosen in a scene, and what stands beside the answer: plain changes of the model."""

import numpy as np
from swaying_session import swaying_pose

from studio.app.scene.body_view import BodyView
from studio.app.scene.guarded_server import GuardedServer
from studio.app.scene.model import LiveSearch, Model, discard_what_if, limb_clicked, same_pictures, select
from studio.body.model import BodyModel
from studio.operations.jobs.events import RunState, StateChanged
from studio.results.evaluation.errors import limb_of_drawn, limb_of_markers
from studio.runs.drawing.colour_tokens import colour_tokens

DARK = colour_tokens(True)
IDLE = StateChanged("", "", RunState.IDLE)


def test_a_limb_is_chosen_and_let_go_by_a_click() -> None:
    model = limb_clicked(Model(IDLE), "left arm")
    assert model.selection.limb == "left arm"
    assert limb_clicked(model, "left arm").selection.limb is None


def test_a_viewer_s_place_changes_no_picture() -> None:
    model = Model(IDLE)
    moved = select(model, eye=(1.0, 2.0, 3.0, 0.0, 0.0, 1.0))
    assert moved.selection.eye == (1.0, 2.0, 3.0, 0.0, 0.0, 1.0)
    assert same_pictures(model, moved)
    assert not same_pictures(model, select(model, limb="left arm"))


def test_only_a_what_if_is_discarded() -> None:
    going = LiveSearch(frame=3)
    assert discard_what_if(Model(IDLE, live=going)).live is going
    asked = Model(IDLE, live=LiveSearch(frame=3, reannealed=True))
    assert discard_what_if(asked).live.frame is None


def test_the_chosen_limb_stands_out(server: GuardedServer, human: BodyModel) -> None:
    view = BodyView(server, human, name="/chosen")
    owner = limb_of_drawn(human)
    assert set(owner.values()) <= set(limb_of_markers(human).values())
    view.show(swaying_pose(human, 0), DARK, 1.0, "left arm")
    for handle, limb in zip(view.handles, human.drawn, strict=True):
        assert (handle.opacity is None) == (owner[limb.name] == "left arm")
    view.show(swaying_pose(human, 0), DARK)
    assert all(handle.opacity is None for handle in view.handles)
    assert np.isfinite(view.handles[0].position).all()
