"""Pictures and films of the scene: captions, files that read back, what the scene shows before and after."""

import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import av
import cv2
import numpy as np
import pytest
from PIL import Image

from studio.app.scene.model import LayerPlayback, Model, Selection
from studio.app.scene.scene_pictures import (
    STANDING,
    Film,
    ScenePictures,
    UnseenSceneError,
    captioned,
    png_of,
    write_film,
)
from studio.foundations.arrays import Bytes
from studio.runs.drawing.colour_tokens import colour_tokens

DARK = colour_tokens(dark=True)
SIZE = (320, 180)


class Browser:
    """A client that draws its picture's number as a grey."""

    def __init__(self) -> None:
        self.asked: list[tuple[int, int]] = []
        self.camera = SimpleNamespace(
            image_width=SIZE[0], image_height=SIZE[1], wxyz=(1, 0, 0, 0), position=(1, 2, 3), fov=0.9
        )

    def get_render(self, height: int, width: int, **_: object) -> Bytes:
        self.asked.append((width, height))
        picture = np.zeros((height, width, 4), dtype=np.uint8)
        picture[: height // 2] = (10 * len(self.asked), 90, 30, 255)
        return picture


class Controller:
    """A scene's thread that does at once what is posted; three layers there are."""

    def __init__(self) -> None:
        shown = Selection("walk", "run-1", 9, 1)
        self.model = Model(SimpleNamespace(), selection=shown, layers=LayerPlayback(playing=True, phase=0.3))  # pyright: ignore[reportArgumentType]
        self.opened = None
        self.seen: list[tuple[int | None, float]] = []
        self.layers = 3
        self.rates: set[float] = set()

    def post(self, change: object, *, announce: bool) -> None:
        assert not announce
        self.model = change(self.model)  # pyright: ignore[reportCallIssue]

    def draw_now(self, drawn: object) -> None:
        if self.model.layers.phase not in (0.3, 1.0):
            self.rates.add(self.model.layers.rate)
        self.seen.append((self.model.selection.layer, self.model.layers.phase))
        drawn(self.layers)  # pyright: ignore[reportCallIssue]


@pytest.fixture
def scene() -> tuple[ScenePictures, Browser, Controller]:
    browser, controller = Browser(), Controller()
    server = SimpleNamespace(get_clients=lambda: {0: browser})
    return ScenePictures(server, controller), browser, controller  # pyright: ignore[reportArgumentType]


def test_a_picture_is_twice_the_window_with_its_caption_below(
    scene: tuple[ScenePictures, Browser, Controller],
) -> None:
    pictures, browser, _ = scene
    made = pictures.take(2.0)
    assert browser.asked == [(640, 360)]
    assert made.shape[1] == 640
    assert made.shape[0] > 380
    assert (made[0, 0] == (10, 90, 30, 255)).all()
    assert tuple(made[300, 5]) == (*DARK["scene-background"], 255)
    caption = made[362:]
    assert (np.abs(caption[..., :3].astype(int) - DARK["text"]).sum(axis=-1) < 30).sum() > 50
    read = cv2.imdecode(np.frombuffer(png_of(made), np.uint8), cv2.IMREAD_UNCHANGED)
    assert tuple(read[0, 0]) == (30, 90, 10, 255)
    clear = pictures.take(1.0, transparent=True)
    assert clear[170, 5, 3] == clear[-1, -1, 3] == 0


def test_a_long_caption_is_wrapped(tmp_path: Path) -> None:
    picture = np.zeros((180, 320, 4), dtype=np.uint8)
    one, many = (captioned(picture, "title", words, DARK).shape[0] for words in ("a word", "a word " * 40))
    assert many > one + 30


@pytest.mark.parametrize("kind", ["mp4", "gif"])
def test_a_film_of_layers_goes_through_all_and_puts_the_scene_back(
    scene: tuple[ScenePictures, Browser, Controller], tmp_path: Path, kind: str
) -> None:
    pictures, browser, controller = scene
    before, reported = controller.model, list[tuple[int, int]]()
    place = tmp_path / f"film.{kind}"
    count = pictures.film(Film(kind, 5.0), place, lambda *step: reported.append(step))
    assert count == 9
    assert [layer for layer, _ in controller.seen[1:]] == [0, 0, 0, 1, 1, 1, 2, 2, 2]
    assert [round(phase, 2) for _, phase in controller.seen[1:4]] == [0.33, 0.67, 1.0]
    assert controller.rates == {STANDING}, "the particles wait for the browser"
    assert reported == [(done, 9) for done in range(9)]
    assert len(browser.asked) == 9
    assert controller.model.selection == before.selection
    assert controller.model.layers == before.layers
    if kind == "gif":
        with Image.open(place) as read:
            assert read.n_frames == 9  # pyright: ignore[reportAttributeAccessIssue]
    else:
        with av.open(str(place)) as read:
            stream = read.streams.video[0]
            assert sum(1 for _ in read.decode(stream)) == 9 + 15
            assert (stream.width, stream.average_rate) == (320, 15)


def test_a_cancelled_film_puts_the_scene_back_and_frees_it(
    scene: tuple[ScenePictures, Browser, Controller], tmp_path: Path
) -> None:
    pictures, _, controller = scene
    before = controller.model

    def stop(done: int, total: int) -> None:
        if done == 4:
            raise KeyboardInterrupt

    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            pictures.film(Film("mp4", 5.0), tmp_path / "film.mp4", stop)
        assert controller.model.selection == before.selection


def test_what_cannot_be_drawn_is_said(
    scene: tuple[ScenePictures, Browser, Controller], tmp_path: Path
) -> None:
    pictures, _, controller = scene
    controller.layers = 0
    with pytest.raises(UnseenSceneError, match="has no layers"):
        pictures.film(Film("mp4", 3.0), tmp_path / "film.mp4", lambda *_: None)
    unseen = ScenePictures(SimpleNamespace(get_clients=dict), controller)  # pyright: ignore[reportArgumentType]
    with pytest.raises(UnseenSceneError, match="No browser shows this scene"):
        unseen.take()
    begun, go_on = threading.Event(), threading.Event()
    controller.layers = 1

    def wait(*_: int) -> None:
        begun.set()
        assert go_on.wait(20)

    first = threading.Thread(target=pictures.film, args=(Film("mp4", 10.0), tmp_path / "a.mp4", wait))
    first.start()
    assert begun.wait(20)
    with pytest.raises(UnseenSceneError, match="is being made"):
        pictures.film(Film("mp4", 10.0), tmp_path / "b.mp4", lambda *_: None)
    go_on.set()
    first.join(20)


def test_no_pictures_no_film(tmp_path: Path) -> None:
    def one() -> Iterator[Bytes]:
        yield np.full((41, 61, 4), 200, dtype=np.uint8)

    assert write_film(tmp_path / "odd.mp4", one(), 3.0, "mp4") == 1
