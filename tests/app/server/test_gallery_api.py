"""The gallery over HTTP: cards, sessions opened and made as jobs, and cards whose footage is elsewhere."""

import dataclasses
import threading
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest
from small_recipes import small
from toy_session import make_session
from waiting import until
from web_doubles import Studio

from studio.foundations.errors import RunError
from studio.foundations.progress import Progress
from studio.operations import gallery
from studio.operations.gallery import CARDS, GALLERY_PICTURES, Card
from studio.results.drawing_footage.clips import ClipWriter
from studio.results.drawing_footage.recipe_file import recipe_names
from studio.sessions.manifest import write_manifest
from studio.sessions.workspace import begin_session

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
    # Its body and meshes are not here.
    still = dataclasses.replace(gallery.card_of("med7"), body="", start_frame=None)
    monkeypatch.setattr(gallery, "CARDS", (still,))
    for name in ("left", "right"):
        folder = tmp_path / "robot-lbr-med7" / "pictures" / name
        folder.mkdir(parents=True)
        for number in range(2):
            cv2.imwrite(str(folder / f"{number:04d}.jpg"), np.full((48, 64, 3), 90 + number, np.uint8))
    studio.post("/api/gallery/med7")
    assert studio.ended("/api/gallery/med7")["state"] == "done"
    assert studio.get("/api/sessions/med7")["fps"] == 1.0


