"""Many faults, one after another, each by a seed of its own; and the table of what became of them."""

import shutil
import time
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from faults.kinds import KINDS
from faults.process_kinds import SERVER_KINDS
from faults.stage import Stage
from faults.trial import Trial

RARER = 20
"""Of kinds that need a server each, one fault for so many of the others."""


@dataclass
class Tally:
    """Of one kind. struck : of the tries, those in which the fault came to pass. failures : the seed, and what was
    wrong.
    """

    tries: int = 0
    struck: int = 0
    survived: int = 0
    lost: int = 0
    wrong: int = 0
    seconds: float = 0.0
    failures: list[tuple[int, str]] = field(default_factory=list)


def plant(stage: Stage, kind: str, seed: int) -> Trial:
    """One fault of a kind; the same seed plants it at the same place."""
    at = stage.place(f"{kind.replace(' ', '-')}-{seed}")
    trial = Trial(stage, at, np.random.default_rng((zlib.crc32(kind.encode()), seed)))
    try:
        KINDS[kind](trial)
        trial.judge()
    except Exception as error:
        trial.wrong.append(f"{type(error).__name__}: {error}")
    finally:
        shutil.rmtree(at.folder)
    return trial


def campaign(
    folder: Path, kinds: Sequence[str], tries: int, seed: int = 0, seconds: float = float("inf")
) -> dict[str, Tally]:
    """Plant `tries` faults of each kind, in turn (of costly kinds one in `RARER`). seconds : begin none after that."""
    stage = Stage(folder)
    tallies = {kind: Tally() for kind in kinds}
    until = time.monotonic() + seconds
    for number in range(seed, seed + tries):
        for kind, tally in tallies.items():
            if time.monotonic() > until:
                return tallies
            if kind in SERVER_KINDS and (number - seed) % RARER:
                continue
            began = time.monotonic()
            trial = plant(stage, kind, number)
            tally.seconds += time.monotonic() - began
            tally.tries += 1
            tally.struck += trial.struck
            tally.survived += not trial.wrong and not trial.lost
            tally.lost += trial.lost
            tally.wrong += len(trial.wrong)
            tally.failures += [(number, text) for text in dict.fromkeys(trial.wrong)]
    return tallies


def table(tallies: dict[str, Tally]) -> str:
    """What became of them, a line a kind, and below how each failure is seen again."""
    head = f"{'fault':28}{'tries':>7}{'struck':>8}{'survived':>10}{'frames lost':>13}{'wrong states':>14}{'s each':>8}"
    lines = [head]
    rows = [*tallies.items()]
    whole = Tally()
    for tally in tallies.values():
        for name in ("tries", "struck", "survived", "lost", "wrong", "seconds"):
            setattr(whole, name, getattr(whole, name) + getattr(tally, name))
    for kind, tally in [*rows, (f"{len(rows)} kinds", whole)]:
        lines.append(
            f"{kind:28}{tally.tries:7}{tally.struck:8}{tally.survived:10}{tally.lost:13}{tally.wrong:14}"
            f"{tally.seconds / max(tally.tries, 1):8.2f}"
        )
    for kind, tally in rows:
        lines += [f'--seed {seed} --only "{kind}": {text}' for seed, text in tally.failures]
    return "\n".join(lines)
