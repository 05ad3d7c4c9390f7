"""A run of 5000 frames with all its particles: how long until it is open, and until any frame of it is shown."""

import dataclasses
import random
import time
from pathlib import Path

import msgspec
from playwright.sync_api import Browser
from sample_walk import copy_of_walk
from stored_clouds import differing, stored_clouds
from studio_page import StudioPage
from studio_server import StudioServer
from tracked_runs import finish

from studio.runs.new_run import prepare_run
from studio.sessions.results_store import ResultsWriter
from studio.sessions.session import Session
from watching.drawing import Drawing, cloud_sizes, watched
from watching.figures import Figures, spent

FRAMES, LOOKS = 5000, 30
TRACKED = 6
"""Frames that are tracked; the long run has them again and again."""
TOGETHER = 50
OPEN = """async ([run, count]) => {
  const [{ get }, { openSession }] = [await import('/assets/js/state.js'), await import('/assets/js/sessions.js')];
  const began = performance.timeOrigin + performance.now();
  openSession("walk", run);
  while (get("run") !== run || get("summary")?.frames.length !== count || get("detail")?.frame !== get("frame"))
    await new Promise((done) => setTimeout(done, 5));
  return [began, performance.timeOrigin + performance.now()]; }"""
GO = """async (frame) => {
  const [{ get }, { goTo }] = [await import('/assets/js/state.js'), await import('/assets/js/selection.js')];
  const began = performance.timeOrigin + performance.now();
  goTo(frame);
  while (get("detail")?.frame !== frame) await new Promise((done) => setTimeout(done, 5));
  return [began, performance.timeOrigin + performance.now()]; }"""


def store_long_run(session: Session, frames: int) -> float:
    """Store runs "short" and "long", the first frames of the one over and over. Returns the bytes of "long"."""
    short = prepare_run(session, name="short", last=TRACKED)
    finish(session, short)
    record = msgspec.structs.replace(short.record, name="long", last=frames)
    with short.results() as stored:
        kept = [(stored.result(frame), stored.layers(frame)) for frame in stored.frames()]
    run = session.new_run(record)
    with ResultsWriter(run.folder) as writer:
        writer.write_settings(1, 0, 0, record.settings)
        for first in range(0, frames, TOGETHER):
            with writer.together():
                for frame in range(first, min(first + TOGETHER, frames)):
                    result, layers = kept[frame % len(kept)]
                    writer.write_frame(
                        dataclasses.replace(result, frame=frame),
                        [dataclasses.replace(layer, frame=frame) for layer in layers],
                    )
    return sum(path.stat().st_size for path in run.folder.glob("results.sqlite*"))


def measure_long_run(browser: Browser, folder: Path, frames: int = FRAMES, looks: int = LOOKS) -> Figures:
    """Open the long run from a window on another one, then look at frames of it in any order."""
    found = Figures()
    session = copy_of_walk(folder / "workspace" / "walk")
    size = store_long_run(session, frames)
    found.lines.append(f"{frames} frames, every layer's particles: {size / 1e6:.0f} MB")
    studio = StudioServer("serve", folder / "workspace")
    try:
        # A view of what is stored: there are fewer pictures than frames, and "why" looks at those.
        address = "session=walk&run=short&panel=views&view=schedule"
        window = StudioPage(watched(browser), studio, open_at=f"{studio.address}&{address}")
        window.see_scene()
        window.until(f"get('summary')?.frames.length === {TRACKED} && get('detail')")
        drawing, clouds = Drawing(window), stored_clouds(window, 0)
        sizes = cloud_sizes(len(clouds[0]))
        with found.loaded():
            drawing.clear()
            before = spent(studio.process.pid)
            began, ready = window.page.evaluate(OPEN, ["long", frames])
            after = spent(studio.process.pid)
            drawn = drawing.settled(sizes)
            found.times("a long run is opened: its timeline and newest frame are there", [ready - began])
            found.times("and its particles drawn", [drawn[-1] - began])
            took = [1e3 * (now - then) for then, now in zip(before, after, strict=True)]
            found.lines.append(
                f"processor time until timeline and newest frame are there: server {took[0]:.0f} ms, browser"
                f" {took[1]:.0f} ms"
            )
            window.until("get('summary')?.checked")
            checked = spent(studio.process.pid)[0] - after[0]
            found.lines.append(f"and of the server until all is read and drawn: {1e3 * checked:.0f} ms")
            there, seen, answered = list[float](), list[float](), list[float]()
            choose, shown = random.Random(0), -1
            for _ in range(looks):
                frame = choose.choice([one for one in range(frames) if one % TRACKED != shown % TRACKED])
                drawing.clear()
                began, ready = window.page.evaluate(GO, frame)
                there.append(ready - began)
                seen.append(drawing.settled(sizes)[-1] - began)
                shown = frame
            before = spent(studio.process.pid)
            for _ in range(looks):
                clock = time.perf_counter()
                studio.get(f"/api/sessions/walk/runs/long/frames/{choose.randrange(frames)}")
                answered.append(1e3 * (time.perf_counter() - clock))
            share = 1e3 * (spent(studio.process.pid)[0] - before[0]) / looks
        if differing(window.wire.layers(), stored_clouds(window, shown)) != set():
            found.wrong.append(f"of frame {shown} other particles are drawn than are stored")
        found.times("a frame at random: the server's answer", answered)
        found.lines.append(f"of it processor time: {share:.0f} ms")
        found.times("its numbers on the page", there)
        found.times("its particles drawn", seen)
        window.close()
    finally:
        studio.stop()
    return found
