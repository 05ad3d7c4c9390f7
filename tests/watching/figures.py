"""Figures of a measurement, and what else the machine did meanwhile."""

import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field

import numpy as np
import psutil


@dataclass
class Figures:
    """lines : what was found, in words. wrong : what was shown wrongly, in sentences; times are not judged."""

    lines: list[str] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)

    def times(self, name: str, milliseconds: Sequence[float]) -> None:
        """A line of times: median, 95 % and worst."""
        values = np.array(milliseconds)
        self.lines.append(
            f"{name}: median {np.median(values):.0f} ms, 95 % {np.quantile(values, 0.95):.0f} ms,"
            f" worst {values.max():.0f} ms ({len(values)} times)"
        )

    @contextmanager
    def loaded(self) -> Iterator[None]:
        """A line on the machine while something is measured, which tells how far the times hold for a quiet one."""
        before, began, own = os.getloadavg()[0], psutil.cpu_times(), cpu_seconds(os.getpid())
        clock = time.monotonic()
        yield
        spent, ended = time.monotonic() - clock, psutil.cpu_times()
        busy = sum(getattr(ended, name) - getattr(began, name) for name in ("user", "nice", "system"))
        others = busy - (cpu_seconds(os.getpid()) - own)
        self.lines.append(
            f"machine: {os.cpu_count()} cores, load {before:.1f} before and {os.getloadavg()[0]:.1f} after; other"
            f" programs used {others / spent:.2f} cores"
        )

    def table(self) -> str:
        """All lines."""
        return "\n".join([*self.lines, *(f"WRONG {text}" for text in self.wrong)])


def spent(studio: int) -> tuple[float, float]:
    """Processor seconds of the studio, by its process, and of everything else below this process: the browser."""
    own = cpu_seconds(studio)
    return own, cpu_seconds(os.getpid()) - own


def cpu_seconds(pid: int) -> float:
    """Processor time of a process and all below it, that of children that ended too."""
    total = 0.0
    for process in [psutil.Process(pid), *psutil.Process(pid).children(recursive=True)]:
        with suppress(psutil.Error):
            total += sum(process.cpu_times()[:2])
    return total
