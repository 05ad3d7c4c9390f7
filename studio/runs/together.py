"""Several bodies tracked at once, each with a tracker of its own; the masks are shared by who explains which pixel.

Frame by frame each body is expected where its last two poses lead. By its limbs there and their colours the mask of all
is parted (`pixel_owners`), each body is searched in its part, and the mask is parted once more by the poses that were
found. All frames are gone through twice: after the first time the bodies' radii are fitted, and the colours are known
from the beginning. What comes of it are masks of each subject, in its own session: runs, checks and exports are of one
body, as always.
"""

import contextlib
import dataclasses
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from studio.body.branches import within_limits
from studio.body.scale import scale_of
from studio.body.subject import height_spread
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array, Bytes
from studio.foundations.errors import RunError
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress, no_progress
from studio.runs.live.following import Following
from studio.runs.search_space import search_space, session_sigma
from studio.runs.setup.initialising import initialise
from studio.runs.setup.pixel_owners import LimbColours, LimbMap, Share, learn_colours, limb_map, owners
from studio.runs.setup.session_settings import session_settings
from studio.runs.setup.shape_on_the_way import (
    FEWEST_CAMERAS,
    FEWEST_FRAMES,
    FITTED_FRAMES,
    LEAST_OVERLAP,
    can_be_fitted,
    fitted_shape,
)
from studio.runs.setup.subject_frames import varied_frames
from studio.runs.setup.subject_masks import WholeMasks, subject_masks_of
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.likelihood.overlay import overlay_points
from studio.search.settings import default_settings
from studio.search.trackers.frame_refinement import FrameRefiner
from studio.search.trackers.tracker import start_of
from studio.sessions.session import Session

TRACKER, WEIGHTING = "annealed", "edge-region-silhouette"
STEP = "tracking the bodies at once"

Masks = Mapping[str, Bytes]
"""(H, W) 0 or 255, by camera."""
Shares = Mapping[str, Share]
"""A body's, by camera."""


@dataclass(frozen=True, slots=True, eq=False)
class BodiesTogether:
    """Bodies that were tracked together.

    first : number of the first frame.
    poses : (F, D) radians and mm of each session's body, from there on.
    """

    first: int
    poses: tuple[Array, ...]


def track_together(sessions: Sequence[Session], progress: Progress = no_progress) -> BodiesTogether:
    """Track the subjects of sessions that share their footage, and give each the masks that its body explains.

    Each begins in its session's start pose; one without is searched for in the masks that it has. The result depends
    on nothing else: seeds are 0. Raises RunError for sessions that do not belong together; then nothing is changed.
    """
    first = _check(sessions)
    bodies = [_Body(session, first, progress) for session in sessions]
    with contextlib.ExitStack() as stack:
        whole = stack.enter_context(closing(WholeMasks(sessions[0], WEIGHTINGS[WEIGHTING].edge_kind)))
        given = [stack.enter_context(closing(session.footage())) for session in sessions]
        puts = [stack.enter_context(subject_masks_of(session)) for session in sessions]
        count = whole.footage.frame_count

        def report(step: str, before: int) -> Progress:
            return lambda _, done, total: progress(step, before + done, 2 * total)

        work = _Work(sessions[0].cameras(), bodies, whole)
        work.follow(range(first, count), report(STEP, 0), _forget)
        work.fit()
        for frame in range(first):
            masks = work.masks(frame)
            nothing = {name: np.zeros_like(mask) for name, mask in masks.items()}
            for put, footage in zip(puts, given, strict=True):
                put(frame, (footage.masks(frame) or masks, masks, nothing))

        def keep(frame: int, masks: Masks, parts: Sequence[Shares]) -> None:
            for put, part in zip(puts, parts, strict=True):
                own = {name: share.mask for name, share in part.items()}
                put(frame, (own, masks, {name: share.hidden for name, share in part.items()}))

        work.follow(range(first, count), report(STEP, count - first), keep)
    return BodiesTogether(first, tuple(np.array(body.following.poses) for body in bodies))


