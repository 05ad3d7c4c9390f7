"""Pictures with overlays: what is drawn lies where an independent projection puts it."""

import dataclasses

import cv2
import numpy as np
import pytest

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends, limb_frames
from studio.evidence.frame_evidence import ViewEvidence
from studio.foundations.errors import StudioError
from studio.foundations.geometry.camera import Camera
from studio.runs.drawing.colour_tokens import colour_tokens, parse_tokens, tokens_file
from studio.runs.drawing.marker_lines import marker_links, marker_sides
from studio.runs.drawing.overlay_drawing import (
    ViewMarks,
    draw_view,
    encode_jpeg,
    projected_silhouette,
    sample_costs,
    upright,
)
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.likelihood.overlay import overlay_points

HEIGHT, WIDTH = 240, 320


def side_camera() -> Camera:
    """A camera 4 m along x at the hips' height, looking back along x with z up."""
    rotation = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
    centre = np.array([4000.0, 0.0, 900.0])
    matrix = np.array([[300.0, 0.0, 160.0], [0.0, 305.0, 118.0], [0.0, 0.0, 1.0]])
    distortion = np.array([-0.2, 0.05, 0.001, 0.0005, 0.0])
    return Camera("side", WIDTH, HEIGHT, matrix, distortion, rotation, -rotation @ centre)


def evidence(mask: np.ndarray | None = None, edges: np.ndarray | None = None) -> ViewEvidence:
    nothing = np.zeros((HEIGHT, WIDTH), dtype=np.uint8)
    picture = np.full((HEIGHT, WIDTH, 3), 90, dtype=np.uint8)
    return ViewEvidence(
        "side", picture, nothing if mask is None else mask, nothing if edges is None else edges
    )


def square(left: float, top: float, size: float) -> np.ndarray:
    return np.array([[left, top], [left + size, top], [left + size, top + size], [left, top + size]])


def marks(contour: np.ndarray, **more: object) -> ViewMarks:
    none = np.zeros((0, 2))
    return ViewMarks((contour,), ("left",), none, none, **more)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
def test_outlines_lie_within_two_pixels_of_opencvs_projection(scale: float) -> None:
    body, camera = load_body("human31"), side_camera()
    pose = body.neutral + np.random.default_rng(2).uniform(-0.3, 0.3, len(body.parameters))
    seen = overlay_points(body, (camera,), pose, WEIGHTINGS["edge-region"].settings_type())[0]
    drawn = draw_view(
        evidence(),
        ViewMarks(seen.contours, tuple(limb.side for limb in body.drawn), np.zeros((0, 2)), np.zeros((0, 2))),
        ("outline",),
        colour_tokens(),
        scale=scale,
    )
    touched = np.argwhere((drawn != 90).any(axis=2))[:, ::-1] / scale
    # Rims of the cones through OpenCV: every point of the surface's silhouette lies near some touched pixel.
    frames = limb_frames(body, pose)[0]
    vector, _ = cv2.Rodrigues(camera.rotation)
    for limb, frame in zip(body.drawn, frames, strict=True):
        axis = frame[:, :3].T @ (camera.centre - frame[:, 3])
        aside = np.array([-axis[1] * limb.scale_x, axis[0] * limb.scale_y])
        aside /= np.hypot(aside[0] / limb.scale_x, aside[1] / limb.scale_y)
        for sign in (-1.0, 1.0):
            rim = frame[:, :3] @ [
                sign * limb.radius_start * aside[0],
                sign * limb.radius_start * aside[1],
                0.0,
            ]
            pixel, _ = cv2.projectPoints(
                (rim + frame[:, 3])[None], vector, camera.translation, camera.matrix, camera.distortion
            )
            assert np.linalg.norm(touched - pixel.ravel(), axis=1).min() < 2.0 + 1.0 / scale


def test_silhouettes_are_red_blue_and_yellow() -> None:
    mask = np.zeros((HEIGHT, WIDTH), dtype=np.uint8)
    mask[50:100, 50:100] = 255
    drawn = draw_view(evidence(mask), marks(square(75, 75, 50)), ("mask",), colour_tokens())
    for pixel, token in (((60, 60), "observed"), ((110, 110), "projected"), ((90, 90), "both")):
        expected = 0.5 * 90 + 0.5 * np.array(colour_tokens()[f"silhouette-{token}"][::-1])
        np.testing.assert_allclose(drawn[pixel], expected, atol=1.0)
    np.testing.assert_array_equal(drawn[10, 10], [90, 90, 90])


