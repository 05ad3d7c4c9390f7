"""The benchmark of poses that are sent on notes each pose's arrival in another process."""

from collections.abc import Callable
from typing import Any

import pytest

from studio.garden.benchmarks import live_out


@pytest.mark.parametrize(("kind", "receive"), list(live_out.RECEIVERS.items()))
def test_every_pose_s_way_is_measured(kind: str, receive: Callable[..., Any]) -> None:
    milliseconds = live_out.measure(kind, receive, 6)
    assert 0 < len(milliseconds) <= 6
    assert all(value > 0.0 for value in milliseconds)
