"""Pictures of the person in the room, or of several, with their exact masks.

The room is traced once a camera; in each frame the person's shadow on the floor is computed once for all cameras and
the person is traced inside a bounding window. A picture is then the room, darkened by the shadow, under the
person, softened as by a lens, with sensor noise that depends only on seed, camera and frame.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.body.person import PersonMotion, sampled
from studio.foundations.arrays import Array, Bytes, Floats
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.results.drawing_footage.cameras import pixel_rays
from studio.results.drawing_footage.flesh import (
    BOUND,
    BOUND_RADIUS,
    clothed_pieces,
    piece_tables,
    tables_of_all,
)
from studio.results.drawing_footage.noise_kernels import add_sensor_noise
from studio.results.drawing_footage.room import Room, block_tables
from studio.results.drawing_footage.room_kernels import trace_room
from studio.results.drawing_footage.tracing_kernels import floor_shadow, trace_person
from studio.results.drawing_footage.wardrobes import STRIPED

SHADOW_REACH, SHADOW_CELL = 2600.0, 26.0
EXPOSURE, LENS_BLUR = 1.8, 0.55
STREAMS_PER_FRAME = 64
LIGHTEST, FAR_AWAY = 252.0, 1e6
"""Grey level that the lightest pixel of a picture in place of the room has; its distance, mm."""
MOMENTS = 5
"""Number of moments averaged over an exposure. The shadow is that of the middle one."""


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """One camera's constant data. shadow_place : (H, W, 2) float32 column and row in the shadow's grid."""

    camera: Camera
    rays: Floats
    key: Floats
    ambient: Floats
    depth: Floats
    shadow_place: Floats


@dataclass(frozen=True, slots=True, eq=False)
class RenderedPerson:
    """Somebody in the room. girth, wardrobe : as `Renderer` takes them."""

    motion: PersonMotion
    girth: float
    wardrobe: Array


class Renderer:
    """Renders any frame of one motion for any camera; frames are independent of each other."""

    def __init__(
        self,
        room: Room,
        cameras: tuple[Camera, ...],
        motion: PersonMotion,
        *,
        noise: float,
        samples: int,
        seed: int,
        girth: float = 1.0,
        wardrobe: Array = STRIPED,
        shutter: float = 0.0,
        beside: Sequence[RenderedPerson] = (),
    ) -> None:
        """tables, labels : (F, M, P, COLUMNS) and (P, 2) of `flesh.piece_tables`, at M moments of each exposure."""
        self._room, self._noise, self._samples, self._seed = room, noise, samples, seed
        people = [RenderedPerson(motion, girth, wardrobe), *beside]
        self._wardrobe = np.concatenate([person.wardrobe for person in people])
        self._moments = MOMENTS if shutter > 0.0 else 1
        tables, self._labels = tables_of_all(
            [
                piece_tables(
                    _moments(person.motion, shutter) if shutter > 0.0 else person.motion,
                    clothed_pieces(person.motion.skeleton, person.girth),
                )
                for person in people
            ]
        )
        self._tables = tables.reshape(motion.frame_count, self._moments, *tables.shape[1:])
        self._views = tuple(_view(room, camera, samples) for camera in cameras)

    def empty(self, camera: int, frame: int) -> Bytes:
        """(H, W, 3) BGR picture of the room alone; its noise is that of frame -1 - `frame`, unlike any other's."""
        view = self._views[camera]
        return self._developed(view.key + view.ambient, camera, -1 - frame)

    def shadow(self, frame: int) -> tuple[Floats, Floats]:
        """The person's shadow of the lamp and of the surroundings on the floor's grid, (n, n) each, 1 = no shadow."""
        count = int(2 * SHADOW_REACH / SHADOW_CELL) + 1
        key, ambient = np.ones((count, count), np.float32), np.ones((count, count), np.float32)
        left = -SHADOW_REACH
        floor_shadow(
            left,
            left,
            SHADOW_CELL,
            self._tables[frame, self._moments // 2],
            self._labels,
            self._room.lights,
            key,
            ambient,
        )
        return key, ambient

    def picture(self, camera: int, frame: int, shadow: tuple[Floats, Floats]) -> tuple[Bytes, Bytes]:
        """(H, W, 3) BGR picture and (H, W) mask, 255 where the person covers half a pixel or more."""
        view = self._views[camera]
        light = self._shaded(view, shadow)
        mask = np.zeros(view.depth.shape, np.uint8)
        tables = self._tables[frame]
        window = _window(view.camera, tables.reshape(-1, tables.shape[-1]))
        if window is not None:
            rows, columns = window
            person, coverage = self._person(view, tables[0], rows, columns)
            for table in tables[1:]:
                more, covered = self._person(view, table, rows, columns)
                person, coverage = person + more, coverage + covered
            person, coverage = person / np.float32(len(tables)), coverage / np.float32(len(tables))
            light[rows, columns] *= 1.0 - coverage[..., None]
            light[rows, columns] += person
            mask[rows, columns] = np.where(coverage >= 0.5, 255, 0)
        return self._developed(light, camera, frame), mask

    def shaded(self, camera: int, shadow: tuple[Floats, Floats]) -> Floats:
        """(H, W) share of the room's light that the shadow leaves, 0...1."""
        view = self._views[camera]
        share: Floats = self._shaded(view, shadow).sum(axis=-1) / (view.key + view.ambient).sum(axis=-1)
        return share

    def _shaded(self, view: _View, shadow: tuple[Floats, Floats]) -> Floats:
        """(H, W, 3) light of the room in a shadow."""
        key, ambient = (_at_places(grid, view.shadow_place) for grid in shadow)
        return np.asarray(view.key * key[..., None] + view.ambient * ambient[..., None], np.float32)

    def _person(self, view: _View, table: Array, rows: slice, columns: slice) -> tuple[Floats, Floats]:
        """Light (h, w, 3) and coverage (h, w) of the person at one moment inside a window."""
        s = self._samples
        rays = view.rays[rows.start * s : rows.stop * s, columns.start * s : columns.stop * s]
        depth = np.ascontiguousarray(view.depth[rows, columns])
        light, coverage = np.zeros((*depth.shape, 3), np.float32), np.zeros(depth.shape, np.float32)
        trace_person(
            view.camera.centre,
            np.ascontiguousarray(rays),
            s,
            depth,
            table,
            self._labels,
            self._room.lights,
            self._wardrobe,
            light,
            coverage,
        )
        return light, coverage

    def _developed(self, light: NDArray[np.floating], camera: int, frame: int) -> Bytes:
        """The sensor's picture of linear light: lens blur, exposure, noise, BGR bytes."""
        soft = cv2.GaussianBlur(np.ascontiguousarray(light[..., ::-1], np.float32), (0, 0), LENS_BLUR)
        exposed = np.asarray(255.0 * (1.0 - np.exp(-EXPOSURE * soft)), np.float32)
        out = np.zeros(exposed.shape, np.uint8)
        stream = (self._seed * 1_000_003 + frame) * STREAMS_PER_FRAME + camera
        add_sensor_noise(exposed, self._noise, stream, out)
        return out


class SurfaceRenderer(Renderer):
    """Renders a surface of swept spheres that is no person's: a robot, a hand."""

    def __init__(
        self,
        room: Room,
        cameras: tuple[Camera, ...],
        tables: Array,
        labels: NDArray[np.int64],
        *,
        noise: float,
        samples: int,
        seed: int,
        wardrobe: Array = STRIPED,
    ) -> None:
        """tables, labels : (F, M, P, COLUMNS) and (P, 2) of `flesh.piece_tables`, at M moments of an exposure."""
        self._room, self._noise, self._samples, self._seed = room, noise, samples, seed
        self._wardrobe, self._moments = wardrobe, tables.shape[1]
        self._tables, self._labels = tables, labels
        self._views = tuple(_view(room, camera, samples) for camera in cameras)


@dataclass(frozen=True, slots=True, eq=False)
class DrawnSurface:
    """A surface in a picture. window : rows and columns. picture : (h, w, 3) BGR. mask : (h, w) 0 or 255."""

    window: tuple[slice, slice]
    picture: Bytes
    mask: Bytes

    @property
    def nbytes(self) -> int:
        return self.picture.nbytes + self.mask.nbytes


class RendererBefore(Renderer):
    """Renders a surface of swept spheres before pictures of an empty place, one a camera; it throws no shadow."""

    def __init__(
        self,
        pictures: Sequence[Bytes],
        cameras: tuple[Camera, ...],
        tables: Array,
        labels: NDArray[np.int64],
        *,
        lights: Array,
        noise: float,
        samples: int,
        seed: int,
        wardrobe: Array = STRIPED,
    ) -> None:
        """pictures : (H, W, 3) BGR grey levels. tables, labels : (F, P, COLUMNS) and (P, 2) of `flesh.piece_tables`.
        lights : of a `Room`.
        """
        self._room = Room((0.0, 0.0), 0.0, (), lights)
        self._noise, self._samples, self._seed = noise, samples, seed
        self._wardrobe, self._moments = wardrobe, 1
        self._tables, self._labels = tables[:, None], labels
        self._views = tuple(
            _view_before(camera, samples, picture) for camera, picture in zip(cameras, pictures, strict=True)
        )
        self._pictures = tuple(pictures)

    @property
    def frame_count(self) -> int:
        return len(self._tables)

    @property
    def names(self) -> tuple[str, ...]:
        """The cameras' names."""
        return tuple(view.camera.name for view in self._views)

    def surface(self, camera: int, frame: int) -> DrawnSurface | None:
        """What the camera sees of the surface, None where it sees nothing."""
        view, table = self._views[camera], self._tables[frame, 0]
        window = _window(view.camera, table)
        if window is None:
            return None
        surface, coverage = self._person(view, table, *window)
        light = view.key[window] * (1.0 - coverage[..., None]) + surface
        mask = np.where(coverage >= 0.5, np.uint8(255), np.uint8(0))
        return DrawnSurface(window, self._developed(light, camera, frame), mask)

    def seen(self, camera: int, drawn: DrawnSurface | None) -> tuple[Bytes, Bytes]:
        """(H, W, 3) BGR picture and (H, W) mask, 255 where the surface covers half a pixel or more. Around the surface
        the picture has the sensor's noise, elsewhere it is that of the empty place.
        """
        picture = self._pictures[camera].copy()
        mask = np.zeros(picture.shape[:2], np.uint8)
        if drawn is not None:
            picture[drawn.window], mask[drawn.window] = drawn.picture, drawn.mask
        return picture, mask


def _moments(motion: PersonMotion, shutter: float) -> PersonMotion:
    """The motion at the MOMENTS of each frame's exposure, one after the other."""
    within = shutter * ((np.arange(MOMENTS) + 0.5) / MOMENTS - 0.5)
    times = (np.arange(motion.frame_count)[:, None] + within) / motion.fps
    return sampled(motion, times.ravel(), motion.fps * MOMENTS)


def _view(room: Room, camera: Camera, samples: int) -> _View:
    """Trace the empty room for one camera."""
    shape = (camera.height, camera.width)
    rays = pixel_rays(camera, samples)
    key, ambient, depth = np.zeros((*shape, 3)), np.zeros((*shape, 3)), np.zeros(shape)
    blocks, patterns = block_tables(room)
    size = np.array([*room.half, room.height])
    trace_room(camera.centre, rays, samples, size, room.lights, blocks, patterns, key, ambient, depth)
    middle = rays if samples == 1 else pixel_rays(camera, 1)
    points = camera.centre + depth[..., None] * middle
    lamp = room.lights[0]
    on_floor = lamp + (points - lamp) * (lamp[2] / np.maximum(lamp[2] - points[..., 2], 1.0))[..., None]
    places = (on_floor[..., :2] + SHADOW_REACH) / SHADOW_CELL
    single = np.float32
    return _View(
        camera, rays, key.astype(single), ambient.astype(single), depth.astype(single), places.astype(single)
    )


def _view_before(camera: Camera, samples: int, picture: Bytes) -> _View:
    """A camera's constant data where a picture (H, W, 3), BGR grey levels, stands for the room."""
    shape = (camera.height, camera.width)
    levels = np.clip(np.asarray(picture, np.float32)[..., ::-1], 0.0, LIGHTEST)
    light = np.ascontiguousarray(-np.log(1.0 - levels / 255.0) / EXPOSURE, dtype=np.float32)
    depth = np.full(shape, FAR_AWAY, np.float32)
    nothing = np.zeros((0, 0, 2), np.float32)
    return _View(camera, pixel_rays(camera, samples), light, nothing, depth, nothing)


def _at_places(grid: Floats, places: Floats) -> Floats:
    """The grid's values at (H, W, 2) places, 1 outside."""
    return cv2.remap(
        grid,
        places[..., 0],
        places[..., 1],
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=(1.0,),
    ).astype(np.float32)


def _window(camera: Camera, table: Array) -> tuple[slice, slice] | None:
    """Rows and columns around the person, None when out of the picture."""
    pixels, depth = project(camera, table[:, BOUND : BOUND + 3])
    ahead = depth > 100.0
    if not ahead.any():
        return None
    reach = 1.25 * camera.matrix[0, 0] * table[ahead, BOUND_RADIUS] / depth[ahead] + 4.0
    low, high = (pixels[ahead] - reach[:, None]).min(axis=0), (pixels[ahead] + reach[:, None]).max(axis=0)
    left, top = (int(max(np.floor(value), 0)) for value in low)
    right, bottom = (
        int(min(np.ceil(high[0]) + 1, camera.width)),
        int(min(np.ceil(high[1]) + 1, camera.height)),
    )
    return (slice(top, bottom), slice(left, right)) if right > left and bottom > top else None
