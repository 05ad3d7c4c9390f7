"""The masks of one of several subjects: whom the visual hull shows in the first frame, and what is his after it.

The masks in use are those of all who are in view (`WholeMasks`); the pieces of their hull are followed from frame to
frame (`evidence.volume.hull_subjects`), and each pixel of a mask goes to those whose piece lies behind it
(`evidence.shared_masks`). Subjects that touch are parted roughly; `together` tracks their bodies for that.
"""

import contextlib
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence, Set
from contextlib import closing
from dataclasses import dataclass

import cv2
import numpy as np
from pydantic import FiniteFloat

from studio.body.scale import scale_of
from studio.evidence.backgrounds import Backgrounds
from studio.evidence.masks import reduced
from studio.evidence.pipeline import EvidenceMaker
from studio.evidence.shared_masks import shared_mask
from studio.evidence.volume.hull import Hull
from studio.evidence.volume.hull_settings import HullSettings
from studio.evidence.volume.hull_subjects import (
    HullFollower,
    HullSubject,
    Labels,
    label_silhouettes,
    labels_at,
    subjects_of,
)
from studio.evidence.volume.reconstruction import Reconstructor, check_views
from studio.evidence.volume.tracking_space import box_of
from studio.footage.capture.footage import HIDDEN, thresholded_mask, turned_picture
from studio.footage.capture.pictures import read_picture
from studio.foundations.arrays import Bytes
from studio.foundations.errors import FootageError
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress, no_progress
from studio.runs.setup.session_settings import session_settings
from studio.sessions.background_files import (
    SUBJECT_MASKS,
    WHOLE,
    MadeMasks,
    home_of_masks,
    made_masks,
    mask_name,
)
from studio.sessions.session import Session

FOLLOWING = "following the subjects"
CARVED_SIDE = 240
"""Least shorter side (pixels) of the masks that the hulls are carved of."""
CARVED = HullSettings(hull_depth=7, hull_edge_share=0.5, hull_least_views=2)
MM = 1000.0

Place = tuple[FiniteFloat, FiniteFloat]
"""x and y on the floor, metres."""


@dataclass(frozen=True, slots=True)
class SeenSubject:
    """A subject in view. at : x and y on the floor, metres. litres : of its hull. height : metres to its top."""

    at: Place
    litres: float
    height: float

    def in_words(self) -> str:
        """Where it is, as the command line takes it."""
        return f"{self.at[0]:.2f},{self.at[1]:.2f}"


class WholeMasks:
    """The masks of all who are in view, of any frame, with what makes evidence of them. Close it when done."""

    def __init__(self, session: Session, edge_kind: str = "none") -> None:
        """edge_kind : of the evidence."""
        self._session, self.footage = session, session.footage()
        cut = [home_of_masks(source) == SUBJECT_MASKS for source in session.manifest.footage.cameras]
        self._cut = any(cut)
        cameras = session.cameras()
        settings = session_settings(session).evidence
        self.maker = EvidenceMaker(cameras, self.footage, Backgrounds(self.footage), settings, edge_kind)

    def of(self, camera: str, frame: int) -> Bytes:
        """(H, W) 0 or 255. Raises FootageError."""
        if not self._cut:
            return self.maker.mask(camera, frame)
        source = next(one for one in self._session.manifest.footage.cameras if one.name == camera)
        folder = self._session.path / source.masks
        path = folder.parent / WHOLE / folder.name / mask_name(source, frame)
        return thresholded_mask(turned_picture(read_picture(path), source.turned))

    def by_camera(self, cameras: Sequence[Camera], frame: int) -> dict[str, Bytes]:
        """Those of a frame; empty where a camera has no picture. Raises FootageError."""
        absent = self.footage.absent(frame)
        return {
            camera.name: np.zeros((camera.height, camera.width), np.uint8)
            if camera.name in absent
            else self.of(camera.name, frame)
            for camera in cameras
        }

    def close(self) -> None:
        self.footage.close()


class _Carver:
    """The hulls of a session's whole masks."""

    def __init__(self, session: Session) -> None:
        self.cameras = session.cameras()
        if len(self.cameras) < 2:
            raise FootageError(
                f"Session '{session.name}' has one camera: it cannot tell where a person stands.",
                "Exclude the others by hand (--exclude), or paint strokes.",
            )
        check_views(self.cameras)
        self.small = tuple(camera.reduced(CARVED_SIDE) for camera in self.cameras)
        self.scale = scale_of(session.body())
        self._box = box_of(self.cameras, scale=self.scale)
        self._reconstructors: dict[tuple[Camera, ...], Reconstructor] = {}

    def hull(self, whole: Mapping[str, Bytes], absent: Set[str]) -> tuple[Hull, list[Bytes], list[Camera]]:
        """Of masks (H, W) by camera, without the cameras that have no picture (their empty masks would leave nothing);
        the masks and cameras that it is of, as small as `small`.
        """
        cameras = tuple(camera for camera in self.small if camera.name not in absent)
        if cameras not in self._reconstructors:
            self._reconstructors[cameras] = Reconstructor(cameras, self._box, CARVED)
        masks = [reduced(whole[camera.name], camera) for camera in cameras]
        return self._reconstructors[cameras].shape(masks), masks, list(cameras)


def seen_subjects(session: Session, frame: int = 0) -> tuple[SeenSubject, ...]:
    """Who is in view in a frame, the largest first. Raises FootageError, NotFoundError."""
    carver = _Carver(session)
    with closing(WholeMasks(session)) as whole:
        masks = whole.by_camera(carver.cameras, frame)
        hull, seen, cameras = carver.hull(masks, whole.footage.absent(frame))
    return () if hull.empty else tuple(map(_as_seen, subjects_of(hull, seen, cameras)[1]))


