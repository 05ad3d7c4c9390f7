"""Outcomes are kept under the code that made them."""

from pathlib import Path

import studio
from studio.garden.reproduction.caillette.training_set import ROOMS
from studio.results.comparison.kept_trials import SCIENCE


def test_every_room_of_a_digest_has_code() -> None:
    """A room that was renamed would leave its code out of the digest: what an older likelihood measured would count."""
    package = Path(studio.__file__).parent
    for room in {*SCIENCE, *ROOMS}:
        assert list((package / room).rglob("*.py")), room
    assert "search" in SCIENCE
