"""Hull and blobs in the scene: what is drawn is what was carved and fitted, in the colours that were seen."""

import dataclasses
import threading

import numpy as np
from scipy.spatial.transform import Rotation
from swaying_session import swaying_pose
from toy_session import true_poses
from tracked_runs import finish

from studio.app.scene.frame_volume import FrameVolume, FrameVolumes
from studio.app.scene.guarded_server import GuardedServer
from studio.app.scene.model import LiveSearch
from studio.app.scene.opened_run import OpenedRun
from studio.app.scene.volume_view import BLOB_REACH, VolumeView, as_light, blob_instances, voxel_instances
from studio.body.model import BodyModel
from studio.evidence.volume.blob_model import BlobMixture, cone_blobs
from studio.evidence.volume.hull import Hull
from studio.evidence.volume.tracking_space import Box
from studio.foundations.errors import StudioError
from studio.runs.drawing.colour_tokens import colour_tokens
from studio.runs.new_run import prepare_run
from studio.runs.problem_source import ProblemSource
from studio.search.likelihood.blobs import BlobFrameLikelihood
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

TOKENS = colour_tokens(True)
PATIENCE = 60.0


def some_hull(count: int, seed: int = 0) -> Hull:
    """Voxels of two sizes anywhere, each in a colour of its own."""
    rng = np.random.default_rng(seed)
    edges = np.where(np.arange(count) % 3 == 0, 50.0, 25.0)
    colours = rng.integers(0, 256, (count, 3)).astype(np.float32)
    box = Box(np.zeros(3), np.full(3, 1600.0))
    return Hull(rng.uniform(0.0, 1600.0, (count, 3)), edges, colours, colours[:, None], 6, box)


def test_voxels_are_boxes_of_their_size_in_the_colours_of_a_screen() -> None:
    hull = some_hull(7)
    places, turns, edges, colours = voxel_instances(hull)
    np.testing.assert_allclose(places, hull.centres / 1000.0)
    np.testing.assert_allclose(edges, np.tile(hull.edges[:, None], 3) / 1000.0)
    assert (turns == [1.0, 0.0, 0.0, 0.0]).all()
    np.testing.assert_array_equal(colours, hull.colours[:, ::-1].astype(np.uint8))


