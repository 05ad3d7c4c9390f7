"""A session's pictures with evidence and projected body drawn over them, for the scene and the page.

A composer opens a session's footage once and keeps it; `compose_view` keeps the composers last used, so that a route
can request one picture after another.
"""

import threading
import time
import weakref
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.body.motion_files.trc import MarkerMotion, read_trc
from studio.evidence.backgrounds import Backgrounds
from studio.evidence.frame_evidence import ViewEvidence
from studio.evidence.pipeline import EvidenceMaker
from studio.footage.capture.footage import Footage
from studio.foundations.arrays import Array, Bytes, Indices
from studio.foundations.errors import NotFoundError, StudioError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.foundations.memory import give_back_freed_memory
from studio.runs.drawing.colour_tokens import colour_tokens
from studio.runs.drawing.marker_lines import marker_links
from studio.runs.drawing.overlay_drawing import NO_MARKS, OVERLAYS, ViewMarks, draw_view, upright
from studio.runs.moved_knobs import stored_settings
from studio.runs.run_footage import footage_of
from studio.runs.setup.session_settings import session_settings
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.likelihood.overlay import limb_contours, overlay_points
from studio.search.settings import RunSettings
from studio.search.trackers.tracker import LayerRecord
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

Answer = TypeVar("Answer")

REST_SECONDS = 20.0
_NEED_EVIDENCE = {"mask", "edges", "cost"}
_NEED_EDGES = {"edges", "cost"}
_NEED_SAMPLES = {"samples", "cost"}
_NEED_BODY = {"outline", "filled", "mask", *_NEED_SAMPLES}
_KEPT_COMPOSERS, _KEPT_PIXELS = 3, 18_000_000
"""Composers kept at most, and pixels of all their cameras. A pixel takes about 100 bytes (decoder, background,
pictures), so two sessions of four full-HD cameras take 1.7 GB.
"""


@dataclass(frozen=True, slots=True, eq=False)
class OtherBody:
    """Another body in a picture. pose : (D,) of it. colour : a token. body : whose, None for that of the pose shown."""

    pose: Array
    colour: str
    body: BodyModel | None = None


