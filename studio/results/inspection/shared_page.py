"""A run as one page that opens without the studio: its settings, the views of its search, the body moving in 3-D.

Everything is inside the file: numbers, drawings (those of the studio's own pages) and type. Its size is bounded: of a
long run the page has some frames, evenly chosen, the one that is looked into among them.
"""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import limb_ends
from studio.body.model import extremities
from studio.body.motion_files.trc import read_trc
from studio.foundations.arrays import Array
from studio.foundations.errors import NotFoundError, RunError, SessionError, StudioError
from studio.foundations.geometry.camera import Camera
from studio.foundations.package import software_version
from studio.foundations.progress import Progress, no_progress
from studio.results.evaluation.errors import Evaluation, evaluate
from studio.results.inspection.reading import InspectedRun, no_value
from studio.results.inspection.tables import Selection, Table, Viewed
from studio.results.inspection.views import look, look_over, view_named
from studio.results.self_contained import self_contained_page
from studio.results.uncertainty.half_widths import kept_uncertainty
from studio.runs.notes import notes_by_frame
from studio.runs.tracks import RAW, read_track
from studio.search.settings import all_knobs, settings_from_values, values
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.tracker import Tracker
from studio.sessions.manifest import now

MOST_CLOUDS, MOST_PARTICLES = 12, 200
"""Frames whose particles are in the page, and particles of a layer: evenly chosen of more."""
MOST_FRAMES = 800
"""Frames whose numbers and bodies are in the page."""
DIGITS = 6
CAMERA_DEPTH = 350.0
"""Length of a drawn camera, mm."""
OVER_RUN, OF_FRAME = ("why", "variance", "schedule"), ("variance", "schedule")

FRAME_COLUMNS = (
    ("frame", "Frame", ""), ("error_mm", "Error of the markers", "mm"), ("log_weight", "Log weight", ""),
    ("milliseconds", "Time", "ms"), ("evaluations", "Evaluations", ""), ("tracking", "The search's own state", ""),
    ("lost", "Limb lost (truth)", ""), ("overlap", "Share of the body in the masks", ""),
)  # fmt: skip

SCRIPT = """import { showSharedRun } from "js/shared_run.js";
showSharedRun(JSON.parse(document.getElementById("data").textContent));"""
BODY = """<header class="shared-head"><div id="heading"></div>
<button type="button" id="theme" aria-label="Light or dark" title="Light or dark">◐</button></header>
<main id="shared"><p>This page is drawn by a script; allow scripts for this file to read it.</p></main>
<div id="toasts" role="status"></div>"""


@dataclass(frozen=True, slots=True)
class _Shown:
    """What the page is of. frames : (K,) those that it has, all of the run's or some. frame : that is looked into."""

    run: InspectedRun
    track: str
    frame: int
    frames: NDArray[np.int64]
    whole: int


