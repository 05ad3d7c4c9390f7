"""Things that stand in front of the subject: found in masks of a drawn walker, kept, unknown in the evidence."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from studio.evidence.backgrounds import Backgrounds
from studio.evidence.pipeline import EvidenceMaker
from studio.foundations.arrays import Bytes
from studio.foundations.geometry.projection import project
from studio.results.drawing_footage.cameras import placed_camera
from studio.runs.setup.mask_quality import count_frame
from studio.runs.setup.session_settings import session_settings
from studio.runs.setup.things_in_front import things_in_front
from studio.sessions.background_files import (
    add_polygon,
    painted_in_front,
    read_evidence,
    set_region,
    use_found_in_front,
)
from studio.sessions.session import Session

SIZE, FRAMES = (320, 240), 16
CAMERAS = tuple(
    placed_camera(f"cam{number}", (x, y, 1600.0), (0.0, 0.0, 900.0), size=SIZE, focal_px=260.0)
    for number, (x, y) in enumerate([(4200.0, 300.0), (300.0, 4000.0), (-4100.0, 200.0), (-200.0, -4300.0)])
)
PARTS = {
    "trunk": ((0.0, 0.0, 1150.0), (240.0, 260.0, 320.0)),
    "head": ((0.0, 0.0, 1620.0), (100.0, 90.0, 130.0)),
    "left": ((0.0, 120.0, 420.0), (110.0, 110.0, 440.0)),
    "right": ((0.0, -120.0, 420.0), (110.0, 110.0, 440.0)),
}
"""Of a standing body: middle and half axes, mm."""
TABLE = np.array([[150, 130], [215, 130], [215, 239], [150, 239]])
POLE = np.array([[160, 60], [166, 60], [166, 239], [160, 239]])


def ball() -> np.ndarray:
    """(K, 3) points on a sphere."""
    turns, heights = np.meshgrid(np.linspace(0, 2 * np.pi, 24), np.linspace(-1, 1, 17))
    width = np.sqrt(1 - heights**2)
    return np.stack([width * np.cos(turns), width * np.sin(turns), heights], axis=-1).reshape(-1, 3)


def masks_at(x: float, y: float) -> list[Bytes]:
    """(H, W) of each camera: the body at a place."""
    masks = [np.zeros(SIZE[::-1], np.uint8) for _ in CAMERAS]
    for middle, axes in PARTS.values():
        points = ball() * axes + np.add(middle, (x, y, 0.0))
        for mask, camera in zip(masks, CAMERAS, strict=True):
            pixels = np.rint(project(camera, points)[0]).astype(np.int32)
            cv2.fillConvexPoly(mask, cv2.convexHull(pixels), 255)
    return masks


def walking(frame: int) -> tuple[float, float]:
    return -450.0 + 900.0 * frame / FRAMES, 200.0 - 400.0 * frame / FRAMES


def standing(_: int) -> tuple[float, float]:
    return 100.0, 50.0


Way = Callable[[int], tuple[float, float]]


def seen_with(things: dict[int, np.ndarray], way: Way = walking) -> list[list[Bytes]]:
    """Masks of all frames. things : by camera, a polygon that hides what is behind it."""
    frames = [masks_at(*way(frame)) for frame in range(FRAMES)]
    for masks in frames:
        for at, corners in things.items():
            cv2.fillPoly(masks[at], [corners], 0)
    return frames


def nothing() -> list[Bytes]:
    return [np.zeros(SIZE[::-1], np.uint8) for _ in CAMERAS]


def polygon(corners: np.ndarray) -> np.ndarray:
    out = np.zeros(SIZE[::-1], np.uint8)
    cv2.fillPoly(out, [corners], 255)
    return out > 0


@pytest.mark.parametrize(("corners", "share"), [(TABLE, 0.7), (POLE, 0.3)], ids=["table", "pole"])
def test_what_hides_the_subject_of_one_camera_is_found(corners: np.ndarray, share: float) -> None:
    thing = polygon(corners)
    whole = seen_with({})
    hidden = np.sum([(masks[1] > 0) & thing for masks in whole], axis=0) >= 4
    assert hidden.sum() > 300
    found = [one > 0 for one in things_in_front(CAMERAS, seen_with({1: corners}), nothing())]
    assert (found[1] & hidden).sum() > share * hidden.sum()
    # What lies beside a thing never shows the subject, or is a pixel or two of its border.
    near = cv2.dilate(thing.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
    walked = np.any([masks[1] > 0 for masks in whole], axis=0)
    assert not (found[1] & walked & ~near).any()
    assert not any(found[at].any() for at in (0, 2, 3))


@pytest.mark.parametrize("way", [walking, standing])
def test_nothing_is_found_where_nothing_stands(way: Way) -> None:
    assert not any(one.any() for one in things_in_front(CAMERAS, seen_with({}, way), nothing()))


def test_who_stands_behind_a_table_is_enough_to_find_it() -> None:
    corners = np.array([[110, 150], [210, 150], [210, 239], [110, 239]])
    hidden = (masks_at(*standing(0))[1] > 0) & polygon(corners)
    found = things_in_front(CAMERAS, seen_with({1: corners}, standing), nothing())
    assert (found[1][hidden] > 0).mean() > 0.5


def test_what_is_known_is_not_found_again_and_helps_to_find_more() -> None:
    known = nothing()
    known[1] = np.where(polygon(TABLE), np.uint8(255), np.uint8(0))
    found = things_in_front(CAMERAS, seen_with({1: TABLE, 2: TABLE}), known)
    assert not (found[1] & known[1]).any()
    assert found[2].any()


def test_views_do_not_disagree_about_what_a_thing_hides() -> None:
    masks = seen_with({1: TABLE})[FRAMES // 2]
    thing = np.where(polygon(TABLE), np.uint8(255), np.uint8(0))
    before = count_frame(masks, CAMERAS)
    after = count_frame(masks, CAMERAS, in_front={"cam1": thing})
    lost = [1.0 - one.both[0] / one.mask[0] for one in (before, after)]
    assert lost[0] > 0.2
    assert lost[1] < 0.1
    assert after.removed[1] < 0.1 * before.removed[1]


def unknown_of(session: Session, camera: int) -> Bytes | None:
    footage = session.footage()
    try:
        maker = EvidenceMaker(
            session.cameras(), footage, Backgrounds(footage), session_settings(session).evidence, "none"
        )
        return maker.evidence(0).views[camera].unknown
    finally:
        footage.close()


def test_what_was_found_is_replaced_and_what_was_painted_stays(session_on_disk: Session) -> None:
    session = session_on_disk
    source = session.manifest.footage.cameras[0]
    place = session.path / "in_front" / f"{source.name}.png"
    thing = np.zeros((source.height, source.width), np.uint8)
    thing[:20, :30] = 255
    use_found_in_front(session, {source.name: thing})
    assert read_evidence(session).found_in_front == [source.name]
    assert painted_in_front(session) == []
    hidden = unknown_of(session, 0)
    assert hidden is not None
    assert (hidden[:20, :30] > 0).mean() > 0.9
    use_found_in_front(session, {})
    assert not place.exists()
    assert unknown_of(session, 0) is None
    # A find that was painted over is the user's own.
    use_found_in_front(session, {source.name: thing})
    corners = np.array([[0, 0], [9, 0], [9, 39], [0, 39]])
    assert add_polygon(session, "in_front", source.name, corners) == 20 * 30 + 20 * 10
    use_found_in_front(session, {})
    assert painted_in_front(session) == [source.name]
    assert place.exists()
    assert set_region(session, "in_front", source.name, b"") == 0
    assert painted_in_front(session) == []
