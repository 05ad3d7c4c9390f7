"""A clip with what a search of its frames needs, in memory, by the default likelihood."""

from collections.abc import Sequence

import numpy as np

from studio.foundations.arrays import Array
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.tracked import measured
from studio.runs.live.following import Following
from studio.runs.search_space import search_space, session_sigma
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.likelihood.problem import FrameLikelihood
from studio.search.settings import DEFAULT_WEIGHTING, RunSettings
from studio.search.trackers.tracker import start_of


class SearchedClip:
    """A clip. settings : of a tracker with the default likelihood."""

    def __init__(self, cache: FootageCache, clip: str, settings: RunSettings) -> None:
        self.cache, self.settings = cache, settings
        self.session = cache.session(clip)
        self.body, self.cameras = self.session.body(), self.session.cameras()
        sigma = session_sigma(self.session, self.body, self.session.manifest.fps)
        self.space = search_space(self.body, sigma)
        self.likelihood = WEIGHTINGS[DEFAULT_WEIGHTING].prepare(self.body, self.cameras, settings.weighting)

    def problem(self, frame: int) -> FrameLikelihood:
        """The likelihood of a frame."""
        chosen, knobs = WEIGHTINGS[DEFAULT_WEIGHTING], self.settings.evidence
        return self.likelihood.problem(
            self.cache.evidence(
                self.session, self.cameras, frame, knobs, chosen.edge_kind, chosen.reads_pictures
            )
        )

    def followed(self, seed: int) -> Following:
        """A run that begins in the session's start pose."""
        start = self.session.start_pose(self.body)
        return Following(
            self.settings, self.space, start_of(None if start is None else tuple(map(float, start))), seed
        )

    def errors(self, poses: Array, frames: Sequence[int]) -> list[float]:
        """Of each frame, mm from the true markers."""
        return measured(self.session, self.body, poses, np.array(frames), 0, 0.0).per_frame_mm
