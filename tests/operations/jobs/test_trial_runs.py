"""A comparison's trial as a stored run: made once, and its errors are the trial's."""

import shutil

import pytest
from sample_walk import copy_of_walk
from tracked_runs import finish

from studio.body.motion_files.trc import read_trc
from studio.foundations.errors import NotFoundError
from studio.foundations.progress import no_progress
from studio.operations.comparison_folders import new_comparison, place_of
from studio.operations.jobs.comparison_run import run_comparison
from studio.operations.trial_runs import run_of_trial, trial_lines
from studio.results.comparison.candidates import Lineup
from studio.results.comparison.kept_comparison import KeptComparison
from studio.results.comparison.plan import conclude, plan_comparison
from studio.results.evaluation.errors import evaluate
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

FIRST, LAST = 2, 6
CHANGES = {"annealed:mine": {"survival": 0.4}}


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """The bundled walk where it can be written to."""
    return copy_of_walk(tmp_path_factory.mktemp("workspace") / "walk")


@pytest.fixture(scope="module")
def kept(walk: Session) -> KeptComparison:
    """A finished comparison that begins after the session's start pose."""
    lineup = Lineup(("annealed:mine", "swarm"), "", 200, 3, CHANGES)
    made = new_comparison(
        place_of(walk, "small"), plan_comparison(walk, lineup, (3, 4), first=FIRST, last=LAST)
    )
    run_comparison(made, walk, no_progress, conclude, processes=1)
    return made


def errors_of(walk: Session, run: StoredRun) -> dict[int, float]:
    """The mean error of each frame's markers, mm."""
    assert walk.truth_path is not None
    with run.results() as results:
        frames, poses = results.poses()
    found = evaluate(poses, frames, run.body(), read_trc(walk.truth_path), walk.manifest.fps)
    return dict(zip(found.frames, found.per_frame_mm, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize(("tracker", "seed"), [("annealed:mine", 4), ("swarm", 3)])
def test_the_run_of_a_trial_has_its_errors(
    walk: Session, kept: KeptComparison, tracker: str, seed: int
) -> None:
    [line] = [one for one in trial_lines(walk, kept) if (one.tracker, one.seed) == (tracker, seed)]
    assert line.run == ""
    run = run_of_trial(walk, kept, tracker, seed)
    finish(walk, run)
    result = kept.result()
    wanted = result["per_frame"]["error_mm"][tracker][[3, 4].index(seed)]
    found = errors_of(walk, run)
    assert [found[frame] for frame in range(FIRST, LAST)] == pytest.approx(wanted, abs=2e-3)
    assert found[line.worst_frame] == pytest.approx(line.worst_mm, abs=2e-3)
    # It is made once, and known by what it is of, whatever its name.
    assert run_of_trial(walk, kept, tracker, seed).name == run.name
    [again] = [one for one in trial_lines(walk, kept) if one.run]
    assert (again.tracker, again.seed, again.run) == (tracker, seed, run.name)
    run.folder.rename(run.folder.with_name("renamed"))
    assert run_of_trial(walk, kept, tracker, seed).name == "renamed"
    shutil.rmtree(walk.path / "runs" / "renamed")


def test_what_is_no_trial_is_refused_with_those_that_are(walk: Session, kept: KeptComparison) -> None:
    for tracker, seed in (("annealed", 3), ("swarm", 9)):
        with pytest.raises(NotFoundError, match="annealed:mine, swarm, seeds 3 to 4"):
            run_of_trial(walk, kept, tracker, seed)
