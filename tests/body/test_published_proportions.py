"""Bodies of people take a height by the same published shares (Drillis & Contini 1966, in Winter, Fig. 4.1)."""

import pytest

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.body.subject import Subject, fit_subject

# Heights above the floor of a standing person: ankle 0.039, knee 0.285, hip 0.530 of the stature; the rest are lengths.
PUBLISHED = {
    "thigh_length": 0.530 - 0.285,
    "shin_length": 0.285 - 0.039,
    "foot_length": 0.152,
    "upper_arm_length": 0.186,
    "forearm_length": 0.146,
    "hand_length": 0.108,
}


@pytest.mark.parametrize("name", ["human25", "human29", "human31", "human34", "human35"])
def test_a_height_gives_published_lengths_and_that_height(name: str) -> None:
    body, notes = fit_subject(load_body(name), Subject(body=name, height_mm=1800.0))
    assert not notes
    for part, share in PUBLISHED.items():
        for side in ("left", "right"):
            assert body.dimensions[f"{side}_{part}"] == pytest.approx(share * 1800.0, abs=0.1)
    assert body.dimensions["ankle_height"] == pytest.approx(0.039 * 1800.0)
    # Within what a head that leans back lacks: 288 mm times 1 - cos 6 degrees.
    assert limb_ends(body, body.neutral)[0, ..., 2].max() == pytest.approx(1800.0, abs=1.6)
    assert "Drillis & Contini 1966" in body.definition.source
