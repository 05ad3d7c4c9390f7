"""Evaluations of several seeds in one line, in words and as JSON."""

import json

import numpy as np
import pytest

from studio.evaluation.errors import Evaluation
from studio.evaluation.report import as_document, in_words, summarize


def evaluation(mean: float, lost: tuple[str, ...] = ()) -> Evaluation:
    return Evaluation(
        frames=(0, 1),
        mean_mm=mean,
        std_mm=1.0,
        worst_mm=mean + 5.0,
        lost_frames=len(lost),
        lost_frame_numbers=tuple(range(len(lost))),
        lost_limbs=lost,
        lost_by_frame=(lost, ()),
        per_marker_mm={"Hip": mean},
        per_frame_mm=(mean - 1.0, mean + 1.0),
        root_aligned_mm=mean / 2.0,
        procrustes_mm=None,
        unmatched_markers=("Nose",),
    )


def test_seeds_are_summed_up() -> None:
    summary = summarize([evaluation(20.0), evaluation(26.0, ("left arm", "right leg")), evaluation(23.0)])
    assert summary.runs == 3
    assert summary.mean_mm == pytest.approx(23.0)
    assert summary.spread_mm == pytest.approx(np.std([20.0, 26.0, 23.0], ddof=1))
    assert summary.highest_mean_mm == 26.0
    assert summary.worst_mm == pytest.approx(28.0)
    assert (summary.lost_limbs, summary.runs_without_loss) == (2, 2)
    assert summarize([evaluation(20.0)]).spread_mm == 0.0


def test_the_document_is_strict_json_and_the_words_say_threshold_and_alignment() -> None:
    found = evaluation(21.04, ("left arm",))
    document = json.loads(json.dumps(as_document(found), allow_nan=False))
    assert document["mean_mm"] == 21.04
    assert document["lost_threshold_mm"] == 150.0
    words = in_words(found)
    assert "21.0 mm" in words
    assert "150 mm" in words
    assert "no alignment" in words
    assert "left arm" in words
    assert "Nose" in words
