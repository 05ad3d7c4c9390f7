"""Short forms of what `make watching` measures: what is shown is right; how long it takes is only printed."""

from pathlib import Path

import pytest
from playwright.sync_api import Browser

from watching.figures import Figures
from watching.first_steps import measure_first_steps
from watching.layers import measure_layers
from watching.long_run import measure_long_run
from watching.slider import measure_slider
from watching.windows import measure_windows


def _right(found: Figures, *words: str) -> None:
    assert found.wrong == []
    for word in words:
        assert word in found.table()


@pytest.mark.slow
@pytest.mark.browser
def test_a_moved_slider_is_timed_until_its_clouds_are_drawn(browser: Browser, tmp_path: Path) -> None:
    found = measure_slider(browser, tmp_path, moves=2)
    _right(found, "to the last new layer drawn: median", "(2 times)", "other programs used")


@pytest.mark.slow
@pytest.mark.browser
def test_a_moved_survival_rate_of_the_first_steps_changes_scene_and_charts(
    browser: Browser, tmp_path: Path
) -> None:
    found = measure_first_steps(browser, tmp_path, moves=2)
    _right(found, "survival moved to its cloud drawn", "survival moved to Schedule drawn anew: median")


@pytest.mark.slow
def test_ten_windows_show_their_own_runs_while_one_is_tracked(tmp_path: Path) -> None:
    _right(measure_windows(None, tmp_path, stretches=4, frames=2), "with 10 windows: ratio", "kB a frame")


@pytest.mark.slow
@pytest.mark.browser
def test_frames_of_a_long_run_are_looked_at(browser: Browser, tmp_path: Path) -> None:
    _right(
        measure_long_run(browser, tmp_path, frames=60, looks=2), "60 frames", "its particles drawn: median"
    )


@pytest.mark.slow
@pytest.mark.browser
def test_layers_that_are_played_are_counted_on_the_wire_and_in_the_browser(
    browser: Browser, tmp_path: Path
) -> None:
    found = measure_layers(browser, tmp_path, seconds=2.0)
    _right(found, "100 particles at 3 layers", "1000 particles in the browser", "% of a core by the server")


def test_what_is_wrong_stands_below_the_times() -> None:
    found = Figures()
    with found.loaded():
        found.times("a look", [1.0, 3.0, 2.0])
    found.wrong.append("another cloud")
    lines = found.table().splitlines()
    assert lines[0] == "a look: median 2 ms, 95 % 3 ms, worst 3 ms (3 times)"
    assert lines[1].startswith("machine: ")
    assert lines[2] == "WRONG another cloud"