def shared_page(
    run: InspectedRun,
    frame: int,
    *,
    track: str = "",
    clouds: Sequence[int] = (),
    progress: Progress = no_progress,
) -> str:
    """The page's text. frame : that is looked into. track : whose poses are drawn and measured, the search's own by
    default. clouds : frames whose particles are in the page, beside those of `frame`; at most MOST_CLOUDS.

    Raises RunError for a run without frames, NotFoundError for a frame or track that it does not have.
    """
    finished = run.frames()
    if not finished:
        raise RunError(f"Run '{run.run.name}' has no finished frame.", "Track it first.")
    if frame not in finished:
        raise NotFoundError(
            f"Run '{run.run.name}' has no finished frame {frame}.", f"It has {finished[0]} to {finished[-1]}."
        )
    searched = sorted({frame, *clouds})
    if len(searched) > MOST_CLOUDS or not set(searched) <= set(finished):
        raise RunError(
            f"The particles of frames {', '.join(map(str, clouds))} cannot be in the page.",
            f"Name at most {MOST_CLOUDS - 1} finished frames; they are {finished[0]} to {finished[-1]}.",
        )
    shown = _Shown(run, track or RAW, frame, _some(finished, *searched), len(finished))
    figures: list[dict[str, Any]] = []
    over_run = (*OVER_RUN, "uncertainty") if _has_half_widths(run) else OVER_RUN
    total = 2 + len(over_run) + len(OF_FRAME)
    parameter = _most_settled(look(run, frame, "variance", Selection()))
    for done, name in enumerate(over_run):
        progress(f"view {name}", done, total)
        selection = Selection(track=track, parameter=parameter)
        figures.append(_figure(shown, name, look_over(run, name, selection), None))
    for done, name in enumerate(OF_FRAME, len(over_run)):
        progress(f"view {name} of frame {frame}", done, total)
        figures.append(_figure(shown, name, look(run, frame, name, Selection(track=track)), frame))
    progress("why", total - 2, total)
    why = _why(shown)
    progress("page", total - 1, total)
    record = run.run.record
    return self_contained_page(
        title=f"{run.session.name} / {run.run.name}",
        kind="shared",
        styles=("page.css", "views.css", "shared.css"),
        entries=("js/shared_run.js",),
        body=BODY,
        data={
            "session": run.session.name,
            "run": run.run.name,
            "caption": run.caption(),
            "made": f"{now()[:16].replace('T', ' ')} UTC, Capture studio {software_version()}",
            "facts": _facts(shown),
            "settings": _settings(run),
            "notes": [*record.notes, *_remarks(shown), *_left_out(shown)],
            "fps": record.fps,
            "frame": frame,
            "parameter": parameter,
            "parameters": [{"name": one.name, "label": one.label} for one in run.body.parameters],
            "score": list(TRACKERS.get(record.tracker, Tracker).score),
            "scene": _scene(shown),
            "clouds": [_cloud(run, one) for one in searched],
            "figures": [_over_frames(shown), *figures],
            "why": why,
        },
        script=SCRIPT,
    )


def _most_settled(viewed: Viewed) -> str:
    """The parameter whose variance the layers of a frame reduced by the largest factor."""
    table = viewed.table("settled")
    reduced = zip(table.column("parameter"), table.column("reduction"), strict=True)
    return str(max(reduced, key=lambda entry: float(entry[1] or 0.0))[0])


def _some(finished: Sequence[int], *frames: int) -> NDArray[np.int64]:
    """At most MOST_FRAMES of the frames, the first, the last and `frames` among them."""
    most = MOST_FRAMES - len(frames)
    chosen = np.linspace(0, len(finished) - 1, min(len(finished), most)).round().astype(int)
    return np.unique(np.append(np.array(finished)[chosen], frames))


def _cloud(run: InspectedRun, frame: int) -> dict[str, Any]:
    """The particles of a frame's layers: where their extremities (hands, feet, head) are, as 16-bit numbers, `step` mm
    each, from `offset`, particle by particle; of each the particle of the layer before that it was drawn from, -1 for
    none that is in the page; its weight beside the layer's heaviest, 0 to 255.
    """
    records = run.frame(frame).layers
    tips = list(extremities(run.body))
    kept = [
        np.linspace(0, len(record.poses) - 1, min(len(record.poses), MOST_PARTICLES)).round().astype(int)
        for record in records
    ]
    ends = [limb_ends(run.body, one.poses[rows])[:, tips, 1] for one, rows in zip(records, kept, strict=True)]
    everywhere: Array = np.concatenate([one.reshape(-1, 3) for one in ends])
    offset = np.asarray(np.round(everywhere.mean(axis=0)), dtype=np.float64)
    step = max(0.5, float(np.abs(everywhere - offset).max()) / 32000.0)
    layers: list[dict[str, Any]] = []
    for at, (record, rows, places) in enumerate(zip(records, kept, ends, strict=True)):
        before = records[at - 1].parents[0] if at else np.zeros(0, dtype=np.int64)
        place_of = {int(row): place for place, row in enumerate(kept[at - 1])} if at else {}
        heavy: Array = np.exp(record.log_weights[rows] - record.log_weights[rows].max())
        steps: Array = np.round((places - offset) / step)
        layers.append(
            {
                "layer": record.layer,
                "beta": _number(record.beta),
                "points": _pack(steps.astype("<i2")),
                "parents": [place_of.get(int(before[row]), -1) if row < len(before) else -1 for row in rows],
                "weights": _pack(np.rint(255.0 * heavy).astype(np.uint8)),
                "of": len(record.poses),
            }
        )
    return {"frame": frame, "offset": offset.tolist(), "step": step, "tips": len(tips), "layers": layers}


