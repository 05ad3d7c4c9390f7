"""A rendered template against a silhouette: the likelihood of Deutscher & Reid 2005, section 6.1 (Figs. 11 to
18).

The limbs are drawn as filled quadrilaterals, their projected outlines; a pixel belongs to the template where
its centre lies in any of them. The weight compares template and silhouette over **all** pixels, so that
pixels drawn but not seen count as much as pixels seen but not drawn ("both directions"; Eq. 15 alone compares only
inside the model):

    log w = - Σ over cameras of the mean squared difference of template and silhouette, both 0 or 1.

One camera facing the plane of the arm is the paper's case. A limb that reaches behind the camera is not
drawn: what the silhouette shows of it is then missed, so nothing is gained. log w lies between -cameras and
0.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array
from studio.search.likelihood.evidence_check import check_views
from studio.search.likelihood.problem import BaseFrameLikelihood, Preparation, Shares
from studio.search.likelihood.silhouette_areas import Silhouettes


@dataclass(frozen=True, slots=True)
class TemplateSettings:
    """No knobs: all pixels count equally."""

    title: ClassVar[str] = "Template"


class TemplateLikelihood(Preparation):
    """Makes the likelihood of any frame."""

    def problem(self, evidence: FrameEvidence) -> "TemplateFrameLikelihood":
        """One frame as a function of poses. Raises FootageError where masks do not fit the cameras."""
        check_views(self.cameras, evidence, edges=False)
        return TemplateFrameLikelihood(self, Silhouettes(evidence))


class TemplateFrameLikelihood(BaseFrameLikelihood):
    """One frame as a function of poses."""

    def __init__(self, likelihood: TemplateLikelihood, silhouettes: Silhouettes) -> None:
        self.likelihood, self.priors, self.silhouettes = likelihood, likelihood.priors, silhouettes

    def log_likelihood(self, poses: Array, stage: int = 0) -> Array:
        """(N, D) poses to (N,) log-weights. Raises BodyError for poses that are no finite (N, D)."""
        return -self.differences(np.asarray(poses, dtype=np.float64)).sum(axis=1)

    def shares(self, poses: Array) -> Shares:
        """Minus the mean squared difference in every camera."""
        names = tuple(camera.name for camera in self.likelihood.cameras)
        return Shares(names, ("silhouette",), -self.differences(poses)[:, :, None])

    def differences(self, poses: Array) -> Array:
        """(N, V) mean squared difference over all pixels of poses (N, D)."""
        outlines = self.likelihood.projector.blocks(poses)
        areas = self.silhouettes.areas(outlines, len(poses))
        differing = areas.projected + areas.observed - 2 * areas.both
        return differing / self.silhouettes.sizes.prod(axis=1)
