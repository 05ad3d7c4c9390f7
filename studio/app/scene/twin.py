"""Two scenes of one window beside each other: the stored frame in one, a trial of it in the other, seen alike.

Whatever is chosen in either is chosen in both; what is drawn, and where layers are played, is said by the leading
scene, which has the controls. A viewer's place goes from scene to scene as it moves, and waits for neither to be drawn.
"""

import time
from collections import deque
from dataclasses import replace

import numpy as np

from studio.app.scene.model import LiveSearch, Model

CHOSEN = ("limb", "parameter", "particle", "camera", "look_through", "eye")
SEEN = ("frame", "layer", *CHOSEN)
OWN_OPTIONS = ("trials", "stored")
ECHO_SECONDS, ECHO_METRES = 3.0, 0.02
"""How long, and how nearly, a browser may answer with the place that it was put to."""

Eye = tuple[float, ...]


def following(model: Model, leader: Model) -> Model:
    """The follower's model after a change of the leader's; each keeps whether it shows trials."""
    own = {name: getattr(model.options, name) for name in OWN_OPTIONS}
    return replace(
        model,
        selection=replace(model.selection, **{name: getattr(leader.selection, name) for name in SEEN}),
        options=replace(leader.options, **own),
        layers=replace(leader.layers, playing=False),
        ghosts=leader.ghosts,
    )


def joining(model: Model, follower: Model) -> Model:
    """The leader's model after something was chosen in the follower."""
    chosen = {name: getattr(follower.selection, name) for name in CHOSEN}
    return replace(model, selection=replace(model.selection, **chosen))


def differ(before: Model, after: Model) -> bool:
    """Whether a change concerns the other scene."""
    return (
        before.selection != after.selection
        or before.options != after.options
        or before.layers != after.layers
        or before.ghosts is not after.ghosts
    )


def show_trial(model: Model, trial: LiveSearch) -> Model:
    """Show a trial in the place of its frame; without one what is stored."""
    return replace(model, live=trial)


class Places:
    """Where a scene's viewers were put lately, to tell their own moves from the browsers' answers.

    is_reached : whether they stood where they were put; what they said before was not of their own choice.
    """

    def __init__(self) -> None:
        self._put: deque[tuple[float, Eye]] = deque(maxlen=128)
        self._said: Eye | None = None
        self.is_reached = False

    def note(self, eye: Eye) -> None:
        """Viewers were put there: place and what is looked at (6,) metres."""
        self._put.append((time.monotonic(), eye))
        self.is_reached |= self._said is not None and _is_near(self._said, eye)

    def is_echo(self, eye: Eye) -> bool:
        """Whether a viewer, who says that it is there, is only where it was put: last, or a moment ago."""
        self._said = eye
        put = tuple(self._put)
        near = [when for when, place in put if _is_near(eye, place)]
        self.is_reached |= bool(near)
        return bool(near) and (near[-1] == put[-1][0] or near[-1] > time.monotonic() - ECHO_SECONDS)


def _is_near(eye: Eye, place: Eye) -> bool:
    return np.allclose(eye, place, atol=ECHO_METRES)
