"""The answer to a moved slider is measured from the change to the last layer."""

import pytest

from studio.garden.benchmarks.reannealing import measure_reannealing
from studio.operations.jobs.control import StudioControl
from studio.runs.new_run import prepare_run
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace


@pytest.mark.slow
def test_every_answer_is_waited_for(session_on_disk: Session) -> None:
    run = prepare_run(session_on_disk, last=2, knobs={"layers": 3, "particles": 40})
    control = StudioControl(Workspace(session_on_disk.path.parent))
    try:
        found = measure_reannealing(control, session_on_disk, run, repeats=3)
    finally:
        control.close()
    print(f"\nre-annealing 3 × 40: median {found.median_ms} ms, worst {found.worst_ms} ms")
    assert (found.layers, found.particles, found.repeats) == (3, 40, 3)
    assert 0.0 < found.median_ms <= found.worst_ms
    with run.results() as results:
        assert results.frames() == [0, 1]


def test_a_run_of_another_session_is_refused(session_on_disk: Session) -> None:
    run = prepare_run(session_on_disk, last=1)
    control = StudioControl(Workspace(session_on_disk.path / "elsewhere"))
    try:
        with pytest.raises(Exception, match="toy"):
            measure_reannealing(control, session_on_disk, run)
    finally:
        control.close()
