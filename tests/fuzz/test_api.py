"""The API answers whatever it is asked as it says it does."""

from pathlib import Path

import pytest
from faults.process_kinds import server
from faults.stage import Stage

from fuzz.api import REMOVING, ask, left_to_ask
from studio.app.server.api_document import api_document


def test_only_what_removes_or_takes_long_is_not_asked() -> None:
    document = api_document()
    before, after = document["paths"], left_to_ask(document)["paths"]
    assert isinstance(before, dict)
    assert len(after) > 0.9 * len(before)
    for path in REMOVING:
        assert "get" in after[path], path
        assert "delete" in before[path], path
        assert "delete" not in after[path], path


@pytest.mark.slow
def test_every_answer_is_one_that_is_declared(tmp_path: Path) -> None:
    with server(Stage(tmp_path).place("api")) as studio:
        code, said = ask(studio, tmp_path, 20, 0)
        assert code == 0, said
        studio.finish()
