"""A quarter of a minute of the groups that `make races` fires by the thousand."""

from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from races.campaign import Tally, _begun, campaign, table
from races.verbs import VERBS


def test_numbers_of_several_calls_add_up(tmp_path: Path) -> None:
    kept = tmp_path / "races.json"
    done = Tally(3, 5, 2, 1, 4.5, {frozenset(("a", "b"))}, {"no": 2}, ["wrong"], ["earlier"])
    kept.write_bytes(msgspec.json.encode(done))
    begun = _begun(kept)
    assert begun.commits[0] == "earlier"
    assert len(begun.commits) == 2
    assert replace(begun, commits=done.commits) == done


@pytest.mark.slow
def test_verbs_at_the_same_time_leave_nothing_wrong(tmp_path: Path) -> None:
    found = campaign(tmp_path, range(300, 400), VERBS, seconds=15.0)
    assert found.groups
    assert not found.wrong, "\n".join([*found.wrong, table(found)])


@pytest.mark.slow
def test_two_thousand_groups(tmp_path: Path) -> None:
    found = campaign(tmp_path, range(2000), VERBS)
    assert not found.wrong, "\n".join([*found.wrong, table(found)])
