"""A slow watcher loses what is out of date, and only that."""

import asyncio
import dataclasses
import queue
import threading
from typing import Any

import pytest
from store_records import layer_of, result_of

from studio.operations.jobs.events import (
    Acknowledged,
    Event,
    FrameFinished,
    LayerFinished,
    LogLine,
    nothing_open,
)
from studio.operations.jobs.watchers import Subscription, Watchers


def drained(subscription: Subscription[Event]) -> list[Any]:
    events: list[Any] = []
    while True:
        try:
            events.append(subscription.get_nowait())
        except queue.Empty:
            return events


def layer(frame: int, number: int, again: bool = False) -> LayerFinished:
    return LayerFinished("s", "r", layer_of(frame, number), again)


def put(subscription: Subscription[Event], event: Event) -> None:
    subscription.put(event, event.key)


def test_the_newest_state_and_result_stand() -> None:
    subscription = Subscription[Event]()
    for frame in range(50):
        put(subscription, dataclasses.replace(nothing_open(), frame=frame))
        put(subscription, FrameFinished("s", "r", result_of(frame)))
    state, finished = drained(subscription)
    assert state.frame == 49
    assert finished.result.frame == 49


def test_all_layers_of_the_last_frame_are_there_in_order_and_answers_beside_them() -> None:
    subscription = Subscription[Event]()
    for frame in range(20):
        for number in range(10):
            put(subscription, layer(frame, number))
    for number in range(10):
        put(subscription, layer(7, number, again=True))
    events = drained(subscription)
    stored = [event.record for event in events if not event.reannealed]
    again = [event.record for event in events if event.reannealed]
    assert [(record.frame, record.layer) for record in stored] == [(19, number) for number in range(10)]
    assert [(record.frame, record.layer) for record in again] == [(7, number) for number in range(10)]


def test_acknowledgements_are_kept_one_by_one_and_the_whole_is_bounded() -> None:
    subscription = Subscription[Event](limit=30)
    for number in range(10):
        put(subscription, Acknowledged("", "", str(number), "Pause", True))
    assert [event.identifier for event in drained(subscription)] == [str(number) for number in range(10)]
    for number in range(1000):
        put(subscription, LogLine("", "", "info", 0.0, str(number)))
    assert [event.text for event in drained(subscription)] == [str(number) for number in range(970, 1000)]


def test_waiting_in_a_thread_ends_with_an_event_or_the_close() -> None:
    subscription = Subscription[Event]()
    with pytest.raises(queue.Empty):
        subscription.get(timeout=0.01)
    threading.Timer(0.02, put, [subscription, nothing_open()]).start()
    assert subscription.get(timeout=60.0) == nothing_open()
    threading.Timer(0.02, subscription.close).start()
    with pytest.raises(queue.Empty):
        subscription.get()
    put(subscription, nothing_open())
    assert drained(subscription) == []


def test_waiting_in_an_event_loop() -> None:
    async def watch() -> list[int]:
        subscription = Subscription[Event]()
        waiting = asyncio.create_task(subscription.next())
        await asyncio.sleep(0)
        threading.Thread(target=put, args=(subscription, layer(3, 1))).start()
        first = await waiting
        put(subscription, layer(3, 2))
        second = await subscription.next()
        closing = asyncio.create_task(subscription.next())
        await asyncio.sleep(0)
        subscription.close()
        with pytest.raises(queue.Empty):
            await closing
        return [first.record.layer, second.record.layer]

    assert asyncio.run(watch()) == [1, 2]


def test_everyone_gets_everything_and_leavers_are_forgotten() -> None:
    watchers = Watchers()
    one, other = watchers.subscribe(), watchers.subscribe()
    watchers.publish(layer(0, 0))
    one.close()
    watchers.publish(layer(0, 1))
    assert [event.record.layer for event in drained(other)] == [0, 1]
    assert [event.record.layer for event in drained(one)] == [0]
    assert len(watchers._subscriptions) == 1
