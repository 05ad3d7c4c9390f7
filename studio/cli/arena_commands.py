"""`studio arena`: problems listed and exported, optimisers raced."""

from dataclasses import asdict

import click

from studio.cli.deriving import Call, command_of
from studio.foundations.words import counted
from studio.operations.arena import Exported, Raced, export, problem_line, problems, race, racers
from studio.results.arena.problem import Problem


@click.group("arena")
def arena_command() -> None:
    """Race optimisers on frames as black-box problems: the bundled ones, or those of any run."""


@command_of(problems, name="list")
def list_command(call: Call) -> dict[str, object]:
    listed: tuple[Problem, ...] = call()
    lines = [problem_line(one) for one in listed]
    words = [
        f"{one.name:28} {one.kind:5} {one.dimensions:>3} parameters  {one.weighting:22} {one.about}"
        for one in lines
    ]
    members = [{"name": one.name, "label": one.label} for one in racers()]
    words.append(f"Racers: {', '.join(one['name'] for one in members)}; or a Python file of your own.")
    return {"problems": [asdict(one) for one in lines], "racers": members, "text": "\n".join(words)}


@command_of(export)
def export_command(call: Call) -> dict[str, object]:
    done: Exported = call()
    words = f"{done.file} ({done.size / 1e6:.2f} MB): {counted(len(done.problems), 'problem')}."
    return {
        "file": str(done.file),
        "problems": list(done.problems),
        "bytes": done.size,
        "text": f"{words} Race on it with: studio arena race --file {done.file}",
    }


@command_of(race)
def race_command(call: Call) -> dict[str, object]:
    done: Raced = call()
    findings = done.document["findings"]
    tables = {table["title"]: table for table in findings["tables"]}
    lines = [findings["words"]]
    for title, table in tables.items():
        if title != "Problems":
            lines += ["", title, *_aligned([table["columns"], *table["rows"]])]
    lines += ["", f"{counted(done.measured, 'trial')} run, {done.kept} kept from before: {done.folder}"]
    return {
        **findings,
        "folder": str(done.folder),
        "measured": done.measured,
        "kept": done.kept,
        "text": "\n".join(lines),
    }


def _aligned(rows: list[list[object]]) -> list[str]:
    words = [["" if cell is None else str(cell) for cell in row] for row in rows]
    widths = [max(len(row[at]) for row in words) for at in range(len(words[0]))]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in words
    ]


for _one in (list_command, export_command, race_command):
    arena_command.add_command(_one)
