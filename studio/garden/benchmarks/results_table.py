"""The benchmark as a table: a row a figure, beside what is aimed at, with a bar; and the history of earlier ones.

Figures depend on the machine, which is printed with them. A ratio to a limit that was measured in the same run depends
on it less.
"""

import json
import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from studio.foundations.numba_in_threads import numba
from studio.foundations.typed_decoding import is_table
from studio.sessions.workspace import workspace_root

BAR = 20
"""Characters of a full bar: the aim is reached."""
HISTORY = "bench-history.jsonl"
LESS, MORE = "less", "more"


@dataclass(frozen=True, slots=True)
class Measure:
    """A row: its words, where its figure stands in the document (keys), and the aim. better : LESS or MORE. limit :
    where the limit that was measured with it stands; of_limit : the aim is a part of that.
    """

    name: str
    figure: tuple[str, ...]
    unit: str
    aim: float
    better: str = MORE
    limit: tuple[str, ...] = ()
    scale: float = 1.0
    of_limit: bool = False


def _kernel(name: str, key: str, aim: float) -> Measure:
    """The row of a kernel, on one thread: as much as can be of what the loads, spans and counts alone take."""
    figure, limit = ("others_evaluations_per_second", key), ("limits_per_second", key)
    return Measure(name, figure, "M/s", aim, limit=limit, scale=1e-6, of_limit=True)


def _on_card(name: str, figure: tuple[str, ...], unit: str, aim: float, better: str = MORE) -> Measure:
    """A row of a graphics card, beside its limit where one was measured: loads of single bytes, empty launches."""
    limit = {"M/s": ("gpu", "card", "loads_allow_M_per_s"), "ms": ("gpu", "card", "launches_take_ms")}
    return Measure(f"card: {name}", ("gpu", *figure), unit, aim, better, limit.get(unit, ()))


MEASURES = (
    Measure(
        "edge + region (limit: bare row-major loads)",
        ("edge_region", "evaluations_per_second"),
        "M/s",
        0.85,
        limit=("edge_region", "load_limit_per_second"),
        scale=1e-6,
        of_limit=True,
    ),
    Measure("edge + region, two threads over one", ("edge_region", "two_threads"), "×", 1.85),
    _kernel("edge + region, occlusion-aware", "edge_region_occlusion_aware", 0.6),
    Measure(
        "edge + region + silhouette, half resolution",
        ("others_evaluations_per_second", "edge_region_silhouette_half"),
        "M/s",
        0.35,
        limit=("limits_per_second", "edge_region_silhouette_half"),
        scale=1e-6,
    ),
    _kernel("edge + region + silhouette, full", "edge_region_silhouette_full", 0.7),
    _kernel("edges + silhouette, half resolution", "edge_silhouette_half", 0.7),
    _kernel("edges + silhouette, full", "edge_silhouette_full", 0.7),
    _kernel("template", "template", 0.7),
    Measure(
        "the benchmark's own weighting",
        ("others_evaluations_per_second", "bodytrack"),
        "M/s",
        0.57,
        limit=("limits_per_second", "bodytrack"),
        scale=1e-6,
    ),
    _on_card("edge + region, 100 000 poses there", ("resident", "100000", "two_M_per_s"), "M/s", 70.0),
    _on_card("three terms, 100 000 poses there", ("resident", "100000", "three_M_per_s"), "M/s", 40.0),
    _on_card("three terms, 100 000 poses here", ("called", "100000"), "M/s", 20.0),
    Measure(
        "card: the benchmark's score, 100 000 poses here",
        ("gpu", "score_called", "100000"),
        "M/s",
        20.0,
        MORE,
    ),
    _on_card("annealed 10 × 10 000, a frame", ("frame_ms", "10000", "frame"), "ms", 15.0, LESS),
    _on_card("annealed 10 × 100 000, a frame", ("frame_ms", "100000", "frame"), "ms", 60.0, LESS),
    _on_card("64 runs of 10 × 100, times one", ("many_runs", "times_one"), "×", 20.0),
    _on_card("64 seeds with records, times one", ("seeds_together", "times_one"), "×", 10.0),
    _on_card("swarm of 10 000 evaluations, a frame", ("swarm_ms", "frame"), "ms", 40.0, LESS),
    _on_card("tempered of 10 000 evaluations, a frame", ("tempered_ms", "frame"), "ms", 40.0, LESS),
    _on_card("largest difference of a log-weight", ("agreement", "largest"), "", 1e-3, LESS),
    _on_card("largest difference of a benchmark's score", ("score_agreement", "largest"), "", 1e-3, LESS),
    Measure("a whole frame, default tracker", ("frames", "default", "ms"), "ms", 25.0, LESS),
    Measure("of it refinement, one thread", ("frames", "default", "refinement_ms"), "ms", 5.0, LESS),
    Measure("a whole frame, improved filter 10 × 200", ("frames", "improved", "ms"), "ms", 16.7, LESS),
    Measure("a whole frame, swarm 1000", ("frames", "swarm", "ms"), "ms", 16.7, LESS),
    Measure("a whole frame of the benchmark's", ("frames", "bodytrack", "ms"), "ms", 7.5, LESS),
    Measure("live, scene open, 30 Hz", ("live", "scene_open", "frames_per_second"), "/s", 30.0),
    Measure("live frames dropped", ("live", "scene_open", "dropped_share"), "%", 0.1, LESS, scale=100.0),
    Measure(
        "live, picture to pose, 95 % of frames", ("live", "scene_open", "latency_ms", "p95"), "ms", 60.0, LESS
    ),
    Measure(
        "live, idle share of all cores", ("live", "scene_open", "idle_share"), "%", 33.0, MORE, scale=100.0
    ),
    Measure("live, growth of memory", ("live", "scene_open", "memory_growth"), "%", 5.0, LESS, scale=100.0),
    Measure("a live frame on one core", ("live", "frame_ms"), "ms", 12.0, LESS),
    Measure("slider to new cloud, server", ("reannealing", "median_ms"), "ms", 20.0, LESS),
    Measure("demo to first frame, all to be compiled", ("start", "cold_s"), "s", 15.0, LESS),
    Measure("demo to first frame, compiled before", ("start", "warm_s"), "s", 4.0, LESS),
)


