"""The verbs that are fired: of Python in another process, and requests to a server; and what each leaves once done."""

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from faults.stage import DONE, FRAMES, NEW, QUICK
from toy_session import true_poses

import studio
from studio.capture.calibration_files import read_calibration
from studio.runs.notes import notes_of
from studio.runs.tracks import track_names
from studio.sessions.calibration_changes import EARLIER, NewCalibration, replace_calibration
from studio.sessions.session import CAMERAS_PATH, Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace

POSE = [float(value) for value in true_poses()[0] + 0.02]


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
    "note": lambda at: studio.note(at.run, at.place, at.called("note")),
    "subject": lambda at: studio.subject(at.name, lengths_mm={}, body="planar_arm4"),
    "fit the subject": lambda at: studio.fit_subject(at.name, count=1, lengths=False),
    "initialise": lambda at: studio.initialise(at.name, replace=True),
    "background": lambda at: studio.background(at.name, "masks", tune=False),
    "add footage": lambda at: studio.add_footage(at.name, at.source, replace=True, fps=60.0),
    "calibrate": _calibrate,
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
    "served make a run": lambda at: (
        "POST",
        "/runs",
        {"start_pose": POSE, "settings": QUICK},
    ),
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
    "served look": lambda at: ("GET", RUN, None),
    "served list": lambda at: ("GET", "/api/sessions", None),
}
VERBS: tuple[str, ...] = (*PYTHON, *SERVED)


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
    "note": lambda there, at: any(
        at.called("note") in [note.text for note in notes_of(run)] for run in there.runs
    ),
    "rename": lambda there, at: there.any_session(lambda one: one.manifest.name == at.called("renamed")),
    "retitle": lambda there, at: there.any_session(lambda one: one.manifest.title == at.called("title")),
    "duplicate": lambda there, at: there.any_session(lambda one: one.manifest.name == at.called("copy")),
    "rename the run": lambda there, at: there.any_run(at.called("renamed")),
    "turn": lambda there, at: there.any_session(
        lambda one: [camera.turned for camera in one.manifest.footage.cameras] == [180]
    ),
    "synchronise": lambda there, at: LEFT["turn"](there, at),
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
