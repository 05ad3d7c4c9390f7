"""A long run that is watched: what the page asks of the server and what it keeps stay small."""

import sqlite3
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from playwright.sync_api import Browser
from studio_page import StudioPage
from studio_server import StudioServer
from toy_session import make_session, true_poses
from tracked_runs import finish

from studio.runs.new_run import prepare_run
from studio.sessions.results_reader import FILE_NAME

pytestmark = pytest.mark.browser

FRAMES = 150
RUN = "/api/sessions/arm/runs/long"
SUMMARY_SECONDS = 1.5
MEGABYTE = 1_000_000


@pytest.fixture
def studio(tmp_path: Path) -> Iterator[StudioServer]:
    """`studio serve` with a quick run of 150 frames."""
    workspace = tmp_path / "workspace"
    workspace.mkdir()
    make_session(workspace / "arm", FRAMES)
    with StudioServer("serve", workspace) as made:
        settings = {"layers": 6, "particles": 60, "start_repeats": 1}
        start = true_poses(1)[0].tolist()
        made.post("/api/sessions/arm/runs", {"name": "long", "settings": settings, "start_pose": start})
        yield made


def heap(window: StudioPage) -> float:
    """Bytes of live objects in the page, rubbish collected."""
    session = window.context.new_cdp_session(window.page)
    session.send("HeapProfiler.collectGarbage")
    used = session.send("Runtime.getHeapUsage")["usedSize"]
    session.detach()
    return float(used)


@pytest.mark.slow
def test_a_watched_run_asks_little_and_keeps_little(browser: Browser, studio: StudioServer) -> None:
    window = StudioPage(browser, studio)
    window.until("get('run') === 'long' && get('connected') === true && get('summary') !== null")
    window.see_scene()
    window.page.click("#track-toggle")
    window.until("get('summary').frames.length > 20")
    before, begun = heap(window), len(window.watch.requests)
    clock = window.page.evaluate("performance.now()")
    window.until("get('work').state === 'finished'")
    window.until(f"get('summary').frames.length === {FRAMES} && get('frame') === {FRAMES - 1}")
    window.until("get('detail')?.frame === get('frame') && get('detail').layers.length === 6")
    seconds = (window.page.evaluate("performance.now()") - clock) / 1000.0

    asked = Counter(window.watch.requests[begun:])
    details = sum(count for path, count in asked.items() if path.startswith(f"GET {RUN}/frames/"))
    assert asked[f"GET {RUN}/frames"] <= seconds / SUMMARY_SECONDS + 3
    assert details <= FRAMES / 10, "the layers come with the events, but where the page fell behind them"
    assert asked["POST /api/scene/show"] <= 3, "the scene follows by itself"
    assert asked["GET /api/sessions"] <= 3
    assert heap(window) - before < 8 * MEGABYTE
    window.close()


@pytest.mark.slow
def test_what_of_a_run_is_damaged_is_said_once_all_of_it_was_read(browser: Browser, tmp_path: Path) -> None:
    session = make_session(tmp_path / "workspace" / "arm")
    run = prepare_run(session, name="torn", last=3, start_pose=true_poses(1)[0])
    finish(session, run)
    with closing(sqlite3.connect(run.folder / FILE_NAME)) as connection:
        connection.execute("UPDATE layers SET blob = X'00' WHERE frame = 1 AND layer = 0")
        connection.commit()
    studio = StudioServer("serve", tmp_path / "workspace")
    try:
        window = StudioPage(browser, studio, with_scene=False)
        window.until("get('summary')?.checked && '1' in get('summary').damaged")
        window.until("get('summary').frames.map((line) => line.frame).join() === '0,2'")
        window.until("get('parameters') !== null && get('moved') !== null")
        # The timeline comes before what else is asked of the run, and its frame once.
        path, asked = "/api/sessions/arm/runs/torn", window.watch.requests
        others = [f"GET {path}", f"GET {path}/settings", f"GET {path}/frames/2", "POST /api/scene/show"]
        assert all(asked.index(f"GET {path}/frames") < asked.index(other) for other in others)
        assert asked.count(f"GET {path}/frames/2") == 1
        window.close()
    finally:
        studio.stop()
