"""The verbs that are fired: of Python in another process, and requests to a server; and what each leaves once done."""

import dataclasses
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from faults.stage import DONE, NEW, QUICK, Place, build_session
from toy_session import facing_camera, side_camera, true_poses

import studio
from studio.body.forward_kinematics import limb_ends
from studio.footage.calibration.silhouette_alignment import AlignedCameras
from studio.footage.capture.calibration_files import read_calibration
from studio.foundations.errors import StudioError
from studio.foundations.geometry.projection import project
from studio.foundations.geometry.rotations import rotation_from_vector
from studio.runs.notes import notes_of
from studio.runs.setup.aligning import SessionAlignment
from studio.runs.setup.turned_cameras import turn_cameras
from studio.runs.tracks import track_names
from studio.sessions.calibration_changes import EARLIER, NewCalibration, replace_calibration
from studio.sessions.session import CAMERAS_PATH, Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace

FRAMES = 7
"""So many show enough to align two cameras by."""
POSE = [float(value) for value in true_poses()[0] + 0.02]
CLIP = "front.mp4"
ONE_TRIAL = {"seeds": 1, "last": 1}
"""Of a comparison, that it takes no longer than the start of its process."""


@dataclass(frozen=True, slots=True)
class Given:
    """What a verb is about. root : the workspace. name : of the session. source : of footage. out : folder for files.
    number : of the group, later of the verb in it too, by which what it makes is named. trashed : the entry of a run of
    the session in the trash.
    """

    root: Path
    name: str
    source: Path
    out: Path
    number: int
    place: int = 0
    trashed: str = ""

    @property
    def session(self) -> Path:
        """The session's folder."""
        return self.root / self.name

    @property
    def clip(self) -> Path:
        """A video of the camera `front`, outside the workspace."""
        return self.out.parent / CLIP

    @property
    def run(self) -> str:
        """The run that is tracked to its end, as a person names it."""
        return f"{self.name}/{DONE}"

    def called(self, what: str) -> str:
        """A name that only this verb gives."""
        return f"{what}-{self.number}-{self.place}"

    def with_trashed(self, entry: str) -> "Given":
        """With the entry of the trash."""
        return dataclasses.replace(self, trashed=entry)

    def at(self, place: int) -> "Given":
        """Of one verb of the group."""
        return dataclasses.replace(self, place=place)


@dataclass(frozen=True, slots=True)
class There:
    """What there is after a group, in the workspace and in its trash."""

    sessions: tuple[Session, ...]
    runs: tuple[StoredRun, ...]

    def any_run(self, name: str) -> bool:
        """Whether there is a run of that name."""
        return any(run.record.name == name for run in self.runs)

    def any_track(self, name: str) -> bool:
        """Whether there is a run with a track of that name."""
        return any(name in track_names(run) for run in self.runs)

    def any_session(self, fits: Callable[[Session], object]) -> bool:
        """Whether there is a session of that kind."""
        return any(fits(session) for session in self.sessions)


def build(at: Place, *tracked: str) -> Session:
    """The session that verbs are fired at: two cameras, one of them turned a little. tracked : its finished runs."""
    session = build_session(at, tracked, NEW, FRAMES, (facing_camera(), side_camera()))
    turn_the_cameras(session, 0.5)
    return session


def turn_the_cameras(session: Session, degrees: float) -> None:
    """What aligning ends with where it turns a camera."""
    cameras = session.cameras()
    turn = rotation_from_vector(np.array([0.0, 0.0, np.radians(degrees)]))
    side = dataclasses.replace(
        cameras[1], rotation=turn @ cameras[1].rotation, translation=turn @ cameras[1].translation
    )
    turns = np.array([0.0, degrees])
    turn_cameras(
        session,
        SessionAlignment(
            tuple(camera.name for camera in cameras),
            AlignedCameras((cameras[0], side), turns, np.full(2, 9.0), np.ones(2), (0,)),
        ),
    )


# Python's verbs are imported on first use: here for all processes, before they are forked.
for _verb in dir(studio):
    getattr(studio, _verb)

Request = tuple[str, str, object]
"""Method, path after the session's address, and body."""


