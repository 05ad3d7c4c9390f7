"""A body as flat arrays, the form that kernels read."""

from functools import lru_cache

import numpy as np

from studio.body.model import BodyModel, KinematicTables


@lru_cache(maxsize=64)
def kinematic_tables(body: BodyModel) -> KinematicTables:
    """The body's tree and drawn limbs as arrays (see `KinematicTables`), made once a body: read only."""
    steps = [step for joint in body.joints for step in joint.steps]
    counts = [len(joint.steps) for joint in body.joints]
    shapes = [
        (limb.length, limb.radius_start, limb.radius_end, limb.scale_x, limb.scale_y) for limb in body.drawn
    ]
    return KinematicTables(
        parent=np.array([joint.parent for joint in body.joints], dtype=np.int64),
        first_step=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        step_kind=np.array([step.kind for step in steps], dtype=np.int64),
        step_axis=np.array([step.axis for step in steps], dtype=np.int64),
        step_parameter=np.array([step.parameter for step in steps], dtype=np.int64),
        step_value=np.array([step.value for step in steps], dtype=np.float64),
        limb_joint=np.array([limb.joint for limb in body.drawn], dtype=np.int64),
        limb_shape=np.array(shapes, dtype=np.float64).reshape(-1, 5),
    )
