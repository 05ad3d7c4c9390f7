"""The papers' experiments, as `operations.experiments` wants them."""

from pathlib import Path

from studio.foundations.progress import Progress
from studio.garden.reproduction import runner
from studio.garden.reproduction.catalogue import EXPERIMENTS as KNOWN
from studio.garden.reproduction.catalogue import find_experiments
from studio.garden.reproduction.plan import scale_of
from studio.operations.experiments import ExperimentLine, TrialCounts


class PapersExperiments:
    """Those of the catalogue."""

    def lines(self) -> tuple[ExperimentLine, ...]:
        """All of them, in the order of the report."""
        return tuple(
            ExperimentLine(one.name, one.title, one.source, one.claim, bool(getattr(one, "long", "")))
            for one in KNOWN.values()
        )

    def reproduce(
        self, name: str, out: Path, *, quick: bool, seeds: int | None, progress: Progress
    ) -> TrialCounts:
        """Run what is missing of an experiment, or of ALL, into the folder `out`. Raises NotFoundError, RunError."""
        ran = runner.reproduce(
            find_experiments(name), out, scale_of(seeds, quick), progress, catalogue=tuple(KNOWN.values())
        )
        return TrialCounts(ran.measured, ran.kept, ran.failed)


EXPERIMENTS = PapersExperiments()
