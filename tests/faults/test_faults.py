"""A minute of the faults that `make faults` plants by the thousand, and that the table finds what it is for."""

import os
from pathlib import Path

import pytest

from faults.campaign import campaign, plant, table
from faults.kinds import KINDS
from faults.process_kinds import SERVER_KINDS
from faults.stage import Stage
from studio.sessions.results_codec import CheckedStore, Sums

SHORT = [kind for kind in KINDS if kind not in SERVER_KINDS] + ["camera gone", "server killed"]
# Servers take some seconds to start: seed 1 starts one, and the command line goes on.
SEEDS = {"camera gone": (0,), "server killed": (1,)}
pytestmark = pytest.mark.skipif(not os.path.isdir("/proc/self/fd"), reason="files are named through /proc")


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Stage:
    return Stage(tmp_path_factory.mktemp("stage"))


LONG = ("killed again and again", "killed", "stopped process")


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=pytest.mark.slow) if kind in LONG else kind for kind in SHORT]
)
def test_nothing_is_lost_and_nothing_false_is_said(stage: Stage, kind: str) -> None:
    for seed in SEEDS.get(kind, (0, 1)):
        trial = plant(stage, kind, seed)
        assert (trial.struck, trial.lost, trial.wrong) == (True, 0, []), f"seed {seed}"


def test_the_same_seed_plants_the_same_fault(stage: Stage) -> None:
    first, second = (plant(stage, "write error", 11) for _ in range(2))
    assert first.said
    assert (first.deed, first.said) == (second.deed, second.said)


def test_a_store_that_trusts_the_disk_is_found_out(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Sums, "fits", lambda *_: True)
    monkeypatch.setattr(Sums, "row_fits", lambda *_: True)
    monkeypatch.setattr(Sums, "wrong_layers", lambda *_: [])
    monkeypatch.setattr(CheckedStore, "holds", lambda *_: True)
    trial = plant(stage, "flipped bit in a frame", 0)
    assert any("is not named" in text for text in trial.wrong)


@pytest.mark.slow
def test_a_thousand_faults(tmp_path: Path) -> None:
    found = campaign(tmp_path, [*KINDS], 40)
    assert len(found) >= 15
    assert sum(tally.struck for tally in found.values()) >= 1000
    assert not any(tally.failures or tally.lost for tally in found.values()), table(found)