def count_subjects(masks: Sequence[Bytes], cameras: Sequence[Camera], scale: float = 1.0) -> int:
    """How many subjects masks (H, W) of one frame show, 0 without any. scale : of the body (`scale_of`)."""
    small = tuple(camera.reduced(CARVED_SIDE) for camera in cameras)
    reconstructor = Reconstructor(small, box_of(cameras, scale=scale), CARVED)
    seen = [reduced(mask, camera) for mask, camera in zip(masks, small, strict=True)]
    hull = reconstructor.shape(seen)
    return 0 if hull.empty else len(subjects_of(hull, seen, small)[1])


def _as_seen(one: HullSubject) -> SeenSubject:
    x, y = (round(float(value) / MM, 3) for value in one.place)
    return SeenSubject((x, y), one.volume * 1e-6, one.top / MM)


@dataclass(frozen=True, slots=True, eq=False)
class CutFrame:
    """One frame. whole : (H, W) 0 or 255 by camera, of all. parts : of each wanted subject. hidden : of each, 255 where
    its part says nothing of it, for another one's piece lies behind the pixel too. lost : those not seen.
    """

    frame: int
    whole: Mapping[str, Bytes]
    parts: tuple[Mapping[str, Bytes], ...]
    hidden: tuple[Mapping[str, Bytes], ...]
    lost: tuple[int, ...]


def cut_frames(
    session: Session, places: Sequence[Place], progress: Progress = no_progress
) -> Iterator[CutFrame]:
    """Every frame's masks of the subjects at some places in the first frame, in order.

    Raises FootageError where no subject stands at a place, or masks cannot be made.
    """
    carver = _Carver(session)
    follower: HullFollower | None = None
    count = len(places)
    with closing(WholeMasks(session)) as whole:
        footage = whole.footage
        for frame in range(footage.frame_count):
            progress(FOLLOWING, frame, footage.frame_count)
            masks = whole.by_camera(carver.cameras, frame)
            hull, seen, cameras = carver.hull(masks, footage.absent(frame))
            if follower is None:
                labels, count = _first(hull, seen, cameras, places, carver.scale)
                follower = HullFollower(hull, labels, carver.scale)
            else:
                labels = follower.step(hull, seen, cameras)
            yield _cut(frame, masks, hull, labels, count, len(places), carver.small)
    progress(FOLLOWING, footage.frame_count, footage.frame_count)


def _first(
    hull: Hull, masks: Sequence[Bytes], cameras: Sequence[Camera], places: Sequence[Place], scale: float
) -> tuple[Labels, int]:
    if hull.empty:
        raise FootageError(
            "Nobody is seen in the first frame: the views' masks have nothing in common.",
            "Look at the masks, or begin the footage where the subjects are in view.",
        )
    labels, subjects = subjects_of(hull, masks, cameras)
    named, number = labels_at(hull, labels, subjects, MM * np.array(places), scale)
    if named is None:
        x, y = places[number]
        seen = "; ".join(_as_seen(one).in_words() for one in subjects)
        raise FootageError(
            f"Nobody stands at {x:g},{y:g} (metres) in the first frame.", f"There is a person at {seen}."
        )
    return named, number


def _cut(
    frame: int,
    masks: Mapping[str, Bytes],
    hull: Hull,
    labels: Labels,
    count: int,
    wanted: int,
    small: Sequence[Camera],
) -> CutFrame:
    parts: list[dict[str, Bytes]] = [{} for _ in range(wanted)]
    hidden: list[dict[str, Bytes]] = [{} for _ in range(wanted)]
    lost = tuple(label for label in range(wanted) if not (labels == label).any())
    for camera in small:
        mask = masks[camera.name]
        height, width = mask.shape
        seen = [
            np.asarray(cv2.resize(one, (width, height), interpolation=cv2.INTER_NEAREST), dtype=np.uint8)
            for one in label_silhouettes(hull, labels, count, camera)
        ]
        nothing = np.zeros_like(mask)
        shares = shared_mask(mask, seen) if len(lost) < wanted else [nothing] * count
        several = np.sum([share > 0 for share in shares], axis=0) > 1
        for label in range(wanted):
            own = nothing if label in lost else shares[label]
            parts[label][camera.name], hidden[label][camera.name] = own, np.where(several, own, nothing)
    return CutFrame(frame, masks, tuple(parts), tuple(hidden), lost)


@contextlib.contextmanager
def subject_masks_of(session: Session) -> Generator[Callable[[int, Sequence[Mapping[str, Bytes]]], None]]:
    """Writes masks of a subject that the session uses afterwards: called with a frame and pictures by camera, its
    masks, those of all who are in view, and where its masks say nothing of it.
    """
    with made_masks(session, SUBJECT_MASKS) as made:
        folders = [made]
        for name in (WHOLE, HIDDEN):
            (made.folder / name).mkdir()
            folders.append(MadeMasks(session, made.folder / name))

        def put(frame: int, pictures: Sequence[Mapping[str, Bytes]]) -> None:
            for folder, given in zip(folders, pictures, strict=True):
                for camera, picture in given.items():
                    folder.put(camera, frame, picture)

        yield put


def make_subject_masks(session: Session, place: Place, progress: Progress = no_progress) -> list[int]:
    """Cut a session's masks down to the subject at a place in the first frame, and use them; returns the frames in
    which it is not seen. Raises FootageError, SessionError; then nothing is changed.
    """
    session.check_idle()
    lost: list[int] = []
    with subject_masks_of(session) as put:
        for cut in cut_frames(session, [place], progress):
            put(cut.frame, (cut.parts[0], cut.whole, cut.hidden[0]))
            lost += [cut.frame] if cut.lost else []
    return lost
