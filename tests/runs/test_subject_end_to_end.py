"""Issue 5, Show 4, from pictures alone: the studio's own masks and first poses, a height within 3 cm, the fit."""

from pathlib import Path

import numpy as np
import pytest
from sized_sessions import make_sized_session

from studio.runs.setup.subject_fitting import FitRequest, fit_session_subject

PEOPLE = (104, 105, 106, 13, 14)
"""On whom nothing of the search was tuned."""


@pytest.mark.slow
@pytest.mark.timeout(5400)
def test_lengths_of_people_who_are_only_seen(tmp_path: Path) -> None:
    fitted, usual = [], []
    for seed in PEOPLE:
        session, true, height = make_sized_session(tmp_path / f"person{seed}", seed)
        found = fit_session_subject(session, FitRequest(height_mm=height))
        assert found.poses_from == "a search in each frame"
        sizes = {size.name: size for size in found.sizes}
        after = [sizes[name].after - length for name, length in true.items()]
        before = [sizes[name].before - length for name, length in true.items()]
        print(seed, [round(value) for value in before], "→", [round(value) for value in after])
        fitted += after
        usual += before
    print(f"median {np.median(np.abs(usual)):.1f} mm by height, {np.median(np.abs(fitted)):.1f} mm fitted")
    assert np.median(np.abs(fitted)) <= 15.0
    assert np.median(np.abs(fitted)) < np.median(np.abs(usual))
