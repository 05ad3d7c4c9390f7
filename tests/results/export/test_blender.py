"""A real Blender opens BVH, GLB and USD with the same joints in every frame, and makes an FBX of the GLB that has them.

`blender` of the package manager, or a Python with Blender's module: STUDIO_BPY=/path/to/python (pip install bpy there).
"""

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from export_runs import FRAMES, MADE, moving_poses, track_of

from studio.body.catalogue import load_body
from studio.body.motion_files.recorded_motion import followed
from studio.results.export.exporting import export_run
from studio.results.export.formats import FORMATS
from studio.results.export.skeleton import skeleton_of

pytestmark = pytest.mark.slow

SCRIPT = Path(__file__).with_name("blender_reading.py")
LEAST_MM, LEAST_DEGREES = 0.1, 0.01
# Blender turns a file's y up into its own z up: (x, y, z) in the file becomes (x, -z, y), of the studio's (y, z, x).
BLENDER_FROM_WORLD = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@pytest.fixture(scope="module")
def blender() -> list[str]:
    """The command that runs the script, or a skip that says why."""
    module, found = os.environ.get("STUDIO_BPY"), shutil.which("blender")
    if module:
        return [module, str(SCRIPT)]
    if found is None:
        pytest.skip(
            "no Blender is installed: install the package 'blender' (and 'python3-numpy' for its GLB importer), or let"
            " STUDIO_BPY name a Python that has its module 'bpy'"
        )
    return [*(found, "--background", "--factory-startup", "--python-exit-code", "3", "--python"), str(SCRIPT)]


def opened(blender: list[str], path: Path, *through: Path) -> dict:
    """What Blender sees of a file. through : the FBX that it makes of it and opens in its place."""
    answer = path.with_suffix(".json")
    done = subprocess.run(
        [*blender, "--", str(path), str(answer), "60", *map(str, through)],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    if "No module named 'numpy'" in done.stdout + done.stderr:
        pytest.skip(
            "Blender's own Python has no numpy, which its GLB importer needs: install 'python3-numpy'"
        )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return json.loads(answer.read_text())


@pytest.mark.parametrize("ending", ["bvh", "glb", "usd", "fbx"])
@pytest.mark.parametrize("name", ["human31", "human29"])
def test_the_same_joints_in_every_frame(
    make_run, tmp_path: Path, blender: list[str], ending: str, name: str
) -> None:
    session, run = make_run(name, lambda body: track_of(moving_poses(body)))
    given = "glb" if ending == "fbx" else ending
    report = export_run(session, run, FORMATS[given], {"track": MADE}, tmp_path / f"walk.{given}")
    seen = opened(blender, report.files[0], *([tmp_path / "walk.fbx"] if ending == "fbx" else []))
    body = load_body(name)
    skeleton = skeleton_of(body)
    places, turns = followed(skeleton.tree.parents, *skeleton.animated(moving_poses(body)))
    assert set(seen["bones"]) == set(skeleton.names)
    assert len(seen["heads"]) == FRAMES
    heads = 1000.0 * np.array([[frame[bone] for bone in skeleton.names] for frame in seen["heads"]])
    apart = np.linalg.norm(heads - places @ BLENDER_FROM_WORLD.T, axis=-1).max()
    turned = np.array([[frame[bone] for bone in skeleton.names] for frame in seen["turns"]])
    wanted = BLENDER_FROM_WORLD @ turns @ BLENDER_FROM_WORLD.T
    angle = np.degrees(np.linalg.norm(turned - wanted, axis=(-2, -1)).max() / np.sqrt(2.0))
    print(f"Blender {seen['version']}, {ending} of {name}: {apart:.5f} mm, {angle:.6f} degrees")
    assert apart < LEAST_MM
    assert angle < LEAST_DEGREES
    assert seen["skinned"] == (ending != "bvh")
    assert (seen["vertices"] > 0) == (ending != "bvh")
