"""The balancing man cut out by the network: he stays in place, and there is no picture of the room without him."""

from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from studio.runs.setup.background_setup import set_up_background
from studio.sessions.importers.importing import ImportOptions, import_source
from studio.sessions.session import Session, redescribe

FRAMES = 4


@pytest.mark.slow
@pytest.mark.real_data
def test_the_balancing_man_is_cut_out_without_a_plate(real_data: Path, tmp_path: Path) -> None:
    """Not the bystander whom two cameras see. The cameras are as they were published: one of them was touched."""
    session = import_source(
        real_data / "pose2sim-balance", tmp_path / "balance", ImportOptions(copy=False)
    ).session
    footage = replace(session.manifest.footage, frame_count=FRAMES)
    session = redescribe(session, msgspec.structs.replace(session.manifest, footage=footage))
    made = set_up_background(session, "person")
    assert made.notes == ()
    for view in made.quality.views:
        print(f"{view.camera}: covered {view.covered:.3f}, inside {view.inside:.3f}")
    assert all(view.agreement >= 0.88 for view in made.quality.views)
    assert all(source.masks for source in Session(session.path).manifest.footage.cameras)
