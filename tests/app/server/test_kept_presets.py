"""A person's own presets: kept in a file that older versions wrote otherwise, and that is never lost."""

import json
from pathlib import Path

import pytest

from studio.foundations.errors import SessionError
from studio.operations.presets import FILE_NAME, all_presets, drop_preset, keep_preset, preset


def test_presets_of_the_first_version_get_the_tracker_that_has_their_knobs(tmp_path: Path) -> None:
    first = {
        "swift": {"help": "for walks", "values": {"crossover": 0.2, "layers": 5}},
        "either": {"help": "", "values": {"survival": 0.2, "limits": "reflect"}},
    }
    (tmp_path / FILE_NAME).write_text(json.dumps(first))
    own = {entry.name: entry for entry in all_presets(tmp_path) if entry.own}
    assert list(own) == ["either", "swift"]
    assert (own["swift"].tracker, own["swift"].help) == ("annealed", "for walks")
    assert own["swift"].values == {"crossover": 0.2, "layers": 5}
    # More than one tracker has a survival rate; the knob has today's name.
    assert (own["either"].tracker, own["either"].values) == ("", {"survival": 0.2, "constraints": "clamp"})

    keep_preset("third", "", {"particles": 7}, tmp_path, tracker="annealed", weighting="edge-region")
    assert json.loads((tmp_path / FILE_NAME).read_text())["schema"] == 2
    assert preset("swift", tmp_path).tracker == "annealed"
    assert preset("third", tmp_path).fits("annealed", "edge-region")
    assert not preset("third", tmp_path).fits("annealed", "blobs")


def test_a_damaged_file_hides_no_preset_of_the_studio_and_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_text('{"mine": ')
    assert all_presets(tmp_path)
    assert not any(entry.own for entry in all_presets(tmp_path))
    for change in (
        lambda: keep_preset("other", "", {"survival": 0.2}, tmp_path),
        lambda: drop_preset("mine", tmp_path),
    ):
        with pytest.raises(SessionError, match="cannot be read"):
            change()
    assert (tmp_path / FILE_NAME).read_text() == '{"mine": '
