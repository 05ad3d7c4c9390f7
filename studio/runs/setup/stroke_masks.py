"""Masks of anything for all frames of a session, from brush strokes in one picture of each camera or in more.

Each camera for itself (`evidence.stroke_cut`): its first picture with a stroke inside is cut, then the frames after it,
one after another, then those before it, backwards. Strokes in a later picture correct what comes after it (before it,
on the way back); masks that they cannot change are taken over from those made before.
"""

import os
import threading
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import cv2
import numpy as np
from cachetools import LRUCache

from studio.evidence.stroke_cut import StrokeCut
from studio.evidence.strokes import Stroke
from studio.footage.capture.footage import Footage
from studio.foundations.arrays import Bytes
from studio.foundations.errors import FootageError
from studio.foundations.progress import Progress
from studio.runs.setup.projected_masks import ProjectedMasks
from studio.sessions.background_files import MadeMasks
from studio.sessions.session import Session
from studio.sessions.stroke_files import (
    StrokeMasks,
    StrokeMasksMade,
    check_strokes,
    made_of_strokes,
    pictures_of,
    write_made,
)

CARRYING = "carrying the strokes"
KEPT_CUTS = 4
"""For previews: cuts of first pictures, of which each stroke in a later one would make the same again."""
READ_AT_ONCE = 8
"""Pictures that are read forwards, to be gone through backwards: videos are slow the other way."""

Strokes = Mapping[int, tuple[Stroke, ...]]
"""One camera's strokes by frame."""


def by_frame(strokes: Sequence[Stroke], camera: str) -> Strokes:
    """One camera's strokes, those of a frame in the order in which they were painted."""
    frames: dict[int, tuple[Stroke, ...]] = {}
    for stroke in strokes:
        if stroke.camera == camera:
            frames[stroke.frame] = (*frames.get(stroke.frame, ()), stroke)
    return frames


def first_frame(strokes: Strokes) -> int | None:
    """The first frame with a stroke inside, from which they are carried; None without one."""
    return min(
        (frame for frame, those in strokes.items() if any(one.kind == "inside" for one in those)),
        default=None,
    )


def check_all_cameras(session: Session, strokes: Sequence[Stroke]) -> None:
    """Raises FootageError where strokes do not fit the session, or a camera has none inside."""
    check_strokes(session, strokes)
    for name in unpainted_cameras(session, strokes):
        raise FootageError(
            f"Camera {name} has no stroke inside the subject.",
            "Paint one in a frame in which the camera sees it well, and some outside.",
        )


def unpainted_cameras(session: Session, strokes: Sequence[Stroke]) -> list[str]:
    names = [source.name for source in session.manifest.footage.cameras]
    return [name for name in names if first_frame(by_frame(strokes, name)) is None]


def kept_frames(strokes: Strokes, before: Strokes, count: int) -> range:
    """The frames whose masks are the same for strokes as they are and as they were `before`, of `count` frames."""
    first = first_frame(strokes)
    if first is None or first != first_frame(before) or strokes[first] != before[first]:
        return range(0)
    changed = [frame for frame in {*strokes, *before} if strokes.get(frame) != before.get(frame)]
    low = max((frame + 1 for frame in changed if frame < first), default=0)
    return range(low, min((frame for frame in changed if frame > first), default=count))


def make_stroke_masks(
    session: Session,
    strokes: Sequence[Stroke],
    made: MadeMasks,
    progress: Progress,
    projected: ProjectedMasks | None = None,
) -> Mapping[str, range]:
    """Fill in the masks of all cameras and frames; returns the frames by camera whose masks were taken over.

    projected : where a run's model is. What `progress` raises ends it. Raises FootageError.
    """
    check_all_cameras(session, strokes)
    run = "" if projected is None else projected.made_of
    footage, earlier = session.footage(), made_of_strokes(session, run)
    names = [source.name for source in session.manifest.footage.cameras]
    work = _Work(session, footage, strokes, made, progress, projected, earlier)
    cv2.setNumThreads(1)
    try:
        with ThreadPoolExecutor(min(len(names), os.cpu_count() or 1), "strokes") as threads:
            kept = dict(zip(names, threads.map(work.camera, names), strict=True))
    finally:
        footage.close()
    given = StrokeMasksMade(
        strokes=tuple(strokes), folders=made.folders, footage=pictures_of(session.manifest.footage), run=run
    )
    write_made(made.folder, given)
    return kept


_cuts = LRUCache[tuple[object, ...], StrokeCut](KEPT_CUTS)
_cuts_lock = threading.Lock()


def _begin(
    session: Session, footage: Footage, camera: str, first: int, strokes: tuple[Stroke, ...]
) -> StrokeCut:
    """A cut of the first picture, to continue from; those of the last few are kept."""
    key = (session.path, camera, pictures_of(session.manifest.footage)[camera], first, strokes)
    with _cuts_lock:
        cut = _cuts.get(key)
        if cut is None:
            cut = StrokeCut()
            cut.begin(footage.picture(camera, first), strokes)
            _cuts[key] = cut
        return cut.copy()


