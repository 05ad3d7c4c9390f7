"""A run of the toy arm, and two of its frames as problems: the whole arm, and two joints with the rest held."""

from dataclasses import dataclass
from pathlib import Path

from toy_session import make_session, true_poses

import studio
from studio.results.arena.making import problems_of_run
from studio.results.arena.problem import Definition, Problem
from studio.results.arena.problem_files import write_problems
from studio.results.inspection.reading import InspectedRun

WHOLE, PART = 3, 4
JOINTS = ("x3", "x4")
EVALUATIONS = 20_000


@dataclass(frozen=True)
class ToyArena:
    run: InspectedRun
    whole: Definition
    part: Definition
    file: Path

    def problem(self, budget: int | None = None) -> Problem:
        return Problem(self.whole, budget)


def make_arena(folder: Path) -> ToyArena:
    """Tracked and searched in a folder, in which the set is a file."""
    session = make_session(folder / "toy")
    tracked = studio.track(
        session, last=6, start_pose=true_poses()[0], knobs={"particles": 20, "layers": 3}, progress=False
    )
    run = InspectedRun(session, tracked.run)
    (whole,) = problems_of_run(run, [WHOLE], evaluations=EVALUATIONS)
    (part,) = problems_of_run(run, [PART], JOINTS, EVALUATIONS)
    return ToyArena(run, whole, part, write_problems([whole, part], folder / "set.npz"))
