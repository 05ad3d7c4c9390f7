"""A run's twin: the run drawn as footage of its own, tracked as it was tracked, and the errors there.

The twin's body moves as the run's poses say, before the same cameras in the same empty place. A person is drawn clothed
(`twin_person.py`), any other body with the surface of its cones. The masks are the drawn ones with the faults of the
run's own (`mask_faults.py`), of frames a third of the run away. What the run was given it is given, too: settings as
they changed, σ0, start pose, behaviour model, corrected sides, and a shape fitted to its first frames where the run's
was. Of the truth, if the session has one, nothing is read.
"""

import shutil
import tempfile
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np
from cachetools import LRUCache

from studio.body.dimensions import with_dimensions
from studio.body.forward_kinematics import joint_frames
from studio.body.model import BodyModel
from studio.body.person import marker_motion
from studio.body.scale import scale_of
from studio.body.shape_space import keeps_taped
from studio.body.subject import REPORTED_SPREAD, height_spread
from studio.evidence.backgrounds import Backgrounds
from studio.evidence.pipeline import EvidenceMaker
from studio.footage.capture.calibration_files import write_calibration
from studio.footage.capture.footage import Footage
from studio.footage.capture.footage_source import FootageSource
from studio.foundations.arrays import Array, Bytes, evenly_spread
from studio.foundations.errors import RunError
from studio.foundations.geometry.camera import Camera
from studio.foundations.knobs import Value
from studio.foundations.progress import Progress
from studio.results.drawing_footage.body_footage import body_pieces
from studio.results.drawing_footage.flesh import IntArray, clothed_pieces, piece_tables
from studio.results.drawing_footage.renderer import DrawnSurface, RendererBefore
from studio.results.drawing_footage.rooms import OFFICE_LIGHTS
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.reference import body_points
from studio.results.uncertainty.mask_faults import FaultShares, MaskFaults
from studio.results.uncertainty.twin_person import is_person, person_of_poses
from studio.runs.drawing.overlay_drawing import projected_silhouette
from studio.runs.problem_source import ProblemSource
from studio.runs.setup.shape_on_the_way import FIRST_FRAMES, LEAST_OVERLAP, shaped_body
from studio.runs.sides import correct_clip
from studio.runs.tracking_run import TrackingRun
from studio.runs.tracks import SIDES, Track, best_track, read_track, track_digest
from studio.search.likelihood.overlay import limb_contours
from studio.search.settings import default_settings, settings_from_values
from studio.sessions.provenance import digests
from studio.sessions.results_store import ResultsWriter, create_store
from studio.sessions.run_record import BEHAVIOUR_NAME, CAMERAS_NAME, write_run_record
from studio.sessions.stored_run import BODY_FOLDER, StoredRun

SEED = 9001
"""Added to the run's: its twin draws other random numbers."""
AWAY = 1.0 / 3.0
"""Share of the run from which the faults of a frame's masks come."""
SAMPLES, NOISE = 1, 2.5
"""Rays along a pixel's side, and the sensor's noise, grey levels."""
GIRTHS, GIRTH_FRAMES, GIRTH_LIMITS = (0.9, 1.1), 4, (0.6, 1.6)
KEPT_BYTES = 256 << 20
"""Of what was drawn, where the body is: a person in four small pictures takes a MB a frame."""
MOST_MISSING = 0.15
"""Of the choosing half's clips whose errors are at most 1.6 times their twins', no camera's masks lack more than 6 % of
the body; where boxes hide it (39 %), errors are twice their twins'.
"""
REMEDY = "Its joints have no half widths; 'evaluate' measures it where there is a truth."
EVERY = 2
"""Masks are compared with silhouettes in every so many frames; the others have the faults of the one before."""
OWN_MASKS: Mapping[str, Value] = {
    "background_model": "mask",
    "mask_clean_given": False,
    "hull_evidence": "masks",
    "record_particles": 0,
}


@dataclass(frozen=True, slots=True, eq=False)
class TwinErrors:
    """Of a twin's F frames and M points. errors : (F, M, 3) mm, reported less true. turns : (F, M, 3, 3) axes of the
    joint that carries each point, as reported. faults : what was wrong with the masks.
    """

    errors: Array
    turns: Array
    faults: tuple[FaultShares, ...]

    @property
    def in_carriers(self) -> Array:
        """(F, M, 3) the errors in the axes of what carries each point, so that a bias turns with the limb."""
        return np.einsum("fmji,fmj->fmi", self.turns, self.errors)


