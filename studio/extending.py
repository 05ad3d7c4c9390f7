"""What adding your own takes: everything that a tracker, a likelihood, an export or a calibration format is made of.

Each name is imported on first use, like the verbs of `studio`: a package may be loaded while the studio's own
catalogues are. The guide's page *Adding your own* uses most of them.
"""

from studio.foundations.first_use import on_first_use

_NAMES = {
    "studio.body.forward_kinematics": ("joint_frames", "limb_ends", "marker_points"),
    "studio.body.model": ("BodyModel",),
    "studio.evidence.frame_evidence": ("FrameEvidence", "ViewEvidence"),
    "studio.footage.capture.calibration_parts": ("FoundCameras",),
    "studio.footage.capture.calibration_writers": ("CalibrationFormat", "WrittenCalibration"),
    "studio.foundations.errors": ("CalibrationError", "ExportError", "RunError", "StudioError"),
    "studio.foundations.geometry.camera": ("Camera",),
    "studio.foundations.geometry.projection": ("project",),
    "studio.foundations.knobs": ("knob",),
    "studio.results.export.formats": ("FRAMES", "POINTS", "ExportFormat"),
    "studio.results.export.task": ("ExportTask", "Written"),
    "studio.search.likelihood.catalogue": ("LossLimit", "Weighting"),
    "studio.search.likelihood.hard_priors": ("HardPriors",),
    "studio.search.likelihood.problem": (
        "TRUNK_FIRST",
        "WHOLE_BODY",
        "BaseFrameLikelihood",
        "FrameLikelihood",
        "Shares",
    ),
    "studio.search.trackers.annealing": ("Annealed", "anneal"),
    "studio.search.trackers.layer_record": ("layer_record",),
    "studio.search.trackers.particles": (
        "estimate",
        "uniform_poses",
        "unweighted",
        "weighted_mean",
        "weighted_variance",
    ),
    "studio.search.trackers.random_numbers": ("RandomNumbers",),
    "studio.search.trackers.shared_knobs": ("SearchSettings", "start_repeats"),
    "studio.search.trackers.tracker": (
        "Estimate",
        "FilterState",
        "LayerRecord",
        "ParticleSet",
        "SearchSpace",
        "Tracker",
    ),
}
__getattr__, __dir__ = on_first_use(__name__, _NAMES)
