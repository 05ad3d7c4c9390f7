"""The page of verdicts by hand agrees with the numbers that the guide keeps, and with what judges them."""

import ast
import json
import math
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from scipy import stats

from studio.garden.reproduction import claims, verdicts_by_hand
from studio.garden.reproduction.guide_findings import guide_folder
from studio.garden.reproduction.verdicts_by_hand import (
    STUDENT,
    TEN,
    Judged,
    both_sides,
    interval_of_share,
    page,
    rank_correlation,
    recompute,
    spans_of_all_resamples,
)

KINDS = ("ratio", "equality", "sign test", "share", "curve")


def judged(folder: Path) -> dict[str, Judged]:
    return {one.number: one for section in recompute(folder) for one in section.judged}


def kept(name: str) -> dict:
    return json.loads((guide_folder() / f"{name}.json").read_text(encoding="utf-8"))


def number(document: dict, name: str) -> dict:
    return next(entry for entry in document["numbers"] if entry["name"] == name)


def test_the_page_is_made_of_the_kept_numbers_and_agrees_with_the_studio() -> None:
    sections = recompute(guide_folder())
    assert tuple(section.kind for section in sections) == KINDS
    every = [one for section in sections for one in section.judged]
    assert len({one.experiment.partition("-")[0] for one in every}) == 3
    assert {"not reproduced", "reproduced"} < {one.here for one in every}
    for one in every:
        assert one.shown == number(kept(one.experiment), one.number)["verdict"]
        assert one.agrees, one
    written = (guide_folder().parent / "reproduction_by_hand.md").read_text(encoding="utf-8")
    assert written == page(guide_folder()), "run `make guide`"


def test_what_judges_today_gives_the_kept_verdicts_from_the_kept_numbers() -> None:
    """Where the file has every seed's number, or a count: the code's verdict, not only the file's."""
    needs = {
        name: {
            row[0]: [float(cell.strip("> ≤")) for cell in row[1:]] for row in kept(name)["tables"][0]["rows"]
        }
        for name in ("deutscher-full-body", "deutscher-crossover")
    }
    for one in judged(guide_folder()).values():
        shown = number(kept(one.experiment), one.number)
        if one.experiment in needs:
            rows = needs[one.experiment]
            names = ("Eq. 13", "adaptive and crossover")
            if base := one.number.partition("chain: ")[2].removesuffix(", cut by parameters"):
                names = (
                    f"{base}, chain, 10 pictures/s",
                    f"{base}, crossed by parameters, chain, 10 pictures/s",
                )
            ratios = [slow / fast for slow, fast in zip(*(rows[name] for name in names), strict=True)]
            found = claims.saved(one.number, ratios, shown["paper"])
        elif shown["unit"] == "of 1":
            lose = round(shown["ours"] * shown["seeds"])
            held = [seed < lose for seed in range(shown["seeds"])]
            found = claims.share(one.number, held, shown["paper"])
        else:
            continue
        assert found.verdict == shown["verdict"] == one.here
        assert (found.low, found.high) == pytest.approx((shown["low"], shown["high"]), rel=1e-3)


NO_WORSE = {
    "caillette-equation-9",
    "caillette-fig-12",
    "caillette-fig-12-second",
    "caillette-unseen",
    "fleischmann-other-swarms",
    "fleischmann-partitions",
    "fleischmann-parts",
}
"""Where a paper says that something is maintained, or no significant gain: a smaller error is no refutation."""
BOUNDS = {"particles saved by 10 layers instead of 5": 2.0, "spells that end with the limb found again": 0.5}
"""What is claimed to be exceeded, by the beginning of a number's name; else an error's ratio is to be below 1."""

GAINED = "likelihood gained"
"""Beginning of the names of numbers that are claimed to be above 0."""


def possible(entry: dict) -> set[str]:
    """The verdicts that a kept number may have: of the 90 % interval only its middle is known, what was measured."""
    paper, low, high, ours = entry["paper"], entry["low"], entry["high"], entry["ours"]
    if entry["unit"] == "of 1":
        held = round(ours * entry["seeds"])
        as_printed = held if paper == 1.0 else entry["seeds"] - held
        for side, verdict in (("greater", "reproduced"), ("less", "not reproduced")):
            if stats.binomtest(as_printed, entry["seeds"], 0.5, alternative=side).pvalue <= 0.05:
                return {verdict}
        return {"undecided"}
    if paper is None and entry["name"].startswith(GAINED):
        return {"reproduced" if low > 0.0 else "not reproduced" if high <= 0.0 else "undecided"}
    if paper is None:
        bound = next((value for name, value in BOUNDS.items() if entry["name"].startswith(name)), 1.0)
        if entry["better"] == "higher":
            low, high, bound = 1.0 / high, 1.0 / low, 1.0 / bound
        return {"reproduced" if high < bound else "not reproduced" if low >= bound / 1.1 else "undecided"}
    if (entry["better"] == "lower" and high < paper) or (entry["better"] == "higher" and low > paper):
        return {"better"}
    near = (ours >= paper / 1.1 or entry["better"] == "lower") and (
        ours <= paper * 1.1 or entry["better"] == "higher"
    )
    return {"undecided" if low <= paper <= high else "not reproduced", *(["reproduced"] if near else [])}


