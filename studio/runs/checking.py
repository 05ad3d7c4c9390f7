"""How well a track fits its pictures, measured every few frames and stored with the run.

`checks/<track>.json`: for each checked frame and camera the share of the model's pixels that lie in the mask, and of
the mask's pixels that the model covers; also lost and doubtful frames, turns faster than a person can make, jumps of
limbs (`jumps`), limbs contradicted by the masks (`search.trackers.agreement`), and the jitter of the markers.
"""

import contextlib
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel
from studio.evidence.backgrounds import Backgrounds
from studio.evidence.distance_maps import silhouette_distances
from studio.evidence.frame_evidence import FrameEvidence
from studio.evidence.pipeline import EvidenceMaker
from studio.foundations.arrays import Array
from studio.foundations.errors import RunError, SessionError
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress, no_progress
from studio.foundations.words import counted
from studio.runs.drawing.overlay_drawing import projected_silhouette
from studio.runs.jumps import Jump, jumps_of
from studio.runs.refining import jitter
from studio.runs.run_footage import filmed_cameras, footage_of
from studio.runs.setup.person_witness import LimbsByNetwork
from studio.runs.tracks import BEST, Track, read_track, track_stamp
from studio.search.likelihood.overlay import limb_contours
from studio.search.settings import RunSettings, settings_from_values
from studio.search.trackers.agreement import Agreement, Disagreement
from studio.search.trackers.hidden_areas import without_hidden
from studio.search.trackers.limb_resampling import thin_limbs_of
from studio.search.trackers.limbs_elsewhere import (
    Elsewhere,
    LimbsElsewhere,
    changes_by_camera,
    lost_of,
    without_sure,
)
from studio.search.trackers.loss_detection import anything_seen
from studio.search.trackers.reported_limbs import reported_limbs, reported_lost
from studio.search.trackers.start_candidates import facing
from studio.search.trackers.thin_limbs import HALF_PLAIN, lines_along
from studio.search.trackers.tracker import LIMB_LOST_SHARE
from studio.sessions.record_files import RecordFile
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

FOLDER = "checks"
SCHEMA_VERSION = 1
EVERY = 10
GOOD_SHARE = 0.85
"""A frame with a smaller share of the model's pixels in the masks does not fit."""
EXPLAINED_SHARE = 0.7
"""Of all masks' pixels: where the body explains fewer, something else is in the masks: another person, a shadow."""
DOUBTFUL = 0.6
"""Agreement of the silhouettes (f_s) below which a frame is marked."""
FASTEST_TURN = 2700.0
"""Degrees a second about the vertical, more than people reach: left and right were exchanged."""
LOST = ("lost", "no evidence")
NAMED = 4
"""Jumps named in one line."""