def _workspace(given: Given) -> Workspace:
    return Workspace(given.root)


def _calibrate(given: Given) -> None:
    """What aligning, levelling and solving end with."""
    session = studio.open_session(given.name)
    cameras = read_calibration(session.path / CAMERAS_PATH).cameras
    replace_calibration(session, NewCalibration(tuple(cameras), given.called("calibration")))


def _level(given: Given) -> object:
    """By three points of a floor a metre and a half down."""
    cameras = studio.open_session(given.name).cameras()
    floor = np.array([[-400.0, 0.0, -900.0], [400.0, 0.0, -900.0], [0.0, 500.0, -900.0]])
    seen = {camera.name: project(camera, floor)[0] for camera in cameras}
    points = [{"pixels": {name: seen[name][at].tolist() for name in seen}} for at in range(len(floor))]
    file = given.out / f"{given.called('clicks')}.json"
    file.write_text(json.dumps({"points": points}))
    return studio.level(given.name, clicks=file)


def _strokes(given: Given) -> list[dict[str, object]]:
    """Along the arm, and off it, in the first frame of each camera."""
    session = studio.open_session(given.name)
    near, far = limb_ends(session.body(), true_poses(1))[0].transpose(1, 0, 2)
    away = np.array([0.0, 0.0, 300.0])
    return [
        {"camera": camera.name, "frame": 0, "kind": kind, "width": 3.0, "points": line.tolist()}
        for camera in session.cameras()
        for kind, line in (
            ("inside", project(camera, (near + far) / 2)[0]),
            ("outside", project(camera, (near + far) / 2 + away)[0]),
        )
    ]


def _paint(given: Given) -> object:
    file = given.out / f"{given.called('strokes')}.json"
    file.write_text(json.dumps({"strokes": _strokes(given)}))
    return studio.background(given.name, "strokes", strokes=file, tune=False)


def _live(given: Given) -> None:
    """Seven pictures as they come, and the same again without the clock."""
    name = given.called("live")
    studio.live(given.name, tracker="annealed", weighting="edge-region", knobs=QUICK, name=name)
    studio.replay(f"{given.name}/{name}", name=given.called("replayed"))


def _batch(given: Given) -> None:
    """What fails in it is said of its session."""
    name = given.called("batched")
    done = studio.batch([given.name], name=name, knobs=QUICK, fit_shape=False, processes=1)
    for line in done.lines:
        if line.failure:
            raise StudioError(f"{line.session}: {line.failure}", "")


def _edit_body(given: Given) -> object:
    sizes = {"link_1_length": 120.0 + given.place}
    return studio.edit_body(
        "planar_arm4", session=given.name, sizes=sizes, save_as=given.called("arm"), replace=True
    )


def _record(given: Given) -> object:
    """A replayed clip, with the session's calibration."""
    return studio.record({"front": str(given.clip)}, given.called("taken"), given.name, fps=30.0)


