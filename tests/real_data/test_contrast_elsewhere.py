"""Two people of others: before a frame is tracked the one on wood is called like the floor, the one on tiles is not."""

from pathlib import Path

import pytest

from studio.runs.setup.contrast import measure_contrast
from studio.runs.setup.session_settings import session_settings
from studio.sessions.importers.importing import import_source
from studio.sessions.session import Session

pytestmark = [pytest.mark.real_data, pytest.mark.slow]


@pytest.mark.parametrize(("clip", "cameras"), [("wood", ("cam01", "cam02", "cam03", "cam04")), ("tiles", ())])
def test_skin_on_wood_is_named_and_tiles_are_not(
    real_data: Path, tmp_path: Path, clip: str, cameras: tuple[str, ...]
) -> None:
    import_source(real_data / "drawn-elsewhere" / clip, tmp_path / clip)
    session = Session(tmp_path / clip)
    found = measure_contrast(session, session_settings(session).evidence)
    assert found.alike == ({"subject": cameras} if cameras else {})
