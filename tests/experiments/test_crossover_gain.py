"""Figure 16: what crossover gains where there are branches, and that it harms nothing where there are none."""

import json

import pytest
from scipy.stats import binom

from studio.experiments.arm_report import arm_report
from studio.experiments.arms import template_arm
from studio.experiments.crossover_gain import SHARES, crossover_report


def test_whole_limbs_gain_on_the_branched_arms() -> None:
    found = crossover_report(template_arm("branched_arms6"), "limbs", range(40))
    assert found.ratio < 0.9
    assert found.better > found.worse
    assert found.p_value < 0.05
    assert found.gains
    # The sign test by hand: twice the tail of a fair coin.
    tail = binom.sf(found.better - 1, found.better + found.worse, 0.5)
    assert found.p_value == pytest.approx(2 * tail, rel=1e-6)


def test_an_arm_without_branches_has_no_whole_limbs_to_swap() -> None:
    found = crossover_report(template_arm("planar_arm4"), "limbs", range(6))
    assert found.ssd[0] == found.ssd[-1]
    assert found.harmless
    assert not found.gains
    assert found.p_value == 1.0


def test_values_are_per_share_and_seed() -> None:
    found = crossover_report(template_arm("branched_arms6"), "parameters", range(3), layers=2)
    assert found.settings["layers"] == 2
    assert len(found.ssd) == len(found.mean_ssd) == len(SHARES)
    assert all(len(row) == 3 and min(row) > 0.0 for row in found.ssd)
    assert found.ratio == pytest.approx(sum(found.ssd[-1]) / sum(found.ssd[0]))


@pytest.mark.slow
def test_all_findings_hold() -> None:
    found = arm_report()
    json.dumps(found.plain())
    print(found.variance.verdict, *(entry.verdict for entry in found.crossover), sep="\n")
    assert found.passed
