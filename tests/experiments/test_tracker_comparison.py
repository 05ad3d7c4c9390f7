"""The bundled walk, tracked by the improved filter, Eq. 13 alone and Condensation with the same evaluations."""

import dataclasses
import json
import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numba
import pytest

from studio.errors import TruthError
from studio.experiments.tracker_comparison import (
    BASELINE,
    IMPROVED,
    PLANNED,
    Contender,
    Row,
    compare,
    contenders,
    track_and_measure,
)
from studio.sessions.session import Session

ROOT = Path(__file__).resolve().parents[2]
WALK = ROOT / "sample_sessions" / "walk"
SEEDS = range(10)


def keep(name: str, rows: tuple[Row, ...]) -> None:
    """Print the table and keep it as an artefact."""
    folder = Path(os.environ.get("STUDIO_ARTEFACTS", ROOT / "artefacts"))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.json").write_text(json.dumps([dataclasses.asdict(row) for row in rows], indent=1))
    for row in rows:
        found = row.summary
        print(
            f"\n{row.contender:18} {row.evaluations_per_frame} evaluations: mean {found.mean_mm:.1f} mm, worst frame "
            f"{found.worst_mm:.1f} mm, limbs lost {found.lost_limbs}, clean runs "
            f"{found.runs_without_loss}/{found.runs}, "
            f"seeds {row.per_seed_mm}, last β {row.likelihood_scales[0]:.1f}"
        )


def test_the_first_frames_are_followed() -> None:
    contender = Contender(IMPROVED, "annealed", {"layers": 5, "particles": 100})
    found, evaluations, _ = track_and_measure(WALK, contender, seed=1, frames=4)
    assert evaluations == 500
    assert found.mean_mm < 35.0
    assert found.lost_frames == 0


def test_a_session_without_truth_is_refused(session_on_disk: Session) -> None:
    with ThreadPoolExecutor(1) as executor, pytest.raises(TruthError, match="no truth"):
        compare(session_on_disk.path, contenders(), [0], executor)


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_the_improved_filter_keeps_every_limb_on_the_bundled_walk() -> None:
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(2, mp_context=context, initializer=numba.set_num_threads, initargs=(1,)) as pool:
        rows = compare(WALK, contenders(), SEEDS, pool)
    keep("walk_accuracy", rows)
    found = {row.contender: row.summary for row in rows}
    assert {row.evaluations_per_frame for row in rows} == {2000}
    assert found[IMPROVED].mean_mm <= 35.0
    assert found[IMPROVED].runs_without_loss >= 8
    assert found[IMPROVED].mean_mm < found[PLANNED].mean_mm
    assert found[IMPROVED].mean_mm < found[BASELINE].mean_mm
