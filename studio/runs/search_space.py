"""The search space of a body: names, limits, σ0, the parameters of each limb, and the tree."""

import numpy as np

from studio.body.model import BodyModel
from studio.body.scale import scale_of
from studio.foundations.arrays import Array
from studio.runs.hierarchy import hierarchy_of
from studio.search.behaviour.model import BehaviourModel
from studio.search.trackers.tracker import SearchSpace
from studio.sessions.session import Session

SHARE_OF_MAX_STEP = 0.5
"""σ0 as a share of the largest movement expected from one frame to the next (Deutscher & Reid 2005, 3.1)."""


def default_sigma(body: BodyModel, fps: float) -> Array:
    """(D,) σ0 from frame to frame: half of `max_step` (per second) times the time between two frames.

    The paper gives the value as the diagonal of a covariance; it is read as a standard deviation.
    """
    return np.array([SHARE_OF_MAX_STEP * entry.max_step / fps for entry in body.parameters])


def session_sigma(session: Session, body: BodyModel, fps: float) -> Array:
    """(D,) σ0 from frame to frame at `fps`: the session's own, else the body's default."""
    own = session.sigma(fps, body)
    return default_sigma(body, fps) if own is None else own


def search_space(body: BodyModel, sigma: Array, behaviour: BehaviourModel | None = None) -> SearchSpace:
    """The search space of a body's pose vectors. sigma : (D,) σ0, mm and rad. behaviour : at the rate of σ0."""
    limbs = [entry.limb for entry in body.parameters]
    number = {limb: index for index, limb in enumerate(dict.fromkeys(limbs))}
    return SearchSpace(
        names=parameter_names(body),
        lower=body.lower,
        upper=body.upper,
        sigma=sigma,
        limb=np.array([number[limb] for limb in limbs], dtype=np.int64),
        hierarchy=hierarchy_of(body),
        behaviour=behaviour,
        scale=scale_of(body),
    )


def parameter_names(body: BodyModel) -> tuple[str, ...]:
    """Names of the pose vector's entries, in order."""
    return tuple(entry.name for entry in body.parameters)
