"""The candidates of a comparison: names, labels, changes, equal evaluations."""

import pytest

from studio.cli.reading import read_assignments
from studio.foundations.errors import SettingsError, StudioError
from studio.results.comparison.candidates import LINEUPS, VARIANTS, Candidate, Lineup, candidates
from studio.search.settings import changed_settings, default_settings
from studio.search.trackers.catalogue import TRACKERS


def made(
    *names: str, changes: tuple[str, ...] = (), evaluations: int = 1000, layers: int = 10
) -> dict[str, Candidate]:
    """The candidates by name."""
    lineup = Lineup(names, "edge-region", evaluations, layers, read_assignments(changes))
    return {candidate.name: candidate for candidate in candidates(lineup)}


def test_all_candidates_have_equal_evaluations() -> None:
    found = made("annealed", "annealed:eq13", "condensation")
    assert list(found) == ["annealed", "annealed:eq13", "condensation"]
    for candidate in found.values():
        assert (
            TRACKERS[candidate.tracker].evaluations(candidate.settings().tracker)
            == candidate.evaluations
            == 1000
        )
    assert (found["annealed"].settings().tracker.layers, found["annealed"].settings().tracker.particles) == (
        10,
        100,
    )


def test_other_layers_keep_the_evaluations() -> None:
    found = made("annealed", "annealed:five", changes=("annealed:five.layers=5",))
    assert found["annealed:five"].settings().tracker.particles == 200
    assert made("annealed", layers=20)["annealed"].settings().tracker.particles == 50


@pytest.mark.parametrize("name", VARIANTS)
def test_a_known_label_implies_its_knobs(name: str) -> None:
    settings = made(name)[name].settings().tracker
    for knob, value in VARIANTS[name].changes.items():
        assert getattr(settings, knob) == value


def test_lineups_stand_for_their_members() -> None:
    for lineup, members in LINEUPS.items():
        assert tuple(made(lineup)) == members
    improved = made("improvements")
    assert improved["annealed:eq13"].settings().tracker.adaptive_diffusion is False
    assert improved["annealed:improved"].settings().tracker.crossover == 0.5


@pytest.mark.parametrize("evaluations", [1000, 2000, 4000])
def test_every_partition_of_the_swarm_weighs_as_many_poses(evaluations: int) -> None:
    for candidate in made("partitions", evaluations=evaluations).values():
        assert candidate.evaluations == pytest.approx(evaluations, rel=0.01)
        assert candidate.settings().tracker.partition in candidate.name or candidate.name == "swarm"


def test_changes_apply_to_the_named_candidate() -> None:
    changes = (
        "annealed.survival=0.5",
        "annealed:b.crossover=0",
        "diffusion_scale=2",
        "annealed:b.weighting=bodytrack",
    )
    found = made("annealed", "annealed:b", "condensation", changes=changes)
    assert found["annealed"].settings().tracker.survival == 0.5
    assert found["annealed:b"].settings().tracker.survival != 0.5
    assert found["annealed:b"].weighting == "bodytrack"
    assert {candidate.settings().tracker.diffusion_scale for candidate in found.values()} == {2.0}
    assert found["annealed"].weighting == found["condensation"].weighting == "edge-region"


def test_recorded_changes_make_the_same_settings_again() -> None:
    candidate = made("annealed:eq13", changes=("annealed:eq13.survival=0.4",))["annealed:eq13"]
    again = changed_settings(default_settings(candidate.tracker, candidate.weighting), candidate.changes)
    assert again == candidate.settings()
    assert again.tracker.survival == 0.4


@pytest.mark.parametrize(
    ("names", "changes", "words"),
    [
        (("annealed", "annealed"), (), "named twice"),
        (("unknown",), (), "no tracker 'unknown'"),
        (("annealed:a b",), (), "not a tracker's name"),
        (("annealed:mine",), (), "does not differ"),
        (("annealed",), ("condensation.particles=3",), "does not take part"),
        (("annealed",), ("annealed.survivor=1",), "no setting 'survivor'"),
        (("annealed",), ("survivor=1",), "No tracker of the comparison has a setting 'survivor'"),
        (("annealed",), ("weighting=bodytrack",), "not a knob"),
        (("annealed",), ("annealed.particles=500",), "5000 poses a frame instead of 1000"),
        (("annealed",), ("annealed.weighting=nothing",), "no weighting 'nothing'"),
        (("annealed",), ("annealed.survival",), "is not an assignment"),
        ((), (), "No tracker"),
    ],
)  # fmt: skip
def test_impossible_comparisons_are_refused_with_a_remedy(
    names: tuple[str, ...], changes: tuple[str, ...], words: str
) -> None:
    with pytest.raises(StudioError, match=words) as refused:
        made(*names, changes=changes)
    assert refused.value.hint


def test_too_few_evaluations_are_refused() -> None:
    with pytest.raises(SettingsError, match="too few"):
        made("annealed", evaluations=5)