class TwinFootage(Footage):
    """What a renderer draws, under the frame numbers of a run, with masks that have faults."""

    def __init__(
        self, source: FootageSource, folder: Path, renderer: RendererBefore, first: int, faults: MaskFaults
    ) -> None:
        """source, folder : as of the run's footage, whose excluded areas hold here for cameras of the same names.
        first : its first frame.
        """
        super().__init__(source, folder)
        self._renderer, self._first, self._given = renderer, first, faults
        self._count = renderer.frame_count
        self._views = {name: at for at, name in enumerate(renderer.names)}
        self._drawn = LRUCache[tuple[str, int], DrawnSurface](KEPT_BYTES, lambda drawn: drawn.nbytes)

    def picture(self, camera: str, frame: int) -> Bytes:
        return self._seen(camera, frame)[0]

    def mask(self, camera: str, frame: int) -> Bytes | None:
        view, at = self._views[camera], frame - self._first
        source = (at + round(AWAY * self._count)) % self._count
        source -= source % EVERY
        return self._given.given_to(self._seen(camera, frame)[1], view, at, source)

    def has_masks(self, camera: str) -> bool:
        return True

    def hidden(self, camera: str, frame: int) -> Bytes | None:
        return None

    def absent(self, frame: int) -> frozenset[str]:
        return frozenset()

    def _seen(self, camera: str, frame: int) -> tuple[Bytes, Bytes]:
        key, view = (camera, frame), self._views[camera]
        drawn = self._drawn.get(key)
        if drawn is None:
            drawn = self._renderer.surface(view, frame - self._first)
            if drawn is not None and drawn.nbytes <= KEPT_BYTES:
                self._drawn[key] = drawn
        return self._renderer.seen(view, drawn)


class NotPromisedError(RunError):
    """A run of which a twin would promise too much. why : a clause."""

    def __init__(self, run: str, why: str) -> None:
        super().__init__(f"How far off run '{run}' is cannot be promised: {why}.", REMEDY)
        self.why = why


def not_promised(run: StoredRun, why: str) -> NotPromisedError:
    """The error for a run of which a twin would promise too much. why : a clause."""
    return NotPromisedError(run.name, why)


def stamp_of(run: InspectedRun) -> str:
    """What changes with all that a run's twin is made of: its poses, footage, calibration and masks."""
    inputs, track = digests(run.session, ("footage", "calibration", "masks")), reported(run.run)
    return " ".join([track.name, track_digest(track), *(value[:12] for value in inputs.values())])


def points_of(body: BodyModel) -> tuple[str, ...]:
    """(M,) names of the body's points: its markers, or its limbs, whose far ends are meant, where it has none."""
    return tuple(one.name for one in (body.markers or body.drawn))


def carriers_of(body: BodyModel) -> list[int]:
    """(M,) the joint that carries each of the body's points: of one at its joint's origin the joint above."""
    carriers: list[int] = []
    if not body.markers:
        return [limb.joint for limb in body.drawn]
    for marker in body.markers:
        above = body.joints[marker.joint].parent
        carriers.append(above if above >= 0 and not np.any(marker.offset) else marker.joint)
    return carriers


def track_twin(run: InspectedRun, frames: range, progress: Progress) -> TwinErrors:
    """Draw and track a run's twin. frames : of the run, each with a pose. What a progress raises ends it.

    Raises RunError where the masks lack too much of the body.
    """
    with closing(Twins(run, frames, progress)) as twins:
        return twins.track(progress)


@dataclass(frozen=True, slots=True, eq=False)
class TwinCamera:
    """A camera that films a twin. like : the run's camera whose empty place and mask faults it has."""

    camera: Camera
    like: str


