"""Poses that the page lays before the scene's viewers, and what becomes of them."""

from collections.abc import Callable, Sequence

import numpy as np

from studio.scene.director import Director
from studio.scene.pose_desk import Editing
from studio.scene.proposal import EditWish, Proposal


class ScenePoses:
    """May be used from any thread; while the scene is not running nothing happens."""

    def __init__(self, director: Callable[[], Director | None]) -> None:
        self._director = director

    @property
    def editing(self) -> Editing | None:
        """What is being edited now, None while nothing is."""
        director = self._director()
        return None if director is None else director.posing.editing

    def propose(self, session: str, pose: Sequence[float], said: str, frame: int | None = None) -> None:
        """Show a start pose (D,) that was found for a session. said : how sure it is, for the viewers. frame : that it
        was found in.
        """
        director = self._director()
        if director is not None:
            director.propose(Proposal(session, np.array(pose, dtype=np.float64), said, frame))

    def edit(
        self, session: str, run: str = "", frame: int | None = None, pose: Sequence[float] | None = None
    ) -> None:
        """Let the viewers edit a session's start pose, or the right pose of a run's frame. pose : (D,) to begin
        with, or to go on with where that is being edited already; None: the one that is shown there.
        """
        director = self._director()
        if director is not None:
            given = None if pose is None else np.array(pose, dtype=np.float64)
            director.edit(EditWish(True, session, run, frame, given))

    def leave(self) -> None:
        """Leave off editing."""
        director = self._director()
        if director is not None:
            director.edit(EditWish(False))
