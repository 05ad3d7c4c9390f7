"""A first frame that is searched several times over: its searches are counted, in a frame and over the frames."""

from toy_session import true_poses
from tracked_runs import finish

from studio.inspection.cloud_outlines import outline_of
from studio.inspection.reading import InspectedRun
from studio.inspection.tables import Selection
from studio.inspection.views import look, look_over
from studio.runs.new_run import prepare_run
from studio.sessions.session import Session

LAYERS = 3


def test_the_searches_of_a_frame_are_counted_and_its_cloud_shrinks(session_on_disk: Session) -> None:
    knobs = {"particles": 60, "layers": LAYERS, "start_repeats": 2, "refine_frames": False}
    start = true_poses()[0]
    run = InspectedRun(session_on_disk, prepare_run(session_on_disk, start_pose=start, last=2, knobs=knobs))
    finish(session_on_disk, run.run)
    first, second = run.frame(0), run.frame(1)
    assert (first.search_layers, first.searches, len(first.layers)) == (LAYERS, 2, 2 * LAYERS)
    assert (second.search_layers, second.searches) == (LAYERS, 1)

    notes = [look(run, frame, "variance", Selection()).notes for frame in (0, 1)]
    assert notes[0][0] == (
        "The frame was searched several times over: layers 1 to 3 are the first search and layers 4 to 6 are the"
        " second search."
    )
    assert not any("several times" in note for note in notes[1])

    # Over the frames each row says of which search it is, so that a map needs no rows that one frame has alone.
    view = look_over(run, "variance", Selection(parameter=run.names[0]))
    (table,) = [one for one in view.tables if one.name == "parameter"]
    frames = [row[:3] for row in table.rows]
    assert frames[: 2 * LAYERS] == [(0, 1 + layer // LAYERS, layer) for layer in range(2 * LAYERS)]
    assert frames[2 * LAYERS :] == [(1, 1, layer) for layer in range(LAYERS)]

    # The outlines are those of the particles: one ellipse for the arm's only end, smaller layer by layer.
    camera = run.run.cameras()[0]
    outlines = [outline_of(run.body, camera, layer.poses, layer.mean) for layer in second.layers]
    sizes = [outline.ellipses[0][2] + outline.ellipses[0][4] for outline in outlines if outline]
    assert [len(outline.ellipses) for outline in outlines if outline] == [1] * LAYERS
    assert sizes[0] > sizes[-1] > 0.0
    assert len(outlines[0].figure) == len(run.body.drawn)  # pyright: ignore[reportOptionalMemberAccess]
