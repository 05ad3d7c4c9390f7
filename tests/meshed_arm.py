"""An arm whose links have meshes, three cameras, and a pose that these see well."""

from dataclasses import replace

import numpy as np
from toy_footage import rig

from studio.body.definition import BodyDefinition, JointEntry, LimbEntry, MeshEntry, ParameterEntry, StepEntry
from studio.body.meshes import cone_mesh, mesh_entry
from studio.body.model import BodyModel
from studio.body.reader import assemble, check_definition

CAMERAS = tuple(
    replace(
        camera, matrix=camera.matrix * [[4.0], [4.0], [1.0]], width=4 * camera.width, height=4 * camera.height
    )
    for camera in rig(3)
)
TRUE = np.radians([25.0, -50.0, 40.0])


def arm(axes: str = "yxy") -> BodyModel:
    """Three links with a crossbar each, which no cone around them shows."""
    parameters, joints = list[ParameterEntry](), list[JointEntry]()
    limbs, meshes = list[LimbEntry](), list[MeshEntry]()
    parent, steps = "world", (StepEntry(300.0, move="z"),)
    for number, axis in enumerate(axes, 1):
        name, turn = f"link_{number}", f"A{number}"
        parameters.append(ParameterEntry(turn, "angle", 100.0, "arm", lower=-150.0, upper=150.0))
        joints.append(JointEntry(name, parent, "hinge", (*steps, StepEntry(turn, turn=axis))))
        limbs.append(LimbEntry(name, name, 400.0, 150.0, 150.0))
        meshes.append(mesh_entry(name, *cone_mesh(400.0, (50.0, 40.0), (1.0, 1.0))))
        bar, faces = cone_mesh(300.0, (30.0, 30.0), (1.0, 1.0))
        meshes.append(mesh_entry(name, bar[:, [2, 0, 1]] + [0.0, 0.0, 250.0], faces))
        parent, steps = name, (StepEntry(400.0, move="z"),)
    definition = BodyDefinition("arm", tuple(parameters), tuple(joints), tuple(limbs), meshes=tuple(meshes))
    check_definition(definition, "arm")
    return assemble(definition, "arm", {})
