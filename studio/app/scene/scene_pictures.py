"""Pictures and films of a window's scene: drawn by the window's own browser from where it looks, captioned like charts.

While a film is made the scene goes through its layers or frames; afterwards it shows again what it showed.
"""

import queue
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import av
import cv2
import numpy as np
import viser
from PIL import Image, ImageDraw, ImageFont

from studio.app.scene.controller import SceneController
from studio.app.scene.model import Model, select, show_frame
from studio.foundations.arrays import Bytes
from studio.foundations.errors import StudioError
from studio.foundations.package import assets_folder
from studio.results.export.overlay_video import even_sized
from studio.results.inspection.reading import InspectedRun
from studio.results.self_contained import TYPE
from studio.runs.drawing.colour_tokens import ColourTokens, colour_tokens

MOST_PIXELS = 4096
"""Of a picture's longer side."""
FILM_PIXELS, GIF_PIXELS = 1920, 720
FILM_FPS = 15
"""Pictures a second of a film of layers: between two layers the particles travel."""
HOLD_SECONDS = 1.0
"""For which the last layer stays."""
STANDING = 1e-9
"""Layers a second while a picture is drawn: the particles wait on their way, however long that takes."""
DRAWN_SECONDS, RENDER_SECONDS = 10.0, 60.0
TITLE_SHARE, LEAST_TITLE = 0.018, 13
QUALITY = "18"
MP4, GIF = "mp4", "gif"
Report = Callable[[int, int], None]


class UnseenSceneError(StudioError):
    """Nothing draws the scene, so there is no picture of it."""

    status, code = 409, "scene"


class Film(NamedTuple):
    """What is filmed. kind : MP4 or GIF. rate : layers, or frames, a second. frames : shown one after the other; ()
    the layers of the frame that is shown.
    """

    kind: str
    rate: float
    frames: tuple[int, ...] = ()


class ScenePictures:
    """Pictures of one scene; its methods block while a browser draws, so call them in a thread of their own."""

    def __init__(self, server: viser.ViserServer, controller: SceneController) -> None:
        self._server, self._controller = server, controller
        self._filming = threading.Lock()

    def take(self, scale: float = 2.0, *, transparent: bool = False) -> Bytes:
        """The scene as it is shown, (H, W, 4) RGBA, its caption below. scale : pixels for each of the window's.

        Raises UnseenSceneError.
        """
        look, count = _Look.of(self._server, scale, MOST_PIXELS), self._drawn()
        return self._captioned(look.draw(), count, transparent=transparent)

    def film(self, film: Film, place: Path, report: Report) -> int:
        """Write a film; returns how many pictures it has. report : called with those that are done and their number.

        Raises UnseenSceneError, also while another film of this scene is made.
        """
        if not self._filming.acquire(blocking=False):
            raise UnseenSceneError("A film of this scene is being made.", "Wait for it, or cancel it.")
        before = self._controller.model
        try:
            look = _Look.of(self._server, 1.0, FILM_PIXELS if film.kind == MP4 else GIF_PIXELS)
            changes = self._frames(film) if film.frames else self._layers(film)
            pictures = self._pictures(look, changes, report)
            fps = film.rate if film.frames else FILM_FPS
            return write_film(place, pictures, fps, film.kind, hold=0.0 if film.frames else HOLD_SECONDS)
        finally:
            self._controller.post(lambda model: _as_before(model, before), announce=False)
            self._filming.release()

    def _pictures(
        self, look: "_Look", changes: "list[Callable[[Model], Model]]", report: Report
    ) -> Iterator[Bytes]:
        for done, change in enumerate(changes):
            report(done, len(changes))
            count = self._drawn(change)
            yield self._captioned(look.draw(), count)

    def _layers(self, film: Film) -> "list[Callable[[Model], Model]]":
        count = self._drawn()
        if not count:
            raise UnseenSceneError("The shown frame has no layers.", "Show a frame that is tracked.")
        steps = max(1, round(FILM_FPS / film.rate))
        return [
            lambda model, layer=layer, phase=(step + 1) / steps: _at(model, layer, phase)
            for layer in range(count)
            for step in range(steps)
        ]

    def _frames(self, film: Film) -> "list[Callable[[Model], Model]]":
        return [lambda model, frame=frame: show_frame(model, frame) for frame in film.frames]

    def _drawn(self, change: Callable[[Model], Model] | None = None) -> int:
        """Change what is shown, and return once the scene has been told: the number of layers of its frame."""
        drawn: queue.Queue[int] = queue.Queue()
        if change is not None:
            self._controller.post(change, announce=False)
        self._controller.draw_now(drawn.put)
        try:
            return drawn.get(timeout=DRAWN_SECONDS)
        except queue.Empty:
            raise UnseenSceneError("The scene does not answer.", "Reload the page, then try again.") from None

    def _captioned(self, picture: Bytes, count: int, *, transparent: bool = False) -> Bytes:
        model, opened = self._controller.model, self._controller.opened
        tokens, shown = colour_tokens(model.options.dark), model.selection
        words = ""
        if opened is not None and opened.run is not None:
            words = InspectedRun(opened.session, opened.run).caption(shown.frame)
        layer = "all layers" if shown.layer is None else f"layer {shown.layer + 1} of {count}"
        frame = "" if shown.frame is None else f"frame {shown.frame}"
        parts = (" / ".join(filter(None, (shown.session, shown.run))), frame, layer if count else "")
        return captioned(picture, " · ".join(filter(None, parts)), words, tokens, transparent=transparent)


def _at(model: Model, layer: int, phase: float) -> Model:
    """One layer, its particles so far on their way (phase 0..1) from their parents' places."""
    still = replace(model.layers, playing=False, phase=phase, rate=STANDING)
    return replace(select(model, layer=layer), layers=still)