def test_every_point_of_an_ellipsoid_is_equally_far_from_its_blob() -> None:
    rng = np.random.default_rng(3)
    roots = rng.normal(0.0, 40.0, (5, 3, 3))
    covariances = roots @ roots.transpose(0, 2, 1)
    colours = rng.uniform(0.0, 255.0, (5, 3))
    colours[2] = np.nan
    mixture = BlobMixture(rng.uniform(-900.0, 900.0, (5, 3)), covariances, colours, colours, np.full(5, 0.2))
    places, turns, reach, tints = blob_instances(mixture, (1, 2, 3))
    ball = rng.standard_normal((40, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    for blob in range(5):
        axes = Rotation.from_quat(turns[blob], scalar_first=True)
        away = 1000.0 * axes.apply(ball * reach[blob])
        distances = np.einsum("ni,ij,nj->n", away, np.linalg.inv(covariances[blob]), away)
        np.testing.assert_allclose(distances, BLOB_REACH**2, rtol=1e-6)
    np.testing.assert_allclose(places, mixture.means / 1000.0)
    assert tuple(tints[2]) == (1, 2, 3)
    np.testing.assert_array_equal(tints[0], np.round(colours[0, ::-1]))


def test_light_follows_the_screen_standard() -> None:
    light = as_light(np.array([0, 10, 128, 188, 255], dtype=np.uint8))
    np.testing.assert_array_equal(light, [0, 1, 55, 128, 255])


def test_what_is_drawn_already_is_not_sent_again(server: GuardedServer, human: BodyModel) -> None:
    view = VolumeView(server, human)
    model = cone_blobs(human)
    first, then = swaying_pose(human, 0), swaying_pose(human, 3)
    volume = FrameVolume(0, some_hull(40), model, model.mixture(human, first[None]).at(0))
    view.show(volume, first, TOKENS, hull=True, blobs=True)
    np.testing.assert_allclose(view.own.handle.batched_positions, view.fitted.handle.batched_positions)
    buffer = server._websock_server._broadcast_buffer
    before = buffer.message_counter
    view.show(volume, first.copy(), TOKENS, hull=True, blobs=True)
    assert buffer.message_counter == before
    view.show(volume, then, TOKENS, hull=True, blobs=True)
    wanted = model.mixture(human, then[None]).at(0).means / 1000.0
    np.testing.assert_allclose(view.own.handle.batched_positions, wanted, rtol=1e-6)
    other = dataclasses.replace(volume, hull=some_hull(60, 1))
    view.show(other, then, TOKENS, hull=True, blobs=False)
    assert len(view.voxels.handle.batched_positions) == 60
    assert view.fitted.handle is None
    assert view.own.handle is None
    view.show(other, then, TOKENS, hull=False, blobs=False)
    assert view.voxels.handle is None
    view.show(None, None, TOKENS, hull=True, blobs=True)
    assert view.voxels.handle is None


def tracked(session: Session, weighting: str) -> StoredRun:
    """A short run through all its frames."""
    changes = {"particles": 40, "layers": 3, "start_repeats": 1}
    changes |= {"blob_learning": 2, "hull_depth": 6} if weighting == "blobs" else {}
    start = true_poses()[0]
    run = prepare_run(session, weighting=weighting, start_pose=start, last=4, knobs=changes)
    finish(session, run)
    return run


class Made:
    """Hears of volumes and waits for them."""

    def __init__(self, opened: OpenedRun) -> None:
        self.happened = threading.Event()
        self.problems: list[StudioError] = []
        self.opened, self.volumes = opened, FrameVolumes(opened, self.happened.set, self.problems.append)

    def of(self, frame: int, *, blobs: bool) -> FrameVolume | None:
        """The volume of a stored frame, when it is made."""
        moment = self.opened.moment(frame, LiveSearch())
        settings = self.opened.settings()
        self.happened.clear()
        found = self.volumes.of(moment, settings, blobs=blobs)
        if found is None or found.frame != frame:
            assert self.happened.wait(PATIENCE)
            found = self.volumes.of(moment, settings, blobs=blobs)
        return found


def test_a_run_weighed_by_blobs_shows_its_own_hull_and_fit(session_on_disk: Session) -> None:
    run = tracked(session_on_disk, "blobs")
    made = Made(OpenedRun(session_on_disk, run))
    assert made.of(2, blobs=False) is not None
    volume = made.of(3, blobs=True)
    with run.results() as results:
        before, answer = results.result(2), results.result(3)
    source = ProblemSource(session_on_disk, run.body(), run.cameras())
    problem = source.problem(3, made.opened.settings())
    assert isinstance(problem, BlobFrameLikelihood)
    np.testing.assert_array_equal(volume.hull.centres, problem.hull.centres)
    expected = problem.expecting(answer.estimate.pose[None], before.carried.memory)
    np.testing.assert_array_equal(volume.fitted.means, expected.fitted.mixture.means)
    assert np.isfinite(volume.model.colour).any(), "the blobs that the run has learnt, not the cones'"
    source.close()
    made.volumes.close()


def test_every_other_run_shows_a_hull_and_no_blobs(session_on_disk: Session) -> None:
    run = tracked(session_on_disk, "edge-region")
    made = Made(OpenedRun(session_on_disk, run))
    volume = made.of(1, blobs=True)
    assert not volume.hull.empty
    assert volume.model is None
    assert volume.fitted is None
    assert made.of(1, blobs=False) is volume, "kept"
    made.volumes.close()


def test_one_camera_is_refused_once(stored: tuple[Session, StoredRun]) -> None:
    opened = OpenedRun(*stored)
    opened.cameras = opened.cameras[:1]
    made = Made(opened)
    assert made.of(1, blobs=False) is None
    assert made.of(2, blobs=False) is None
    assert [problem.message for problem in made.problems] == ["One camera makes no visual hull."]
    made.volumes.close()
