"""`studio/SCALE.md`, from the figures of `garden.benchmarks.growth`: a thousand hours of footage on many machines."""

from collections.abc import Mapping
from typing import Any

HOURS, FPS = 1000, 60
MACHINES, CORES = (1, 10, 100), 16
"""Machines that are reckoned with, and cores of each."""


def document(measured: Mapping[str, Any], machine: str = "") -> str:
    """The page. found : as `growth.as_json` makes it. machine : it in words; default: its cores and system."""
    about, usual = measured["machine"], measured["usual_frame"]
    words = machine or f"a machine with {about['cores']} cores ({about['system']})"
    frames = HOURS * 3600 * FPS
    hours = usual["busy"] * frames / 3600
    rows = [_row(count, hours, usual, frames) for count in MACHINES]
    return "\n".join(
        [
            "# How cost grows",
            "",
            f"Made by `make growth` on {words}; figures are ratios, or of that machine.",
            "",
            "| size | from | to | cost of | grows | exponent | memory |",
            "|---|---|---|---|---|---|---|",
            *(_curve(row) for row in measured["curves"]),
            "",
            "An exponent is the slope of log time over log size at the upper half of the sizes (asked: at most 1.05);"
            " times are of all threads together. Memory is the peak of the largest size over that of the one before.",
            "",
            f"## {HOURS} hours of footage, {usual['cameras']:.0f} cameras at {FPS} Hz",
            "",
            f"A frame of the bundled walk ({usual['cameras']:.0f} × 640 × 480, default tracker) costs"
            f" {1e3 * usual['busy']:.0f} ms of one core there, all stages together; {frames:,} frames are"
            f" {hours:,.0f} hours of one such core. A session is one task (`studio batch`), tasks do not speak with one"
            f" another, so N machines of {CORES} such cores need:",
            "",
            "| machines | days | Mbit/s from the store | to it, all particles | to it, the last set of a frame |",
            "|---|---|---|---|---|",
            *rows,
            "",
            f"Footage is reckoned at the walk's {usual['footage'] * FPS * 8 / 1e6 / usual['cameras']:.1f} Mbit/s a"
            f" camera; all of it is {usual['footage'] * frames / 1e12:,.1f} TB. Runs with every layer's particles are"
            f" {usual['stored'] * frames / 1e12:,.1f} TB, with `--set record_particles=0`"
            f" {usual['stored_few'] * frames / 1e12:,.1f} TB: many machines at one store want the latter. Sessions are"
            " best minutes, not hours long: the last ones end later than the rest, by at most one session.",
            "",
        ]
    )


def _row(machines: int, hours: float, usual: Mapping[str, float], frames: int) -> str:
    seconds = hours * 3600 / (machines * CORES)
    rates = (
        f"{usual[name] * frames * 8 / 1e6 / seconds:,.0f}" for name in ("footage", "stored", "stored_few")
    )
    return f"| {machines} | {seconds / 86400:,.2f} | {' | '.join(rates)} |"


def _curve(row: Mapping[str, Any]) -> str:
    memory = "" if row["memory_growth"] is None else f"× {row['memory_growth']:.2f}"
    growth = row["seconds"][-1] / row["seconds"][0]
    return (
        f"| {row['name']} | {row['sizes'][0]:,} | {row['sizes'][-1]:,} | {row['per']} | × {growth:,.1f} |"
        f" {row['exponent']:.2f} | {memory} |"
    )
