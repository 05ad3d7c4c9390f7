"""The guide's course: short runs of the bundled walk, which its pages lead to."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from studio.foundations.declaring import operation
from studio.foundations.errors import RunError, StudioError
from studio.foundations.progress import Progress
from studio.operations.behaviours import learn
from studio.operations.jobs.job_runner import JobKind, SessionJob
from studio.operations.jobs.swept_runs import measure_run
from studio.operations.jobs.trials import TrialResult, run_jobs
from studio.operations.progress import Reporting, reporting
from studio.results.comparison.tracked import TrackingTrial
from studio.results.comparison.trials import TrialJob
from studio.runs.behaviour_models import SUFFIX, models_folder
from studio.search.settings import DEFAULT_WEIGHTING
from studio.search.trackers.recovery_settings import OFF
from studio.sessions.samples import install_prepared_runs, install_sample
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace

BEGINNING, BEGINNING_RUN = "planar_arm", "arm"
"""The session and run that the course begins with; they travel with the studio."""
SAMPLE, MODEL, FRAMES = "walk", "course-walk", 40
"""The session, the behaviour model and the number of frames of its runs."""
Checkpoint = Callable[[], None]
SEARCH_ALONE: Mapping[str, object] = {"refine_frames": False, "recovery": OFF}


@dataclass(frozen=True, slots=True)
class CourseRun:
    """A run of the course. knobs : beside those of SEARCH_ALONE, so that what is seen is the search's own."""

    name: str
    words: str
    tracker: str = "annealed"
    knobs: Mapping[str, object] = field(default_factory=dict[str, object])
    behaviour: str = ""


RUNS = (
    CourseRun("course-one-layer", "one layer of 1000 particles", knobs={"layers": 1, "particles": 1000}),
    CourseRun("course-annealed", "ten layers of 100 particles", knobs={"layers": 10, "particles": 100}),
    CourseRun("course-swarm", "a swarm that searches the root first", tracker="swarm"),
    CourseRun(
        "course-behaviour", "particles that know how people walk", tracker="behaviour", behaviour=MODEL
    ),
)


class CourseState(SessionJob):
    """How the making of the course's runs stands."""


COURSE = JobKind(
    "course",
    "making of the course's runs",
    CourseState,
    changes_session=True,
    makes_session=True,
    busy="The course's runs are being made.",
    page="/guide/course",
)


@dataclass(frozen=True, slots=True)
class CourseRunLine:
    """A run of the course. there : whether it is tracked to its end."""

    name: str
    words: str
    there: bool


@dataclass(frozen=True, slots=True)
class CourseView:
    """The course's runs. job : how their making stands, null if it was not begun."""

    session: str
    runs: list[CourseRunLine]
    job: CourseState | None


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """The runs of the guide's course, all tracked.

    session : the bundled walk.
    runs : one for each kind of search.
    """

    session: Session
    runs: tuple[StoredRun, ...]


@operation
def course(*, progress: Reporting = None) -> Course:
    """Make the runs that the guide's course speaks of: the bundled walk, tracked by each kind of search.

    Runs that exist are kept; an interrupted one is continued.

    Raises SessionError where the workspace cannot be written, RunError where a run fails.
    """
    with reporting(progress, "course") as report:
        return make_course(Workspace(), report)


def make_course(
    workspace: Workspace,
    report: Progress,
    *,
    processes: int | None = None,
    checkpoint: Checkpoint = lambda: None,
) -> Course:
    """The course's runs in a workspace. processes, checkpoint : see `trials.run_jobs`. Raises StudioError."""
    for sample in (BEGINNING, SAMPLE):
        install_prepared_runs(session := install_sample(workspace, sample), sample)
    missing = [one for one in RUNS if not finished(session, one)]
    model = models_folder(workspace.root) / f"{MODEL}{SUFFIX}"
    if any(one.behaviour for one in missing) and not model.exists():
        model.parent.mkdir(exist_ok=True)
        # The motion of the sample's own recipe: as good as a prediction can be.
        learn([SAMPLE], str(model), body=session.manifest.body, progress=report)
    done = 0

    def on_result(job: TrialJob, result: TrialResult) -> None:
        nonlocal done
        if result.measured is None:
            raise RunError(f"{job.label} could not be tracked: {result.failure}", "Try again.")
        done += 1
        report(job.label, done, len(missing))

    report("tracking", 0, len(missing))
    jobs = [_job(session, one, model) for one in missing]
    run_jobs(jobs, session.path.parent, on_result, processes, checkpoint=checkpoint)
    return Course(session, tuple(session.run(one.name) for one in RUNS))


def course_view(workspace: Workspace, job: CourseState | None) -> CourseView:
    """The course's runs, and whether they are there. job : how their making stands."""
    try:
        session = workspace.session(SAMPLE)
    except StudioError:
        session = None
    lines = [
        CourseRunLine(one.name, one.words, session is not None and finished(session, one)) for one in RUNS
    ]
    beginning = CourseRunLine(BEGINNING_RUN, "an arm of four links", begins(workspace))
    return CourseView(SAMPLE, [beginning, *lines], job)


def finished(session: Session, run: CourseRun) -> bool:
    known = {one.name: one for one in session.runs()}
    return run.name in known and known[run.name].summary(blobs=False).status == "finished"


def begins(workspace: Workspace) -> bool:
    """Whether the course's first run exists."""
    try:
        return bool(workspace.session(BEGINNING).run(BEGINNING_RUN).folder)
    except StudioError:
        return False


def _job(session: Session, run: CourseRun, model: Path) -> TrialJob:
    trial = TrackingTrial(
        str(session.path.absolute()),
        run.tracker,
        session.manifest.weighting or DEFAULT_WEIGHTING,
        seed=0,
        changes={**SEARCH_ALONE, **run.knobs},
        last=FRAMES,
        behaviour=str(model) if run.behaviour else "",
    )
    return TrialJob(
        key=run.name,
        experiment="course",
        label=run.words,
        arguments={**trial.plain(), "fit_shape": True, "run": run.name},
        measure=measure_run,
        footage=(trial.footage,),
        frames=None,
        alone=False,
    )
