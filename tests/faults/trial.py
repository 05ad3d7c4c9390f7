"""One fault, planted once: what it met, what was said of it, and whether everything is right again afterwards."""

import traceback
from collections.abc import Callable, Collection
from dataclasses import dataclass, field

import numpy as np

from faults.seams import Act, Touch, watched
from faults.stage import DEEDS, DONE, FRAMES, NEW, Place, Stage, frames_of, problems_of
from studio.foundations.errors import StudioError


@dataclass
class Trial:
    """struck : whether the fault came to pass. said : the errors that the studio raised, in its words. wrong : what was
    false. lost : how many frames.
    """

    stage: Stage
    at: Place
    rng: np.random.Generator
    struck: bool = False
    deed: str = "track"
    said: list[str] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)
    lost: int = 0

    def a_deed(self, among: Collection[str] = DEEDS) -> str:
        """One of the things that a person does."""
        self.deed = str(self.rng.choice(sorted(among)))
        return self.deed

    def attempt(self, do: Callable[[], object], fault: tuple[type[BaseException], ...] = ()) -> None:
        """Do something that the fault may end. fault : what stands for the fault itself and may come out as it is."""
        try:
            do()
        except StudioError as error:
            self.said.append(f"{error.message} {error.hint}")
            if not error.message or not error.hint:
                self.wrong.append(f"an error without a remedy: {error.message}")
        except fault:
            self.said.append("the fault itself")
        except Exception as error:
            last = traceback.extract_tb(error.__traceback__)
            place = next((entry for entry in reversed(last) if "/studio/" in entry.filename), last[-1])
            where = f"{place.filename.rpartition('/studio/')[2]}:{place.lineno}"
            self.wrong.append(f"{type(error).__name__} in {self.deed}, {where}: {error}")

    def disturb(self, act: Act, fault: tuple[type[BaseException], ...] = ()) -> None:
        """Do the deed with `act` at each of its touches."""

        def attempted() -> None:
            with watched(self.at.folder, act):
                DEEDS[self.deed].do(self.at)

        self.attempt(attempted, fault)

    def once(self, kinds: Collection[str], do: Callable[[Touch], None], for_good: bool = False) -> Act:
        """An act at one of the deed's touches of these kinds. for_good : and at all of them that follow."""
        number = self.number_of(kinds)
        seen = 0

        def act(touch: Touch) -> None:
            nonlocal seen
            if touch.kind not in kinds:
                return
            seen += 1
            if seen - 1 == number or (for_good and seen - 1 > number):
                self.struck = True
                do(touch)

        return act

    def number_of(self, kinds: Collection[str]) -> int:
        """One of the deed's touches of these kinds, counted as they come where nothing fails."""
        return int(self.rng.integers(sum(kind in kinds for kind in self.stage.touches[self.deed])))

    def look(self) -> None:
        """Nobody does anything now: what is said must be true."""
        self.wrong += problems_of(self.stage, self.at)

    def judge(self) -> None:
        """The deed is done again, without a fault: then all must be as if there had been none."""
        self.look()
        deed = DEEDS[self.deed]
        try:
            deed.do(self.at)
            if deed.after(self.at) != self.stage.afters[self.deed]:
                self.wrong.append(f"'{self.deed}' done again came out differently")
            for name in (DONE, NEW):
                run = self.at.run(name)
                DEEDS["track"].do(self.at)
                found = frames_of(run)
                self.lost += sum(found.get(frame) != digest for frame, digest in self.stage.frames.items())
        except Exception as error:
            self.lost += FRAMES
            self.wrong.append(f"'{self.deed}' cannot be done any more: {type(error).__name__}: {error}")
        self.look()
