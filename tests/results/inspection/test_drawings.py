"""The views as they are drawn: what was tried stands beside what is stored, with the numbers of both."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from drawings import Drawings, clouds_of
from planted_runs import FEWER_PARTICLES, FRAME, LAYERS, MORE_LAYERS, PARTICLES

from studio.results.evaluation.errors import lost_mm
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.seeds import search_seeds
from studio.results.inspection.tables import Selection, Viewed
from studio.results.inspection.views import VIEWS, look, look_over
from studio.results.uncertainty import view as uncertainty_view
from studio.results.uncertainty.half_widths import RunUncertainty, uncertainty_of
from studio.results.uncertainty.twin import TwinErrors, points_of

pytestmark = pytest.mark.browser

PARAMETER = "left_knee_ry"
BOTH = "stored and tried"
Series = list[dict]
Numbers = list[float | None]


@pytest.fixture(scope="module", autouse=True)
def searched(run: InspectedRun, tried: InspectedRun) -> None:
    """View `seeds` has numbers once they were computed."""
    for one in (run, tried):
        search_seeds(one, FRAME, 2, lambda *_: None)


def drawn_of(drawings: Drawings, view: str, *sides: InspectedRun) -> dict:
    """A view of the frame, of one side or of both."""
    selection = Selection(parameter=PARAMETER) if view in ("clouds", "landscape") else Selection()
    found = [viewed(side, view, selection) for side in sides]
    of = "run" if view == "coverage" else "frame"
    return drawings.draw(view, *found, frame=FRAME, of=of, selection=selection)


def viewed(run: InspectedRun, view: str, selection: Selection) -> Viewed:
    """A view's tables as the page takes them together."""
    if view == "coverage":
        return look_over(run, view, selection)
    found = look(run, FRAME, view, selection)
    if view == "why":
        of_run = look_over(run, view, selection)
        return Viewed((*found.tables, *of_run.tables), search_layers=found.search_layers, searches=1)
    if view == "clouds":
        return clouds_of(run, FRAME, selection)
    return found


def cells(series: Series, side: int) -> Numbers:
    """The third numbers of the cells of a split map."""
    return [cell[2] for one in series if one.get("name") == BOTH for cell in one["data"] if cell[3] == side]


def points(series: Series, name: str, kind: str = "line") -> list[Numbers]:
    """The data of the series of a name; of points with a place their height."""
    return [
        [entry["value"] if isinstance(entry, dict) else entry for entry in one["data"]]
        for one in series
        if (one.get("name"), one["type"]) == (name, kind)
    ]


def heights(places: list) -> Numbers:
    return [place[1] for place in places]


def check_variance(series: Series, stored: Viewed, tried: Viewed) -> None:
    first = {row["parameter"]: row["first"] for row in stored.table("settled").records()}
    for side, answer in enumerate((stored, tried)):
        wanted = [
            math.log10(row[key] / first[row["parameter"]])  # type: ignore[operator]
            for key in ("before", "after")
            for row in answer.table("layers").records()
            if row[key]
        ]
        assert cells(series, side) == pytest.approx(wanted)


def check_schedule(series: Series, stored: Viewed, tried: Viewed) -> None:
    for key, name in (
        ("beta", "tried"),
        ("alpha_reached", "tried, reached"),
        ("effective", "tried, effective"),
    ):
        assert tried.table("layers").column(key) in points(series, name), key
    (reached,) = points(series, "stored, reached")
    assert reached == stored.table("layers").column("alpha_reached") + [None] * (MORE_LAYERS - LAYERS)


def check_genealogy(series: Series, stored: Viewed, tried: Viewed) -> None:
    sets = points(series, "tried", "scatter")
    assert [len(one) for one in sets] == [MORE_LAYERS * FEWER_PARTICLES]
    assert tried.table("ancestors").column("ancestors") in points(series, "tried, ancestors")
    assert [len(one) for one in points(series, "stored", "scatter")] == [LAYERS * PARTICLES]


def check_weights(series: Series, stored: Viewed, tried: Viewed) -> None:
    for name, answer in (("stored", stored), ("tried", tried)):
        known = [weight for weight in answer.table("sorted").column("weight") if weight]
        assert known in [heights(one) for one in points(series, name) if isinstance(one[0], list)], name
        largest = answer.table("layers").column("largest")
        assert any(one[: len(largest)] == largest for one in points(series, name)), name


