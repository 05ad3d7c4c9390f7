"""Starts of the demo are measured to its first tracked frame."""

import pytest

from studio.foundations.errors import StudioError
from studio.garden.benchmarks import first_frame
from studio.garden.benchmarks.first_frame import measure_starts
from studio.garden.benchmarks.results_table import rows_of


@pytest.mark.slow
def test_a_start_that_compiles_takes_longer_than_one_that_does_not() -> None:
    steps: list[tuple[str, int, int]] = []
    found = measure_starts(lambda *step: steps.append(step), starts=1)
    (cold, warm) = (row["value"] for row in rows_of({"start": found}))
    assert 0.0 < warm < cold  # pyright: ignore[reportOperatorIssue]
    assert steps[-1][1:] == (2, 2)


def test_a_demo_that_ends_at_once_is_no_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(first_frame, "COMMAND", "raise SystemExit(1)")
    with pytest.raises(StudioError, match="tracked no frame"):
        measure_starts(lambda *_: None)
