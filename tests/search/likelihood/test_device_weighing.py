"""Weighing on a card: in Numba's simulator against the processor, every kernel as PTX, and where there is no card."""

import importlib
import re
from pathlib import Path
from types import SimpleNamespace

import numba
import numpy as np
import pytest
from compiled_card import FLAG, GENERATIONS, LONG, SINGLE, compiled, kernels_of, needs_compilers, of_type
from simulated_card import run_simulated
from simulated_weighing import FEW_WORDS, SAMPLES, SCENES, scene_of, terms_of
from weighting_scene import four_cameras, smooth_evidence

from studio.body.catalogue import load_body
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.errors import BodyError, StudioError
from studio.foundations.geometry.camera_table import camera_table, outward_limit
from studio.operations.jobs.batch import track_to_end
from studio.runs.new_run import prepare_run
from studio.search.likelihood import device_weighing, devices, edge_region
from studio.search.likelihood.edge_region import EdgeRegionLikelihood, EdgeRegionSettings
from studio.search.likelihood.edge_region_silhouette import (
    EdgeRegionSilhouetteLikelihood,
    EdgeRegionSilhouetteSettings,
)
from studio.search.likelihood.outlines import OutlineProjector
from studio.search.likelihood.problem import TRUNK_FIRST, WHOLE_BODY
from studio.search.likelihood.silhouette_areas import Silhouettes
from studio.sessions.samples import install_sample
from studio.sessions.workspace import Workspace

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """What a card's kernels give, in a process whose card is simulated."""
    place = tmp_path_factory.mktemp("device") / "terms.npz"
    run_simulated(HERE / "simulated_weighing.py", place)
    with np.load(place) as found:
        return dict(found)


@pytest.mark.parametrize("scene", SCENES)
def test_a_cards_terms_are_the_processors(simulated, scene):
    """But for samples that the last bit of a place carries into the next pixel, whose value differs by little here."""
    expected = terms_of(scene, "cpu")
    found = {name: simulated[f"{scene}.{name}"] for name in expected}
    for name in ("both", "projected"):
        np.testing.assert_array_equal(found[name], expected[name])
    for name in ("edge", "region", "trunk", "weights", "trunk weights"):
        np.testing.assert_allclose(found[name], expected[name], atol=1e-3)
    np.testing.assert_allclose(found["outside"], expected["outside"], rtol=1e-4, atol=1.0)
    assert np.ptp(expected["weights"]) > 1e-3
    if scene != "hidden edges":
        limbs = len(load_body(SCENES[scene][0]).drawn)
        for name, samples in (("edge", SAMPLES["edge_samples"]), ("region", SAMPLES["region_samples"])):
            whole = 255 * samples * limbs * found[name]
            np.testing.assert_allclose(whole, np.round(whole), atol=1e-6)
            apart = np.abs(whole - 255 * samples * limbs * expected[name]) > 0.5
            assert apart.mean() < 0.3, "nearly all are equal"
    if scene == "human31":
        assert np.abs(expected["trunk"] - expected["edge"]).max() > 0.01
        assert (expected["edge"] == 1.0).any(), "some cameras see nothing of a pose"
        assert (expected["outside"] > 0.0).any(), "some limbs leave the picture"
    if scene == "in bands":
        assert expected["projected"].min() > 32 * FEW_WORDS, "the union does not fit the words"


def signatures():
    """Every kernel of the modules for cards, by name, and the types that it is called with."""
    weighing = importlib.import_module("studio.search.likelihood.device_weighing_kernels")
    searching = importlib.import_module("studio.search.trackers.device_search_kernels")
    table = numba.typeof(camera_table(four_cameras(), outward_limit, np.float32))
    numbers, f4, f8, u8 = of_type("i4"), of_type("f4", 2), of_type("f8", 2), of_type("u8", 2)
    moments = of_type("f8", 3)
    places = of_type("i4", 3)
    terms = (
        f4, numbers, f4, numbers, table, places, of_type("u1"), of_type("u4"), LONG, SINGLE, of_type("f4", 3),
    )  # fmt: skip
    found = {
        "turn_poses": (weighing.turn_poses, (f4, f4)),
        "weigh_poses": (
            weighing.weigh_poses,
            (of_type("f4", 3), places, LONG, of_type("f8"), of_type("f8"), f8),
        ),
        "find_frames": (
            weighing.frames_kernel(15)[0].py_func,
            (f4, *(numbers,) * 4, of_type("f4"), of_type("f4", 3), f4),
        ),
    }
    for areas, occlusion in ((False, False), (True, False), (True, True)):
        kernel = weighing.terms_kernel(10, 1, 1, areas, occlusion).py_func
        found[f"add_terms, areas {areas}, occlusion {occlusion}"] = kernel, terms
    of_a_layer = {
        "anneal_weights": (f8, LONG, f8, f8, of_type("f8")),
        "carry_over": (f4, LONG, of_type("f8"), u8, LONG, FLAG, f8, LONG, f4),
        "draw_survivors": (f4, of_type("f8"), u8, LONG, FLAG, f8, of_type("i8"), f4, of_type("i4", 2)),
        "find_moments": (f4, LONG, LONG, moments),
        "find_weighted_moments": (f4, of_type("f8"), LONG, moments),
        "find_correlations": (f4, LONG, moments, moments),
        "find_root": (moments,),
        "spread": (f4, moments, moments, f8, u8, f8, LONG, f4),
        "take_rows": (f4, f8, f8, LONG, LONG, moments, moments),
    }
    found |= {name: (getattr(searching, name), types) for name, types in of_a_layer.items()}
    for module in (weighing, searching):
        own = kernels_of(module) - {"frames_kernel", "terms_kernel"}
        assert own <= set(found), "a kernel that is not compiled here"
    return found