class Twins:
    """A run's twins, which cameras that are not the run's may film as well: the same body, motion, person and mask
    faults. Close it when done.
    """

    def __init__(self, run: InspectedRun, frames: range, progress: Progress) -> None:
        """frames : of the run, each with a pose. What a progress raises ends it.

        Raises RunError where the masks lack too much of the body.
        """
        self._run, self._frames = run, frames
        body, poses, self._cameras = run.body, reported(run.run).poses[: len(frames)], run.run.cameras()
        self._own = run.session.footage()
        try:
            backgrounds = Backgrounds(self._own)
            self._faults = _measured(run, frames, poses, self._cameras, self._own, backgrounds, progress)
            for one in self._faults.shares():
                if one.holes + one.empty > MOST_MISSING:
                    raise not_promised(
                        run.run,
                        f"{100.0 * (one.holes + one.empty):.0f} % of the body are missing in the masks of {one.camera},"
                        " so that something hides it, or it is elsewhere",
                    )
            self._pictures = [_empty_place(backgrounds, camera.name) for camera in self._cameras]
            self._surface, self.truth = _drawn(body, poses, self._cameras, self._pictures, run.run.record.fps)
        except BaseException:
            self._own.close()
            raise

    def close(self) -> None:
        self._own.close()

    def track(
        self, progress: Progress, rig: Sequence[TwinCamera] | None = None, *, seed: int = 0
    ) -> TwinErrors:
        """Draw and track a twin. rig : cameras, the run's by default. seed : another one draws other random numbers."""
        run, frames = self._run, self._frames
        rig = rig or [TwinCamera(camera, camera.name) for camera in self._cameras]
        own = [camera.name for camera in self._cameras]
        like = [own.index(one.like) for one in rig]
        cameras, seed = tuple(one.camera for one in rig), run.run.record.seed + SEED * (1 + seed)
        renderer = _renderer(
            cameras,
            [self._pictures[at] for at in like],
            *self._surface,
            1.0 if is_person(run.body) else scale_of(run.body),
            SAMPLES,
            seed,
        )
        sources = {one.name: one for one in self._own.source.cameras}
        filmed = tuple(replace(sources[one.like], name=one.camera.name) for one in rig)
        source = replace(self._own.source, cameras=filmed)
        faults = self._faults.in_cameras(cameras, like)
        with (
            closing(TwinFootage(source, self._own.folder, renderer, frames.start, faults)) as footage,
            _prepared(run, frames, cameras, footage, seed, progress) as twin,
            ThreadPoolExecutor(1, thread_name_prefix="next-frame") as ahead,
            closing(
                ProblemSource(
                    run.session, twin.body(), cameras, last=frames.stop, executor=ahead, footage=footage
                )
            ) as problems,
        ):
            track_to_end(twin, problems, lambda done, total: progress("tracking the twin", done, total))
            found = reported(twin).poses
            errors = body_points(twin.body(), found) - self.truth
            turns = joint_frames(twin.body(), found)[:, carriers_of(run.body), :, :3]
        return TwinErrors(errors, turns, self._faults.shares())


def reported(run: StoredRun) -> Track:
    """The run's track with its sides put right, if anything was; else the search's own."""
    return read_track(run, best_track(run, (SIDES,)).name)


def _empty_place(backgrounds: Backgrounds, camera: str) -> Bytes:
    """(H, W, 3) what a camera sees without the body: its plate, else the footage's median."""
    plate = backgrounds.empty_room(camera)
    return np.rint(backgrounds.combined(camera)[0].mean).astype(np.uint8) if plate is None else plate


def _measured(
    run: InspectedRun,
    frames: range,
    poses: Array,
    cameras: tuple[Camera, ...],
    footage: Footage,
    backgrounds: Backgrounds,
    progress: Progress,
) -> MaskFaults:
    """The faults of the run's own masks."""
    faults, makers = MaskFaults(run.body, cameras, poses), dict[object, EvidenceMaker]()
    for at in range(0, len(frames), EVERY):
        frame = frames[at]
        progress("what the masks get wrong", at, len(frames))
        settings = run.settings(frame).evidence
        maker = makers.setdefault(settings, EvidenceMaker(cameras, footage, backgrounds, settings, "none"))
        faults.measure(at, {view.camera: view.mask for view in maker.evidence(frame).views})
    return faults


def _drawn(
    body: BodyModel, poses: Array, cameras: tuple[Camera, ...], pictures: list[Bytes], fps: float
) -> tuple[tuple[Array, IntArray], Array]:
    """The surface of a body in poses (F, D), as renderers take it, and where its points then are, (F, M, 3) mm."""
    truth = body_points(body, poses)
    if not is_person(body):
        return body_pieces(body, poses, 1.0 / scale_of(body)), truth
    motion = person_of_poses(body, poses, fps)
    markers, names = marker_motion(motion), points_of(body)
    truth[:, [names.index(name) for name in markers.names]] = markers.positions

    def surface(girth: float) -> tuple[Array, IntArray]:
        return piece_tables(motion, clothed_pieces(motion.skeleton, girth))

    return surface(_girth(body, poses, cameras, pictures, surface)), truth


def _renderer(
    cameras: tuple[Camera, ...],
    pictures: list[Bytes],
    tables: Array,
    labels: IntArray,
    scale: float,
    samples: int,
    seed: int,
) -> RendererBefore:
    """scale : of the body beside a person. A small one is drawn larger, before cameras that are so much farther off."""
    enlarged = tuple(replace(camera, translation=camera.translation / scale) for camera in cameras)
    return RendererBefore(
        pictures, enlarged, tables, labels, lights=OFFICE_LIGHTS, noise=NOISE, samples=samples, seed=seed
    )


