"""Experiments that measure in milliseconds, for the tests of everything around experiments.

Each trial leaves a line in the file `log` of its arguments, so that tests see what was run and by which process.
"""

import math
import os
import signal
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from studio.foundations.errors import StudioError
from studio.garden.reproduction.experiment import Experiment, Part
from studio.results.comparison.findings import Chart, Heat, Series, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.trials import Outcome, Scale, Trial

SETTINGS = ("plain", "clever")


def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Errors around 40 ("plain") and 30 ("clever"); does what `deed` says."""
    with Path(arguments["log"]).open("a") as log:
        log.write(f"{os.getpid()} {arguments['setting']} {arguments['seed']}\n")
    deed = arguments.get("deed", "")
    if deed == "refuse" or (deed == "once refused" and _first(arguments)):
        raise StudioError("The toy refuses.", "Ask another.")
    if deed == "break":
        raise ZeroDivisionError("toy")
    first_of_all = deed == "die once" and _first(arguments)
    if arguments["setting"] == "plain" and (deed == "die" or first_of_all):
        os.kill(os.getpid(), signal.SIGKILL)
    if deed == "wait":
        while not Path(arguments["gate"]).exists():
            time.sleep(0.01)
    rng = np.random.default_rng((arguments["seed"], SETTINGS.index(arguments["setting"])))
    side = 2.0 if arguments["seed"] % 2 else -2.0
    error = (40.0 if arguments["setting"] == "plain" else 30.0) + side + rng.normal(0.0, 0.2)
    curve = [error + float(rng.normal()) for _ in range(60)]
    return {
        "error": np.float64(error),
        "curve": np.array(curve),
        "gap": math.nan,
        "threads": os.environ.get("NUMBA_NUM_THREADS", ""),
    }


def toy(
    name: str, log: Path, *, alone: bool = False, footage: tuple[str, ...] = (), **deeds: str
) -> Experiment:
    """An experiment of two settings. deeds : "seed" + number to what that trial does beside measuring."""
    return Experiment(
        name=name,
        title=f"Errors of two settings ({name})",
        source="Toy 2024, Fig. 1",
        claim="The clever setting is at 30 mm, ten below the plain one.",
        trials=_trials(log, deeds),
        measure=measure,
        shown=shown,
        footage=footage,
        alone=alone,
    )


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """Numbers of every verdict, a table, and a chart of every kind."""
    errors = {
        name: [o.measured["error"] for o in outcomes if o.trial.arguments["setting"] == name]
        for name in SETTINGS
    }
    yield number("error, plain", errors["plain"], "mm", paper=40.0, better="lower")
    yield number("error, clever", errors["clever"], "mm", paper=38.0, better="lower")
    yield number("seeds' gap", [o.measured["gap"] for o in outcomes])
    yield "As the paper says."
    means = tuple((name, float(np.mean(values))) for name, values in errors.items())
    yield Table("By setting", ("setting", "error (mm)"), means)
    yield from _charts(outcomes, errors)
    yield {"particles": 200, "survival": 0.5}


def _charts(outcomes: Sequence[Outcome], errors: Mapping[str, list[float]]) -> tuple[Chart, ...]:
    frames = tuple(float(frame) for frame in range(60))
    thin = tuple(
        Series(
            o.trial.label, frames, tuple(o.measured["curve"]), group=o.trial.arguments["setting"], thin=True
        )
        for o in outcomes
    )
    thick = tuple(
        Series(name, frames, (math.nan, *(float(np.mean(values)),) * 59), group=name)
        for name, values in errors.items()
    )
    means = tuple(float(np.mean(values)) for values in errors.values())
    bars = Series("ours", (0.0, 1.0), means, tuple(m - 2 for m in means), tuple(m + 2 for m in means))
    still = ((10.0, 30.0, "still"),)
    scaling = Series("</script><b>", (1.0, 10.0), (4.0, 2.0))
    damage = Heat(("0", "10"), SETTINGS, ((1.0, math.nan), (3.0, 4.0)))
    return (
        Chart("Error over frames", "lines", "frame", "error (mm)", thin + thick, paper=38.0, bands=still),
        Chart("Error by setting", "bars", "setting", "error (mm)", (bars,), categories=SETTINGS, paper=38.0),
        Chart("Scaling", "points", "particles", "error (mm)", (scaling,), log_x=True),
        Chart("Damage", "heat", "holes (%)", "tracker", heat=damage),
    )


def _trials(log: Path, deeds: Mapping[str, str]) -> Callable[[Scale], tuple[Trial, ...]]:
    def trials(scale: Scale) -> tuple[Trial, ...]:
        return tuple(
            Trial(
                f"{setting}, seed {seed}",
                {"log": str(log), "setting": setting, "seed": seed, "quick": scale.quick}
                | ({"deed": deeds[f"seed{seed}"], "gate": f"{log}.gate"} if f"seed{seed}" in deeds else {}),
            )
            for setting in SETTINGS
            for seed in scale.seeds
        )

    return trials


def _first(arguments: Mapping[str, Any]) -> bool:
    lines = Path(arguments["log"]).read_text().splitlines()
    return sum(line.split(" ", 1)[1] == f"{arguments['setting']} {arguments['seed']}" for line in lines) == 1
