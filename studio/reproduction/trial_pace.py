"""How long the trials that are left will take, from those of the same kind that are done."""

from collections.abc import Callable, Iterable, Mapping

from studio.comparison.kept_trials import KeptOutcome
from studio.comparison.trials import TrialJob

# Called with a step in words, what is done of it, how much it is, and the seconds that are left (None: unknown).
Report = Callable[[str, int, int, float | None], None]

Kind = tuple[str, tuple[str, ...]]


class TrialPace:
    """Mean seconds of trials by what is measured on which footage."""

    def __init__(self, jobs: Mapping[str, TrialJob], kept: Mapping[str, KeptOutcome], processes: int) -> None:
        self._processes = processes
        self._taken: dict[Kind, list[float]] = {}
        for key, outcome in kept.items():
            self.took(jobs[key], outcome.seconds)

    def took(self, job: TrialJob, seconds: float) -> None:
        """A trial is done."""
        self._taken.setdefault(_kind(job), []).append(seconds)

    def left(self, waiting: Iterable[TrialJob]) -> float | None:
        """Seconds for the trials that wait, None while nothing is known."""
        known = [seconds for taken in self._taken.values() for seconds in taken]
        if not known:
            return None
        together = alone = 0.0
        for job in waiting:
            taken = self._taken.get(_kind(job), known)
            seconds = sum(taken) / len(taken)
            together, alone = (together, alone + seconds) if job.alone else (together + seconds, alone)
        return together / self._processes + alone


def _kind(job: TrialJob) -> Kind:
    return (f"{job.measure.__module__}.{job.measure.__qualname__}", job.footage)