PYTHON: Mapping[str, Callable[[Given], object]] = {
    "refine": lambda at: studio.refine(at.run, into=at.called("refined")),
    "smooth": lambda at: studio.smooth(at.run, into=at.called("smoothed")),
    "check": lambda at: studio.check(at.run, "raw"),
    "export": lambda at: studio.export_run(at.run, at.out / f"{at.called('arm')}.trc"),
    "share": lambda at: studio.share(at.run, at.out / f"{at.called('page')}.html"),
    "make a run": lambda at: studio.new_run(at.name, start_pose=POSE, knobs=QUICK),
    "track": lambda at: studio.track(at.name, name=at.called("tracked"), start_pose=POSE, knobs=QUICK),
    "go on": lambda at: studio.go_on(f"{at.name}/{NEW}"),
    "branch": lambda at: studio.branch(at.run, 2, knobs={"survival": 0.4}, name=at.called("branched")),
    "correct": lambda at: studio.correct(at.run, 2, POSE, name=at.called("corrected")),
    "live": _live,
    "batch": _batch,
    "edit the body": _edit_body,
    "record": _record,
    "note": lambda at: studio.note(at.run, at.place, at.called("note")),
    "subject": lambda at: studio.subject(at.name, lengths_mm={}, body="planar_arm4"),
    "fit the subject": lambda at: studio.fit_subject(at.name, count=1, lengths=False),
    "initialise": lambda at: studio.initialise(at.name, replace=True),
    "background": lambda at: studio.background(at.name, "masks", tune=False),
    "add footage": lambda at: studio.add_footage(at.name, at.source, replace=True, fps=60.0),
    "import": lambda at: studio.import_footage(at.source, at.called("imported"), fps=60.0),
    "import again": lambda at: studio.import_footage(at.session, at.called("again")),
    "calibrate": _calibrate,
    "align": lambda at: studio.align(at.name),
    "turn the cameras": lambda at: turn_the_cameras(studio.open_session(at.name), 0.1),
    "unalign": lambda at: studio.unalign(at.name),
    "level": _level,
    "strokes": _paint,
    "mask quality": lambda at: studio.mask_quality(at.name, [0, 1]),
    "subjects": lambda at: studio.subjects(at.name),
    "evaluate": lambda at: studio.evaluate(at.run),
    "seeds": lambda at: studio.seeds(at.run, 1, count=2),
    "split the error": lambda at: studio.split_error(at.run, frame=1, evaluations=1000),
    "uncertainty": lambda at: studio.uncertainty(at.run),
    "rig": lambda at: studio.rig(at.run),
    "body from film": lambda at: studio.body_from_film(at.name, save_as=at.called("filmed")),
    "carry clicks": lambda at: studio.carry_clicks(at.name, name=at.called("carried")),
    "view": lambda at: studio.view(at.run, "variance"),
    "why": lambda at: studio.why(at.run, 1),
    "workflow": lambda at: studio.workflow(at.name),
    "inspect": lambda at: studio.inspect(at.session),
    "upload": lambda at: studio.upload(at.name, f"memory://races/{at.called('put')}"),
    "compare": lambda at: studio.compare(
        at.name, trackers=["annealed"], evaluations=40, **ONE_TRIAL, name=at.called("compared"), processes=1
    ),
    "sweep": lambda at: studio.sweep(
        at.name,
        vary={"survival": [0.4]},
        knobs=QUICK,
        fit_shape=False,
        **ONE_TRIAL,
        name=at.called("swept"),
        processes=1,
    ),
    "synchronise": lambda at: studio.synchronise(at.name, rotations={"front": 180}),
    "verify": lambda at: studio.verify(at.name, mend=True),
    "rename": lambda at: _workspace(at).rename(at.name, at.called("renamed")),
    "retitle": lambda at: _workspace(at).retitle(at.name, at.called("title")),
    "duplicate": lambda at: _workspace(at).duplicate(at.name, at.called("copy")),
    "delete": lambda at: _workspace(at).trash(at.name),
    "rename the run": lambda at: _workspace(at).rename_run(at.name, DONE, at.called("renamed")),
    "delete the run": lambda at: _workspace(at).trash_run(at.name, DONE),
    "restore": lambda at: _workspace(at).restore_run(at.trashed),
}

