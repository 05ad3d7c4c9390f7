"""The guide's page of formats names every format, and a test for each row."""

import re
from pathlib import Path

from studio.footage.capture.calibration_files import CALIBRATION_FORMATS
from studio.results.export.formats import FORMATS

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "web_assets" / "guide" / "formats.md").read_text()
ROWS = [line.strip("|").split("|") for line in PAGE.splitlines() if re.match(r"\| [^f-]|\| folder", line)]


def test_every_row_has_a_test_that_is_there() -> None:
    assert len(ROWS) > 25
    for row in ROWS:
        (path,) = re.findall(r"`(tests/[^`]+\.py)`", row[-1])
        assert "def test_" in (ROOT / path).read_text(), path


def test_every_format_has_a_row() -> None:
    out = PAGE.partition("## Out")[2]
    named = set(re.findall(r"`\.(\w+)`", out))
    assert {name for name in FORMATS if name not in named} == set()
    assert all(writer in out for writer in CALIBRATION_FORMATS)
