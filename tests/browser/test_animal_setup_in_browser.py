"""A mouse, from its raw videos and pictures of a board to a CSV of points, in the browser only (the guide's animal).

The first frames of four videos, pictures of a board, and a person's clicks and strokes; no file is written by hand and
no command typed. Pictures of every step are kept in STUDIO_ARTEFACTS/animal-guided.
"""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from guided_setup import GuidedSetup
from playwright.sync_api import Page, expect

from studio.results.drawing_footage.clips import ClipWriter

pytestmark = [pytest.mark.slow, pytest.mark.browser, pytest.mark.real_data, pytest.mark.timeout(3600)]

PICTURES = "animal-setup"
FRAMES = 10
SIZE = (1280, 1024)
"""Pixels, width and height."""
TURNED: tuple[Callable[[float, float], tuple[float, float]], ...] = (
    lambda x, y: (x, y),
    lambda x, y: (SIZE[1] - 1 - y, x),
    lambda x, y: (SIZE[0] - 1 - x, SIZE[1] - 1 - y),
    lambda x, y: (y, SIZE[0] - 1 - x),
)
"""Where a pixel lies after quarter turns clockwise."""
CAMERAS = ("back", "mid", "side", "top")
STROKES = Path(__file__).resolve().parents[1] / "real_data" / "mouse_setup_strokes.json"
APART_MM = {("Nose", "TTI"): (60.0, 130.0), ("Shoulder_left", "Shoulder_right"): (15.0, 40.0)}
"""Distances of a grown mouse's points (by the footage's proofread points: 85 and 27 mm)."""


