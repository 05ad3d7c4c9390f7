"""What the help of option `names` says is absent is absent, and nothing else is."""

import pytest

from studio.body.catalogue import load_body
from studio.foundations.knobs import knobs_of
from studio.results.export.naming import name_map, points_of
from studio.results.export.options import ExportOptions

FACE_AND_TOES = {"Nose", "LEye", "REye", "LEar", "REar", "LSmallToe", "RSmallToe"}
FEET = {"LHeel", "RHeel", "LBigToe", "RBigToe"}


@pytest.mark.parametrize(
    ("body", "absent"),
    [("human25", FACE_AND_TOES), ("human34", FACE_AND_TOES), ("human31", FACE_AND_TOES | FEET)],
)
def test_points_that_bodies_lack(body: str, absent: set[str]) -> None:
    found = points_of(load_body(body), "halpe26")
    assert set(name_map("halpe26").points) - set(found.names) == absent
    help_text = next(entry for entry in knobs_of(ExportOptions) if entry.name == "names").help
    for word in ("nose", "eyes", "ears", "small toes", "heels", "big toes", "human31"):
        assert word in help_text
