"""The catalogue of experiments: names, nearest names, and trials that can be stored."""

import pickle
from types import SimpleNamespace

import pytest
from toy_experiments import toy

from studio.foundations.errors import NotFoundError
from studio.garden.reproduction.catalogue import EXPERIMENTS, by_name, find_experiments
from studio.garden.reproduction.plan import each_once, footage_needed, frames_of, plan, scale_of
from studio.results.comparison.kept_trials import plain
from studio.results.drawing_footage.recipe_file import recipe_names


def test_names_are_found(tmp_path) -> None:
    known = {
        name: toy(name, tmp_path) for name in ("deutscher-fig-8", "deutscher-fig-9", "fleischmann-table-2")
    }
    assert find_experiments("all", known) == tuple(known.values())
    assert find_experiments("deutscher-fig-9", known) == (known["deutscher-fig-9"],)
    with pytest.raises(NotFoundError, match="deutscher-fig-8") as refused:
        find_experiments("deutscher-fig8", known)
    assert "studio reproduce list" in refused.value.hint
    with pytest.raises(NotFoundError) as refused:
        find_experiments("zzz", known)
    assert "Did you mean" not in refused.value.hint


def test_names_are_taken_once(tmp_path) -> None:
    first, second = toy("one", tmp_path), toy("two", tmp_path)
    assert list(by_name((first, second))) == ["one", "two"]
    with pytest.raises(ValueError, match="'one' is taken"):
        by_name((first, first))
    with pytest.raises(ValueError, match="taken"):
        by_name((toy("trials", tmp_path),))


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_can_be_planned_and_kept(name: str) -> None:
    experiment = EXPERIMENTS[name]
    assert experiment.claim
    assert experiment.title
    assert experiment.source
    assert set(experiment.footage) <= set(recipe_names())
    quick, full = plan(experiment, scale_of(quick=True)), plan(experiment, scale_of())
    assert not quick.problem
    assert 0 < len(quick.jobs) <= len(full.jobs)
    assert len(each_once([full])) == len(full.jobs), "two trials of one experiment are the same"
    assert len({job.label for job in full.jobs}) == len(full.jobs), "two trials have the same label"
    if name != "shadow-test":  # which draws its pictures itself
        for job in full.jobs:
            assert opened(job.arguments) <= set(job.footage), "a trial's footage would not be rendered"
    for job in quick.jobs:
        if name.startswith("deutscher-") and experiment.footage:
            # A preview renders less than a second of each footage.
            assert job.frames is not None
            assert 1 <= job.frames <= 48
        assert plain(job.arguments) == job.arguments
        assert pickle.loads(pickle.dumps(job)) == job


def opened(arguments: object) -> set[str]:
    """The recipes whose sessions a trial opens."""
    if not isinstance(arguments, dict):
        return set()
    own = {arguments.get(key) for key in ("clip", "footage")} & set(recipe_names())
    return own.union(*(opened(value) for value in arguments.values()))


def test_only_used_frames_are_needed(tmp_path) -> None:
    assert frames_of({"footage": "walk", "last": 90}) == 90
    assert frames_of({"footage": "walk", "last": None}) is None
    assert frames_of({"attempt": {"last": 30}, "other": {"last": 50}}) == 50
    assert frames_of({"attempt": {"last": 30}, "changes": {"layers": 3}}) == 30
    assert frames_of({"attempt": {"last": 30}, "other": {"last": None}}) is None
    assert frames_of({"seed": 1}) is None
    jobs = [
        SimpleNamespace(footage=footage, frames=frames)
        for footage, frames in ((("a",), 10), (("a", "b"), 30), (("b",), None), (("b",), 5), ((), None))
    ]
    assert footage_needed(jobs) == {"a": 30, "b": None}  # pyright: ignore[reportArgumentType]