class ViewComposer:
    """One session's pictures, one run's body and settings. Safe for several threads, a picture at a time."""

    def __init__(
        self, session: Session, run: StoredRun | None = None, settings: RunSettings | None = None
    ) -> None:
        self.body: BodyModel = run.body() if run else session.body()
        self.cameras: dict[str, Camera] = {camera.name: camera for camera in session.cameras()}
        self._footage: Footage = footage_of(session, run)
        self._backgrounds = Backgrounds(self._footage)
        self._settings = settings or _settings_of(session, run)
        self._truth = _truth_of(session)
        self._lock = threading.RLock()
        self._used = time.monotonic()
        self._rests = False
        _all_composers.add(self)

    @property
    def pixels(self) -> int:
        """Pixels of all cameras' pictures together."""
        return sum(camera.width * camera.height for camera in self.cameras.values())

    def use(self, settings: RunSettings) -> None:
        """Make masks, edge maps and samples with these settings from now on."""
        with self._lock:
            self._settings = settings

    def compose(
        self,
        frame: int,
        camera: str,
        layers: Sequence[str] = ("outline",),
        *,
        pose: Array | None = None,
        clouds: Sequence[LayerRecord] = (),
        limbs: Sequence[int] = (),
        height: int | None = None,
        body: BodyModel | None = None,
        beside: Sequence[OtherBody] = (),
        own: str = "",
    ) -> Bytes:
        """(h, w, 3) BGR picture of a camera as stored (not turned), with layers of `OVERLAYS` over it.

        pose : (D,) whose limbs are projected, None for none; body : whose, other than the session's. beside : other
        bodies; own : the colour token of the one itself, "" for those of its limbs' sides. clouds : the layers whose
        particles are drawn, at the far ends of `limbs` (indices of drawn limbs; none: all). height : of the result,
        None for the stored size. Raises NotFoundError for a camera or frame that does not
        exist, StudioError for an unknown layer.
        """
        _check_layers(layers)
        with self._lock:
            self._used, self._rests = time.monotonic(), False
            view = self._view(frame, camera, layers)
            marks = self._marks(camera, frame, layers, pose, clouds, limbs, body or self.body)
            if {"outline", "filled"} & set(layers):
                lenses = (self.cameras[camera],)
                drawn = [
                    (limb_contours(other.body or body or self.body, lenses, other.pose)[0], other.colour)
                    for other in beside
                ]
                marks = replace(marks, own=own, beside=tuple(drawn))
        scale = 1.0 if height is None else height / view.picture.shape[0]
        return draw_view(view, marks, tuple(layers), colour_tokens(dark=True), scale=scale)

    def close(self) -> None:
        with self._lock:
            self._footage.close()

    def rest(self, before: float) -> bool:
        """Release files, pictures and background models unless used since `before` (`time.monotonic`); they are made
        again when needed. Returns whether there was anything to release.
        """
        with self._lock:
            if self._rests or self._used >= before:
                return False
            self._rests = True
            for camera in self.cameras:
                self._backgrounds.release(camera)
            self._footage.close()
        return True

    def _view(self, frame: int, camera: str, layers: Sequence[str]) -> ViewEvidence:
        if camera not in self.cameras:
            raise NotFoundError(
                f"There is no camera '{camera}' in this session.", f"It has {', '.join(self.cameras)}."
            )
        if not _NEED_EVIDENCE & set(layers):
            nothing = np.zeros((0, 0), dtype=np.uint8)
            return ViewEvidence(camera, self._footage.picture(camera, frame), nothing, nothing)
        kind = WEIGHTINGS[self._settings.weighting_name].edge_kind if _NEED_EDGES & set(layers) else "none"
        # A hull may be carved without masks; the overlay shows one all the same.
        kind = "none" if kind == "hull" else kind
        lenses = tuple(self.cameras.values())
        maker = EvidenceMaker(lenses, self._footage, self._backgrounds, self._settings.evidence, kind)
        return maker.view(camera, frame)

    def _marks(
        self,
        camera: str,
        frame: int,
        layers: Sequence[str],
        pose: Array | None,
        clouds: Sequence[LayerRecord],
        limbs: Sequence[int],
        body: BodyModel,
    ) -> ViewMarks:
        lens = self.cameras[camera]
        truth = self._truth_lines(lens, frame) if "truth" in layers else NO_MARKS.truth
        dots = self._dots(lens, clouds, limbs) if "particles" in layers else ()
        if pose is None or not _NEED_BODY & set(layers):
            return replace(NO_MARKS, clouds=dots, truth=truth)
        sides = tuple(limb.side for limb in body.drawn)
        if not _NEED_SAMPLES & set(layers):
            outlined = replace(NO_MARKS, contours=limb_contours(body, (lens,), pose)[0], sides=sides)
            return replace(outlined, clouds=dots, truth=truth)
        seen = overlay_points(body, (lens,), pose, self._settings.weighting)[0]
        return ViewMarks(seen.contours, sides, seen.edge_samples, seen.region_samples, dots, truth)

    def _dots(
        self, camera: Camera, clouds: Sequence[LayerRecord], limbs: Sequence[int]
    ) -> tuple[tuple[Array, tuple[int, int, int]], ...]:
        tokens = colour_tokens(dark=True)
        count = max((record.layer for record in clouds), default=0) + 1
        chosen = list(limbs) or list(range(len(self.body.drawn)))
        drawn: list[tuple[Array, tuple[int, int, int]]] = []
        for record in sorted(clouds, key=lambda entry: entry.layer):
            ends = limb_ends(self.body, record.poses)[:, chosen, 1].reshape(-1, 3)
            drawn.append((project(camera, ends)[0], tokens.layer(record.layer, count)))
        return tuple(drawn)

    def _truth_lines(self, camera: Camera, frame: int) -> Array:
        if self._truth is None:
            return NO_MARKS.truth
        rows: Indices = np.round(self._truth.times * self._footage.fps).astype(np.int64)
        place = int(np.searchsorted(rows, frame))
        links = marker_links(self.body, self._truth.names)
        if place >= len(rows) or rows[place] != frame or not links:
            return NO_MARKS.truth
        return project(camera, self._truth.positions[place][np.array(links)])[0]


