"""The gallery over HTTP: cards, sessions opened and made as jobs, and cards whose footage is elsewhere."""

import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest
from small_recipes import small
from waiting import until
from web_doubles import Studio

from studio.operations import gallery
from studio.operations.gallery import CARDS, GALLERY_PICTURES, Card
from studio.results.drawing_footage.clips import ClipWriter
from studio.results.drawing_footage.recipe_file import recipe_names

SHORT = Card("stand", "Standing", "Almost still.")


def card(studio: Studio, name: str) -> dict:
    return next(one for one in studio.get("/api/gallery")["cards"] if one["name"] == name)


def test_every_card_can_be_opened_made_or_tells_where_its_footage_is(studio: Studio) -> None:
    names = [one["name"] for one in studio.get("/api/gallery")["cards"]]
    assert names == [one.name for one in CARDS]
    assert len(set(names)) == len(names)
    assert {"walk", "planar_arm", "branched_arms", "mouse", "balance"} <= set(names)
    for one in CARDS:
        assert one.title
        assert one.words
        if one.kind == "recipe":
            assert (one.recipe or one.name) in recipe_names()
        if one.kind == "elsewhere":
            assert one.data
            assert one.footage
            assert all(line.startswith("studio ") for line in one.commands)


def test_a_bundled_session_is_opened_and_stays(studio: Studio) -> None:
    assert studio.client.get("/api/gallery/planar_arm/picture.jpg").headers["content-type"] == "image/jpeg"
    assert card(studio, "planar_arm")["there"] is False
    studio.post("/api/gallery/planar_arm", code=202)
    assert studio.ended("/api/gallery/planar_arm")["state"] == "done"
    assert card(studio, "planar_arm")["there"] is True
    studio.get("/api/sessions/planar_arm")
    studio.post("/api/gallery/planar_arm")
    assert studio.ended("/api/gallery/planar_arm")["state"] == "done"


def test_what_can_be_rendered_has_a_picture_before_it_is(studio: Studio) -> None:
    shipped = {path.stem for path in GALLERY_PICTURES.glob("*.jpg")}
    assert shipped == {one.name for one in CARDS if one.kind == "recipe"}, "make gallery-pictures"
    for name in shipped:
        assert card(studio, name)["picture"]
        assert not card(studio, name)["there"]
        shown = studio.client.get(f"/api/gallery/{name}/picture.jpg")
        assert shown.headers["content-type"] == "image/jpeg"
        assert len(shown.content) < 40_000


@pytest.fixture
def standing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The one card is a recipe, whose pictures are small."""
    monkeypatch.setattr(gallery, "CARDS", (SHORT,))
    real, recipe = gallery.synthesize, small(tmp_path, "stand", frames=60)
    monkeypatch.setattr(
        gallery, "synthesize", lambda _, into, report, frames: real(recipe, into, report, frames)
    )


@pytest.mark.slow
def test_a_recipe_is_rendered_as_a_job(
    studio: Studio, standing: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = gallery.synthesize
    monkeypatch.setattr(gallery, "synthesize", lambda recipe, into, report, _: real(recipe, into, report, 2))
    studio.post("/api/gallery/stand", code=202)
    assert studio.ended("/api/gallery/stand")["state"] == "done"
    assert studio.get("/api/sessions/stand")["frame_count"] == 2


def test_rendering_that_is_cancelled_leaves_nothing(studio: Studio, standing: None) -> None:
    studio.post("/api/gallery/stand")
    until(lambda: studio.get("/api/gallery/stand")["done"] > 0, 120.0)
    studio.delete("/api/gallery/stand", code=202)
    assert studio.ended("/api/gallery/stand")["state"] == "cancelled"
    assert not (studio.workspace.root / "stand").exists()


def test_footage_that_is_not_shipped_is_imported_where_there_is_a_copy(
    studio: Studio, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("STUDIO_REAL_DATA", str(tmp_path))
    assert "STUDIO_REAL_DATA" in card(studio, "mouse")["missing"]
    videos = tmp_path / "mouse" / "videos"
    videos.mkdir(parents=True)
    (videos / "back.mp4").write_bytes(b"no video")
    assert card(studio, "mouse")["missing"] == ""
    studio.post("/api/gallery/mouse")
    assert studio.ended("/api/gallery/mouse")["state"] == "failed"
    assert not (studio.workspace.root / "mouse").exists(), "what failed leaves nothing"
    for name in ("back", "top"):
        with ClipWriter(videos / f"{name}.mp4", (64, 48), 30.0, 12) as clip:
            for level in range(4):
                clip.add(np.full((48, 64, 3), 40 * level, np.uint8))
    studio.post("/api/gallery/mouse")
    assert studio.ended("/api/gallery/mouse")["state"] == "done"
    assert card(studio, "mouse")["there"] is True
    assert studio.get("/api/sessions/mouse")["frame_count"] == 4


def test_pictures_that_do_not_say_their_rate_have_the_cards(
    studio: Studio, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("STUDIO_REAL_DATA", str(tmp_path))
    for name in ("left", "right"):
        folder = tmp_path / "robot-lbr-med7" / "pictures" / name
        folder.mkdir(parents=True)
        for number in range(2):
            cv2.imwrite(str(folder / f"{number:04d}.jpg"), np.full((48, 64, 3), 90 + number, np.uint8))
    studio.post("/api/gallery/med7")
    assert studio.ended("/api/gallery/med7")["state"] == "done"
    assert studio.get("/api/sessions/med7")["fps"] == 1.0


@pytest.mark.real_data
@pytest.mark.slow
@pytest.mark.parametrize("name", [one.name for one in CARDS if one.kind == "elsewhere"])
def test_footage_of_others_is_imported_as_it_lies(real_data: Path, studio: Studio, name: str) -> None:
    if card(studio, name)["missing"]:
        pytest.skip(f"the footage of {name} is not here")
    studio.post(f"/api/gallery/{name}")
    assert studio.ended(f"/api/gallery/{name}")["state"] == "done"
    assert studio.get(f"/api/sessions/{name}")["frame_count"] > 1


def test_what_cannot_be_made_says_why(
    studio: Studio, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("STUDIO_REAL_DATA", str(tmp_path / "nowhere"))
    studio.post("/api/gallery/mouse")
    state = studio.ended("/api/gallery/mouse")
    assert state["state"] == "failed"
    assert "sleap-anipose" in state["hint"]
    studio.post("/api/gallery/nothing", code=404)
    studio.get("/api/gallery/mouse/picture.jpg", code=404)
    assert "STUDIO_REAL_DATA" in card(studio, "dance")["missing"]
    assert card(studio, "handstand")["missing"] == ""


def test_a_card_more_is_an_entry_more(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    more = dataclasses.replace(SHORT, name="another", recipe="stand")
    monkeypatch.setattr("studio.app.server.gallery_routes.CARDS", (*CARDS, more))
    assert card(studio, "another")["title"] == "Standing"