@pytest.fixture(scope="module")
def raw(real_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What was recorded: the board's pictures, and the first frames of the videos."""
    mouse = real_data / "mouse"
    if not mouse.is_dir():
        pytest.skip("the mouse's footage is not here")
    folder = tmp_path_factory.mktemp("raw")
    (folder / "videos").mkdir()
    (folder / "board").symlink_to(mouse / "board")
    for name in CAMERAS:
        with (
            av.open(str(mouse / "videos" / f"{name}.mp4")) as video,
            ClipWriter(folder / "videos" / f"{name}.mp4", SIZE, 30.0, 12) as clip,
        ):
            for _, frame in zip(range(FRAMES), video.decode(video=0), strict=False):
                clip.add(frame.to_ndarray(format="bgr24"))
    return folder


def test_footage(guided: GuidedSetup, raw: Path) -> None:
    page = guided.page
    page.locator("dialog input[name=name]").fill("mouse")
    page.get_by_role("combobox", name="Who or what is tracked").select_option("mouse")
    page.click("dialog button.primary")
    guided.stands("footage", "ready")
    page.set_input_files("input[name=files]", sorted((raw / "videos").glob("*.mp4")))
    guided.press("Add footage")
    guided.stands("footage", "done")
    guided.shoot("footage")


def test_calibration_from_pictures_of_a_board(guided: GuidedSetup, raw: Path) -> None:
    """One folder of pictures a camera gives lenses, places and, by its first picture, the floor."""
    page = guided.page
    guided.to("calibration")
    page.get_by_role("tab", name="From a board").click()
    for label, value in (("Columns", "8"), ("Rows", "11"), ("Square mm", "24"), ("Marker mm", "18.75")):
        page.get_by_label(label, exact=True).fill(value)
    page.get_by_role("combobox", name="Markers", exact=True).select_option("DICT_4X4_1000")
    page.get_by_label("Upload a folder").set_input_files((raw / "board").resolve())
    page.get_by_label("Board on the floor in frame").fill("0")
    guided.press("Calibrate")
    expect(page.locator(".proposal")).to_contain_text("ChArUco board 8x11")
    guided.shoot("calibration-proposed")
    guided.press("Use this calibration")
    guided.stands("calibration", "done")
    guided.shoot("calibration")


def paint(page: Page, stroke: dict[str, Any], turns: int) -> None:
    """A stroke with the mouse, as wide as it was drawn, on a picture that is shown after so many quarter turns."""
    size = page.get_by_label("Size of the brush")
    size.fill(str(stroke["width"]))
    page.get_by_role("button", name=stroke["kind"].title(), exact=True).click()
    canvas = page.locator(".strokes-canvas")
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    scale = box["width"] / SIZE[turns % 2]
    upright = [TURNED[turns](x, y) for x, y in stroke["points"]]
    places = [(box["x"] + scale * (x + 0.5), box["y"] + scale * (y + 0.5)) for x, y in upright]
    page.mouse.move(*places[0])
    page.mouse.down()
    for place in places[1:]:
        page.mouse.move(*place, steps=4)
    page.mouse.up()


def test_masks_from_strokes(guided: GuidedSetup) -> None:
    page = guided.page
    strokes = json.loads(STROKES.read_text())["strokes"]
    turns = {one["name"]: one["quarter_turns"] for one in guided.studio.get("/api/sessions/mouse")["cameras"]}
    guided.to("background")
    page.set_viewport_size({"width": 1920, "height": 1080})
    page.get_by_role("radio", name="Strokes Anything").check()
    for name in CAMERAS:
        page.get_by_role("button", name=f"Paint on {name}").click()
        page.locator(".strokes-canvas").wait_for()
        for stroke in strokes:
            if stroke["camera"] == name:
                paint(page, stroke, turns[name])
        page.get_by_role("button", name="Keep", exact=True).first.click()
        page.locator(".masks .picture").first.wait_for()
    guided.press("Set up the background")
    shares = guided.agreement()
    print("agreement:", shares)
    assert min(shares) >= 0.8
    guided.shoot("masks")


def test_the_body_is_made_of_the_shipped_mouse(guided: GuidedSetup) -> None:
    """The shipped mouse is chosen, changed on the page of bodies, and saved as this session's own."""
    page = guided.page
    guided.to("subject")
    page.get_by_role("combobox", name="Body", exact=True).select_option("mouse")
    guided.press("Take this body")
    guided.stands("subject", "done")
    guided.shoot("subject")
    page.get_by_role("link", name="Change it, or make one of your own").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("mouse")
    ear = page.get_by_label("left ear, length", exact=True)
    ear.fill("9")
    ear.press("Tab")
    expect(page.get_by_label("right ear, length", exact=True)).to_have_value("9")
    guided.shoot("body")
    page.get_by_role("button", name="Save…").click()
    page.get_by_label("Name", exact=True).fill("my-mouse")
    page.get_by_role("button", name="Save", exact=True).click()
    page.get_by_role("link", name="Go on in the guided set-up").click()
    guided.stands("subject", "done")
    assert guided.studio.get("/api/sessions/mouse")["body"]["name"] == "my-mouse"


def test_start_pose(guided: GuidedSetup) -> None:
    guided.to("start-pose")
    guided.press("Find it automatically")
    guided.stands("start-pose", "done")
    expect(guided.page.locator("figure.picture img[alt*='start pose']")).to_have_count(4)
    guided.shoot("start-pose")
    guided.press("Yes, track all frames from here")


def test_track_and_check(guided: GuidedSetup) -> None:
    """Tracking began with the answer that left and right are right."""
    page = guided.page
    expect(page.locator(".track-status .step-progress")).to_have_count(0)
    guided.stands("track", "done")
    guided.shoot("track")
    guided.to("check")
    guided.press("Check the motion")
    expect(page.locator(".share-strip button").first).to_be_visible()
    expect(page.locator("#step .step-progress")).to_have_count(0)
    guided.shoot("check")


def test_a_csv_of_points_comes_out(guided: GuidedSetup, tmp_path: Path) -> None:
    page = guided.page
    guided.to("export")
    page.locator(".export .format", has_text=".csv").click()
    page.locator(".export-actions button.primary").click()
    guided.stands("export", "done")
    guided.shoot("export")
    file = guided.download(tmp_path)
    with file.open(newline="") as opened:
        rows = list(csv.DictReader(line for line in opened if not line.startswith("#")))
    assert len(rows) == FRAMES
    for (one, other), (least, most) in APART_MM.items():
        for row in rows:
            points = np.array(
                [[float(row[f"{name} {axis} [mm]"]) for axis in "xyz"] for name in (one, other)]
            )
            assert least < float(np.linalg.norm(points[0] - points[1])) < most