def check_clouds(series: Series, stored: Viewed, tried: Viewed) -> None:
    named = {one.get("name") for one in series if one["type"] == "custom"}
    assert {f"tried, {layer + 1}" for layer in range(MORE_LAYERS)} <= named
    assert not {f"{layer + 1}" for layer in range(LAYERS, MORE_LAYERS)} & named


def check_coupling(series: Series, stored: Viewed, tried: Viewed) -> None:
    for side, answer in enumerate((stored, tried)):
        assert cells(series, side) == [
            one for one in answer.table("matrix").column("correlation") if one is not None
        ]
    assert {len(one) for one in points(series, "tried", "scatter")} == {FEWER_PARTICLES}


def check_survivors(series: Series, stored: Viewed, tried: Viewed) -> None:
    for name, answer in (("stored", stored), ("tried", tried)):
        alive = [row["particle"] for row in answer.table("particles").records() if row["survives"]]
        (lines,) = [one["data"] for one in series if (one["type"], one["name"]) == ("parallel", name)]
        assert sorted(line["row"]["particle"] for line in lines) == alive, name
    by_parameter = {row["parameter"]: row["difference"] for row in tried.table("difference").records()}
    (bars,) = [one["data"] for one in series if (one["type"], one["name"]) == ("bar", "tried")]
    assert [bar["value"] for bar in bars] == [by_parameter[bar["row"]["parameter"]] for bar in bars]


def check_landscape(series: Series, stored: Viewed, tried: Viewed) -> None:
    for name, answer in (("stored", stored), ("tried", tried)):
        (curve,) = points(series, name)
        assert heights(curve) == answer.table("slice").column("log_weight"), name


def check_blame(series: Series, stored: Viewed, tried: Viewed) -> None:
    for side, answer in enumerate((stored, tried)):
        nats = answer.table("matrix").column("difference")
        [(level, _)] = answer.table("scale").rows
        wanted = [
            math.copysign(math.log10(1.0 + abs(float(str(one))) / float(str(level))), float(str(one)))
            for one in nats
        ]
        assert cells(series, side) == pytest.approx(wanted)


def check_modes(series: Series, stored: Viewed, tried: Viewed) -> None:
    bars = [
        bar for one in series for bar in one["data"] if isinstance(bar, dict) and bar.get("side") == "tried"
    ]
    wanted = {(row["layer"], row["mode"]): row["mass"] for row in tried.table("layers").records()}
    assert {(bar["row"]["layer"], bar["row"]["mode"]): bar["value"] for bar in bars if "row" in bar} == wanted


def check_seeds(series: Series, stored: Viewed, tried: Viewed) -> None:
    for kind in ("within", "between"):
        (bars,) = points(
            series, f"tried, {kind} a seed" if kind == "within" else "tried, between seeds", "bar"
        )
        assert bars == tried.table("limbs").column(kind)
    (dots,) = points(series, "tried", "scatter")
    assert heights(dots) == tried.table("seeds").column("log_weight")


def check_coverage(series: Series, stored: Viewed, tried: Viewed) -> None:
    (arrows,) = [one["data"] for one in series if one["type"] == "lines"]
    ends = [
        [[row["spread"], row["error"]] for row in answer.table("frames").records() if row["frame"] == FRAME]
        for answer in (stored, tried)
    ]
    assert [arrow["coords"] for arrow in arrows] == [list(pair) for pair in zip(*ends, strict=True)]


def check_why(series: Series, stored: Viewed, tried: Viewed) -> None:
    for side, answer in enumerate((stored, tried)):
        assert cells(series, side) == answer.table("limbs").column("error")
    limbs = {one["name"] for one in series if str(one.get("name")).endswith(", tried")}
    assert limbs
    for name in limbs:
        own = [row for row in tried.table("nearest").records() if f"{row['limb']}, tried" == name]
        assert points(series, name) == [[row["nearest"] for row in own]]


