"""What another process compiles is what a frame needs after its search; it does where something is missing."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest
from held_children import hold
from sample_walk import copy_of_walk

from studio.foundations import kernel_cache
from studio.foundations.children import Child
from studio.runs import compiling_beside
from studio.runs.new_run import prepare_run
from studio.sessions.stored_run import StoredRun

FORMS = """
import sys
from pathlib import Path
from numba.core.dispatcher import Dispatcher
from studio.operations.jobs.open_run import OpenRun
from studio.runs import compiling_beside
from studio.search.trackers import agreement_kernels, limb_colour_kernels, limb_places, refinement_kernels
from studio.search.likelihood import area_kernels
from studio.evidence import distance_maps

def forms():
    modules = (
        *(agreement_kernels, limb_colour_kernels, limb_places, refinement_kernels),
        *(area_kernels, distance_maps),
    )
    kernels = {one for module in modules for one in vars(module).values() if isinstance(one, Dispatcher)}
    kernels -= {area_kernels.three_terms}  # of the search itself
    return {(kernel.py_func.__name__, str(form)) for kernel in kernels for form in kernel.overloads}

session, run = sys.argv[1:]
compiling_beside.compile_for(None, None, Path(session), run)
before = forms()
opened = OpenRun(session, f"{session}/runs/{run}")
while not opened.tracking.done:
    opened.step_layer()
opened.close()
print(len(before), sorted(forms() - before))
"""


@pytest.fixture
def run(tmp_path: Path) -> StoredRun:
    return prepare_run(copy_of_walk(tmp_path / "walk"), last=2)


@pytest.mark.slow
def test_all_that_follows_the_first_search_is_compiled(run: StoredRun) -> None:
    given = [str(run.folder.parents[1]), run.name]
    answer = subprocess.run(
        [sys.executable, "-c", FORMS, *given], capture_output=True, text=True, timeout=300
    )
    assert answer.stdout.split(maxsplit=1)[1].strip() == "[]", answer.stderr
    assert int(answer.stdout.split()[0]) >= 7


def test_the_process_is_started_once_where_a_kernel_is_missing(
    run: StoredRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[Child] = []

    def start(_function: object, *_given: object, name: str, quiet: bool) -> Child:
        started.append(Child(hold, name=name, quiet=quiet))
        return started[-1]

    monkeypatch.setattr(compiling_beside.numba, "get_num_threads", lambda: 2)
    monkeypatch.setattr(compiling_beside, "Child", start)
    with compiling_beside.compiling_beside(run):
        pass
    assert not started
    with compiling_beside.compiling_beside(run):
        kernel_cache._compiling()
        kernel_cache._compiling()
    (process,) = started
    assert process.exit_code is None
    process.kill()
    process.wait(60)
    assert process.exit_code == -signal.SIGKILL