class _Work:
    """The masks of one session's cameras, in threads."""

    def __init__(
        self,
        session: Session,
        footage: Footage,
        strokes: Sequence[Stroke],
        made: MadeMasks,
        progress: Progress,
        projected: ProjectedMasks | None,
        earlier: StrokeMasks | None,
    ) -> None:
        self._footage, self._strokes, self._made = footage, strokes, made
        self._projected, self._earlier = projected, earlier
        self._progress, self._lock = progress, threading.Lock()
        self._done, self._total = 0, len(footage.cameras) * footage.frame_count
        self._ended = False

    def camera(self, name: str) -> range:
        """Fill in one camera's masks; returns the frames whose masks were taken over."""
        try:
            return self._all_frames(name)
        except BaseException:
            self._ended = True
            raise

    def _all_frames(self, name: str) -> range:
        strokes, count = by_frame(self._strokes, name), self._footage.frame_count
        kept = range(0)
        if self._earlier is not None:
            kept = kept_frames(strokes, by_frame(self._earlier.made.strokes, name), count)
        for frame in kept:
            assert self._earlier is not None
            self._made.take_over(name, frame, self._earlier.path(name, frame))
            self._tick()
        first = first_frame(strokes)
        assert first is not None
        if len(kept) == count:
            return kept
        cut = StrokeCut()
        mask = cut.begin(self._footage.picture(name, first), strokes[first])
        if first not in kept:
            self._write(name, first, mask)
        if kept.start > 0 or not kept:
            self._follow(name, cut.copy(), strokes, self._backwards(name, first), kept)
        if kept.stop < count:
            self._follow(name, cut, strokes, self._forwards(name, first + 1), kept)
        self._footage.release(name)
        return kept

    def _follow(
        self,
        name: str,
        cut: StrokeCut,
        strokes: Strokes,
        frames: Iterator[tuple[int, Bytes | None]],
        kept: range,
    ) -> None:
        """Carry a cut through frames, those that are kept only learnt."""
        for frame, picture in frames:
            if self._ended:
                return
            if picture is None:
                width, height = self._footage.size(name)
                if frame not in kept:
                    self._write(name, frame, np.zeros((height, width), np.uint8))
                continue
            painted = strokes.get(frame, ())
            if frame in kept:
                assert self._earlier is not None
                mask = self._earlier.mask(name, frame)
            else:
                expected = None if self._projected is None else self._projected.of(name, frame)
                mask = cut.cut(picture, painted, expected)
                self._write(name, frame, mask)
            cut.learn(picture, mask, bool(painted))

    def _forwards(self, name: str, begin: int) -> Iterator[tuple[int, Bytes | None]]:
        for frame in range(begin, self._footage.frame_count):
            yield frame, self._picture(name, frame)

    def _backwards(self, name: str, end: int) -> Iterator[tuple[int, Bytes | None]]:
        """The frames before `end`, the last first."""
        while end > 0:
            begin = max(0, end - READ_AT_ONCE)
            pictures = [self._picture(name, frame) for frame in range(begin, end)]
            while pictures:
                end -= 1
                yield end, pictures.pop()

    def _picture(self, name: str, frame: int) -> Bytes | None:
        return None if name in self._footage.absent(frame) else self._footage.picture(name, frame)

    def _write(self, name: str, frame: int, mask: Bytes) -> None:
        self._made.put(name, frame, mask)
        self._tick()

    def _tick(self) -> None:
        with self._lock:
            self._done += 1
            self._progress(CARRYING, self._done, self._total)


def preview_mask(session: Session, camera: str, frame: int, strokes: Sequence[Stroke]) -> Bytes | None:
    """(H, W) uint8, 0 or 255: about the mask that strokes give in one frame, without the frames before it.

    strokes : instead of the session's; those of `camera` count. With masks made before, the last of them is carried one
    frame. None where nothing can be said yet: no stroke inside in this frame, and no masks near it. Raises
    FootageError.
    """
    check_strokes(session, strokes)
    own = by_frame(strokes, camera)
    first = first_frame(own)
    if first is None:
        return None
    with closing(session.footage()) as footage:
        earlier = made_of_strokes(session)
        on_frame = own.get(frame, ())
        if frame == first:
            return StrokeCut().begin(footage.picture(camera, frame), on_frame)
        if earlier is not None:
            kept = kept_frames(own, by_frame(earlier.made.strokes, camera), footage.frame_count)
            if frame in kept:
                return earlier.mask(camera, frame)
            beside = frame - 1 if frame > first else frame + 1
            if beside in kept:
                cut = _begin(session, footage, camera, first, own[first])
                if beside != first:
                    cut.learn(footage.picture(camera, beside), earlier.mask(camera, beside), False)
                return cut.cut(footage.picture(camera, frame), on_frame)
        if any(stroke.kind == "inside" for stroke in on_frame):
            return StrokeCut().begin(footage.picture(camera, frame), on_frame)
        return None