@needs_compilers
@pytest.mark.parametrize("capability", GENERATIONS)
def test_every_kernel_compiles_for_a_card(monkeypatch, capability):
    for name, ptx in compiled(monkeypatch, capability, signatures()).items():
        if name.startswith("add_terms"):
            assert "fma.rn.f32" in ptx
            assert "div.s64" not in ptx, "indices stay unsigned"


def settings(**knobs):
    return EdgeRegionSettings(**knobs)


def three_settings(**knobs):
    return EdgeRegionSilhouetteSettings(**knobs)


@pytest.fixture
def no_device(monkeypatch):
    """A machine without a card, whatever this one has."""
    module = importlib.import_module(devices.DEVICE_MODULE)
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


class Array(np.ndarray):
    """In a card's memory, which works."""

    def copy_to_device(self, values, stream=None):
        self[...] = values


class Card:
    """All of a card but its kernels."""

    stream = event = staticmethod(lambda: SimpleNamespace(record=print, wait=print, synchronize=lambda: None))

    @staticmethod
    def to_device(values):
        return np.array(values).view(Array)

    @staticmethod
    def device_array(shape, kind):
        return np.zeros(shape, kind).view(Array)

    @staticmethod
    def pinned_array(shape, kind):
        return np.zeros(shape, kind)


@pytest.mark.parametrize(
    ("fails", "why"),
    [("compilation", "row_stack"), ("launch", "cuLaunchKernel results in CUDA_ERROR_UNKNOWN")],
)
def test_a_card_that_fails_leaves_auto_to_the_processor_which_says_why_once(monkeypatch, fails, why):
    """There is a card; its kernels cannot be compiled, or the first launch fails."""
    device = importlib.import_module(devices.DEVICE_MODULE)
    monkeypatch.setattr(device, "missing", lambda: "")
    monkeypatch.setattr(device, "cuda", Card)
    monkeypatch.setattr(device, "pose_kernels", lambda: broken(fails))
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
    assert note.startswith("The processor weighs the poses.")
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


@pytest.mark.parametrize("count", [1, 63, 64, 65, 200])
def test_poses_are_made_narrower_or_refused(count):
    poses, narrower = np.random.default_rng(0).normal(size=(count, 3)), np.zeros((count, 3), np.float32)
    device_weighing.narrow(poses, narrower)
    np.testing.assert_array_equal(narrower, poses.astype(np.float32))
    # The last is finite, but too large for single precision.
    for wrong in (np.nan, -np.inf, 1e39):
        for row, column in ((0, 0), (count - 1, 2)):
            bad = poses.copy()
            bad[row, column] = wrong
            with pytest.raises(BodyError, match="not finite"):
                device_weighing.narrow(bad, narrower)