def test_what_cannot_be_told_is_violet_inside_and_outside_the_model() -> None:
    mask, unknown = np.zeros((HEIGHT, WIDTH), np.uint8), np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[50:100, 50:100], unknown[90:140, 50:140] = 255, 255
    seen = dataclasses.replace(evidence(mask), unknown=unknown)
    drawn = draw_view(seen, marks(square(75, 75, 50)), ("mask",), colour_tokens())
    wanted = {(60, 60): "observed", (95, 95): "both", (95, 55): "observed", (110, 110): "unknown"}
    for pixel, token in {**wanted, (135, 60): "unknown", (80, 110): "projected"}.items():
        expected = 0.5 * 90 + 0.5 * np.array(colour_tokens()[f"silhouette-{token}"][::-1])
        np.testing.assert_allclose(drawn[pixel], expected, atol=1.0)


def test_the_filled_silhouette_has_the_squares_area() -> None:
    area = np.count_nonzero(projected_silhouette((square(20, 30, 60),), HEIGHT, WIDTH))
    # fillPoly paints the boundary's pixels as well: one row and column more than the square is wide.
    assert area == 61 * 61
    nothing = np.full((4, 2), np.nan)
    assert not projected_silhouette((nothing, np.zeros((0, 2)), square(1e7, 0, 5)), HEIGHT, WIDTH).any()


def test_an_edge_map_tints_by_its_strength() -> None:
    edges = np.zeros((HEIGHT, WIDTH), dtype=np.uint8)
    edges[5, 5], edges[6, 6] = 255, 51
    drawn = draw_view(evidence(edges=edges), marks(np.zeros((0, 2))), ("edges",), colour_tokens())
    tint = np.array(colour_tokens()["edge-map"][::-1])
    np.testing.assert_allclose(drawn[5, 5], tint, atol=1.0)
    np.testing.assert_allclose(drawn[6, 6], 0.8 * 90 + 0.2 * tint, atol=1.0)


def test_dots_and_truth_land_on_their_pixels_and_far_ones_are_left_out() -> None:
    points = np.array([[40.0, 60.0], [np.nan, 3.0], [1e9, 1e9]])
    truth = np.array([[[100.0, 200.0], [140.0, 200.0]], [[np.nan, 0.0], [1.0, 1.0]]])
    given = marks(np.zeros((0, 2)), clouds=((points, (0, 255, 0)),), truth=truth)
    drawn = draw_view(evidence(), given, ("particles", "truth"), colour_tokens())
    np.testing.assert_array_equal(drawn[60, 40], [0, 255, 0])
    assert (drawn[200, 120] > 200).all(), "white, softened at its rim"
    assert (drawn[:, 250:] == 90).all()


def test_grey_pictures_are_drawn_upon_in_colour_and_the_source_is_left_alone() -> None:
    grey = ViewEvidence(
        "side", np.full((20, 30), 7, dtype=np.uint8), np.zeros((0, 0), np.uint8), np.zeros((0, 0), np.uint8)
    )
    drawn = draw_view(grey, marks(square(5, 5, 10)), ("outline",), colour_tokens())
    assert drawn.shape == (20, 30, 3)
    assert (grey.picture == 7).all()


def test_turning_upright_and_encoding() -> None:
    picture = np.zeros((10, 20, 3), dtype=np.uint8)
    picture[0, 19] = 255
    assert upright(picture, 1)[19, 9].all()
    decoded = cv2.imdecode(np.frombuffer(encode_jpeg(picture), dtype=np.uint8), cv2.IMREAD_COLOR)
    assert decoded.shape == picture.shape


def test_the_style_sheet_declares_every_colour_for_both_themes() -> None:
    themes = parse_tokens(tokens_file().read_text())
    for theme in themes.values():
        for token in (
            "limb-left",
            "limb-right",
            "limb-middle",
            "truth",
            "ghost",
            *(f"layer-{i}" for i in range(10)),
        ):
            assert len(theme[token]) == 3
    assert themes["dark"]["truth"] == (255, 255, 255)
    assert sum(themes["light"]["truth"]) < 120
    assert themes["dark"].layer(0, 7) == themes["dark"]["layer-0"]
    assert themes["dark"].layer(6, 7) == themes["dark"]["layer-9"]
    with pytest.raises(StudioError, match="no-such"):
        themes["dark"]["no-such"]