def _as_before(model: Model, before: Model) -> Model:
    """What was shown before a film, in the run that is open still."""
    if (model.selection.session, model.selection.run) != (before.selection.session, before.selection.run):
        return model
    shown = before.selection
    return replace(select(show_frame(model, shown.frame), layer=shown.layer), layers=before.layers)


class _Look(NamedTuple):
    """A browser that draws, from where it looked when the picture was asked for, and the picture's size."""

    client: viser.ClientHandle
    width: int
    height: int
    wxyz: tuple[float, float, float, float]
    position: tuple[float, float, float]
    fov: float

    @classmethod
    def of(cls, server: viser.ViserServer, scale: float, most: int) -> "_Look":
        """Raises UnseenSceneError where no browser shows the scene."""
        clients = list(server.get_clients().values())
        if not clients:
            raise UnseenSceneError(
                "No browser shows this scene, so nothing can draw it.",
                "Open the studio's page, then try again.",
            )
        camera = clients[-1].camera
        width, height = int(camera.image_width), int(camera.image_height)
        scale = min(scale, most / max(width, height, 1))
        w, x, y, z = map(float, camera.wxyz)
        return cls(
            clients[-1],
            max(2, round(width * scale)),
            max(2, round(height * scale)),
            (w, x, y, z),
            (float(camera.position[0]), float(camera.position[1]), float(camera.position[2])),
            float(camera.fov),
        )

    def draw(self) -> Bytes:
        """(H, W, 4) RGBA; where nothing stands it is transparent."""
        try:
            picture = self.client.get_render(
                self.height,
                self.width,
                wxyz=self.wxyz,
                position=self.position,
                fov=self.fov,
                transport_format="png",
                timeout=RENDER_SECONDS,
            )
        except (TimeoutError, RuntimeError) as error:
            raise UnseenSceneError(f"The browser did not draw the scene ({error}).", "Try again.") from None
        return np.ascontiguousarray(picture, dtype=np.uint8)


def captioned(
    picture: Bytes, title: str, words: str, tokens: ColourTokens, *, transparent: bool = False
) -> Bytes:
    """A picture (H, W, 4) on the scene's background, unless it stays transparent, with two lines below it in the
    pages' type: a title, and how it came about. RGBA.
    """
    height, width = picture.shape[:2]
    size = max(LEAST_TITLE, round(TITLE_SHARE * width))
    lines = [(title, size, 650, tokens["text"])]
    quiet = round(0.78 * size)
    lines += [(line, quiet, 450, tokens["text-quiet"]) for line in _wrapped(words, quiet, width - 2 * size)]
    strip = sum(round(1.5 * one[1]) for one in lines) + size
    clear = (0, 0, 0, 0)
    sheet = Image.new("RGBA", (width, height + strip), clear if transparent else (*tokens["surface"], 255))
    if not transparent:
        sheet.paste((*tokens["scene-background"], 255), (0, 0, width, height))
    sheet.alpha_composite(Image.fromarray(picture, "RGBA"))
    pen, at = ImageDraw.Draw(sheet), float(height + size // 2)
    for line, points, weight, colour in lines:
        pen.text((size, at), line, font=_font(points, weight), fill=(*colour, 255))
        at += round(1.5 * points)
    return np.asarray(sheet)


def _wrapped(words: str, points: int, width: int) -> list[str]:
    lines, font = list[str](), _font(points, 450)
    for word in words.split():
        if lines and font.getlength(f"{lines[-1]} {word}") <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines


def _font(points: int, weight: int) -> ImageFont.FreeTypeFont:
    font = ImageFont.truetype(str(assets_folder() / TYPE), points)
    font.set_variation_by_axes([weight])
    return font


def png_of(picture: Bytes) -> bytes:
    """An (H, W, 4) RGBA picture as a PNG file."""
    encoded = cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGBA2BGRA))[1]
    return encoded.tobytes()


def write_film(place: Path, pictures: Iterator[Bytes], fps: float, kind: str, *, hold: float = 0.0) -> int:
    """Write (H, W, 4) pictures as H.264 or a looping GIF; their number. hold : seconds that the last one stays."""
    return _write_gif(place, pictures, fps, hold) if kind == GIF else _write_mp4(place, pictures, fps, hold)


def _write_mp4(place: Path, pictures: Iterator[Bytes], fps: float, hold: float) -> int:
    count, last = 0, None
    with av.open(str(place), "w", format="mp4", options={"movflags": "faststart"}) as container:
        rate = Fraction(fps).limit_denominator(1001)
        stream = container.add_stream("libx264", rate=rate, options={"crf": QUALITY})
        stream.pix_fmt = "yuv420p"
        for picture in pictures:
            last = np.ascontiguousarray(even_sized(picture)[..., :3])
            if not count:
                stream.height, stream.width = last.shape[:2]
            container.mux(stream.encode(av.VideoFrame.from_ndarray(last, format="rgb24")))
            count += 1
        for _ in range(round(hold * fps) if last is not None else 0):
            assert last is not None
            container.mux(stream.encode(av.VideoFrame.from_ndarray(last, format="rgb24")))
        container.mux(stream.encode(None))
    return count


def _write_gif(place: Path, pictures: Iterator[Bytes], fps: float, hold: float) -> int:
    frames = [Image.fromarray(picture[..., :3]).quantize(colors=256) for picture in pictures]
    times = [round(1000 / fps)] * len(frames)
    times[-1] += round(1000 * hold)
    frames[0].save(place, format="GIF", save_all=True, append_images=frames[1:], duration=times, loop=0)
    return len(frames)