@pytest.fixture
def arm(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Card:
    """The one card is the toy arm, whose footage lies elsewhere."""
    monkeypatch.setenv("STUDIO_REAL_DATA", str(tmp_path))
    made = make_session(tmp_path / "films" / "toy")
    for path in made.path.iterdir():
        if path.name not in ("pictures", "masks", "calibration"):
            path.unlink()
    commands = tuple(
        f"studio {verb} toy" for verb in ("import", "subject", "background", "initialise", "track")
    )
    only = Card(
        "arm", "Arm", "It swings.", "elsewhere", footage="films/toy", unit="mm", fps=60.0, commands=commands,
        body="planar_arm4", masks="masks", start_frame=2,
    )  # fmt: skip
    monkeypatch.setattr(gallery, "CARDS", (only,))
    return only


def test_the_import_of_a_card_goes_on_to_body_masks_and_start_pose(studio: Studio, arm: Card) -> None:
    assert card(studio, "arm")["left"] == ["studio track toy"]
    studio.post("/api/gallery/arm", code=202)
    state = studio.ended("/api/gallery/arm")
    assert (state["state"], state["notes"]) == ("done", [])
    session = studio.workspace.session("arm")
    assert session.manifest.body == "planar_arm4"
    way = {step["step"]: step["state"] for step in studio.get("/api/sessions/arm/way")["steps"]}
    assert [way[step] for step in ("background", "subject", "start-pose")] == ["done"] * 3
    assert session.start_pose_frame() == 2
    assert (card(studio, "arm")["there"], card(studio, "arm")["session"]) == (True, "arm")


def test_what_cannot_be_done_after_the_import_is_said_and_the_import_stays(
    studio: Studio, arm: Card, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise RunError("Nothing is to be seen.", "Take another frame.")

    monkeypatch.setattr(gallery, "initialise", fails)
    studio.post("/api/gallery/arm", code=202)
    state = studio.ended("/api/gallery/arm")
    assert state["state"] == "done"
    assert "start pose" in state["notes"][0]
    assert "Nothing is to be seen. Take another frame." in state["notes"][0]
    assert card(studio, "arm")["there"] is True


def test_a_card_that_is_cancelled_after_its_import_leaves_nothing(
    studio: Studio, arm: Card, monkeypatch: pytest.MonkeyPatch
) -> None:
    going = threading.Event()

    def searches(*_: object, progress: Progress) -> None:
        while True:
            going.set()
            progress("searching", 1, 4)

    monkeypatch.setattr(gallery, "initialise", searches)
    studio.post("/api/gallery/arm", code=202)
    assert going.wait(60.0)
    studio.delete("/api/gallery/arm", code=202)
    assert studio.ended("/api/gallery/arm")["state"] == "cancelled"
    assert not (studio.workspace.root / "arm").exists()


def test_what_a_card_does_is_what_its_commands_say() -> None:
    for one in CARDS:
        words = " ".join(line for line in one.commands if line not in one.left)
        assert [line.split()[1] for line in one.left if line.split()[1] == "import"] == []
        for value, option in (
            (one.body, f"--body {one.body}"),
            (one.height_mm, f"--height {one.height_mm or 0:.0f}"),
            (one.masks, f"--source {one.masks}"),
            (one.plates, f"/{one.plates}"),
            (one.exclude_unused, "--exclude unused"),
            (one.start_frame, f"--frame {one.start_frame}"),
        ):
            assert (option in words) if value else value in ("", None, False, 0), (one.name, option)


def make_empty(studio: Studio, name: str, origin: str) -> None:
    made = begin_session(studio.workspace.root / name)
    write_manifest(made.path, msgspec.structs.replace(made.manifest, imported_from=origin))


def test_a_session_is_a_card_s_by_where_it_came_from_and_not_by_its_name(
    studio: Studio, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("STUDIO_REAL_DATA", str(tmp_path))
    for footage in ("three-a", "five"):
        (tmp_path / "mouse-cylinder" / footage).mkdir(parents=True)
    make_empty(studio, "cylinder", "/somewhere/mouse-cylinder/three-a")
    assert (card(studio, "rearing")["there"], card(studio, "rearing")["session"]) == (True, "cylinder")
    assert card(studio, "cylinder")["there"] is False
    assert "'cylinder', is taken" in card(studio, "cylinder")["missing"]
    studio.post("/api/gallery/cylinder")
    assert studio.ended("/api/gallery/cylinder")["state"] == "failed"
    studio.post("/api/gallery/rearing")
    assert studio.ended("/api/gallery/rearing")["state"] == "done"
    assert not (studio.workspace.root / "rearing").exists(), "the one that is there is opened"
    make_empty(studio, "box", "/somewhere/of/mine")
    assert card(studio, "box")["there"] is False
    make_empty(studio, "handstand", "recipe handstand.toml")
    assert card(studio, "handstand")["there"] is True
    # What was uploaded is known by its folder, else by its files' names.
    make_empty(studio, "fly", "/uploads/1234/fly")
    assert card(studio, "fly")["there"] is True


def test_uploaded_footage_of_a_card_s_name_is_known_by_its_files(
    studio: Studio, arm: Card, tmp_path: Path
) -> None:
    session = make_session(studio.workspace.root / "arm")
    write_manifest(session.path, msgspec.structs.replace(session.manifest, imported_from="/uploads/1234"))
    assert card(studio, "arm")["there"] is True
    (tmp_path / "films" / "toy" / "pictures" / "front").rename(
        tmp_path / "films" / "toy" / "pictures" / "left"
    )
    assert card(studio, "arm")["there"] is False


@pytest.mark.real_data
@pytest.mark.slow
@pytest.mark.parametrize("name", [one.name for one in CARDS if one.kind == "elsewhere"])
def test_footage_of_others_is_imported_as_it_lies(real_data: Path, studio: Studio, name: str) -> None:
    if card(studio, name)["missing"]:
        pytest.skip(f"the footage of {name} is not here")
    studio.post(f"/api/gallery/{name}")
    until(lambda: studio.get(f"/api/gallery/{name}")["state"] in ("done", "failed"), 1800.0)
    state = studio.get(f"/api/gallery/{name}")
    assert (state["state"], state["notes"]) == ("done", [])
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
    monkeypatch.setattr(gallery, "CARDS", (*CARDS, more))
    assert card(studio, "another")["title"] == "Standing"
