"""Growth: slopes of known curves, bodies and sessions of the wanted size, a small measurement, the page on scale."""

from pathlib import Path

import numpy as np
import pytest
from sample_walk import copy_of_walk

from studio.body.forward_kinematics import limb_ends
from studio.garden.benchmarks.growth import (
    Curve,
    Sizes,
    as_json,
    chain,
    measure_growth,
    table,
    with_cameras,
    with_pictures,
)
from studio.garden.benchmarks.scale_document import document

ROOT = Path(__file__).resolve().parents[3]
USUAL = {"busy": 0.05, "stored": 1e5, "stored_few": 1e4, "footage": 5e3, "cameras": 4.0}


def test_exponents_are_those_of_known_curves() -> None:
    sizes = (1, 10, 100, 1000)
    linear = Curve("a", "b", sizes, tuple(0.5 + 1e-1 * size for size in sizes))
    assert linear.exponent == pytest.approx(1.0, abs=0.03)
    assert linear.holds
    square = Curve("a", "b", sizes, tuple(1e-3 * size**2 for size in sizes))
    assert square.exponent == pytest.approx(2.0)
    assert not square.holds
    leaking = Curve("a", "b", sizes, linear.seconds, (100, 100, 100, 200))
    assert leaking.memory_growth == 2.0
    assert not leaking.holds


@pytest.mark.slow
def test_what_is_measured_has_the_wanted_size(tmp_path: Path) -> None:
    body = chain(7, tmp_path)
    ends = limb_ends(body, body.neutral[None])
    assert ends.shape[1] == len(body.drawn) == len(body.parameters) == 7
    assert np.ptp(ends[..., 2]) == pytest.approx(1600.0)
    walk = copy_of_walk(tmp_path / "walk")
    many = with_cameras(walk, tmp_path / "many", 6)
    assert [camera.name for camera in many.cameras()] == [f"camera{number}" for number in range(1, 7)]
    footage = many.footage()
    assert (footage.picture("camera2", 3) == footage.picture("camera6", 3)).all()
    footage.close()
    large = with_pictures(walk, tmp_path / "large", 2.0)
    footage = large.footage()
    assert footage.picture("cam1", 0).shape == (960, 1280, 3)
    assert large.cameras()[0].width == 1280
    footage.close()


@pytest.mark.slow
def test_every_curve_is_measured_and_shown() -> None:
    least = Sizes((10, 20), (32, 64), (1, 2), (4, 8), (0.25, 0.5), (10, 60), (2, 4))
    curves, usual = measure_growth(least, lambda *_: None)
    assert [curve.name for curve in curves] == [
        "particles",
        "samples a limb and view",
        "cameras",
        "limbs",
        "pixels of a picture",
        "frames of a run",
        "runs of a workspace",
    ]
    for curve in curves:
        assert len(curve.seconds) == 2
        assert min(curve.seconds) > 0.0
    assert usual["stored"] > usual["stored_few"] > 0.0
    found = as_json(curves, usual)
    for text in (table(found), document(found)):
        assert all(curve.name in text for curve in curves)


def test_the_page_reckons_what_it_says() -> None:
    curves = [Curve("particles", "a whole frame", (10, 100), (1.0, 9.0))]
    text = document(as_json(curves, USUAL), "a machine")
    # 1000 hours at 60 Hz and 50 ms a frame are 3000 hours of a core, 7.8 days of 16.
    assert "3,000 hours of one such core" in text
    assert "| 1 | 7.81 | 13 | 256 | 26 |" in text
    assert "| 10 | 0.78 | 128 | 2,560 | 256 |" in text
    assert "× 9.0 | 0.95" in text


def test_the_page_in_the_project_was_made_by_this() -> None:
    lines = (ROOT / "studio" / "SCALE.md").read_text(encoding="utf-8").splitlines()
    rows = [line.split("|") for line in lines if line.startswith("| ") and "from" not in line]
    exponents = [float(row[6]) for row in rows if len(row) == 9]
    assert len(exponents) == 7
    assert max(exponents) <= 1.05
