"""How many sessions' pictures stay open for the pages."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from toy_session import make_session

from studio.results import overlay_pictures
from studio.results.overlay_pictures import ViewComposer, compose_view, forget_composers
from studio.sessions.session import Session


@pytest.fixture
def closed(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[ViewComposer]]:
    """Composers that were closed, in order."""
    forget_composers()
    composers: list[ViewComposer] = []
    close = ViewComposer.close

    def noted(composer: ViewComposer) -> None:
        composers.append(composer)
        close(composer)

    monkeypatch.setattr(ViewComposer, "close", noted)
    yield composers
    monkeypatch.undo()
    forget_composers()


def look(session: Session) -> None:
    compose_view(session, None, 0, session.cameras()[0].name, ("mask",))


@pytest.mark.parametrize("pixels", [None, 1])
def test_the_oldest_are_closed_beyond_a_count_and_beyond_what_memory_may_hold(
    tmp_path: Path, closed: list[ViewComposer], monkeypatch: pytest.MonkeyPatch, pixels: int | None
) -> None:
    if pixels:
        monkeypatch.setattr(overlay_pictures, "_KEPT_PIXELS", pixels)
    for number in range(5):
        look(make_session(tmp_path / f"toy{number}"))
    assert len(closed) == (4 if pixels else 2)
    look(Session(tmp_path / "toy4"))
    assert len(closed) == (4 if pixels else 2)