def _girth(
    body: BodyModel,
    poses: Array,
    cameras: tuple[Camera, ...],
    pictures: list[Bytes],
    surface: Callable[[float], tuple[Array, IntArray]],
) -> float:
    """The girth with which a person covers as much of the pictures as the body's cones do."""
    rows = evenly_spread(len(poses), GIRTH_FRAMES)
    wanted = sum(
        int(np.count_nonzero(projected_silhouette(contours, camera.height, camera.width)))
        for row in rows
        for camera, contours in zip(cameras, limb_contours(body, cameras, poses[row]), strict=True)
    )
    areas: list[int] = []
    for girth in GIRTHS:
        tables, labels = surface(girth)
        drawn = _renderer(cameras, pictures, tables[rows], labels, 1.0, 1, 0)
        areas.append(
            sum(
                int(np.count_nonzero(drawn.seen(view, drawn.surface(view, at))[1]))
                for at in range(len(rows))
                for view in range(len(cameras))
            )
        )
    low, high = GIRTHS
    slope = (areas[1] - areas[0]) / (high - low)
    girth = low + (wanted - areas[0]) / slope if slope > 0.0 else 1.0
    return float(np.clip(girth, *GIRTH_LIMITS))


@contextmanager
def _prepared(
    run: InspectedRun,
    frames: range,
    cameras: tuple[Camera, ...],
    footage: TwinFootage,
    seed: int,
    progress: Progress,
) -> Generator[StoredRun]:
    """The twin as a run of its own, ready to be tracked, in a folder that is removed at the end."""
    record, body = run.run.record, run.body
    start = record.start_pose
    if record.subject_dimensions and start is not None:
        body, start = _shaped(run, frames, cameras, footage, progress)
    with tempfile.TemporaryDirectory(prefix="studio-twin-") as folder, run.run.results() as results:
        place = Path(folder) / "twin" / "runs" / "twin"
        place.mkdir(parents=True)
        write_calibration(cameras, place / CAMERAS_NAME)
        if (run.run.folder / BEHAVIOUR_NAME).exists():
            shutil.copyfile(run.run.folder / BEHAVIOUR_NAME, place / BEHAVIOUR_NAME)
        if (run.run.folder / BODY_FOLDER).is_dir():
            shutil.copytree(run.run.folder / BODY_FOLDER, place / BODY_FOLDER)
        create_store(place)
        changed = msgspec.structs.replace(
            record,
            last=frames.stop,
            seed=seed,
            settings={**record.settings, **OWN_MASKS},
            dimensions=dict(body.dimensions),
            start_pose=start,
            made_from="",
            notes=(),
        )
        write_run_record(place, changed)
        with closing(ResultsWriter(place)) as writer:
            for entry in results.settings_history():
                writer.write_settings(entry.version, entry.frame, entry.layer, {**entry.values, **OWN_MASKS})
        yield StoredRun(place, changed)


def _shaped(
    run: InspectedRun,
    frames: range,
    cameras: tuple[Camera, ...],
    footage: TwinFootage,
    progress: Progress,
) -> tuple[BodyModel, tuple[float, ...]]:
    """The body with the shape of the twin's first frames, as the run's own was fitted, and its start pose."""
    record = run.run.record
    assert record.start_pose is not None
    body = with_dimensions(run.body, record.subject_dimensions)
    recorded = settings_from_values(record.tracker, record.weighting, {**record.settings, **OWN_MASKS})
    rules = replace(default_settings(), evidence=recorded.evidence)
    problems = ProblemSource(run.session, body, cameras, footage=footage)
    # The footage goes on; what the source has read of it is let go with the source.
    shape = shaped_body(
        body,
        problems.cameras,
        lambda frame: problems.evidence(frame, rules),
        frames[:FIRST_FRAMES],
        np.array(record.start_pose),
        np.array(record.sigma),
        above_floor=recorded.refinement.above_floor,
        height_spread=spread_of_fit(body, record.dimensions),
        progress=lambda step, done, total: progress(f"{step} of the twin", done, total),
    )
    before, after = shape.overlap
    if after < max(LEAST_OVERLAP, before):
        return body, record.start_pose
    return shape.body, tuple(float(value) for value in shape.start)


def spread_of_fit(body: BodyModel, fitted: Mapping[str, float]) -> float | None:
    """mm by which a body's height might be off when a run fitted its shape; None where its lengths were kept.

    body : as it was before. fitted : its dimensions after, mm. At the size of its own file nothing was known of it.
    """
    return None if keeps_taped(body, fitted) else height_spread(body, None) or REPORTED_SPREAD


def track_to_end(run: StoredRun, problems: ProblemSource, step: Callable[[int, int], None]) -> None:
    """Track a prepared run, and put its sides right as a whole. step : is told the frames done and their number."""
    total = run.record.frame_count
    with closing(TrackingRun(run, problems)) as tracking:
        while not tracking.finished:
            step(tracking.done, total)
            tracking.step_layer()
    correct_clip(run, problems, lambda _: step(total, total))
