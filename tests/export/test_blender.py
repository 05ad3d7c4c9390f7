"""Blender as the package manager brings it opens BVH and GLB with the same joints in every frame."""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from export_runs import FRAMES, MADE, moving_poses, track_of

from studio.body.catalogue import load_body
from studio.export.exporting import export_run
from studio.export.formats import FORMATS
from studio.export.skeleton import skeleton_of
from studio.motion_files.recorded_motion import followed

pytestmark = pytest.mark.slow

SCRIPT = Path(__file__).with_name("blender_reading.py")
LEAST_MM, LEAST_DEGREES = 0.1, 0.01
# Blender turns a file's y up into its own z up: (x, y, z) in the file becomes (x, -z, y), of the studio's (y, z, x).
BLENDER_FROM_WORLD = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@pytest.fixture(scope="module")
def blender() -> str:
    """The command, or a skip that says why."""
    found = shutil.which("blender")
    if found is None:
        pytest.skip(
            "no Blender is installed: install the package 'blender' (and 'python3-numpy' for its GLB importer)"
        )
    return found


def opened(blender: str, path: Path) -> dict:
    """What Blender sees of a file."""
    answer = path.with_suffix(".json")
    arguments = ["--background", "--factory-startup", "--python-exit-code", "3", "--python", str(SCRIPT)]
    done = subprocess.run(
        [blender, *arguments, "--", str(path), str(answer), "60"],
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


@pytest.mark.parametrize("ending", ["bvh", "glb"])
@pytest.mark.parametrize("name", ["human31", "human29"])
def test_the_same_joints_in_every_frame(
    make_run, tmp_path: Path, blender: str, ending: str, name: str
) -> None:
    session, run = make_run(name, lambda body: track_of(moving_poses(body)))
    report = export_run(session, run, FORMATS[ending], {"track": MADE}, tmp_path / f"walk.{ending}")
    seen = opened(blender, report.files[0])
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
    assert seen["skinned"] == (ending == "glb")
    assert (seen["vertices"] > 0) == (ending == "glb")
