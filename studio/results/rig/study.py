"""A run's rig and others beside it: what errors to expect of each, kept with the run, and why a run has none.

The present rig's twin is tracked first. Where the bound (`bound.py`) says that a point is seen worse, its error is
predicted to grow as the bound does; where it is seen better, to shrink so, but for what flesh and clothes that are no
cones leave however many cameras see them. So the present rig's prediction is what its twin showed, and other rigs'
follow in seconds; on request they are drawn and tracked, too.
"""

import math
from collections.abc import Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from functools import partial
from typing import Annotated

import msgspec
import numpy as np
from pydantic import Field, FiniteFloat

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.foundations.arrays import Array
from studio.foundations.declaring import Terminal, Web
from studio.foundations.errors import RunError
from studio.foundations.progress import Progress
from studio.foundations.words import counted, enumerated
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.reference import body_points, limbs_of_points
from studio.results.inspection.tables import Row, Table, table
from studio.results.rig.bound import (
    LinearMotion,
    ViewInformation,
    errors_of,
    linear_motion,
    total,
    view_information,
)
from studio.results.rig.places import (
    Place,
    camera_at,
    choose,
    grid_of,
    names_beside,
    parsed_place,
)
from studio.results.uncertainty.half_widths import STALE, frames_of_twin
from studio.results.uncertainty.twin import (
    NotPromisedError,
    TwinCamera,
    TwinErrors,
    Twins,
    points_of,
    reported,
    stamp_of,
)
from studio.sessions.record_files import RecordFile
from studio.sessions.work_under_way import one_at_a_time

FILE_NAME = "rig.json"
PRESENT = "as it is"
FEWEST_CAMERAS = 2
FEWEST_FRAMES = 8
CLOTHES_MM = 6.0
"""A bias that stays: so much, or less, have the joints of a person whom four cameras see from all around (5 and 6 mm in
the mean of two drawn clips); in rigs of two it is three times as much, and goes where there are more.
"""
PATH_POINTS = 60
"""Of the subject's path that are kept, for a plan of the room."""
NAME = r"^[^=]{1,64}=[-+0-9.eE]{1,24},[-+0-9.eE]{1,24},[-+0-9.eE]{1,24}$"
PLACE = NAME.replace("[^=]{1,64}=", "")


@dataclass(frozen=True, slots=True)
class RigRequest:
    """Which rigs are asked for, beside the present one."""

    leave_out: Annotated[bool, Field(description="Rigs that lack one camera each.")] = False
    move: Annotated[
        Sequence[str],
        Field(description="A camera that stands elsewhere, in mm, and looks at the subject"),
        Terminal("--move", metavar="CAMERA=X,Y,Z"),
        Web(kind=list[Annotated[str, Field(pattern=NAME)]]),
    ] = ()
    add: Annotated[
        Sequence[str],
        Field(description="One camera more, in mm, that looks at the subject"),
        Terminal("--add", metavar="X,Y,Z"),
        Web(kind=list[Annotated[str, Field(pattern=PLACE)]]),
    ] = ()
    best: Annotated[
        int, Field(ge=0, le=12, description="So many cameras on the best places of a grid over the room.")
    ] = 0
    instead: Annotated[
        bool, Field(description="These are the whole rig, in place of the present cameras.")
    ] = False
    heights: Annotated[
        Sequence[float],
        Field(description="A height of the grid, mm (default: those of the present cameras)"),
        Terminal("--height", metavar="MM"),
    ] = ()
    spacing: Annotated[
        float | None,
        Field(gt=0.0, le=1e5, description="Of the grid, mm; default: eleven places along the longer side."),
    ] = None
    lens: Annotated[
        str,
        Field(description="The camera like which new ones are; default: the one that sees most alike."),
        Terminal(metavar="CAMERA"),
    ] = ""
    twins: Annotated[
        bool,
        Field(
            description="Draw and track the run as each of these rigs would film it, rather than predict alone."
        ),
    ] = False
    frames: Annotated[
        int | None, Field(ge=FEWEST_FRAMES, description="The run's first so many frames alone; default: all.")
    ] = None
    seeds: Annotated[int, Field(ge=1, le=20, description="How often each rig is drawn and tracked.")] = 1