def _forget(_frame: int, _masks: Masks, _parts: Sequence[Shares]) -> None:
    """What is shared the first time through is not kept."""


class _Work:
    """Bodies in the masks of all. cameras : the sessions'."""

    def __init__(self, cameras: tuple[Camera, ...], bodies: "Sequence[_Body]", whole: WholeMasks) -> None:
        self._cameras, self._bodies, self._whole = cameras, bodies, whole
        self._shared_pixels: dict[int, int] = {}

    def masks(self, frame: int) -> dict[str, Bytes]:
        """Of all, by camera; empty where a camera has no picture."""
        return self._whole.by_camera(self._cameras, frame)

    def follow(
        self, frames: range, progress: Progress, keep: Callable[[int, Masks, Sequence[Shares]], None]
    ) -> None:
        """Track all bodies from their start on; what is known of their colours stays known."""
        for body in self._bodies:
            body.begin()
        for done, frame in enumerate(frames):
            progress("", done, len(frames))
            masks = self.masks(frame)
            seeing = self._seeing(frame)
            parts = self._share_masks(frame, masks, [body.expected() for body in self._bodies])
            for body, part in zip(self._bodies, parts, strict=True):
                body.step(frame, self._evidence(frame, seeing, part))
            poses = [body.following.poses[-1] for body in self._bodies]
            parts = self._share_masks(frame, masks, poses, learn=True)
            both = sum(
                np.count_nonzero(sum(part[name].mask > 0 for part in parts) > 1)
                for name in self._whole.footage.cameras
            )
            self._shared_pixels[frame] = int(both)
            keep(frame, masks, parts)
        progress("", len(frames), len(frames))

    def fit(self) -> None:
        """Fit each body's shape in frames in which the others hide it least, as a run does in its first ones
        (`shape_on_the_way`).
        """
        frames = np.array(sorted(self._shared_pixels))
        if len(frames) < FEWEST_FRAMES or len(self._cameras) < FEWEST_CAMERAS:
            return
        order = np.argsort([self._shared_pixels[int(frame)] for frame in frames], kind="stable")
        rows = np.sort(order[: max(FEWEST_FRAMES, len(frames) // 2)])
        poses = [np.array(body.following.poses) for body in self._bodies]
        for number, body in enumerate(self._bodies):
            if not can_be_fitted(body.body):
                continue
            chosen = varied_frames(body.body, frames[rows], poses[number][rows], FITTED_FRAMES)
            seen: list[FrameEvidence] = []
            for frame in chosen:
                at = [shape[int(np.searchsorted(frames, frame))] for shape in poses]
                part = self._share_masks(frame, self.masks(frame), at)[number]
                seen.append(self._evidence(frame, self._seeing(frame), part))
            if any(len(one.views) < len(self._cameras) for one in seen):
                continue
            rows_there = np.searchsorted(frames, chosen)
            shape = fitted_shape(
                body.body, self._cameras, seen, poses[number][rows_there], height_spread=body.height_spread
            )
            if shape.overlap[1] >= max(LEAST_OVERLAP, shape.overlap[0]):
                body.body = shape.body

    def _seeing(self, frame: int) -> tuple[Camera, ...]:
        absent = self._whole.footage.absent(frame)
        return tuple(camera for camera in self._cameras if camera.name not in absent)

    def _evidence(self, frame: int, cameras: tuple[Camera, ...], shares: Shares) -> FrameEvidence:
        of_mask, names = self._whole.maker.of_mask, [camera.name for camera in cameras]
        views = [of_mask(name, frame, shares[name].mask, shares[name].hidden) for name in names]
        return FrameEvidence(frame, tuple(views))

    def _share_masks(
        self, frame: int, masks: Masks, poses: Sequence[Array], learn: bool = False
    ) -> list[dict[str, Share]]:
        """The masks of all by camera, shared among bodies in poses (D,). learn : their colours too."""
        unseen = {name: Share(mask, np.zeros_like(mask)) for name, mask in masks.items()}
        parts = [dict(unseen) for _ in self._bodies]
        placed = [body.maps(pose) for body, pose in zip(self._bodies, poses, strict=True)]
        for camera in self._seeing(frame):
            name = camera.name
            picture = self._whole.footage.picture(name, frame)
            maps, colours = [one[name] for one in placed], [body.colours[name] for body in self._bodies]
            for part, own in zip(parts, owners(picture, masks[name], maps, colours), strict=True):
                part[name] = own
            if learn:
                learn_colours(picture, masks[name], maps, colours)
        return parts


class _Body:
    """One subject's body, followed in its part of the masks. colours : of its limbs by camera."""

    following: Following

    def __init__(self, session: Session, first: int, progress: Progress) -> None:
        self.body, self._cameras = session.body(), session.cameras()
        self.height_spread = height_spread(self.body, session.subject())
        evidence = session_settings(session).evidence
        self._settings = dataclasses.replace(default_settings(TRACKER, WEIGHTING), evidence=evidence)
        start = session.start_pose(self.body)
        if start is None:
            start = within_limits(
                self.body, initialise(session, first, body=self.body, progress=progress).pose
            )
        self._start, self._scale = start, scale_of(self.body)
        self._sigma = session_sigma(session, self.body, session.manifest.fps)
        self.colours = {camera.name: LimbColours(len(self.body.drawn)) for camera in self._cameras}

    def begin(self) -> None:
        """Follow it from its start pose on."""
        space, refiner = search_space(self.body, self._sigma), FrameRefiner(self.body, self._cameras, 0)
        self.following = Following(self._settings, space, start_of(tuple(self._start.tolist())), 0, refiner)

    def expected(self) -> Array:
        """(D,) the pose that the last two lead to."""
        poses = self.following.poses
        if len(poses) < 2:
            return poses[-1] if poses else self._start
        return 2.0 * poses[-1] - poses[-2]

    def maps(self, pose: Array) -> dict[str, LimbMap | None]:
        seen = overlay_points(self.body, self._cameras, pose, self._settings.weighting)
        return {
            camera.name: limb_map(self.body, camera, pose, view, self._scale)
            for camera, view in zip(self._cameras, seen, strict=True)
        }

    def step(self, frame: int, evidence: FrameEvidence) -> None:
        """Search a frame in its part of the masks."""
        names = {view.camera for view in evidence.views}
        cameras = tuple(camera for camera in self._cameras if camera.name in names)
        likelihood = WEIGHTINGS[WEIGHTING].prepare(self.body, cameras, self._settings.weighting)
        self.following.step(frame, likelihood.problem(evidence), evidence)


def _check(sessions: Sequence[Session]) -> int:
    """The frame that all begin in. Raises RunError for sessions that do not belong together."""
    if len(sessions) < 2:
        raise RunError("One body is tracked alone.", "Name the sessions of the others too.")
    one = sessions[0]
    for other in sessions[1:]:
        if other.path == one.path:
            raise RunError(f"Session '{one.name}' is named twice.", "Name the session of each subject once.")
        same = one.calibration_of_footage() == other.calibration_of_footage()
        if not same or _pictures(one) != _pictures(other):
            raise RunError(
                f"Sessions '{one.name}' and '{other.name}' are not of the same footage.",
                "Make them of one session: studio subjects SESSION --at X,Y --at X,Y.",
            )
    frames = {session.start_pose_frame() for session in sessions if session.start_pose() is not None}
    if len(frames) > 1:
        raise RunError(
            f"The start poses are of different frames ({', '.join(map(str, sorted(frames)))}).",
            "Set them in the same frame.",
        )
    for session in sessions:
        session.check_idle()
    return frames.pop() if frames else 0


def _pictures(session: Session) -> list[tuple[object, ...]]:
    sources = session.manifest.footage.cameras
    count = session.manifest.frame_count
    return [(one.name, one.path, one.offset, one.turned, one.width, one.height, count) for one in sources]