RUN = f"/runs/{DONE}"
SERVED: Mapping[str, Callable[[Given], Request]] = {
    "served refine": lambda at: ("POST", f"{RUN}/refine", {"into": at.called("refined")}),
    "served smooth": lambda at: ("POST", f"{RUN}/smooth", {"into": at.called("smoothed")}),
    "served check": lambda at: ("POST", f"{RUN}/check", {"track": "raw"}),
    "served export": lambda at: ("POST", f"{RUN}/exports", {"format": "trc"}),
    "served make a run": lambda at: ("POST", "/runs", {"start_pose": POSE, "settings": QUICK}),
    "served track": lambda at: ("POST", f"/runs/{NEW}/start", None),
    "served branch": lambda at: (
        "POST",
        f"{RUN}/branch",
        {"frame": 2, "settings": {"survival": 0.4}, "name": at.called("branched")},
    ),
    "served correct": lambda at: (
        "POST",
        f"{RUN}/correct",
        {"frame": 2, "pose": POSE, "back_to": 1, "name": at.called("corrected")},
    ),
    "served note": lambda at: ("PUT", f"{RUN}/frames/{at.place}/note", {"text": at.called("note")}),
    "served pose": lambda at: ("PUT", "/start-pose", {"pose": POSE, "frame": 0}),
    "served better pose": lambda at: ("POST", "/pose/refine", {"pose": POSE, "frame": 0, "keep": True}),
    "served initialise": lambda at: ("POST", "/initialise", {"frame": 0, "replace": True}),
    "served subject": lambda at: ("PUT", "/subject", {"body": "planar_arm4"}),
    "served fit the subject": lambda at: ("POST", "/fit-subject", {"count": 1, "lengths": False}),
    "served background": lambda at: ("POST", "/background", {"source": "masks", "tune": False}),
    "served knobs": lambda at: ("PUT", "/evidence", {"mask_darkest": 10 + at.place}),
    "served settings": lambda at: ("PATCH", f"/runs/{NEW}/settings", {"survival": 0.4}),
    "served add footage": lambda at: (
        "POST",
        "/footage",
        {"source": str(at.source), "replace": True, "fps": 60.0},
    ),
    "served calibrate": lambda at: ("POST", "/calibration/proposals/current/apply", {"anyway": True}),
    "served turn": lambda at: ("PATCH", "/footage", {"rotations": {"front": 180}}),
    "served rename": lambda at: ("PATCH", "", {"name": at.called("renamed")}),
    "served retitle": lambda at: ("PATCH", "", {"title": at.called("title")}),
    "served duplicate": lambda at: ("POST", "/duplicate", {"name": at.called("copy")}),
    "served delete": lambda at: ("DELETE", "", None),
    "served rename the run": lambda at: ("PATCH", RUN, {"name": at.called("renamed")}),
    "served delete the run": lambda at: ("DELETE", RUN, None),
    "served restore": lambda at: ("POST", "/api/trash/restore", {"entry": at.trashed}),
    "served import": lambda at: (
        "POST",
        "/api/imports",
        {"source": str(at.source), "name": at.called("imported"), "fps": 60.0},
    ),
    "served align": lambda at: ("POST", "/alignment", {}),
    "served keep alignment": lambda at: ("POST", "/alignment/keep", None),
    "served unalign": lambda at: ("POST", "/alignment/undo", None),
    "served level": lambda at: ("POST", "/calibration/level", {}),
    "served strokes": lambda at: (
        "PUT",
        "/strokes/front",
        {
            "strokes": [
                {
                    "frame": 0,
                    "kind": "inside",
                    "width": 3.0,
                    "points": [[80.0, 60.0], [90.0 + at.place, 60.0]],
                }
            ]
        },
    ),
    "served landmarks": lambda at: (
        "PUT",
        "/landmarks",
        {"clicks": [{"frame": 0, "camera": "front", "landmark": "Tip", "x": 40.0 + at.place, "y": 30.0}]},
    ),
    "served body from film": lambda at: ("POST", "/body-from-film", {}),
    "served carry clicks": lambda at: ("POST", "/carry-clicks", {}),
    "served mask quality": lambda at: ("POST", "/masks/quality", None),
    "served background off": lambda at: ("DELETE", "/background", None),
    "served synchrony": lambda at: ("POST", "/synchrony", {}),
    "served seeds": lambda at: ("POST", f"{RUN}/frames/1/seeds", {"count": 2}),
    "served open": lambda at: ("POST", f"{RUN}/open", None),
    "served seek": lambda at: ("POST", f"{RUN}/seek", {"frame": at.place}),
    "served reanneal": lambda at: ("POST", f"{RUN}/reanneal", {"frame": 2}),
    "served layer": lambda at: ("POST", f"/runs/{NEW}/step-layer", None),
    "served frame": lambda at: ("POST", f"/runs/{NEW}/step-frame", None),
    "served pause": lambda at: ("POST", f"/runs/{NEW}/pause", None),
    "served cancel": lambda at: ("POST", f"/runs/{NEW}/cancel", None),
    "served settings back": lambda at: ("DELETE", f"/runs/{NEW}/settings/moved", None),
    "served note off": lambda at: ("DELETE", f"{RUN}/frames/{at.place}/note", None),
    "served compare": lambda at: (
        "POST",
        "/api/comparisons",
        {
            "session": at.name,
            "trackers": [{"name": "annealed"}],
            "evaluations": 40,
            "name": at.called("compared"),
            **ONE_TRIAL,
        },
    ),
    "served sweep": lambda at: (
        "POST",
        "/api/comparisons/sweeps",
        {
            "session": at.name,
            "vary": {"survival": [0.4]},
            "settings": QUICK,
            "fit_shape": False,
            "name": at.called("swept"),
            **ONE_TRIAL,
        },
    ),
    "served look": lambda at: ("GET", RUN, None),
    "served list": lambda at: ("GET", "/api/sessions", None),
}
VERBS: tuple[str, ...] = (*PYTHON, *SERVED)
TRACKING = {
    f"served {verb}"
    for verb in (
        *("track", "branch", "correct", "settings", "settings back", "better pose", "open", "seek"),
        *(
            "reanneal",
            "layer",
            "frame",
            "pause",
            "cancel",
            "rename",
            "delete",
            "rename the run",
            "delete the run",
        ),
    )
}
"""Verbs that the server's tracking process has a part in."""
ALONE = (
    "Too few silhouettes",
    "The cameras' pictures are not level",
    "Camera front has",
    "Every landmark is clicked in one view",
)
"""Begin what a verb is refused with where nothing else goes on."""
SLOW = {"fit the subject", "initialise", "compare", "sweep", "batch", "live", "record"}
"""Verbs that take seconds."""


