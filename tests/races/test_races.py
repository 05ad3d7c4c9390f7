"""A quarter of a minute of the groups that `make races` fires by the thousand."""

from pathlib import Path

import pytest

from races.campaign import campaign, table
from races.verbs import VERBS


@pytest.mark.slow
def test_verbs_at_the_same_time_leave_nothing_wrong(tmp_path: Path) -> None:
    found = campaign(tmp_path, range(300, 400), VERBS, seconds=15.0)
    assert found.groups
    assert not found.wrong, "\n".join([*found.wrong, table(found)])


@pytest.mark.slow
def test_two_thousand_groups(tmp_path: Path) -> None:
    found = campaign(tmp_path, range(2000), VERBS)
    assert not found.wrong, "\n".join([*found.wrong, table(found)])
