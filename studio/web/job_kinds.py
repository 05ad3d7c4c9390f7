"""All kinds of work that go on in the background of the server."""

from studio.web.alignment_schemas import AlignmentJob
from studio.web.background_schemas import BackgroundJob
from studio.web.behaviour_learning_schemas import LearningProgress
from studio.web.calibration_schemas import SolveState
from studio.web.comparison_schemas import ComparisonState
from studio.web.export_schemas import ExportState
from studio.web.footage_schemas import SynchronyState
from studio.web.import_schemas import ImportState
from studio.web.initialisation_schemas import InitialisationState
from studio.web.subject_schemas import FitSubjectState
from studio.web.track_schemas import TrackJobState
from studio.worker.jobs import JobKind

IMPORT = JobKind("import", "import", ImportState, changes_session=True)
SYNCHRONY = JobKind("synchrony", "estimate", SynchronyState)
CALIBRATION = JobKind("calibration", "calibration", SolveState)
BACKGROUND = JobKind("background", "set-up", BackgroundJob, changes_session=True)
ALIGNMENT = JobKind("alignment", "comparison of the cameras", AlignmentJob)
SUBJECT = JobKind("subject", "fit", FitSubjectState, changes_session=True)
START_POSE = JobKind("initialise", "search", InitialisationState, changes_session=True)
TRACK = JobKind("track", "job", TrackJobState)
EXPORT = JobKind("export", "export", ExportState)
COMPARISON = JobKind(
    "comparison",
    "comparison",
    ComparisonState,
    busy="Comparison '{name}' of '{session}' is running; one runs at a time.",
)
LEARNING = JobKind(
    "learning",
    "learning",
    LearningProgress,
    busy="Model '{name}' is being learnt; one is learnt at a time.",
)