def test_a_block_inside_a_media_query_or_an_unknown_value_changes_nothing() -> None:
    text = """
        :root { --a: #102030; --b: red; }
        @media print { :root { --a: #ffffff; } }
        :root[data-theme="light"] { --a: #010203; }
    """
    themes = parse_tokens(text)
    assert themes["dark"].colours == {"a": (16, 32, 48)}
    assert themes["light"].colours == {"a": (1, 2, 3)}


def test_stick_figures_follow_the_tree() -> None:
    body = load_body("human31")
    names = ["Hip", "Neck", "Head", "LHip", "LKnee", "LAnkle", "LShoulder", "LElbow", "Clock"]
    links = {frozenset((names[a], names[b])) for a, b in marker_links(body, names)}
    assert links == {
        frozenset(pair)
        for pair in (
            ("Hip", "Neck"),
            ("Neck", "Head"),
            ("Hip", "LHip"),
            ("LHip", "LKnee"),
            ("LKnee", "LAnkle"),
            ("Neck", "LShoulder"),
            ("LShoulder", "LElbow"),
        )
    }
    assert marker_links(body, ["Clock"]) == []
    assert marker_sides(body)["LWrist"] == "left"
    assert marker_sides(body)["Head"] == "middle"


def test_shoulders_hang_on_the_neck_of_every_human_body() -> None:
    for name in ("human25", "human29", "human31", "human34"):
        body = load_body(name)
        names = [marker.name for marker in body.markers]
        assert ("Neck", "RShoulder") in {(names[a], names[b]) for a, b in marker_links(body, names)}, name
    assert limb_ends(load_body("human25"), load_body("human25").neutral).shape == (1, 14, 2, 3)


def test_bodies_beside_one_another_have_their_own_colours() -> None:
    contours = [square(left, 80.0, 40.0) for left in (40.0, 140.0, 240.0)]
    several = marks(
        contours[0], own="series-0", beside=(((contours[1],), "series-1"), ((contours[2],), "series-2"))
    )
    tokens = colour_tokens()
    outlined = draw_view(evidence(), several, ("outline",), tokens)
    filled = draw_view(evidence(), several, ("filled",), tokens)
    for at, contour in enumerate(contours):
        colour = np.array(tokens[f"series-{at}"][::-1])
        column, row = (int(number) for number in contour[0])
        assert np.abs(outlined[row + 20, column].astype(int) - colour).max() <= 30
        assert (outlined[row + 20, column + 20] == 90).all(), "an outline leaves its inside free"
        mixed = 0.45 * colour + 0.55 * 90
        assert np.abs(filled[row + 20, column + 20] - mixed).max() <= 1.5
    assert (filled[20, 20] == 90).all()


def test_samples_are_coloured_by_what_they_cost() -> None:
    mask = np.zeros((HEIGHT, WIDTH), dtype=np.uint8)
    mask[:, :100] = 255
    mask[:, 100:200] = 128
    points = np.array([[50.0, 60.0], [150.0, 60.0], [250.0, 60.0], [np.nan, 60.0]])
    costs = sample_costs(points, mask)
    np.testing.assert_allclose(costs, [0.0, (1.0 - 128 / 255) ** 2, 1.0, 1.0])
    none = np.zeros((0, 2))
    drawn = draw_view(evidence(mask), ViewMarks((), (), none, points), ("cost",), colour_tokens())
    for (column, row), level in zip(points[:3].astype(int), (0, 2, 9), strict=True):
        assert tuple(drawn[row, column][::-1]) == colour_tokens().layer(level, 10)
    # Without a map of the evidence there is nothing to read.
    bare = ViewEvidence("side", evidence().picture, np.zeros((0, 0), np.uint8), np.zeros((0, 0), np.uint8))
    assert (draw_view(bare, ViewMarks((), (), points, points), ("cost",), colour_tokens()) == 90).all()