def plain(verb: str) -> str:
    """The verb, by whichever way."""
    return verb.removeprefix("served ")


def _finished(run: StoredRun) -> bool:
    return run.summary().done == FRAMES


LEFT: Mapping[str, Callable[[There, Given], object]] = {
    "refine": lambda there, at: there.any_track(at.called("refined")),
    "smooth": lambda there, at: there.any_track(at.called("smoothed")),
    "track": lambda there, at: any(
        run.record.name in (at.called("tracked"), NEW) and _finished(run) for run in there.runs
    ),
    "go on": lambda there, at: any(run.record.name == NEW and _finished(run) for run in there.runs),
    "branch": lambda there, at: there.any_run(at.called("branched")),
    "correct": lambda there, at: there.any_run(at.called("corrected")),
    "live": lambda there, at: there.any_run(at.called("live")) and there.any_run(at.called("replayed")),
    "batch": lambda there, at: there.any_run(at.called("batched")),
    "edit the body": lambda there, at: there.any_session(
        lambda one: (one.path / "bodies" / f"{at.called('arm')}.toml").is_file()
    ),
    "record": lambda there, at: there.any_session(lambda one: one.name == at.called("taken")),
    "note": lambda there, at: any(
        at.called("note") in [note.text for note in notes_of(run)] for run in there.runs
    ),
    "rename": lambda there, at: there.any_session(lambda one: one.manifest.name == at.called("renamed")),
    "retitle": lambda there, at: there.any_session(lambda one: one.manifest.title == at.called("title")),
    "duplicate": lambda there, at: there.any_session(lambda one: one.manifest.name == at.called("copy")),
    "rename the run": lambda there, at: there.any_run(at.called("renamed")),
    "turn": lambda there, at: there.any_session(lambda one: one.manifest.footage.cameras[0].turned == 180),
    "synchronise": lambda there, at: LEFT["turn"](there, at),
    "import": lambda there, at: there.any_session(lambda one: one.name == at.called("imported")),
    "import again": lambda there, at: there.any_session(lambda one: one.name == at.called("again")),
    "level": lambda there, at: LEFT["calibrate"](there, at),
    "calibrate": lambda there, at: there.any_session(
        lambda one: list((one.path / "calibration" / EARLIER).glob("*"))
    ),
}
"""Whether what a verb reported as done is there, by the verb."""
OVERWRITES: Mapping[str, Iterable[str]] = {
    "turn": ("add footage",),
    "synchronise": ("add footage",),
    "retitle": ("retitle",),
}
"""By the verb: others that write the same again."""