def rows_of(document: Mapping[str, Any]) -> list[dict[str, object]]:
    """A row for each of the MEASURES that the document holds. reached : 1 where the aim is, less below it. limit,
    of_limit : what was measured in the same run and the ratio to it, None where there is none.
    """
    rows: list[dict[str, object]] = []
    for measure in MEASURES:
        figure = _at(document, measure.figure)
        if figure is None:
            continue
        value, limit = measure.scale * figure, _at(document, measure.limit) if measure.limit else None
        of_limit = None if limit is None else figure / limit
        judged = of_limit if measure.of_limit and of_limit is not None else value
        ratio = judged / measure.aim if measure.better == MORE else measure.aim / max(judged, 1e-9)
        if measure.better == LESS and judged <= measure.aim:
            ratio = 1.0
        rows.append(
            {
                "name": measure.name,
                "value": round(value, 3),
                "unit": measure.unit,
                "better": measure.better,
                "aim": measure.aim,
                "aim_of_limit": measure.of_limit,
                "reached": round(min(ratio, 1.0), 3),
                "limit": None if limit is None else round(measure.scale * limit, 3),
                "of_limit": None if of_limit is None else round(of_limit, 3),
            }
        )
    return rows


def in_lines(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """The rows for a person, with a bar that is full where the aim is reached."""
    lines = [f"{'':46}{'now':>10}{'limit':>10}{'of limit':>10}{'aim':>18}"]
    for row in rows:
        full = round(BAR * row["reached"])
        unit = "of limit" if row["aim_of_limit"] else row["unit"]
        aim = f"{'≤' if row['better'] == LESS else '≥'} {row['aim']:g} {unit}".strip()
        limit, ratio = ("", "") if row["limit"] is None else (f"{row['limit']:.3g}", f"{row['of_limit']:.2f}")
        value = f"{row['value']:.3g} {row['unit']}".strip()
        bar = f"{'█' * full}{'░' * (BAR - full)}"
        lines.append(f"{row['name']:46}{value:>10}{limit:>10}{ratio:>10}{aim:>18}  {bar}")
    return lines


@dataclass(frozen=True, slots=True)
class Machine:
    """Where figures were measured. load : processes that wanted a core in the last minute when it began."""

    processor: str
    cores: int
    threads: int
    system: str
    python: str
    numba: str
    load: float


def this_machine() -> Machine:
    return Machine(
        _processor(),
        os.cpu_count() or 1,
        int(numba.get_num_threads()),
        f"{platform.system()} {platform.machine()}",
        platform.python_version(),
        str(numba.__version__),
        round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else -1.0,
    )


def remember(machine: Machine, rows: Sequence[Mapping[str, object]], place: Path | None = None) -> Path:
    """Append the rows to the history, a JSON line a run; returns its file, by default beside the workspace."""
    place = place or history_file()
    place.parent.mkdir(parents=True, exist_ok=True)
    entry = {
        "when": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": asdict(machine),
        "rows": rows,
    }
    with place.open("a", encoding="utf-8") as file:
        file.write(json.dumps(entry) + "\n")
    return place


def history_file() -> Path:
    """Where earlier results stand."""
    return workspace_root().parent / HISTORY


def _processor() -> str:
    """The processor's name; Linux says it in a file only."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _at(document: Mapping[str, Any], keys: Sequence[str]) -> float | None:
    value: Any = document
    for key in keys:
        if not is_table(value) or key not in value:
            return None
        value = value[key]
    return float(value)
