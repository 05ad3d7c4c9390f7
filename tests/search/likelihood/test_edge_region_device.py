"""Edge and region on a device: in Numba's simulator against the processor, as PTX, and where there is none."""

import importlib
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numba
import numpy as np
import pytest
from simulated_device import SAMPLES, scene_of, terms_of
from weighting_scene import four_cameras

from studio.body.catalogue import load_body
from studio.foundations.errors import SettingsError, StudioError
from studio.foundations.geometry.camera_table import camera_table, outward_limit
from studio.operations.jobs.batch import track_to_end
from studio.runs.new_run import prepare_run
from studio.search.likelihood import edge_region
from studio.search.likelihood.edge_region import EdgeRegionLikelihood, EdgeRegionSettings
from studio.search.likelihood.edge_region_silhouette import (
    EdgeRegionSilhouetteLikelihood,
    EdgeRegionSilhouetteSettings,
)
from studio.search.likelihood.problem import TRUNK_FIRST, WHOLE_BODY
from studio.sessions.samples import install_sample
from studio.sessions.workspace import Workspace

HERE = Path(__file__).parent
BODIES = ("human31", "planar_arm4")


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """What the device's kernels give, in a process whose device is simulated."""
    place = tmp_path_factory.mktemp("device") / "terms.npz"
    simulator = {
        "NUMBA_ENABLE_CUDASIM": "1",
        "NUMBA_DISABLE_JIT": "1",
        "PYTHONPATH": os.pathsep.join(map(str, (HERE, HERE.parents[1], HERE.parents[2]))),
    }
    # Words of 64 bits wrap around where masks are packed, on purpose.
    wrapping = "ignore:overflow encountered in scalar:RuntimeWarning"
    script = [
        sys.executable,
        "-W",
        "error",
        "-W",
        wrapping,
        str(HERE / "simulated_device.py"),
        str(place),
        *BODIES,
    ]
    done = subprocess.run(script, env={**os.environ, **simulator}, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    with np.load(place) as found:
        return dict(found)


@pytest.mark.parametrize("name", BODIES)
def test_the_devices_terms_are_the_processors(simulated, name):
    """But for samples that the last bit of a place carries into the next pixel, whose value differs by little here."""
    expected = terms_of(name, "cpu")
    assert {"edge", "region", "weights"} <= {key.split(".")[1] for key in simulated if key.startswith(name)}
    samples = {"edge": SAMPLES["edge_samples"], "region": SAMPLES["region_samples"]}
    limbs = len(load_body(name).drawn)
    for key, value in expected.items():
        if f"{name}.{key}" not in simulated:
            continue
        found = simulated[f"{name}.{key}"]
        np.testing.assert_allclose(found, value, atol=1e-3)
        if key in samples:
            whole = 255 * samples[key] * limbs * found
            np.testing.assert_allclose(whole, np.round(whole), atol=1e-6)
            assert (np.abs(whole - 255 * samples[key] * limbs * value) > 0.5).mean() < 0.3, (
                "nearly all are equal"
            )
    assert np.ptp(expected["weights"]) > 0.1
    if name == "human31":
        assert "human31.trunk" in simulated
        assert np.abs(expected["trunk"] - expected["edge"]).max() > 0.01
        assert (expected["edge"] == 1.0).any(), "some cameras see nothing of a pose"


def test_every_kernel_compiles_for_a_device(monkeypatch):
    """PTX is made without a card, where the extra `gpu` and NVIDIA's compiler are installed."""
    pytest.importorskip("numba_cuda", reason="the extra `gpu` is not installed")
    pathfinder = pytest.importorskip("cuda.pathfinder")
    for library in ("nvvm", "nvrtc"):
        try:
            pathfinder.load_nvidia_dynamic_lib(library)
        except pathfinder.DynamicLibNotFoundError:
            pytest.skip(f"NVIDIA's compiler is not installed: there is no {library}")
    dispatching = pytest.importorskip("numba.cuda.dispatcher")
    device = pytest.importorskip("studio.search.likelihood.edge_region_device")
    from studio.foundations.numba_on_devices import cuda  # noqa: PLC0415

    capability = (8, 0)
    monkeypatch.setattr(
        dispatching, "get_current_device", lambda: SimpleNamespace(compute_capability=capability)
    )
    table = camera_table(four_cameras(), outward_limit, np.float32)
    f8, f4, i8, i4, u1 = (numba.typeof(np.zeros(1, t)).dtype for t in ("f8", "f4", "i8", "i4", "u1"))

    def array(of, dimensions):
        return numba.types.Array(of, dimensions, "C")

    tables = array(i8, 1), array(i8, 1), array(i8, 1), array(i8, 1), array(f4, 1), array(f4, 3)
    signatures = {
        device.find_frames: (array(f8, 2), *tables, array(f4, 3)),
        device.add_samples: (
            *(array(f4, 3), array(i8, 1), array(f4, 2), numba.typeof(table), array(u1, 1), array(i8, 2)),
            *(i8, i8, array(i4, 3)),
        ),
    }
    for kernel, arguments in signatures.items():
        ptx = cuda.compile_ptx(kernel, numba.types.void(*arguments), cc=capability)[0]
        assert ".entry" in ptx
        assert "fma.rn.f32" in ptx
        assert "call" not in ptx, "every helper is compiled into its kernel"


def settings(**knobs):
    return EdgeRegionSettings(**knobs)


def three_settings(**knobs):
    return EdgeRegionSilhouetteSettings(**knobs)


@pytest.fixture
def no_device(monkeypatch):
    """A machine without a card, whatever this one has."""
    module = importlib.import_module(edge_region.DEVICE_MODULE)
    monkeypatch.setattr(module, "missing", lambda: "no card here")


def test_without_a_card_the_gpu_is_refused_and_auto_is_the_processor(no_device):
    body, cameras, evidence, poses = scene_of("human31")
    with pytest.raises(StudioError, match="no card here") as caught:
        EdgeRegionLikelihood(body, cameras, settings(device="gpu"))
    assert "capture-studio[gpu]" in caught.value.hint
    assert "device to cpu" in caught.value.hint
    weighed = [
        EdgeRegionLikelihood(body, cameras, settings(device=device)).problem(evidence).log_likelihood(poses)
        for device in ("auto", "cpu")
    ]
    np.testing.assert_array_equal(*weighed)


def broken(what):
    """In place of the device's kernels: these fail as numba-cuda 0.30.4 does beside NumPy 2.5, or as a driver does."""
    failures = {
        "compilation": AttributeError("module 'numpy' has no attribute 'row_stack'"),
        "launch": RuntimeError("[999] Call to cuLaunchKernel results in\n CUDA_ERROR_UNKNOWN"),
    }

    class Kernel:
        def __getitem__(self, grid):
            if what == "compilation":
                raise failures[what]
            return self.launched

        def launched(self, *_):
            raise failures[what]

    return Kernel(), Kernel()


class Memory:
    """A card's memory, which works."""

    @staticmethod
    def to_device(values):
        return values

    @staticmethod
    def device_array(shape, kind):
        return np.zeros(shape, kind)


@pytest.mark.parametrize(
    ("fails", "why"),
    [("compilation", "row_stack"), ("launch", "cuLaunchKernel results in CUDA_ERROR_UNKNOWN")],
)
def test_a_card_that_fails_leaves_auto_to_the_processor_which_says_why_once(monkeypatch, fails, why):
    """There is a card; its kernels cannot be compiled, or the first launch fails."""
    device = importlib.import_module(edge_region.DEVICE_MODULE)
    monkeypatch.setattr(device, "missing", lambda: "")
    monkeypatch.setattr(device, "cuda", Memory)
    monkeypatch.setattr(device, "kernels", lambda: broken(fails))
    body, cameras, evidence, poses = scene_of("human31")
    expected = EdgeRegionLikelihood(body, cameras, settings()).problem(evidence).log_likelihood(poses)
    likelihood = EdgeRegionLikelihood(body, cameras, settings(device="auto"))
    assert likelihood.device is not None
    first, beside = likelihood.problem(evidence), likelihood.problem(evidence)
    assert first.notes == ()
    np.testing.assert_array_equal(first.log_likelihood(poses), expected)
    np.testing.assert_array_equal(beside.log_likelihood(poses), expected)
    later = likelihood.problem(evidence)
    np.testing.assert_array_equal(later.log_likelihood(poses), expected)
    (note,) = first.notes + beside.notes + later.notes
    assert note.startswith("The processor evaluates edges and region.")
    assert why in note

    three = EdgeRegionSilhouetteLikelihood(body, cameras, three_settings(device="auto")).problem(evidence)
    here = EdgeRegionSilhouetteLikelihood(body, cameras, three_settings()).problem(evidence)
    for stage in (WHOLE_BODY, TRUNK_FIRST):
        np.testing.assert_array_equal(three.log_likelihood(poses, stage), here.log_likelihood(poses, stage))
    assert len(three.notes) == 1

    asked_for = EdgeRegionLikelihood(body, cameras, settings(device="gpu")).problem(evidence)
    with pytest.raises(StudioError, match=re.escape(why)) as caught:
        asked_for.log_likelihood(poses)
    assert "device to cpu" in caught.value.hint


def test_a_run_stores_why_it_does_without_a_card(no_device, tmp_path):
    """A note of its first frame, and of no other."""
    session = install_sample(Workspace(tmp_path), "planar_arm")
    run = prepare_run(
        session,
        weighting="edge-region",
        first=0,
        last=2,
        knobs={"device": "auto", "particles": 10, "layers": 2},
    )
    track_to_end(session, run, lambda words, done, total: None)
    with run.results() as results:
        noted = [[note for note in results.result(frame).notes if "no card here" in note] for frame in (0, 1)]
    assert noted == [["The processor evaluates edges and region. A GPU cannot be used: no card here."], []]


def test_without_numbas_target_the_gpu_is_refused(monkeypatch):
    body, cameras = load_body("human31"), four_cameras()
    monkeypatch.setattr(edge_region, "DEVICE_MODULE", "studio.search.likelihood.no_such_device")
    with pytest.raises(StudioError, match="No module named"):
        EdgeRegionLikelihood(body, cameras, settings(device="gpu"))
    assert EdgeRegionLikelihood(body, cameras, settings(device="auto")).device is None


def test_occlusion_is_the_processors_alone():
    body, cameras = load_body("human31"), four_cameras()
    with pytest.raises(SettingsError, match="Occlusion-aware"):
        EdgeRegionLikelihood(body, cameras, settings(device="gpu", occlusion_aware=True))
    assert EdgeRegionLikelihood(body, cameras, settings(device="auto", occlusion_aware=True)).device is None


def test_a_machines_missing_device_is_named():
    """On a machine with a card there is nothing missing; on another the reason stands in one line."""
    from studio.foundations.numba_on_devices import cuda, missing  # noqa: PLC0415

    assert (missing() == "") == cuda.is_available()
    assert "\n" not in missing()
