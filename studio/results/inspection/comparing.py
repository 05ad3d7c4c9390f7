"""Two to six stored runs side by side: curves over frames, where their settings differ, the worst frame of each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studio.foundations.errors import RunError
from studio.results.inspection.limbs import disagreements_of, errors_of
from studio.results.inspection.over_frames import summaries
from studio.results.inspection.reading import InspectedRun, no_value
from studio.results.inspection.tables import Column, Row, Table

FEWEST, MOST = 2, 6
DESCRIBED = ("tracker", "weighting", "body", "seed", "first", "last", "fps", "software", "behaviour")
"""Entries of a run's record that count as settings."""


@dataclass(frozen=True, slots=True)
class RunsCompared:
    """Runs side by side.

    runs : as "SESSION/RUN".
    tables : "curves" (by run and frame), "settings" (that differ), "worst" (frame of each run).
    """

    runs: tuple[str, ...]
    tables: tuple[Table, ...]


def compare_stored(runs: Sequence[InspectedRun]) -> RunsCompared:
    """The runs side by side. Raises RunError for fewer than two or more than six, or the same run twice."""
    names = [f"{run.session.name}/{run.run.name}" for run in runs]
    if not FEWEST <= len(runs) <= MOST or len(set(names)) < len(names):
        raise RunError(
            f"{len(set(names))} runs cannot be compared.", f"Name {FEWEST} to {MOST} different runs."
        )
    curves: list[Row] = []
    worst: list[Row] = []
    for name, run in zip(names, runs, strict=True):
        own = _curve(name, run)
        curves += own
        worst.append(_worst(name, own))
    run_column = Column("run", "Run")
    frame, error = Column("frame", "Frame"), Column("error", "Mean error", "mm")
    worst_limb, share = Column("limb", "Worst limb"), Column("disagreement", "Largest disagreement")
    return RunsCompared(
        tuple(names),
        (
            Table(
                "curves",
                "By run and frame",
                (
                    run_column,
                    frame,
                    error,
                    Column("limb_error", "Error of the worst limb", "mm"),
                    worst_limb,
                    share,
                    Column("log_weight", "Log weight", "nats"),
                    Column("effective", "Effective number, last layer"),
                    Column("milliseconds", "Time", "ms"),
                ),
                curves,
            ),
            Table(
                "settings",
                "Settings that differ",
                (Column("setting", "Setting"), *(Column(name, name) for name in names)),
                _differing(runs),
            ),
            Table("worst", "Worst frame of each run", (run_column, frame, error, worst_limb, share), worst),
        ),
    )


def _curve(name: str, run: InspectedRun) -> list[Row]:
    errors, shares, by_frame = errors_of(run), disagreements_of(run), summaries(run)
    with run.run.results() as results:
        line = results.timeline()
    table: list[Row] = []
    for at, number in enumerate(line.frames.tolist()):
        off = {limb: mm for limb, mm in errors.get(number, {}).items() if np.isfinite(mm)}
        share = shares.get(number, {})
        limb = max(off or share, key=lambda one: (off or share)[one]) if off or share else ""
        table.append(
            (
                name,
                number,
                float(np.mean(list(off.values()))) if off else None,
                off[limb] if off else None,
                limb,
                max(share.values()) if share else None,
                no_value(float(line.log_weights[at])),
                no_value(float(by_frame[number].effective[-1])) if number in by_frame else None,
                float(line.milliseconds[at]),
            )
        )
    return table


def _worst(name: str, curve: list[Row]) -> Row:
    """The frame with the largest error; without a truth with the largest disagreement, else the least log weight."""
    if not curve:
        return (name, None, None, "", None)

    def badness(row: Row) -> tuple[float, float, float]:
        error, share, weight = (float("-inf") if row[at] is None else float(str(row[at])) for at in (3, 5, 6))
        return error, share, -weight

    worst = max(curve, key=badness)
    return (name, worst[1], worst[2], worst[4], worst[5])


def _differing(runs: Sequence[InspectedRun]) -> list[Row]:
    """Settings, by name, in which any two of the runs differ; None where a run has no such setting."""
    known: list[dict[str, object]] = []
    for run in runs:
        record, history = run.run.record, run.history.entries
        entries: dict[str, object] = {name: getattr(record, name) for name in DESCRIBED}
        entries["changes while tracking"] = max(len(history) - 1, 0)
        known.append(entries | dict(history[-1].values if history else record.settings))
    table: list[Row] = []
    for name in dict.fromkeys(name for entries in known for name in entries):
        values = [entries.get(name) for entries in known]
        if any(value != values[0] for value in values[1:]):
            table.append(
                (name, *(value if isinstance(value, bool | int | float | str) else None for value in values))
            )
    return table
