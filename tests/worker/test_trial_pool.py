"""Which process takes which trial, and how long is left."""

from toy_experiments import measure

from studio.comparison.kept_trials import KeptOutcome
from studio.comparison.trials import TrialJob
from studio.reproduction.runner import TrialPace
from studio.worker.trial_pool import next_job


def job(key: str, footage: str = "", alone: bool = False) -> TrialJob:
    return TrialJob(key, "toy", key, {}, measure, (footage,) if footage else (), None, alone)


def test_a_process_stays_with_its_footage() -> None:
    waiting = [job("a", "walk"), job("b", "run"), job("c", "walk"), job("d", "box")]
    assert next_job(waiting, ("run",), [("walk",)]) == 1
    assert next_job(waiting, ("stand",), [("walk",), ("run",)]) == 3
    assert next_job(waiting, (), []) == 0
    assert next_job(waiting[:1], ("run",), [("walk",)]) == 0


def test_the_time_left_is_that_of_trials_like_those_done() -> None:
    done = KeptOutcome({}, "", 10.0, "", "", "", {})
    jobs = {"a": job("a", "walk"), "b": job("b", "run"), "c": job("c", "run", alone=True)}
    pace = TrialPace(jobs, {}, processes=2)
    assert pace.left(jobs.values()) is None
    pace = TrialPace(jobs, {"a": done}, processes=2)
    assert pace.left([jobs["b"]]) == 5.0
    pace.took(jobs["b"], 30.0)
    assert pace.left([jobs["a"], jobs["b"], jobs["c"]]) == (10.0 + 30.0) / 2 + 30.0