def _pack(numbers: NDArray[Any]) -> str:
    return base64.b64encode(numbers.tobytes()).decode("ascii")


def _remarks(shown: _Shown) -> list[str]:
    return [f"Frame {frame}: {words}" for frame, words in notes_by_frame(shown.run.run).items()]


def _left_out(shown: _Shown) -> list[str]:
    if len(shown.frames) == shown.whole:
        return []
    return [f"Of {shown.whole} frames this page has {len(shown.frames)}, evenly chosen."]


def _evaluation(shown: _Shown) -> Evaluation | None:
    """The errors of the track; None where nothing can be measured."""
    session, track = shown.run.session, read_track(shown.run.run, shown.track)
    if session.truth_path is None or not len(track.frames):
        return None
    try:
        truth = read_trc(session.truth_path)
        return evaluate(track.poses, track.frames, shown.run.body, truth, session.manifest.fps)
    except StudioError:
        return None


def _facts(shown: _Shown) -> list[list[str]]:
    record, evaluation = shown.run.run.record, _evaluation(shown)
    facts = [
        ["Session", shown.run.session.name],
        ["Run", shown.run.run.name],
        ["Tracker", TRACKERS[record.tracker].label if record.tracker in TRACKERS else record.tracker],
        ["Likelihood", record.weighting],
        ["Body", f"{record.body}, {len(record.parameters)} parameters"],
        ["Frames", f"{record.first} to {record.last - 1}, {shown.whole} tracked, {record.fps:g} a second"],
        ["Seed", str(record.seed)],
        ["Poses", "of the search" if shown.track == RAW else f"track {shown.track}"],
        ["Start", record.start_source],
        [
            "Tracked",
            f"{record.created[:16].replace('T', ' ')} UTC with {record.software or 'an older studio'}",
        ],
    ]
    if record.behaviour:
        facts.append(["Behaviour", record.behaviour])
    if evaluation is not None:
        facts.append(["Mean error", f"{evaluation.mean_mm:.1f} mm, worst frame {evaluation.worst_mm:.1f} mm"])
        facts.append(["Limb lost (truth)", f"in {evaluation.lost_frames} of {len(evaluation.frames)} frames"])
    return facts


def _settings(run: InspectedRun) -> list[dict[str, Any]]:
    """Every knob at the end of the run; `moved` where it is not the default."""
    record, history = run.run.record, run.history.entries
    last = history[-1].values if history else record.settings
    settings = settings_from_values(record.tracker, record.weighting, last)
    now_used = values(settings)
    return [
        {
            "group": knob.group,
            "name": knob.name,
            "label": knob.label,
            "value": now_used[knob.name],
            "unit": knob.unit,
            "moved": now_used[knob.name] != knob.default,
            "help": knob.help,
        }
        for knob in all_knobs(settings)
    ]


def _over_frames(shown: _Shown) -> dict[str, Any]:
    """Weight, error and fit of every frame, as the studio's own view of them."""
    evaluation = _evaluation(shown)
    errors = dict(zip(evaluation.frames, evaluation.per_frame_mm, strict=True)) if evaluation else {}
    lost = dict(zip(evaluation.frames, evaluation.lost_by_frame, strict=True)) if evaluation else {}
    with shown.run.run.results() as results:
        line = results.timeline()
    kept = set(shown.frames.tolist())
    rows = [
        [
            number,
            _number(errors[number]) if number in errors else None,
            _number(float(line.log_weights[at])),
            _number(float(line.milliseconds[at])),
            int(line.evaluations[at]),
            line.tracking[at],
            bool(lost[number]) if number in lost else None,
            _number(float(line.overlaps[at])),
        ]
        for at, number in enumerate(line.frames.tolist())
        if number in kept
    ]
    table = {
        "name": "frames",
        "title": "Weight and error by frame",
        "columns": [{"key": key, "label": label, "unit": unit} for key, label, unit in FRAME_COLUMNS],
        "rows": rows,
    }
    return {
        "view": "frames",
        "of": "run",
        "title": "Over the frames",
        "question": "How did the run go?",
        "caption": shown.run.caption(),
        "search_layers": 0,
        "searches": 0,
        "notes": [],
        "tables": [table],
    }


