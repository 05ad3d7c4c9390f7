"""Layers that a card is given before the records of the last are read: their order, and what stays as it was."""

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import simulated_ahead as made
from simulated_card import found_simulated

from studio.search.trackers import device_runs
from studio.search.trackers.device_runs import DeviceRuns, Launched, LayersAhead, Moment
from studio.search.trackers.random_numbers import RandomNumbers

LAYERS = 4


class Ladder(LayersAhead[str]):
    """A search whose sets are words, which notes what is done when."""

    def __init__(self, runs: int = 1, *, heeds: bool = False, done_there: int = LAYERS) -> None:
        tracker = SimpleNamespace(
            layer_count=lambda settings: LAYERS, fits_device=lambda layer, *_: layer < done_there
        )
        super().__init__(tracker, [None] * runs)  # type: ignore[arg-type, list-item]
        self._set, self.heeds = "start", heeds
        self.done = list[str]()

    def _launch(
        self, given: str, layer: int, moments: Sequence[Moment], settings: Sequence[str]
    ) -> Launched[str]:
        words = "".join(dict.fromkeys(settings))
        name = f"{layer} of {given} by {words} with {','.join(str(one.layer) for one in moments)}"
        self.done.append(f"launch {layer} by {words}")

        def records() -> list[Any]:
            self.done.append(f"read {layer}")
            return [name]

        return Launched(f"{given}/{layer}{words}", 10 + layer, records)

    def _kept(self, given: str) -> str:
        return f"kept {given}"

    def _put_back(self, kept: str) -> str:
        return kept.removeprefix("kept ")

    def _heed(self, records: Sequence[Any], settings: Any) -> bool:  # noqa: ANN401
        return self.heeds

    def step_to(self, layer: int, words: str, *, first: int = 7) -> list[Any]:
        """Step a layer, whose random numbers are those of layer `first` + layer."""
        runs = len(self._spaces)
        return self.step(layer, [RandomNumbers(run, 2, first + layer) for run in range(runs)], words * runs)


def test_each_layer_is_launched_before_the_last_ones_records_are_read() -> None:
    ladder = Ladder(runs=2)
    records = [ladder.step_to(layer, "a")[0] for layer in range(LAYERS)]
    assert ladder.done == [
        *("launch 0 by a", "launch 1 by a", "read 0", "launch 2 by a", "read 1", "launch 3 by a", "read 2"),
        "read 3",
    ]
    assert records == [
        "0 of start by a with 7,7",
        "1 of start/0a by a with 8,8",
        "2 of start/0a/1a by a with 9,9",
        "3 of start/0a/1a/2a by a with 10,10",
    ]
    assert ladder.evaluated == 13
    assert ladder._set == "start/0a/1a/2a/3a"


def test_a_moved_knob_has_the_layer_launched_again_from_the_set_that_was_kept() -> None:
    ladder = Ladder()
    ladder.step_to(0, "a")
    assert ladder._set == "kept start/0a", "whoever stops here has this"
    assert ladder.evaluated == 10
    assert ladder.step_to(1, "b") == ["1 of start/0a by b with 8"]
    assert ladder.step_to(2, "b") == ["2 of start/0a/1b by b with 9"]
    assert [word for word in ladder.done if word.startswith("launch")] == [
        f"launch {layer} by {settings}" for layer, settings in ("0a", "1a", "1b", "2b", "3b")
    ]


def test_other_random_numbers_are_another_layer() -> None:
    ladder = Ladder()
    ladder.step_to(0, "a")
    assert ladder.step_to(1, "a", first=20) == ["1 of start/0a by a with 21"]


def test_a_layer_that_depends_on_the_records_is_not_done_ahead_of_them() -> None:
    ladder = Ladder(heeds=True)
    ladder.step_to(0, "a")
    assert ladder._set == "start/0a"
    assert ladder.step_to(1, "a") == ["1 of start/0a by a with 8"]
    assert ladder.done.count("launch 1 by a") == 2


def test_a_layer_that_the_processor_does_is_not_launched() -> None:
    ladder = Ladder(done_there=2)
    for layer in range(2):
        ladder.step_to(layer, "a")
    assert ladder.done[-1] == "read 1"
    assert "launch 2 by a" not in ladder.done