def test_every_kept_verdict_follows_from_its_numbers() -> None:
    for path in guide_folder().glob("*.json"):
        document = json.loads(path.read_text(encoding="utf-8"))
        if path.name == "before.json":
            continue
        claimed = [entry for entry in document["numbers"] if entry["verdict"] != "answered"]
        verdicts = {entry["verdict"] for entry in claimed} or {"answered"}
        hardest = ("not reproduced", "undecided", "reproduced", "better", "answered")
        assert document["verdict"] == next(one for one in hardest if one in verdicts), path.name
        for entry, line in zip(claimed, document["lines"] if claimed else (), strict=True):
            assert entry["verdict"] in possible(entry), (path.name, entry)
            assert line.endswith(f": {entry['verdict']}"), (path.name, line)
            assert entry["seeds"] >= claims.FEWEST_SEEDS or entry["verdict"] != "reproduced", (
                path.name,
                entry,
            )
            equality = entry["paper"] == 1.0 and entry["unit"] == "×"
            assert not (equality and entry["better"]) or document["name"] in NO_WORSE, (path.name, entry)


def save_half(document: dict) -> None:
    rows = document["tables"][0]["rows"]
    for row in rows:
        if row[0] == "Eq. 13":
            row[1:] = [f"{2.0 * float(cell):g}" for cell in rows[2][1:]]


def make_equal(document: dict) -> None:
    rows = {row[0]: row for row in document["tables"][0]["rows"]}
    for base in ("adaptive, α 0.5", "adaptive, α 0.315"):
        rows[f"{base}, crossed by parameters, chain, 10 pictures/s"][1:] = rows[
            f"{base}, chain, 10 pictures/s"
        ][1:]
        rows[f"{base}, chain, 10 pictures/s"][1:3] = ["64", "45"]
        rows[f"{base}, crossed by parameters, chain, 10 pictures/s"][1:3] = ["63", "46"]


def exchange_signs(document: dict) -> None:
    """At 20 Hz seeds no longer agree, at 60 Hz all do."""
    [signs] = [table for table in document["tables"] if table["title"] == "Sign tests"]
    for row in signs["rows"]:
        row[1] = "6 : 4" if row[0].startswith("swarm, 20 Hz") else "10 : 0"


def lose_half(document: dict) -> None:
    for entry in document["numbers"]:
        if entry["name"].endswith("seeds that lose track"):
            entry["ours"] = 0.5


def gain_by_memory(document: dict) -> None:
    for entry in document["numbers"]:
        if entry["name"].startswith("limb direction, RMS: as printed") and entry["name"].endswith("memory 1"):
            entry.update(ours=90.0, low=80.0, high=99.0)


@pytest.mark.parametrize(
    ("name", "change", "verdicts"),
    [
        ("deutscher-full-body", save_half, {"not reproduced"}),
        ("deutscher-crossover", make_equal, {"reproduced"}),
        ("fleischmann-fig-6", exchange_signs, {"undecided", "not reproduced"}),
        ("caillette-fig-11", lose_half, {"undecided"}),
        ("caillette-fig-13", gain_by_memory, {"reproduced"}),
    ],
)
def test_other_numbers_give_another_verdict_and_another_page(
    tmp_path: Path, name: str, change: Callable[[dict], None], verdicts: set[str]
) -> None:
    folder = tmp_path / "kept"
    shutil.copytree(guide_folder(), folder)
    document = kept(name)
    change(document)
    (folder / f"{name}.json").write_text(json.dumps(document), encoding="utf-8")
    found = [one for one in judged(folder).values() if one.experiment == name]
    assert {one.here for one in found} == verdicts
    assert not any(one.agrees for one in found)
    assert page(folder).count("They do not agree") == len(found)


def test_the_arithmetic_is_that_of_the_books() -> None:
    for percent, reach in STUDENT.items():
        assert reach == pytest.approx(stats.t.ppf(0.5 + percent / 200, TEN - 1), abs=5e-4)
    for nearer in range(11):
        assert both_sides(nearer, 10 - nearer) == pytest.approx(min(1.0, stats.binomtest(nearer, 10).pvalue))
        wanted = stats.binomtest(nearer, 10).proportion_ci(method="exact")
        assert interval_of_share(nearer, 10) == pytest.approx((wanted.low, wanted.high), abs=1e-9)
    assert rank_correlation([3.0, 2.0, 1.0]) == (6, 6, -1.0)
    assert rank_correlation([1.0, 2.0, 3.0]) == (1, 6, 1.0)
    # Two values: 00, 01, 10 and 11, each as likely.
    assert spans_of_all_resamples([0.0, 1.0], (40, 80)) == (3, [(0.5, 0.5), (0.0, 1.0)])
    values = [math.log(value) for value in (1, 2, 3, 5, 8)]
    different, ((low, high),) = spans_of_all_resamples(values, (95,))
    assert different == math.comb(9, 4)
    assert min(values) < low < high < max(values)


def test_nothing_is_shared_with_what_judges() -> None:
    tree = ast.parse(Path(verdicts_by_hand.__file__).read_text(encoding="utf-8"))
    named = {
        name
        for node in ast.walk(tree)
        if isinstance(node, (ast.Import, ast.ImportFrom))
        for name in (
            [node.module] if isinstance(node, ast.ImportFrom) else [entry.name for entry in node.names]
        )
    }
    assert {name for name in named if name.startswith("studio") or "." not in name} - {
        "json", "math", "sys", "collections", "dataclasses", "itertools", "pathlib", "typing"
    } == {"studio.garden.reproduction.guide_findings"}  # fmt: skip
