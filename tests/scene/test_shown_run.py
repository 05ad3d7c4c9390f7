"""One opened run in the scene: which frames it knows of."""

from conftest import FRAMES, LAYERS, cloud_record, frame_result

from studio.body.model import BodyModel
from studio.scene.guarded_server import GuardedServer
from studio.scene.opened_run import OpenedRun
from studio.scene.scene_drawing import SceneDrawing
from studio.scene.shown_run import ShownRun
from studio.sessions.results_store import ResultsWriter
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun


def test_a_frame_that_was_not_heard_of_is_known_with_the_next(
    server: GuardedServer, stored: tuple[Session, StoredRun], human: BodyModel
) -> None:
    opened = OpenedRun(*stored)
    shown = ShownRun(SceneDrawing(server, opened, True), opened)
    assert shown.frames == tuple(range(FRAMES - 1))
    shown.frames = shown.frames[:2]
    shown.frame_finished(2)
    assert shown.frames == (0, 1, 2)
    with ResultsWriter(stored[1].folder) as writer:
        writer.write_frame(
            frame_result(human, FRAMES - 1),
            [cloud_record(human, FRAMES - 1, layer) for layer in range(LAYERS)],
        )
    shown.frame_finished(FRAMES - 1)
    assert shown.frames == tuple(range(FRAMES)), "frames 3 and 4 are in the store"
    shown.close()