def _has_half_widths(run: InspectedRun) -> bool:
    """Whether there are some that hold."""
    try:
        kept = kept_uncertainty(run)
    except SessionError:
        return False
    return kept.of is not None and not kept.stale


def _figure(shown: _Shown, name: str, viewed: Viewed, frame: int | None) -> dict[str, Any]:
    view = view_named(name)
    kept = set(shown.frames.tolist())
    return {
        "view": name,
        "of": "run" if frame is None else "frame",
        "title": view.title if frame is None else f"{view.title}, frame {frame}",
        "question": view.question,
        "caption": shown.run.caption(frame),
        "search_layers": viewed.search_layers,
        "searches": viewed.searches,
        "notes": list(viewed.notes),
        "tables": [_table(table, kept) for table in viewed.tables],
    }


def _table(table: Table, kept: set[int]) -> dict[str, Any]:
    keys = [column.key for column in table.columns]
    at = keys.index("frame") if "frame" in keys else None
    return {
        "name": table.name,
        "title": table.title,
        "columns": [{"key": one.key, "label": one.label, "unit": one.unit} for one in table.columns],
        "rows": [[_cell(value) for value in row] for row in table.rows if at is None or row[at] in kept],
    }


def _why(shown: _Shown) -> dict[str, Any]:
    """What was found about the frame; a sentence where its evidence cannot be read."""
    try:
        viewed = look(
            shown.run, shown.frame, "why", Selection(track="" if shown.track == RAW else shown.track)
        )
    except StudioError as error:
        return {"frame": shown.frame, "notes": [str(error)], "findings": [], "remedies": [], "tables": []}
    return {
        "frame": shown.frame,
        "search_layers": viewed.search_layers,
        "searches": viewed.searches,
        "notes": list(viewed.notes),
        "findings": [
            {"kind": one.kind, "words": one.words, "is_cause": one.is_cause} for one in viewed.findings
        ],
        "remedies": [{"title": one.title, "words": one.words} for one in viewed.remedies],
        "tables": [_table(table, {shown.frame}) for table in viewed.tables],
    }


def _scene(shown: _Shown) -> dict[str, Any]:
    """The ends of all limbs in every frame as 16-bit numbers, `step` mm each, from `offset`; the cameras."""
    body = shown.run.body
    track = read_track(shown.run.run, shown.track)
    known = np.isin(track.frames, shown.frames)
    ends = limb_ends(body, track.poses[known])
    points: Array = ends.reshape(-1, 3)
    ends_of_box: Array = np.array([points.min(axis=0), points.max(axis=0)])
    offset: Array = np.asarray(np.round(ends_of_box.mean(axis=0)), dtype=np.float64)
    step = max(1.0, float(np.abs(ends - offset).max()) / 32000.0)
    packed: NDArray[np.int16] = np.round((ends - offset) / step).astype("<i2")
    return {
        "frames": track.frames[known].tolist(),
        "ends": _pack(packed),
        "offset": offset.tolist(),
        "step": step,
        "limbs": [
            {
                "name": limb.name,
                "side": limb.side,
                "radius_start": round(limb.radius_start, 2),
                "radius_end": round(limb.radius_end, 2),
            }
            for limb in body.drawn
        ],
        "cameras": [
            {"name": one.name, "centre": _point(one.centre), "corners": [_point(at) for at in _corners(one)]}
            for one in shown.run.run.cameras()
        ],
    }


def _corners(camera: Camera) -> Array:
    """(4, 3) the corners of a camera's picture, CAMERA_DEPTH in front of it, mm; without the lens's distortion."""
    width, height = camera.width - 1, camera.height - 1
    pixels = np.array([[0, 0, 1], [width, 0, 1], [width, height, 1], [0, height, 1]], dtype=float)
    rays = pixels @ np.linalg.inv(camera.matrix).T * CAMERA_DEPTH
    return (rays - camera.translation) @ camera.rotation


def _point(place: Array) -> list[float]:
    return [round(float(value), 1) for value in place]


def _cell(value: object) -> object:
    return _number(value) if isinstance(value, float) else value


def _number(value: float) -> float | None:
    return None if no_value(value) is None else float(f"{value:.{DIGITS}g}")
