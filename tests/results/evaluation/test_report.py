"""Evaluations as text and as JSON."""

import json

from studio.results.evaluation.errors import Evaluation
from studio.results.evaluation.report import as_document, in_words


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


def test_the_document_is_strict_json_and_the_text_has_threshold_and_alignment() -> None:
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
