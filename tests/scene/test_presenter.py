"""The drawing thread: newest wins, a held pace, and nothing that goes wrong ends it."""

import threading
from collections.abc import Callable

from studio.errors import StudioError
from studio.scene.presenter import PICTURE_SECONDS, REDRAW_SECONDS, Presenter, _Due
from studio.worker.events import Event, LogLine
from studio.worker.watchers import Subscription

PATIENCE = 10.0


def presenter(
    events: Subscription,
    *,
    heard: Callable[[Event], None] = lambda event: None,
    draw: Callable[[], None] = lambda: None,
    failed: Callable[[StudioError], None] = lambda problem: None,
) -> Presenter:
    return Presenter(
        events, heard=heard, tick=lambda seconds: False, draw=draw, draw_pictures=lambda: None, failed=failed
    )


def test_a_drawing_waits_until_its_pause_is_over() -> None:
    drawing = _Due(lambda: None, 0.5)
    assert not drawing.due(10.0)
    drawing.wanted = True
    assert drawing.due(10.0)
    drawing.done(10.0)
    drawing.wanted = True
    assert not drawing.due(10.4)
    assert abs(drawing.waits(10.4) - 0.1) < 1e-9
    assert drawing.due(10.5)
    assert (REDRAW_SECONDS, PICTURE_SECONDS) == (1.0 / 30.0, 0.1)


def test_many_wishes_are_one_redraw_and_posts_keep_their_order() -> None:
    drawn, order = [], []
    finished = threading.Event()
    made = presenter(Subscription(), draw=lambda: drawn.append(len(order)))

    def wish(number: int) -> None:
        order.append(number)
        made.redraw()
        if number == 99:
            finished.set()

    for number in range(100):
        made.post(lambda number=number: wish(number))
    made.start()
    assert finished.wait(PATIENCE)
    made.stop()
    assert order == list(range(100))
    assert len(drawn) <= 2


def test_what_goes_wrong_is_told_or_logged_and_the_thread_goes_on() -> None:
    told: list[str] = []
    finished = threading.Event()
    events: Subscription = Subscription()

    def heard(event: Event) -> None:
        if isinstance(event, LogLine) and event.text == "bad file":
            raise StudioError("The file cannot be read.", "Put it back.")
        if isinstance(event, LogLine) and event.text == "a fault":
            raise ZeroDivisionError
        finished.set()

    made = presenter(events, heard=heard, failed=lambda problem: told.append(problem.message))
    made.start()
    for text in ("bad file", "a fault", "good"):
        events.put(LogLine("", "", "info", 0.0, text))
    assert finished.wait(PATIENCE)
    made.stop()
    assert told == ["The file cannot be read."]
