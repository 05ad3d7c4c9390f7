"""The arena's bundled problems, made of drawn clips: `python -m studio.garden.arena_set FOLDER`.

Each clip is rendered and tracked as anybody's would be, with default settings, up to the frame before. FOLDER keeps
sessions and runs, so that the command goes on where it was ended. Some clips join recorded motions, which have to be
found through STUDIO_REAL_DATA.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studio.foundations.progress import Progress
from studio.operations.tracking import track
from studio.results.arena.making import REFERENCE, defined, frame_start, with_reference
from studio.results.arena.problem import Definition
from studio.results.arena.problem_files import BUNDLED, write_problems
from studio.results.drawing_footage.recipes import synthesize
from studio.results.inspection.reading import InspectedRun
from studio.sessions.session import Session

RUN = "arena"
RECIPES = Path(__file__).with_name("arena_recipes")


@dataclass(frozen=True, slots=True)
class ArenaClip:
    """A clip of which a frame is taken.

    recipe : by name, or a file of RECIPES. parts : limbs that are problems of their own, the rest of the body held.
    """

    name: str
    recipe: str
    frame: int
    parts: tuple[tuple[str, ...], ...] = ()


CLIPS = (
    ArenaClip("planar-arm", "planar_arm", 20),
    ArenaClip("branched-arms", "branched_arms", 20),
    ArenaClip("walk", "walk", 30, (("left arm",), ("right leg",))),
    ArenaClip("walk-20hz", "choosing-walk-20hz", 12),
    ArenaClip("turns", "choosing-turns", 24),
    ArenaClip("kick", "choosing-kick", 45, (("left leg", "right leg"),)),
    ArenaClip("cartwheel", "choosing-cartwheel", 40),
    ArenaClip("noise", "choosing-hard", 40),
    ArenaClip("hand", "hand-grasp", 20),
    ArenaClip("dog", "dog.toml", 16),
)


def made_of(clip: ArenaClip, folder: Path, report: Progress) -> list[Definition]:
    """A clip's problems: of the whole body, then of parts of it. folder : where sessions and runs are kept."""
    place = folder / clip.name
    if not place.is_dir():
        recipe = RECIPES / clip.recipe if clip.recipe.endswith(".toml") else clip.recipe
        synthesize(recipe, place, report, clip.frame + 1)
    session = Session(place)
    if RUN not in [run.name for run in session.runs()]:
        track(session, name=RUN, first=0, last=clip.frame + 1, allow_inconsistent=True, progress=report)
    run = InspectedRun(session, session.run(RUN))
    begun = frame_start(run, clip.frame)
    made = list[Definition]()
    for limbs in ((), *clip.parts):
        name = "-".join([clip.name, *(limb.replace(" ", "-") for limb in limbs)])
        definition = defined(run, begun, name, limbs)
        known = [np.clip(pose[definition.free], definition.lower, definition.upper) for pose in begun.known]

        def step(share: float, name: str = name) -> None:
            report(f"{name}: searched for long", int(100 * share), 100)

        made.append(with_reference(definition, known, REFERENCE, step))
    return made


def main(arguments: Sequence[str]) -> None:
    folder = Path(arguments[0]).absolute()
    folder.mkdir(parents=True, exist_ok=True)
    definitions = list[Definition]()
    for clip in CLIPS:
        definitions += made_of(clip, folder, lambda step, done, total: None)
        for one in definitions[-1 - len(clip.parts) :]:
            best = one.best
            assert best is not None
            sys.stdout.write(f"{one.name} {len(one.free)} {one.kind} {best.log_weight:.4f} {best.hash}\n")
            sys.stdout.flush()
    sys.stdout.write(f"{write_problems(definitions, BUNDLED).stat().st_size} bytes\n")


if __name__ == "__main__":
    main(sys.argv[1:])
