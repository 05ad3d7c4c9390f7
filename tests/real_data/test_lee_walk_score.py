"""The benchmark's own score of what the filter finds on its own data, beside the C++ program's.

The start pose scores 0.3068; the C++ program reaches 0.2955 to 0.2993 with 5 × 1000 evaluations.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from studio.runs.problem_source import ProblemSource
from studio.runs.search_space import search_space
from studio.search.likelihood.bodytrack import score
from studio.search.settings import changed_settings, default_settings
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.frame_loop import search_frame
from studio.search.trackers.tracker import start_of
from studio.sessions.importers.importing import import_source
from studio.sessions.session import Session

pytestmark = pytest.mark.real_data

SEEDS = range(10)
BEST_OF_CPP = 0.2955
PLANNED = {"particles": 200, "adaptive_diffusion": False, "crossover": 0.0}


class LeeWalk:
    """The first frame of the Lee walk, searched once from the initial pose."""

    def __init__(self, folder: Path) -> None:
        self.session = Session(folder)
        self.body = self.session.body()
        sigma = self.session.sigma(self.session.manifest.fps, self.body)
        assert sigma is not None
        self.space = search_space(self.body, sigma)
        self.start = self.session.start_pose(self.body)
        assert self.start is not None
        settings = default_settings("annealed", "bodytrack")
        source = ProblemSource(self.session, self.body)
        self.problem, self.evidence = source.problem(0, settings), source.evidence(0, settings)
        source.close()

    def score_of(self, pose: np.ndarray) -> float:
        return score(self.body, self.session.cameras(), self.evidence, pose).total

    def found(self, changes: Mapping[str, object]) -> np.ndarray:
        """(10,) scores of the estimates of ten seeds."""
        assert self.start is not None
        settings = changed_settings(default_settings("annealed", "bodytrack"), changes).tracker
        results = [
            search_frame(
                TRACKERS["annealed"],
                self.problem,
                start_of(tuple(self.start)),
                self.space,
                seed=seed,
                frame=0,
                settings_source=lambda: (1, settings),
            )
            for seed in SEEDS
        ]
        return np.array([self.score_of(result.estimate.pose) for result in results])


@pytest.fixture(scope="module")
def lee_walk(real_data: Path, tmp_path_factory: pytest.TempPathFactory) -> LeeWalk:
    place = tmp_path_factory.mktemp("lee") / "lee-walk"
    import_source(real_data / "lee-walk", place)
    return LeeWalk(place)


def test_the_initial_pose_has_the_printed_score(lee_walk: LeeWalk) -> None:
    assert lee_walk.start is not None
    assert lee_walk.score_of(lee_walk.start) == pytest.approx(0.30678, abs=1e-5)


def test_the_filter_beats_the_benchmark_and_eq_13(lee_walk: LeeWalk) -> None:
    improved = lee_walk.found({"particles": 200})
    planned = lee_walk.found(PLANNED)
    many = lee_walk.found({"layers": 5, "particles": 1000})
    for name, scores in (("10 × 200", improved), ("10 × 200, Eq. 13", planned), ("5 × 1000", many)):
        print(f"\n{name:18} {np.round(scores, 4)} mean {scores.mean():.4f} worst {scores.max():.4f}")
    assert improved.max() < BEST_OF_CPP, "the worst seed beats the best run"
    assert improved.mean() <= 0.290
    # One of ten seeds may go the other way: a sign test's 1 %.
    assert (improved < planned).sum() >= 9
    assert many.mean() < BEST_OF_CPP
