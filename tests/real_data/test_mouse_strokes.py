"""The white mouse cut out by strokes painted by hand in its first frame: it stays in place, and no network knows it."""

from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from studio.runs.setup.background_setup import set_up_background
from studio.sessions.importers.importing import ImportOptions, import_source
from studio.sessions.session import Session, redescribe
from studio.sessions.stroke_files import strokes_of_file

FRAMES = 4
STROKES = Path(__file__).parent / "mouse_strokes.json"


@pytest.fixture
def mouse(real_data: Path, tmp_path: Path) -> Session:
    """Its first frames, in a calibration that has no floor."""
    options = ImportOptions(copy=False, allow_inconsistent=True)
    session = import_source(real_data / "mouse", tmp_path / "mouse", options).session
    footage = replace(session.manifest.footage, frame_count=FRAMES)
    return redescribe(session, msgspec.structs.replace(session.manifest, footage=footage))


@pytest.mark.real_data
def test_strokes_in_one_frame_cut_the_mouse_out_of_four_views(mouse: Session) -> None:
    made = set_up_background(mouse, "strokes", strokes=strokes_of_file(mouse, STROKES))
    for view in made.quality.views:
        print(f"{view.camera}: covered {view.covered:.3f}, inside {view.inside:.3f}")
        assert view.agreement >= 0.85, view.camera
    # The mouse itself, not the litter beside it, nor its reflection in the cage's wall.
    footage = Session(mouse.path).footage()
    for camera, low, high in (
        ("back", 9e3, 12e3),
        ("mid", 7e3, 10e3),
        ("side", 23e3, 30e3),
        ("top", 9e3, 13e3),
    ):
        mask = footage.mask(camera, FRAMES - 1)
        assert mask is not None
        assert low < (mask > 0).sum() < high, camera
    footage.close()