class ContradictedLimb(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A limb contradicted by a frame. share : of its area that disagrees with the masks. elsewhere : the pictures
    contradict it, though the masks may not: what changed in them (`search.trackers.limbs_elsewhere`), or where a
    network sees a person's limbs (`setup.person_witness`).
    """

    frame: int
    limb: str
    share: float
    elsewhere: bool = False


class RunCheck(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How well a track fits the pictures.

    frames : numbers of the frames that were checked.
    inside, covered : (F, V) shares: of the model's pixels in the mask, of the mask's under the model; None where there
        is nothing to divide by.
    lost, doubtful, turned : frame numbers.
    jitter_mm : root mean square second difference of the markers.
    jumps, denied : limbs that jump, and limbs that the masks of checked frames contradict; None: not measured.
    stamp, count : of the track when it was checked.
    """

    schema: int = SCHEMA_VERSION
    track: str
    stamp: int
    count: int
    cameras: tuple[str, ...]
    frames: tuple[int, ...]
    inside: tuple[tuple[float | None, ...], ...]
    covered: tuple[tuple[float | None, ...], ...]
    lost: tuple[int, ...]
    doubtful: tuple[int, ...]
    turned: tuple[int, ...]
    jitter_mm: float
    jumps: tuple[Jump, ...] | None = None
    denied: tuple[ContradictedLimb, ...] | None = None

    @property
    def poor(self) -> tuple[int, ...]:
        """Frames with too little of the model in the masks, averaged over the views."""
        shares = [[share for share in row if share is not None] for row in self.inside]
        return tuple(
            frame
            for frame, row in zip(self.frames, shares, strict=True)
            if not row or sum(row) / len(row) < GOOD_SHARE
        )

    @property
    def inside_mean(self) -> float:
        """Mean share of the model's pixels in the masks, over all checked frames and cameras; NaN if there is none."""
        known = [share for row in self.inside for share in row if share is not None]
        return float(np.mean(known)) if known else float("nan")

    @property
    def covered_mean(self) -> float:
        """Mean share of the masks' pixels under the model, over all checked frames and cameras, or NaN."""
        known = [share for row in self.covered for share in row if share is not None]
        return float(np.mean(known)) if known else float("nan")

    @property
    def is_beside_others(self) -> bool:
        """Whether the masks show much that this body does not explain."""
        return self.covered_mean < EXPLAINED_SHARE

    @property
    def good(self) -> bool:
        """Whether nothing needs attention."""
        wrong = (
            self.poor or self.lost or self.turned or self.jumps or self.lost_limbs or self.is_beside_others
        )
        return not wrong

    @property
    def lost_limbs(self) -> dict[str, tuple[int, ...]]:
        """Limbs contradicted by the masks in more than one checked frame, with these frames. (One limb is contradicted
        in one of fifty correct frames.)
        """
        frames: dict[str, tuple[int, ...]] = {}
        for one in self.denied or ():
            frames[one.limb] = (*frames.get(one.limb, ()), one.frame)
        return {limb: own for limb, own in frames.items() if len(own) > 1 or len(self.frames) == 1}

    def in_words(self) -> str:
        """A one-line summary; jumps by frame and limb."""
        parts = [f"{100 * self.inside_mean:.0f} % of the model in the masks"]
        parts += [f"{len(self.poor)} of {len(self.frames)} checked frames do not fit"] if self.poor else []
        if self.is_beside_others:
            parts.append(
                f"only {100 * self.covered_mean:.0f} % of the masks explained: is another person in view?"
            )
        parts += [f"{len(self.lost)} lost"] if self.lost else []
        parts += [
            f"{limb} not where masks or pictures show it in {len(own)} of them"
            for limb, own in self.lost_limbs.items()
        ]
        parts += [f"{len(self.turned)} sudden turns"] if self.turned else []
        parts += [_leaps(self.jumps)] if self.jumps else []
        return ", ".join([*parts, f"jitter {self.jitter_mm:.1f} mm"])


_RECORD = RecordFile(
    RunCheck,
    "the check of a track",
    "Check the run again.",
    ("The track was not checked.", "Check it."),
    SCHEMA_VERSION,
)


def check_run(
    session: Session,
    run: StoredRun,
    track: str = BEST,
    every: int = EVERY,
    *,
    progress: Progress = no_progress,
) -> RunCheck:
    """Measure a track in every `every`-th of its frames and store the result, if the disk can be written.

    Raises RunError for a run without frames, NotFoundError, FootageError.
    """
    chosen = read_track(run, track or BEST)
    if not len(chosen.frames):
        raise RunError(f"Run '{run.name}' has no finished frame.", "Track it first.")
    body, cameras = run.body(), filmed_cameras(session, run.cameras())
    rows = range(0, len(chosen.frames), max(1, every))
    settings = _settings(run)

    fits: list[tuple[tuple[float | None, ...], tuple[float | None, ...]]] = []
    contradicted, agreement = list[ContradictedLimb](), Agreement(body, cameras)
    with contextlib.closing(footage_of(session, run)) as footage, run.results() as results:
        known = set(results.frames())
        backgrounds, knobs = Backgrounds(footage), settings.evidence
        thin = thin_limbs_of(body, cameras, settings.refinement.above_floor)
        maker = EvidenceMaker(cameras, footage, backgrounds, knobs, "none", with_empty=bool(thin))
        witness, network = LimbsElsewhere(body, cameras), LimbsByNetwork(body, cameras)
        for done, row in enumerate(rows):
            progress("comparing with the masks", done, len(rows))
            evidence = maker.evidence(int(chosen.frames[row]))
            frame, pose = evidence.frame, chosen.poses[row]
            fits.append(frame_shares(body, cameras, pose, evidence))
            hidden: Mapping[str, Array] = results.result(frame).carried.memory if frame in known else {}
            off = _contradicted(agreement, pose, evidence, hidden)
            if off is not None:
                elsewhere, changes = dict[str, Elsewhere](), changes_by_camera(evidence)
                if witness.usable:
                    elsewhere = witness.of(pose, tuple(changes.values()), hidden)
                pictures = {view.camera: view.picture for view in evidence.views}
                reported = reported_lost(body, pose, reported_limbs(network, pose, pictures, elsewhere))
                seen = {limb: one.lines(pose, changes, off.corners) for limb, one in thin.items()}
                lines = lines_along(thin, pose, seen)
                contradicted += [
                    ContradictedLimb(frame, limb, *found)
                    for limb, found in contradicted_limbs(off, elsewhere, reported, lines).items()
                ]
    check = RunCheck(
        track=chosen.name,
        stamp=track_stamp(run, chosen.name),
        count=len(chosen.frames),
        cameras=tuple(camera.name for camera in cameras),
        frames=tuple(int(chosen.frames[row]) for row in rows),
        inside=tuple(shown[0] for shown in fits),
        covered=tuple(shown[1] for shown in fits),
        lost=_frames_where(chosen, np.isin(np.array(chosen.states), LOST)),
        doubtful=_frames_where(chosen, chosen.confidence < DOUBTFUL),
        turned=sudden_turns(body, chosen, run.record.fps),
        jitter_mm=jitter(run, chosen),
        jumps=jumps_of(body, chosen),
        denied=tuple(contradicted),
    )
    # What was measured is told, also where the disk cannot keep it.
    with contextlib.suppress(OSError, SessionError):
        (run.folder / FOLDER).mkdir(exist_ok=True)
        _RECORD.write(_path(run, chosen.name), check)
    return check


def kept_check(run: StoredRun, track: str) -> RunCheck | None:
    """The stored check of a track; None if there is none or the track has changed since."""
    path = _path(run, track)
    if not path.is_file():
        return None
    check = _RECORD.read(path)
    stored = read_track(run, track)
    same = (check.stamp, check.count) == (track_stamp(run, track), len(stored.frames))
    return check if same and check.denied is not None else None


def frame_shares(
    body: BodyModel, cameras: tuple[Camera, ...], pose: Array, evidence: FrameEvidence
) -> tuple[tuple[float | None, ...], tuple[float | None, ...]]:
    """For each camera: the share of the model's pixels in the mask, of those where it is known whether they are, and of
    the mask's pixels under the model.
    """
    views = {view.camera: view for view in evidence.views}
    inside: list[float | None] = []
    covered: list[float | None] = []
    for camera, contours in zip(cameras, limb_contours(body, cameras, pose), strict=True):
        view = views.get(camera.name)
        if view is None:
            inside.append(None)
            covered.append(None)
            continue
        mask = view.mask > 0
        model = projected_silhouette(contours, *mask.shape) > 0
        both = int(np.count_nonzero(mask & model))
        told = model if view.unknown is None else model & (view.unknown == 0)
        inside.append(_share(both, int(np.count_nonzero(told))))
        covered.append(_share(both, int(np.count_nonzero(mask))))
    return tuple(inside), tuple(covered)


def _contradicted(
    agreement: Agreement, pose: Array, evidence: FrameEvidence, hidden: Mapping[str, Array]
) -> Disagreement | None:
    """Where a pose (D,) disagrees with a frame's masks; None where not all cameras have one, or none shows anything.
    hidden : known occlusions by camera.
    """
    if len(evidence.views) < len(agreement.cameras) or not anything_seen(evidence):
        return None
    mm = agreement.mm_per_pixel(pose)
    seen = without_hidden(silhouette_distances(evidence), agreement.cameras, mm, hidden)
    return agreement.confirmed(agreement.of(pose, seen), pose, seen)


def contradicted_limbs(
    off: Disagreement,
    elsewhere: Mapping[str, Elsewhere],
    reported: Collection[str],
    lines: Mapping[str, float] | None = None,
) -> dict[str, tuple[float, bool]]:
    """By limb that masks or pictures contradict the share of its area that disagrees with the masks, and whether the
    pictures do. off : of a pose. elsewhere : of `LimbsElsewhere`. reported : of `reported_lost`.
    lines : by thin limb how plainly lines run along it (`thin_limbs`), which alone says whether it is contradicted.
    """
    plain = lines or {}
    lost = {*lost_of(elsewhere), *reported} - plain.keys()
    lost |= {limb for limb, odds in plain.items() if odds < HALF_PLAIN}
    return {
        limb: (round(share, 3), limb in lost)
        for limb, share in without_sure(off, elsewhere).shares().items()
        if (share > LIMB_LOST_SHARE and limb not in plain) or limb in lost
    }


def sudden_turns(body: BodyModel, track: Track, fps: float) -> tuple[int, ...]:
    """Frames in which the body turned about the vertical faster than FASTEST_TURN."""
    if len(track.frames) < 2:
        return ()
    toward = facing(body, track.poses)[:, :2]
    angle = np.unwrap(np.arctan2(toward[:, 1], toward[:, 0]))
    length = np.linalg.norm(toward, axis=1)
    apart = np.diff(track.frames)
    rate = np.degrees(np.abs(np.diff(angle))) * fps / apart
    # A body that lies down faces up: its direction over the floor is meaningless.
    upright = np.minimum(length[1:], length[:-1]) > 0.5
    return tuple(int(frame) for frame in track.frames[1:][(rate > FASTEST_TURN) & upright])


def _leaps(jumps: Sequence[Jump]) -> str:
    """The number of jumps, and the first few."""
    some = "; ".join(jump.in_words() for jump in jumps[:NAMED])
    more = f"; and {len(jumps) - NAMED} more" if len(jumps) > NAMED else ""
    return f"{counted(len(jumps), 'jump')} ({some}{more})"


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None


def _frames_where(track: Track, chosen: NDArray[np.bool_]) -> tuple[int, ...]:
    return tuple(int(frame) for frame in track.frames[chosen])


def _path(run: StoredRun, track: str) -> Path:
    return run.folder / FOLDER / f"{track}.json"


def _settings(run: StoredRun) -> RunSettings:
    with run.results() as results:
        history = results.settings_history()
    values = history[-1].values if history else run.record.settings
    return settings_from_values(run.record.tracker, run.record.weighting, values)