CHECKS: dict[str, Callable[[Series, Viewed, Viewed], None]] = {
    "variance": check_variance,
    "schedule": check_schedule,
    "genealogy": check_genealogy,
    "weights": check_weights,
    "clouds": check_clouds,
    "coupling": check_coupling,
    "survivors": check_survivors,
    "landscape": check_landscape,
    "blame": check_blame,
    "modes": check_modes,
    "seeds": check_seeds,
    "coverage": check_coverage,
    "why": check_why,
}


def test_all_views_are_drawn_here() -> None:
    """All but that of the uncertainty, beside which nothing is tried."""
    assert list(CHECKS) == [name for name in VIEWS if name != "uncertainty"]
    assert len(CHECKS) == 13


def test_half_widths_and_how_often_they_hold_are_drawn(
    drawings: Drawings, run: InspectedRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    count, size = 100, len(points_of(run.body))
    errors = np.random.default_rng(1).standard_normal((count, size, 3)) * np.linspace(1.0, 9.0, size)[:, None]
    twin = TwinErrors(errors, np.tile(np.eye(3), (count, size, 1, 1)), ())
    known = RunUncertainty(uncertainty_of(run.body, twin, "raw", ""), "", ("Measured.",))
    monkeypatch.setattr(uncertainty_view, "kept_uncertainty", lambda run: known)
    answer = look_over(run, "uncertainty", Selection())
    series = drawings.draw("uncertainty", answer, frame=FRAME, of="run", selection=Selection())["series"]
    for level in (50, 80, 95):
        (line,) = points(series, f"{level} %")
        assert line == answer.table("joints").column(f"within_{level}")
    path = answer.table("path").records()
    (height,) = points(series, "z")
    assert height == [row["z"] for row in path]
    areas = [one["data"] for one in series if one.get("areaStyle")]
    assert areas == [[2.0 * row["half_width"] for row in path]] * 3
    (found,) = points(series, "drawn again", "scatter")
    rows = answer.table("coverage").records()
    assert found == [[row["promised"], row["found"]] for row in rows]
    (true,) = points(series, "truth", "scatter")
    assert true == [[row["promised"], row["true"]] for row in rows]


@pytest.mark.parametrize("view", CHECKS)
def test_a_trial_is_drawn_beside_the_stored(
    drawings: Drawings, run: InspectedRun, tried: InspectedRun, view: str
) -> None:
    alone, both = (drawn_of(drawings, view, *sides) for sides in ((run,), (run, tried)))
    selection = Selection(parameter=PARAMETER) if view in ("clouds", "landscape") else Selection()
    CHECKS[view](both["series"], viewed(run, view, selection), viewed(tried, view, selection))
    assert both["series"] != alone["series"]
    assert both["words"] != alone["words"] or view in ("blame", "seeds", "coverage", "why")


@pytest.mark.slow
def test_colours_of_maps_mean_the_same_in_every_frame(
    drawings: Drawings, run: InspectedRun, tried: InspectedRun
) -> None:
    for view in ("variance", "coupling", "blame", "why"):
        scales = []
        for frame, side in ((1, run), (FRAME, run), (FRAME, tried)):
            found = [look(side, frame, view, Selection())]
            if view == "why":
                found.append(look_over(side, view, Selection()))
            whole = Viewed(
                tuple(table for one in found for table in one.tables), search_layers=LAYERS, searches=1
            )
            drawn = drawings.draw(view, whole, frame=frame, written=frame == FRAME and side is run)
            scales.append([(one["min"], one["max"], one["text"]) for one in drawn["scales"]])
        assert scales[0] == scales[1] == scales[2], view
    mm = 2.0 * lost_mm(run.body)
    assert scales[0] == [(0.0, mm, [f"≥ {mm:g} mm", "0 mm"])]


def test_every_limb_of_coverage_is_in_its_legend(drawings: Drawings, run: InspectedRun) -> None:
    drawn = drawings.draw(
        "coverage", look_over(run, "coverage", Selection()), frame=FRAME, of="run", written=True
    )
    limbs = {str(limb) for limb in look_over(run, "coverage", Selection()).table("frames").column("limb")}
    dots = {one["name"] for one in drawn["series"] if one["type"] == "scatter"}
    assert dots == limbs
    assert set(drawn["legends"][0]["data"]) == limbs
    assert limbs <= set(drawn["texts"])