_all_composers: "weakref.WeakSet[ViewComposer]" = weakref.WeakSet()
_composers: OrderedDict[tuple[Path, str], ViewComposer] = OrderedDict()
_composers_lock = threading.Lock()


def compose_view(
    session: Session,
    run: StoredRun | None,
    frame: int,
    camera: str,
    layers: Sequence[str] = ("outline",),
    pose: Array | None = None,
    *,
    height: int | None = None,
    turned: bool = True,
    settings: RunSettings | None = None,
    body: BodyModel | None = None,
    beside: Sequence[OtherBody] = (),
    own: str = "",
) -> Bytes:
    """(h, w, 3) BGR: a camera's picture of a frame, upright (`turned`), with layers of `OVERLAYS` over it.

    pose : (D,) instead of the run's stored pose. height : of the picture as shown. settings : other than
    the run's, for masks and samples. body : of `pose`, if not the run's or session's. beside : other bodies
    beside it; own : the colour token of the one itself. Raises StudioError for what does not exist.
    """
    composer = _composer(session, run)
    composer.use(settings or _settings_of(session, run))
    if camera not in composer.cameras:
        raise NotFoundError(
            f"There is no camera '{camera}' in this session.", f"It has {', '.join(composer.cameras)}."
        )
    records: Sequence[LayerRecord] = ()
    if run is not None:
        with run.results() as results:
            pose = _or_none(lambda: results.result(frame).estimate.pose) if pose is None else pose
            records = (_or_none(lambda: results.layers(frame)) or ()) if "particles" in layers else ()
    lens = composer.cameras[camera]
    turns = lens.quarter_turns % 4 if turned else 0
    stored_height = None
    if height is not None:
        stored_height = round(height * lens.height / lens.width) if turns % 2 else height
    picture = composer.compose(
        frame,
        camera,
        layers,
        pose=pose,
        clouds=records,
        height=stored_height,
        body=body,
        beside=beside,
        own=own,
    )
    return upright(picture, turns)


def forget_composers() -> None:
    """Close the footage that `compose_view` keeps open (before a session is moved or deleted, and at the end)."""
    with _composers_lock:
        for composer in _composers.values():
            composer.close()
        _composers.clear()


def let_composers_rest(seconds: float = REST_SECONDS) -> None:
    """Release what composers unused for `seconds` hold, the scene's too."""
    before = time.monotonic() - seconds
    if any([composer.rest(before) for composer in list(_all_composers)]):
        give_back_freed_memory()


def _composer(session: Session, run: StoredRun | None) -> ViewComposer:
    key = (session.path, run.name if run else "")
    with _composers_lock:
        if key not in _composers:
            _composers[key] = ViewComposer(session, run)
        _composers.move_to_end(key)
        while len(_composers) > 1 and (
            len(_composers) > _KEPT_COMPOSERS
            or sum(composer.pixels for composer in _composers.values()) > _KEPT_PIXELS
        ):
            _composers.popitem(last=False)[1].close()
        return _composers[key]


def _settings_of(session: Session, run: StoredRun | None) -> RunSettings:
    if run is None:
        return session_settings(session)
    return stored_settings(run)[1]


def _truth_of(session: Session) -> MarkerMotion | None:
    path = session.truth_path
    if path is None:
        return None
    try:
        return read_trc(path)
    except StudioError:
        return None


def _or_none(find: Callable[[], Answer]) -> Answer | None:
    try:
        return find()
    except NotFoundError:
        return None


def _check_layers(layers: Sequence[str]) -> None:
    for layer in layers:
        if layer not in OVERLAYS:
            raise StudioError(f"There is no overlay '{layer}'.", f"Choose among {', '.join(OVERLAYS)}.")
