"""All kinds of work that go on in the background of the server."""

from studio.jobs.job_runner import JobKind, SessionJob
from studio.server.alignment_schemas import AlignmentJob
from studio.server.background_schemas import BackgroundJob
from studio.server.behaviour_learning_schemas import LearningProgress
from studio.server.calibration_schemas import SolveState
from studio.server.comparison_schemas import ComparisonState
from studio.server.course_schemas import CourseState
from studio.server.export_schemas import ExportState
from studio.server.footage_schemas import SynchronyState
from studio.server.import_schemas import ImportState
from studio.server.initialisation_schemas import InitialisationState
from studio.server.subject_schemas import FitSubjectState
from studio.server.track_schemas import TrackJobState
from studio.server.view_schemas import SeedsState


class GalleryState(SessionJob):
    """How the making of a card's session stands."""


GALLERY = JobKind("gallery", "session", GalleryState, changes_session=True)
IMPORT = JobKind("import", "import", ImportState, changes_session=True)
SYNCHRONY = JobKind("synchrony", "estimate", SynchronyState)
CALIBRATION = JobKind("calibration", "calibration", SolveState)
BACKGROUND = JobKind("background", "set-up", BackgroundJob, changes_session=True)
ALIGNMENT = JobKind("alignment", "comparison of the cameras", AlignmentJob)
SUBJECT = JobKind("subject", "fit", FitSubjectState, changes_session=True)
START_POSE = JobKind("initialise", "search", InitialisationState, changes_session=True)
TRACK = JobKind("track", "job", TrackJobState)
SEEDS = JobKind("seeds", "search with other seeds", SeedsState)
EXPORT = JobKind("export", "export", ExportState)
COMPARISON = JobKind(
    "comparison",
    "comparison",
    ComparisonState,
    busy="Comparison '{name}' of '{session}' is running; one runs at a time.",
)
COURSE = JobKind(
    "course", "course", CourseState, changes_session=True, busy="The course's runs are being made."
)
LEARNING = JobKind(
    "learning",
    "learning",
    LearningProgress,
    busy="Model '{name}' is being learnt; one is learnt at a time.",
)
