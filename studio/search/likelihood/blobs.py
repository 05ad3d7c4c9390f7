"""The likelihood of coloured Gaussian blobs (Caillette, Galata & Howard 2007, sections 6.2 to 6.4).

The masks become a visual hull, the hull a mixture of blobs fitted by K-means from where the body is expected, and a
pose weighs 1 / D, D the relative entropy between the mixture that its own blobs make and the fitted one:

    log w = -s ln max(D, FLOOR),    s = 1 in the paper.

A pose costs its forward kinematics and a few products a blob, no picture is read.

**Expectations and memory.** The fit depends on where it starts, so a search gives the frame its expected poses before
it weighs (`search.likelihood.problem.FittedToPoses`). The learnt blobs pass from frame to frame as memory, with the
particles, through the results store; a frame's problem is a function of evidence, expectations and memory. A run
begins with the blobs of the body's cones and no colours. After each of the first `blob_learning` frames the found
pose assigns voxels to limbs, and the blobs are relearnt from all such frames (the paper's 20 frames); frames without
a person, or lost, are left out. Without expected poses (a warm-up, a sweep along one parameter) the body is expected
at the mean of the poses weighed.

**Loss.** `quality` is the likelihood of the voxels under the fit (nats a voxel) less the learnt blobs' expected
likelihood of a body like themselves.

Root and trunk first (swarms): only the trunk's blobs count, if the body has a trunk.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import checked_poses
from studio.body.model import BodyModel
from studio.evidence.frame_evidence import FrameEvidence
from studio.evidence.volume.alignment import root_parameters
from studio.evidence.volume.blob_acquisition import Profiles, blobs_of
from studio.evidence.volume.blob_fitting import Fitted, fit_blobs
from studio.evidence.volume.blob_model import BlobMixture, BlobModel, cone_blobs
from studio.evidence.volume.body_space import space_of
from studio.evidence.volume.hull import Hull
from studio.evidence.volume.reconstruction import Reconstructor
from studio.evidence.volume.relative_entropy import DivergenceOfPoses
from studio.foundations.arrays import Array
from studio.foundations.errors import BodyError
from studio.foundations.geometry.camera import Camera
from studio.search.likelihood.blob_settings import BlobSettings
from studio.search.likelihood.evidence_check import check_views
from studio.search.likelihood.hard_priors import HardPriors
from studio.search.likelihood.problem import TRUNK_FIRST, WHOLE_BODY, BaseFrameLikelihood

FLOOR = 1e-6
"""Nats: divergences below this count as equal."""
NOTHING_SEEN = 1e4
"""Nats: the divergence of every pose from an empty hull."""
TRUNK = "trunk"


class BlobLikelihood:
    """Makes the likelihood of any frame; learnt blobs are in the frames' memory, not here."""

    def __init__(self, body: BodyModel, cameras: tuple[Camera, ...], settings: BlobSettings) -> None:
        self.body, self.cameras, self.settings = body, cameras, settings
        self.reconstructor = Reconstructor(cameras, space_of(body, cameras), settings)
        self.priors = HardPriors(body)
        self.cones = cone_blobs(body)
        self.moves = len(root_parameters(body)) > 0
        self._last: tuple[Array, BlobModel] | None = None

    def problem(self, evidence: FrameEvidence) -> "BlobFrameLikelihood":
        """One frame as a function of poses. Raises FootageError where views do not fit the cameras."""
        check_views(self.cameras, evidence, edges=False)
        return BlobFrameLikelihood(self, self.reconstructor.hull(evidence))

    def model(self, memory: Mapping[str, Array]) -> BlobModel:
        """The blobs in a frame's memory, else the cones'; the last result is cached."""
        if "blobs" in memory:
            return _model_of(memory["blobs"])
        profiles = self.profiles(memory)
        if not profiles.frames:
            return self.cones
        kept = self._last
        if kept is None or not np.array_equal(kept[0], profiles.sums):
            made = blobs_of(self.body, profiles, self.settings.blob_split, self.settings.blob_parts)
            kept = self._last = (profiles.sums, made)
        return kept[1]

    def profiles(self, memory: Mapping[str, Array]) -> Profiles:
        """The limbs' profiles from the frames so far."""
        if "blob_profiles" not in memory:
            return Profiles.none(self.body)
        return Profiles(memory["blob_profiles"], int(memory["blob_frames"][0]))