class RigCamera(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A camera of a rig. place : mm. ahead : of length 1, where it looks. half_angle : degrees, of what it sees
    sideways. like : the run's camera whose lens and masks it has. is_new : whether it does not stand there now.
    """

    name: str
    place: tuple[FiniteFloat, FiniteFloat, FiniteFloat]
    ahead: tuple[FiniteFloat, FiniteFloat, FiniteFloat]
    half_angle: FiniteFloat
    like: str
    is_new: bool


class RigErrors(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What errors to expect of a rig, mm. kind : "present", "without", "changed" or "best". By point in the study's
    order: bound_mm : by the bound alone. predicted_mm : what follows from it and the present rig's twin. tracked_mm :
    measured where the run was drawn and tracked so, and the bias in it; null where it was not. by_seed : means over all
    points, one a twin. predicted, tracked : means over all points.
    """

    name: str
    kind: str
    cameras: tuple[RigCamera, ...]
    bound_mm: tuple[FiniteFloat, ...]
    predicted_mm: tuple[FiniteFloat, ...] = ()
    predicted: FiniteFloat = 0.0
    tracked_mm: tuple[FiniteFloat, ...] | None = None
    bias_mm: tuple[FiniteFloat, ...] | None = None
    tracked: FiniteFloat | None = None
    by_seed: tuple[FiniteFloat, ...] = ()

    @property
    def expected_mm(self) -> tuple[float, ...]:
        """By point: as measured, else as predicted."""
        return self.predicted_mm if self.tracked_mm is None else self.tracked_mm

    @property
    def expected(self) -> float:
        """The mean over all points: as measured, else as predicted."""
        return self.predicted if self.tracked is None else self.tracked

    def with_twin(self, twin: TwinErrors) -> "RigErrors":
        """The same with one twin more."""
        done = len(self.by_seed)
        off: Array = np.linalg.norm(twin.errors, axis=2).mean(axis=0)
        bias: Array = np.linalg.norm(twin.in_carriers.mean(axis=0), axis=1)
        nothing = (0.0,) * len(off)
        mean = (done * np.array(self.tracked_mm or nothing) + off) / (done + 1)
        return msgspec.structs.replace(
            self,
            tracked_mm=_numbers(mean),
            bias_mm=_numbers((done * np.array(self.bias_mm or nothing) + bias) / (done + 1)),
            tracked=float(mean.mean()),
            by_seed=(*self.by_seed, float(off.mean())),
        )


class GridPlace(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A place of the grid. sees : share of the body in its picture. predicted : mean error with a camera there beside
    the present ones, mm. order : the how manieth to be chosen, from 1; null where it is not.
    """

    place: tuple[FiniteFloat, FiniteFloat, FiniteFloat]
    sees: FiniteFloat
    predicted: FiniteFloat
    order: int | None


class BodyFigure(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The body at rest from its front, mm, to the right and up. points : (M, 2). lines : (L, 4) of the limbs, from and
    to.
    """

    points: tuple[tuple[FiniteFloat, FiniteFloat], ...]
    lines: tuple[tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat], ...]


class RigStudy(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A run's rig and those that were asked for.

    stamp : changes with the run's poses, footage, calibration and masks. frames : how many of the run, from its first.
    points, limbs : of the body. rigs : the present one first. places : of the last grid. spacing : of it, mm.
    path : where the subject is. figure : of the body. subject : where cameras at other places look.
    """

    stamp: str
    track: str
    frames: int
    points: tuple[str, ...]
    limbs: tuple[str, ...]
    rigs: tuple[RigErrors, ...]
    places: tuple[GridPlace, ...]
    spacing: FiniteFloat | None
    path: tuple[tuple[FiniteFloat, FiniteFloat, FiniteFloat], ...]
    figure: BodyFigure
    subject: tuple[FiniteFloat, FiniteFloat, FiniteFloat]
    schema: Annotated[int, Web(left_out=True)] = 1

    @property
    def present(self) -> RigErrors:
        return self.rigs[0]

    def tables(self) -> tuple[Table, ...]:
        """Rigs, their joints, the places of the grid, the cameras of rigs with new ones."""
        return _tables_of(self)


_RECORD = RecordFile(
    RigStudy,
    "a study of a rig",
    "Move the file away: the run is unchanged without it.",
    ("Where cameras should stand was not asked of run '{name}'.", "Ask with 'studio rig'."),
)


@dataclass(frozen=True, slots=True)
class RunRig:
    """What is known of a run's rig and others.

    study : None where none was made.
    stale : why it no longer holds, a clause; "" if it does.
    words : what it says and does not, in sentences.
    """

    study: RigStudy | None
    stale: str
    words: tuple[str, ...]


def kept_rig(run: InspectedRun) -> RunRig:
    """A run's study as it was kept. Raises SessionError where it cannot be read."""
    path = run.run.folder / FILE_NAME
    if not path.exists():
        return RunRig(None, "", ("What errors to expect of this rig has not been measured: start that job.",))
    study = _RECORD.read(path)
    if study.stamp == stamp_of(run):
        return RunRig(study, "", words_of(study))
    return RunRig(study, STALE, (f"The study no longer holds, since {STALE}: ask again.",))


def rig_frames(run: InspectedRun) -> range:
    """The frames that a study is of. Raises RunError for a run that says nothing of its rig, and why."""
    if len(run.run.cameras()) < FEWEST_CAMERAS:
        raise _not_said(run, "it has one camera, and a rig of one tells nothing of depth")
    try:
        return frames_of_twin(run)
    except NotPromisedError as none:
        raise _not_said(run, none.why) from None


def check_request(run: InspectedRun, request: RigRequest) -> None:
    """Raise RunError for a run that says nothing of its rig, and for cameras and places that are none."""
    _Asker(run, rig_frames(run)[: request.frames], request).rigs()


def study_rig(run: InspectedRun, request: RigRequest, progress: Progress, *, again: bool = False) -> RunRig:
    """Predict the errors of the rigs that are asked for and, on request, draw and track them; all is kept with the run
    as it comes. What was tracked before, and holds, is tracked `again` on request only.

    What a progress raises ends it. Raises RunError for a run that says nothing of its rig, and for a request that
    cannot be met.
    """
    frames, stamp, kept = rig_frames(run)[: request.frames], stamp_of(run), kept_rig(run).study
    if kept is not None and (again or kept.stamp != stamp or kept.frames != len(frames)):
        kept = None
    asker = _Asker(run, frames, request)
    present = ("present", [TwinCamera(camera, camera.name) for camera in asker.cameras])
    asked = {PRESENT: present} | asker.rigs()
    rigs = {one.name: one for one in kept.rigs} if kept else {}
    places, spacing = (kept.places, kept.spacing) if kept else ((), None)

    def keep() -> None:
        study = RigStudy(
            stamp,
            reported(run.run).name,
            len(frames),
            points_of(run.body),
            limbs_of_points(run.body),
            tuple(asker.predicted(one, rigs[PRESENT]) for one in rigs.values()),
            places,
            spacing,
            asker.path_kept(),
            _figure(run.body),
            asker.subject,
        )
        with one_at_a_time(run.run.folder.parent.parent):
            _RECORD.write(run.run.folder / FILE_NAME, study)

    with ExitStack() as open_things:
        twins: Twins | None = None

        def track(name: str) -> None:
            nonlocal twins
            for seed in range(len(rigs[name].by_seed), request.seeds):
                if twins is None:
                    twins = open_things.enter_context(closing(Twins(run, frames, progress)))
                number = f", {seed + 1} of {request.seeds}" if request.seeds > 1 else ""
                report = partial(_under, progress, f"{name}{number}")
                rigs[name] = rigs[name].with_twin(twins.track(report, asked[name][1], seed=seed))
                keep()

        def take(name: str) -> None:
            made, before = asker.bound(name, *asked[name]), rigs.get(name)
            if before is None or before.cameras != made.cameras:
                rigs[name] = made

        take(PRESENT)
        track(PRESENT)
        if request.best:
            name, rig, places, spacing = asker.best_places(rigs[PRESENT], progress)
            asked[name] = ("best", rig)
        for name in asked:
            take(name)
        keep()
        for name in asked if request.twins else ():
            track(name)
    return kept_rig(run)


class _Asker:
    """What a request asks of a run: rigs, and their predicted errors."""

    def __init__(self, run: InspectedRun, frames: range, request: RigRequest) -> None:
        self._run, self._request = run, request
        self.cameras = run.run.cameras()
        poses = reported(run.run).poses[: len(frames)]
        self._motion: LinearMotion = linear_motion(run.body, poses)
        self._path: Array = body_points(run.body, poses).mean(axis=1)
        x, y, z = self._path.mean(axis=0).tolist()
        self.subject: Place = (x, y, z)
        self._views: dict[str, ViewInformation] = {
            one.name: view_information(self._motion, one) for one in self.cameras
        }
        names = [camera.name for camera in self.cameras]
        if request.lens and request.lens not in names:
            raise RunError(
                f"Run '{run.run.name}' has no camera '{request.lens[:40]}'.", f"It has {enumerated(names)}."
            )

    def path_kept(self) -> tuple[Place, ...]:
        every = max(1, len(self._path) // PATH_POINTS)
        return tuple((float(x), float(y), float(z)) for x, y, z in self._path[::every])

    def rigs(self) -> dict[str, tuple[str, list[TwinCamera]]]:
        """By name, kinds and cameras of what is asked for, but for places of a grid. Raises RunError."""
        rigs: dict[str, tuple[str, list[TwinCamera]]] = {}
        if self._request.leave_out:
            if len(self.cameras) <= FEWEST_CAMERAS:
                raise RunError(
                    f"None of {counted(len(self.cameras), 'camera')} can be left out: a rig of one tells nothing of"
                    " depth.",
                    "Move one, or add one.",
                )
            for left in self.cameras:
                others = [TwinCamera(one, one.name) for one in self.cameras if one is not left]
                rigs[f"without {left.name}"] = ("without", others)
        if self._request.instead and self._request.best == 1:
            raise RunError("A rig of one camera tells nothing of depth.", "Ask for two places or more.")
        moved, words = self._moved()
        added = [parsed_place(text) for text in self._request.add]
        words += [f"one more at {_metres(place)}" for place in added]
        if words:
            rig = [moved.get(one.name, TwinCamera(one, one.name)) for one in self.cameras]
            rigs[enumerated(words)] = ("changed", [*rig, *self._new(added)])
        return rigs

    def _moved(self) -> tuple[dict[str, TwinCamera], list[str]]:
        own = {camera.name: camera for camera in self.cameras}
        moved: dict[str, TwinCamera] = {}
        words: list[str] = []
        for text in self._request.move:
            name, _, place = text.rpartition("=")
            if name not in own or name in moved:
                cause = "is moved twice" if name in moved else f"is none of run '{self._run.run.name}'"
                raise RunError(
                    f"Camera '{name[:40]}' {cause}.",
                    f"Write CAMERA=X,Y,Z; the cameras are {enumerated([*own])}.",
                )
            at = parsed_place(place)
            # What is painted over its pictures does not hold elsewhere, so it has another name there.
            moved[name] = camera_at(f"{name}-moved", at, self.subject, self.cameras, name)
            words.append(f"{name} to {_metres(at)}")
        return moved, words

    def _new(self, places: Sequence[Place]) -> list[TwinCamera]:
        names = names_beside(len(places), [camera.name for camera in self.cameras])
        return [
            camera_at(name, place, self.subject, self.cameras, self._request.lens)
            for name, place in zip(names, places, strict=True)
        ]

    def best_places(
        self, present: RigErrors, progress: Progress
    ) -> tuple[str, list[TwinCamera], tuple[GridPlace, ...], float]:
        """The rig with the best places of the grid, with its name, the grid, and its spacing, mm. Raises RunError."""
        request = self._request
        places, spacing = grid_of(
            self.cameras, self._path, request.heights, request.spacing, self._motion.scale
        )
        now = [*self._views.values()]
        chosen = choose(
            self._motion,
            [] if request.instead else now,
            now,
            [one.camera for one in self._new(places)],
            request.best,
            lambda errors: self._in_mm(errors, present).mean(axis=-1),
            lambda done, of: progress("places of the grid", done, of),
        )
        order = {at: number + 1 for number, at in enumerate(chosen.chosen)}
        grid = tuple(
            GridPlace(place, sees, float(added), order.get(at))
            for at, (place, sees, added) in enumerate(zip(places, chosen.seen, chosen.added, strict=True))
        )
        kept = [] if request.instead else [TwinCamera(one, one.name) for one in self.cameras]
        rig = [*kept, *self._new([places[at] for at in chosen.chosen])]
        where = "instead of" if request.instead else "beside"
        name = f"best {counted(request.best, 'place')} {where} the present cameras"
        return name, rig, grid, spacing

    def bound(self, name: str, kind: str, rig: Sequence[TwinCamera]) -> RigErrors:
        """A rig of which nothing but the bound is known."""
        views = [
            self._views.get(one.camera.name) or view_information(self._motion, one.camera) for one in rig
        ]
        own = {camera.name for camera in self.cameras}
        cameras = tuple(_described(one, is_new=one.camera.name not in own) for one in rig)
        return RigErrors(name, kind, cameras, _numbers(errors_of(self._motion, total(views, self._motion))))

    def predicted(self, rig: RigErrors, present: RigErrors) -> RigErrors:
        """A rig with what follows from the present one's twin."""
        values = self._in_mm(np.array(rig.bound_mm), present)
        return msgspec.structs.replace(rig, predicted_mm=_numbers(values), predicted=float(values.mean()))

    def _in_mm(self, bound: Array, present: RigErrors) -> Array:
        """Errors (…, M) that are expected where the bound is so far off. present : with its twin's errors."""
        measured, least = np.array(present.tracked_mm), np.maximum(present.bound_mm, 1e-9)
        stays = np.minimum(np.minimum(present.bias_mm or 0.0, measured), CLOTHES_MM * self._motion.scale)
        times = bound / least
        better = np.hypot(stays, np.sqrt(measured**2 - stays**2) * times)
        return np.where(times < 1.0, better, measured * times)


def _figure(body: BodyModel) -> BodyFigure:
    points, ends = body_points(body, body.neutral[None])[0], limb_ends(body, body.neutral)[0]
    spread = np.ptp(ends.reshape(-1, 3), axis=0)
    # A body is seen from where it is widest; persons face along x.
    plane = [1 if spread[1] >= spread[0] else 0, 2]
    seen, lines = points[:, plane], ends[..., plane]
    return BodyFigure(
        tuple((float(x), float(y)) for x, y in seen),
        tuple((float(a), float(b), float(c), float(d)) for a, b, c, d in lines.reshape(-1, 4)),
    )


def _described(one: TwinCamera, *, is_new: bool) -> RigCamera:
    camera = one.camera
    sideways = math.atan2(0.5 * camera.width, float(camera.matrix[0, 0]))
    return RigCamera(
        camera.name,
        _place(camera.centre),
        _place(camera.rotation[2]),
        math.degrees(sideways),
        one.like,
        is_new,
    )


def words_of(study: RigStudy) -> tuple[str, ...]:
    """What a study says and does not, in sentences."""
    present, points = study.present, study.points
    mean, worst = _said(present, points)
    sentences = [
        f"Present rig, {counted(len(present.cameras), 'camera')}: {mean}, {worst}. Its twin was tracked over"
        f" {counted(study.frames, 'frame')}{_of_seeds(present)}."
    ]
    without = [one for one in study.rigs if one.kind == "without"]
    if without:
        most = max(without, key=lambda one: one.expected)
        sentences.append(
            f"{most.name[0].upper()}{most.name[1:]} the error grows most, to {_said(most, points)[0]}."
        )
    sentences += [
        f"{one.name[0].upper()}{one.name[1:]}: {', '.join(_said(one, points))}."
        for one in study.rigs
        if one.kind in ("changed", "best")
    ]
    if any(one.tracked_mm is None for one in study.rigs):
        sentences.append(
            "Predicted is what follows from the present rig's twin and from what each camera sees of the limbs'"
            " outlines; drawn and tracked is what came of it. A gain is sooner predicted than had: draw and track a rig"
            " before you buy cameras for it."
        )
    return (*sentences, NOT_IN_IT)


NOT_IN_IT = (
    "Not in it: things that stand in the way of a camera, light and backgrounds at other places, and how well a new"
    " camera is calibrated."
)


def _said(rig: RigErrors, points: Sequence[str]) -> tuple[str, str]:
    """Its mean error and its worst point, in words."""
    worst = int(np.argmax(rig.expected_mm))
    how = "predicted" if rig.tracked_mm is None else "drawn and tracked"
    return (
        f"{rig.expected:.0f} mm ({how})",
        f"worst {points[worst]} with {rig.expected_mm[worst]:.0f} mm",
    )


def _of_seeds(rig: RigErrors) -> str:
    if len(rig.by_seed) < 2:
        return ""
    return f", {len(rig.by_seed)} times: {min(rig.by_seed):.0f} to {max(rig.by_seed):.0f} mm"


def _not_said(run: InspectedRun, why: str) -> RunError:
    return RunError(
        f"Where cameras should stand cannot be said from run '{run.run.name}': {why}.",
        "Ask of a run that was tracked from footage with two cameras or more, and whose body was found in every frame.",
    )


def _under(progress: Progress, name: str, step: str, done: int, total: int) -> None:
    progress(f"{name}: {step}", done, total)


def _numbers(values: Array) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _place(values: Array) -> Place:
    x, y, z = (float(value) for value in values)
    return (x, y, z)


def _metres(place: Place) -> str:
    return f"({', '.join(f'{value / 1000.0:.2f}' for value in place)}) m"


TABLES = (
    table(
        "rigs",
        "Rigs",
        ("rig", "Rig"),
        ("cameras", "Cameras"),
        ("predicted", "Predicted", "mm"),
        ("tracked", "Drawn and tracked", "mm"),
        ("twins", "Times"),
        ("worst", "Worst joint"),
        ("worst_mm", "Its error", "mm"),
    ),
    table(
        "joints",
        "By joint",
        ("rig", "Rig"),
        ("point", "Joint"),
        "limb",
        ("predicted", "Predicted", "mm"),
        ("tracked", "Drawn and tracked", "mm"),
        ("bias", "Bias in it", "mm"),
    ),
    table(
        "places",
        "Places of the grid",
        ("x", "x", "mm"),
        ("y", "y", "mm"),
        ("z", "z", "mm"),
        ("sees", "Share of the body in the picture"),
        ("predicted", "With a camera there, predicted", "mm"),
        ("order", "Chosen as"),
    ),
    table(
        "cameras",
        "Where the cameras stand",
        ("rig", "Rig"),
        "camera",
        ("x", "x", "mm"),
        ("y", "y", "mm"),
        ("z", "z", "mm"),
        ("like", "Like camera"),
    ),
)


def _tables_of(study: RigStudy) -> tuple[Table, ...]:
    rows: dict[str, list[Row]] = {
        "rigs": [_row(one, study.points) for one in study.rigs],
        "joints": [
            (one.name, point, limb, predicted, tracked, bias)
            for one in study.rigs
            for point, limb, predicted, tracked, bias in zip(
                study.points,
                study.limbs,
                one.predicted_mm,
                one.tracked_mm or (None,) * len(study.points),
                one.bias_mm or (None,) * len(study.points),
                strict=True,
            )
        ],
        "places": [(*one.place, one.sees, one.predicted, one.order) for one in study.places],
        "cameras": [
            (rig.name, one.name, *one.place, one.like)
            for rig in study.rigs
            if rig.kind in ("changed", "best")
            for one in rig.cameras
        ],
    }
    return tuple(Table(kind.name, kind.title, kind.columns, rows[kind.name]) for kind in TABLES)


def _row(rig: RigErrors, points: Sequence[str]) -> Row:
    worst = int(np.argmax(rig.expected_mm))
    return (
        rig.name,
        len(rig.cameras),
        rig.predicted,
        rig.tracked,
        len(rig.by_seed),
        points[worst],
        rig.expected_mm[worst],
    )