def test_silhouettes_are_rows_of_words():
    masks = [
        np.random.default_rng(k).random(shape) < 0.5 for k, shape in enumerate([(5, 70), (9, 32), (4, 31)])
    ]
    views = [
        ViewEvidence(f"c{k}", np.zeros((0, 0, 3), np.uint8), np.where(mask, 255, 0).astype(np.uint8), mask)
        for k, mask in enumerate(masks)
    ]
    pictures = device_weighing.rows_of_words(Silhouettes(FrameEvidence(0, tuple(views))))
    for picture, mask in zip(pictures, masks, strict=True):
        height, width = mask.shape
        assert picture.shape == (height, -(-width // 32))
        for row, word in np.ndindex(picture.shape):
            pixels = mask[row, 32 * word : 32 * word + 32]
            assert int(picture[row, word]) == sum(1 << k for k, pixel in enumerate(pixels) if pixel)


@pytest.fixture
def weighing(monkeypatch):
    """The part of a card's memory in which human31 is weighed in four cameras, without kernels."""
    monkeypatch.setattr(device_weighing, "cuda", Card)
    projector = OutlineProjector.of_body(load_body("human31"), four_cameras())
    monkeypatch.setattr(device_weighing, "terms_kernel", lambda *_: None)
    monkeypatch.setattr(device_weighing, "frames_kernel", lambda joints: (None, 32))
    return device_weighing.WeighingDevice(projector.program, projector.camera_table, (2, 1), areas=True)


def test_what_a_card_is_given_once_is_kept(weighing):
    assert weighing.samples(10) == (16 * 2 * 2 * 10, 16 * 3 * 1 * 10)
    assert weighing.samples(3) == (16 * 2 * 2 * 3, 16 * 3 * 1 * 10)
    np.testing.assert_array_equal(weighing.edges_of(None), np.arange(10))
    chosen = weighing.edges_of(np.array([1, 7]))
    np.testing.assert_array_equal(chosen, [1, 7])
    assert weighing.edges_of(np.array([1, 7])) is chosen
    assert weighing.constant(1.0, 2.5) is weighing.constant(1.0, 2.5)
    np.testing.assert_array_equal(weighing.constant(1.0, 2.5), [1.0, 2.5])
    one = weighing.memory("a", (2, 3), np.float32)
    assert one.shape == (2, 3)
    assert weighing.memory("a", (2, 3), np.float32) is one
    for other in (("b", (2, 3), np.float32), ("a", (3, 2), np.float32), ("a", (2, 3), np.int32)):
        assert weighing.memory(*other) is not one


def test_arrays_are_lent_to_one_at_a_time(weighing):
    class Borrower:
        pass

    first, second = Borrower(), Borrower()
    arrays = weighing.lend_arrays(first)
    assert weighing.lend_arrays(second) is not arrays
    del first
    assert weighing.lend_arrays(Borrower()) is arrays


def test_problems_lie_one_after_another_on_a_card(weighing):
    """Maps, silhouettes and where they begin; a frame that is gone leaves its memory to the next."""
    given = []
    for seed in (3, 4):
        evidence = smooth_evidence(four_cameras(), seed)
        given.append((edge_region.weighting_maps(evidence), Silhouettes(evidence, "half")))
    frame = weighing.frames(given)
    assert frame.scale == 0.5
    places = np.array(frame.places)
    assert places.shape == (2, 4, 9)
    for number, (maps, silhouettes) in enumerate(given):
        pictures = device_weighing.rows_of_words(silhouettes)
        np.testing.assert_array_equal(frame.observed[number], silhouettes.pixels)
        for view, (row, picture) in enumerate(zip(places[number], pictures, strict=True)):
            width, height = maps.views[view, 2:]
            assert tuple(row[2:4]) == (width, height)
            for kind in range(2):
                own = maps.values[maps.views[view, kind] :][: width * height + 2]
                np.testing.assert_array_equal(frame.values[row[kind] :][: len(own)], own)
            assert row[5] == picture.shape[1]
            np.testing.assert_array_equal(frame.words[row[4] :][: picture.size], picture.ravel())
            assert tuple(row[6:]) == (*silhouettes.sizes[view], silhouettes.pixels[view])
    there = frame.values
    assert weighing.frames(given).values is not there
    del frame
    later = weighing.frames(given[::-1])
    assert later.values is there
    # Without silhouettes the scale is that of the pictures.
    assert weighing.frame(given[0][0]).scale == 1.0


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
    assert noted == [["The processor weighs the poses. A GPU cannot be used: no card here."], []]


def test_without_numbas_target_the_gpu_is_refused(monkeypatch):
    body, cameras = load_body("human31"), four_cameras()
    monkeypatch.setattr(devices, "DEVICE_MODULE", "studio.search.likelihood.no_such_device")
    with pytest.raises(StudioError, match="No module named"):
        EdgeRegionLikelihood(body, cameras, settings(device="gpu"))
    assert EdgeRegionLikelihood(body, cameras, settings(device="auto")).device is None


def test_a_pose_that_is_not_finite_is_named(monkeypatch):
    """By its number, as on the processor; nothing is given up."""
    device = importlib.import_module(devices.DEVICE_MODULE)
    monkeypatch.setattr(device, "missing", lambda: "")
    monkeypatch.setattr(device, "cuda", Card)
    body, cameras, evidence, poses = scene_of("human31")
    monkeypatch.setattr(device, "pose_kernels", lambda: broken("launch"))
    likelihood = EdgeRegionLikelihood(body, cameras, settings(device="gpu"))
    poses[3, 7] = np.nan
    with pytest.raises(BodyError, match="Parameter 7 of pose 3 is nan"):
        likelihood.problem(evidence).log_likelihood(poses)
    assert likelihood.device is not None


def test_a_body_or_picture_that_is_too_large_is_refused(monkeypatch):
    device = importlib.import_module(devices.DEVICE_MODULE)
    monkeypatch.setattr(device, "missing", lambda: "")
    monkeypatch.setattr(device, "cuda", Card)
    body, cameras, evidence, _ = scene_of("human31")
    monkeypatch.setattr(device, "WIDEST_PICTURE", 100)
    with pytest.raises(StudioError, match="at most 100 pixels across"):
        EdgeRegionLikelihood(body, cameras, settings(device="gpu")).problem(evidence)
    monkeypatch.setattr(device, "MOST_LIMBS", 9)
    with pytest.raises(StudioError, match="at most 9 limbs, not 10"):
        EdgeRegionLikelihood(body, cameras, settings(device="gpu"))


def test_a_machines_missing_device_is_named():
    """On a machine with a card there is nothing missing; on another the reason stands in one line."""
    from studio.foundations.numba_on_devices import cuda, missing  # noqa: PLC0415

    assert (missing() == "") == cuda.is_available()
    assert "\n" not in missing()