class BlobFrameLikelihood(BaseFrameLikelihood):
    """One frame as a function of poses, before expected poses are given."""

    def __init__(self, likelihood: BlobLikelihood, hull: Hull) -> None:
        self.likelihood, self.hull, self.priors = likelihood, hull, likelihood.priors

    def expecting(self, poses: Array, memory: Mapping[str, Array]) -> "ExpectedBlobs":
        """The frame with blobs fitted from expected poses (S, D), of which the first `blob_starts` are used. Raises
        BodyError for poses that are no finite (S, D).
        """
        return ExpectedBlobs(self.likelihood, self.hull, _finite(self.likelihood.body, poses), memory)

    def remembered(self, pose: Array) -> Mapping[str, Array]:
        """Memory that a run's first frame passes to the second."""
        return self.expecting(pose[None], {}).remembered(pose)

    def log_likelihood(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        """(N, D) poses to (N,) log-weights, the body being expected at the mean of these poses. Raises BodyError for
        poses that are no finite (N, D).
        """
        checked = _finite(self.likelihood.body, poses)
        if not len(checked):
            return np.zeros(0)
        return self.expecting(checked.mean(axis=0)[None], {}).log_likelihood(checked, stage)


class ExpectedBlobs(BlobFrameLikelihood):
    """One frame as a function of poses, with the blobs fitted.

    model : the blobs known so far. fitted : to the hull, None where nothing is seen. starts : (S, D) fitted from.
    """

    def __init__(
        self, likelihood: BlobLikelihood, hull: Hull, expected: Array, memory: Mapping[str, Array]
    ) -> None:
        super().__init__(likelihood, hull)
        settings = likelihood.settings
        self.memory = memory
        self.model = likelihood.model(memory)
        self.starts = expected[: settings.blob_starts]
        self.fitted: Fitted | None = None
        if len(hull.centres):
            self.fitted = fit_blobs(
                hull,
                self.model,
                likelihood.body,
                self.starts,
                settings.blob_iterations,
                moved=likelihood.moves,
            )
        self._divergences: dict[int, DivergenceOfPoses] = {}

    def divergences(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        """(N, D) poses to (N,) D(F||G), nats; NOTHING_SEEN for an empty hull. Raises BodyError for poses that are no
        finite (N, D).
        """
        checked = _finite(self.likelihood.body, poses)
        if self.fitted is None:
            return np.full(len(checked), NOTHING_SEEN)
        if stage not in self._divergences:
            self._divergences[stage] = DivergenceOfPoses.against(
                self.likelihood.body, self.model, self.fitted.mixture, self._counted(stage)
            )
        return self._divergences[stage](checked)

    def log_likelihood(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        """(N, D) poses to (N,) log-weights, -s ln D. Raises BodyError for poses that are no finite (N, D)."""
        sharpness = self.likelihood.settings.blob_sharpness
        return -sharpness * np.log(np.maximum(self.divergences(poses, stage), FLOOR))

    def remembered(self, pose: Array) -> Mapping[str, Array]:
        """The memory with this frame's hull added, if it is usable for learning; the finished blobs once there are
        enough frames.
        """
        likelihood = self.likelihood
        wanted = likelihood.settings.blob_learning
        if "blobs" in self.memory or wanted == 0 or self.lost_evidence:
            return self.memory
        profiles = likelihood.profiles(self.memory).with_frame(likelihood.body, self.model, self.hull, pose)
        memory = {"blob_profiles": profiles.sums, "blob_frames": np.array([float(profiles.frames)])}
        return memory if profiles.frames < wanted else {"blobs": _table_of(likelihood.model(memory))}

    @property
    def quality(self) -> float:
        """Fit's likelihood less the learnt blobs' expected one, nats a voxel; -inf where nothing is seen."""
        return -np.inf if self.fitted is None else self.fitted.margin

    @property
    def lost_evidence(self) -> bool:
        """Whether the likelihood is poor (section 6.3). Before blobs are learnt a poor one may be due to the cones as
        well as the pose; then only an empty hull is lost.
        """
        if self.fitted is None or not self.memory:
            return self.fitted is None
        return self.quality < -self.likelihood.settings.blob_lost

    def _counted(self, stage: int) -> NDArray[np.int64] | None:
        """The blobs that a stage uses; None for all."""
        if stage != TRUNK_FIRST:
            return None
        drawn = self.likelihood.body.drawn
        trunk = [index for index, limb in enumerate(self.model.limb) if drawn[int(limb)].part == TRUNK]
        return np.array(trunk, dtype=np.int64) if trunk else None


def blob_mixture(problem: object) -> BlobMixture | None:
    """The blobs fitted to a frame, for pictures of them; None for another likelihood's frame and for an empty hull."""
    return problem.fitted.mixture if isinstance(problem, ExpectedBlobs) and problem.fitted else None


def _finite(body: BodyModel, poses: Array) -> Array:
    """Poses as contiguous (N, D); raises BodyError unless they are finite and the body's."""
    checked = checked_poses(body, poses)
    if not np.isfinite(checked).all():
        row = int(np.argmin(np.isfinite(checked).all(axis=1)))
        raise BodyError(
            f"Pose {row} has entries that are not finite.", "Check the start pose and the calibration."
        )
    return checked


def _table_of(model: BlobModel) -> Array:
    """A model as one array (B, 12)."""
    return np.column_stack(
        [
            model.limb.astype(np.float64),
            model.offset,
            model.eigenvalues,
            model.colour,
            model.colour_variance,
            model.weight,
        ]
    )


def _model_of(table: Array) -> BlobModel:
    """The inverse of `_table_of`."""
    return BlobModel(
        table[:, 0].astype(np.int64), table[:, 1], table[:, 2:5], table[:, 5:8], table[:, 8:11], table[:, 11]
    )