class LazyCard:
    """A card that does at once what is launched, but copies to the host on another stream only once that is waited
    for.
    """

    def __init__(self) -> None:
        self.waiting = list[Any]()

    def stream(self) -> object:
        return object()

    def event(self) -> Any:  # noqa: ANN401
        def synchronize() -> None:
            for copy in self.waiting:
                copy()
            self.waiting.clear()

        return SimpleNamespace(record=lambda stream: None, wait=lambda stream: None, synchronize=synchronize)

    def device_array(self, shape: tuple[int, ...], kind: Any) -> "LazyArray":  # noqa: ANN401
        return LazyArray(self, np.zeros(shape, kind))

    def pinned_array(self, shape: tuple[int, ...], kind: Any) -> np.ndarray:  # noqa: ANN401
        return np.zeros(shape, kind)


class LazyArray:
    """An array of a lazy card."""

    def __init__(self, card: LazyCard, values: np.ndarray) -> None:
        self.card, self.values = card, values
        self.shape, self.dtype = values.shape, values.dtype

    def copy_to_device(self, other: "LazyArray", stream: object) -> None:
        self.values[...] = other.values

    def copy_to_host(self, place: np.ndarray, stream: object) -> np.ndarray:
        self.card.waiting.append(lambda: np.copyto(place, self.values))
        return place


def test_what_is_sent_is_what_it_was_however_late_it_is_copied(monkeypatch: pytest.MonkeyPatch) -> None:
    """While two sendings are on their way, and the arrays have changed since."""
    card = LazyCard()
    monkeypatch.setattr(device_runs, "cuda", card)
    space = SimpleNamespace(names=("x",))
    runs = DeviceRuns(SimpleNamespace(lend_arrays=lambda borrower: {}), space, 1)  # type: ignore[arg-type]
    one, other = (LazyArray(card, np.zeros(2)) for _ in range(2))
    sent = []
    for number in range(2):
        one.values[...], other.values[...] = number, -number
        sent.append(runs._send({"one": one, "other": other}))
    one.values[...] = other.values[...] = 9.0
    arrived = [parcel.arrive() for parcel in sent]
    runs._send({"one": one, "other": other}).arrive()
    runs._send({"one": one, "other": other}).arrive()
    for number, values in enumerate(arrived):
        np.testing.assert_array_equal(values["one"], [number, number])
        np.testing.assert_array_equal(values["other"], [-number, -number])


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a process gives whose device is simulated."""
    return found_simulated(Path(made.__file__), tmp_path_factory)


def test_what_is_sent_is_what_it_was_when_it_was_sent(simulated: dict[str, Any]) -> None:
    np.testing.assert_array_equal(simulated["sent"], np.arange(4.0)[:, None, None] * np.ones((4, 2, 3)))


def assert_alike(there: list[Any], here: list[Any]) -> None:
    assert [record.layer for record in there] == [record.layer for record in here]
    for one, other in zip(there, here, strict=True):
        for name in ("poses", "best", "mean", "variance_weighed", "variance_resampled", "variance_diffused"):
            np.testing.assert_allclose(getattr(one, name), getattr(other, name), atol=2e-5, err_msg=name)
        np.testing.assert_allclose(one.log_weights, other.log_weights, atol=1e-3)


@pytest.mark.parametrize("name", made.SCHEDULES)
@pytest.mark.parametrize("way", ["moved", "looked at"])
def test_a_frame_whose_knobs_are_moved_is_the_processors(
    simulated: dict[str, Any], name: str, way: str
) -> None:
    """Layers that were launched with the old knobs leave no trace, nor does looking at the sets between layers."""
    found, expected = simulated[name][way], made.with_moved_knobs(name, there=False, looked_at=True)
    assert_alike(found["records"], expected["records"])
    found["sets"].append(found["last"])
    assert len(found["sets"]) == (len(expected["sets"]) + 1 if way == "looked at" else 1)
    for ours, theirs in zip(found["sets"][::-1], [expected["last"], *expected["sets"][::-1]], strict=False):
        np.testing.assert_allclose(ours.poses, theirs.poses, atol=2e-5)
        for key, values in theirs.extra.items():
            np.testing.assert_allclose(ours.extra[key], values, atol=2e-5, err_msg=key)


@pytest.mark.parametrize("name", made.SCHEDULES)
@pytest.mark.parametrize("after", [1, 3])
def test_a_frame_that_the_processor_goes_on_with_is_its_own(
    simulated: dict[str, Any], name: str, after: int
) -> None:
    expected = made.with_moved_knobs(name, there=False)
    assert_alike(simulated[name]["stopped"][after]["records"], expected["records"])
