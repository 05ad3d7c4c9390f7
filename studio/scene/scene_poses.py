"""Poses that the page lays before the scene's viewers, and what becomes of them."""

from collections.abc import Sequence

import numpy as np

from studio.scene.director import Director
from studio.scene.pose_desk import Editing
from studio.scene.proposal import EditWish, Proposal


class ScenePoses:
    """May be used from any thread."""

    def __init__(self, director: Director) -> None:
        self._director = director

    @property
    def editing(self) -> Editing | None:
        """What is being edited now, None while nothing is."""
        return self._director.posing.editing

    def propose(self, session: str, pose: Sequence[float], said: str, frame: int | None = None) -> None:
        """Show a start pose (D,) that was found for a session. said : how sure it is, for the viewers. frame : that it
        was found in.
        """
        self._director.propose(Proposal(session, np.array(pose, dtype=np.float64), said, frame))

    def edit(
        self, session: str, run: str = "", frame: int | None = None, pose: Sequence[float] | None = None
    ) -> None:
        """Let the viewers edit a session's start pose, or the right pose of a run's frame. pose : (D,) to begin
        with, or to go on with where that is being edited already; None: the one that is shown there.
        """
        given = None if pose is None else np.array(pose, dtype=np.float64)
        self._director.edit(EditWish(True, session, run, frame, given))

    def leave(self) -> None:
        """Leave off editing."""
        self._director.edit(EditWish(False))
