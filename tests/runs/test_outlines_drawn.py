"""Outlines over the bundled walk's pictures lie where an independent projection of the cones' surfaces lies.

The surface of every cone is sampled densely, carried by the kinematics and projected by OpenCV, lens included; the
convex hull of the pixels is the limb's silhouette. Both ways: no point of the one is farther from the other than 2 px.
"""

import cv2
import numpy as np
import pytest
from sample_walk import WALK
from scipy.spatial import KDTree

from studio.body.forward_kinematics import limb_frames
from studio.body.model import BodyModel, Limb
from studio.evidence.frame_evidence import ViewEvidence
from studio.foundations.geometry.camera import Camera
from studio.runs.drawing.colour_tokens import colour_tokens
from studio.runs.drawing.overlay_drawing import ViewMarks, draw_view
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.likelihood.overlay import overlay_points
from studio.sessions.session import Session

TOLERANCE_PX = 2.0
STATIONS, DIRECTIONS = 25, 180
SETTINGS = WEIGHTINGS["edge-region"].settings_type()


@pytest.fixture(scope="module")
def walk() -> tuple[BodyModel, tuple[Camera, ...], np.ndarray]:
    """The subject's body, the cameras, and six poses around the start pose."""
    session = Session(WALK)
    body = session.body()
    start = session.start_pose(body)
    turns = np.array([entry.kind == "angle" for entry in body.parameters])
    shifts = np.random.default_rng(0).uniform(-0.25, 0.25, (6, len(start))) * turns
    shifts[0] = 0.0
    return body, tuple(session.cameras()), start + shifts


def silhouette(limb: Limb, frame: np.ndarray, camera: Camera) -> np.ndarray:
    """(K, 2) pixels: the hull of the cone's surface, through OpenCV."""
    angles = np.linspace(0.0, 2.0 * np.pi, DIRECTIONS, endpoint=False)
    share = np.linspace(0.0, 1.0, STATIONS)[:, None]
    radius = limb.radius_start + (limb.radius_end - limb.radius_start) * share
    surface = np.stack(
        [
            radius * limb.scale_x * np.cos(angles),
            radius * limb.scale_y * np.sin(angles),
            np.broadcast_to(share * limb.length, (STATIONS, DIRECTIONS)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    world = surface @ frame[:, :3].T + frame[:, 3]
    turn, _ = cv2.Rodrigues(camera.rotation)
    pixels, _ = cv2.projectPoints(world, turn, camera.translation, camera.matrix, camera.distortion)
    return cv2.convexHull(pixels.astype(np.float32)).reshape(-1, 2)


def along(polygon: np.ndarray, count: int = 1500) -> np.ndarray:
    """(count, 2) points at even steps along a closed polygon."""
    closed = np.vstack([polygon, polygon[:1]])
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    steps = np.linspace(0.0, way[-1], count)
    return np.column_stack([np.interp(steps, way, closed[:, axis]) for axis in (0, 1)])


def farthest(ones: np.ndarray, others: np.ndarray) -> float:
    """How far a point of the first set is from the second at most."""
    return float(KDTree(others).query(ones)[0].max())


@pytest.mark.parametrize("number", range(6))
def test_every_limbs_outline_is_its_silhouette_in_every_view(
    walk: tuple[BodyModel, tuple[Camera, ...], np.ndarray], number: int
) -> None:
    body, cameras, poses = walk
    frames = limb_frames(body, poses[number])[0]
    compared = 0
    for seen, camera in zip(overlay_points(body, cameras, poses[number], SETTINGS), cameras, strict=True):
        for limb, frame, contour in zip(body.drawn, frames, seen.contours, strict=True):
            expected, drawn = along(silhouette(limb, frame, camera)), along(contour)
            assert farthest(expected, drawn) < TOLERANCE_PX
            assert farthest(drawn, expected) < TOLERANCE_PX
            compared += 1
    assert compared == len(body.drawn) * len(cameras)


def test_the_pixels_that_are_painted_lie_on_the_silhouettes(
    walk: tuple[BodyModel, tuple[Camera, ...], np.ndarray],
) -> None:
    body, cameras, poses = walk
    frames = limb_frames(body, poses[1])[0]
    for seen, camera in zip(overlay_points(body, cameras, poses[1], SETTINGS), cameras, strict=True):
        blank = np.full((camera.height, camera.width, 3), 90, dtype=np.uint8)
        nothing = np.zeros((0, 0), dtype=np.uint8)
        marks = ViewMarks(
            seen.contours, tuple(limb.side for limb in body.drawn), np.zeros((0, 2)), np.zeros((0, 2))
        )
        view = ViewEvidence(camera.name, blank, nothing, nothing)
        picture = draw_view(view, marks, ("outline",), colour_tokens()).astype(int)
        # The lines are the only saturated colours; their dark rim is left out.
        painted = np.argwhere(np.ptp(picture, axis=2) > 60)[:, ::-1]
        assert len(painted) > 300
        lines = np.concatenate(
            [along(silhouette(limb, frame, camera)) for limb, frame in zip(body.drawn, frames, strict=True)]
        )
        assert farthest(painted, lines) < TOLERANCE_PX
        assert farthest(lines, painted) < TOLERANCE_PX
