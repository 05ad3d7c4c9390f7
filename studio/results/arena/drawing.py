"""A race as a picture of each problem: the silhouette in one camera, and every racer's heaviest pose after so many
evaluations, as lines along the limbs, in that picture and in space.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np

from studio.body.forward_kinematics import limb_ends
from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.projection import project
from studio.results.arena.problem import Definition, Problem
from studio.results.comparison.trials import Outcome

COARSE = 0.6
"""Pixels by which an outline may be simplified."""


def drawn_race(definitions: Sequence[Definition], outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """A picture a problem, as plain values in pixels.

    camera, width, height : of the view with the largest silhouette. outline : closed lines [[x, y], …]. start, best :
    lines along the limbs [[x, y, x, y], …] of the start pose and of the heaviest known one. shapes : `side` and radii
    (mm) of each limb. best_limbs : the heaviest known pose in the world, [[[x, y, z], [x, y, z]], …] (mm). counts :
    evaluations. racers : by name, for each of the counts that it spent, its heaviest pose as `lines` and `limbs`, and
    `left`, the share of the way from the start pose to the heaviest known one that is left.
    """
    return [_drawn(one, outcomes) for one in definitions]


def _drawn(definition: Definition, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    problem, maps = Problem(definition), definition.maps
    view = int(np.argmax([np.count_nonzero(one.mask) for one in maps.views]))
    best = definition.best
    assert best is not None
    racers = dict[str, dict[str, Any]]()
    for outcome in outcomes:
        arguments, measured = outcome.trial.arguments, outcome.measured
        if arguments["problem"] == definition.name and measured["poses"]:
            racers[arguments["name"]] = {
                count: {
                    "lines": _lines(problem, view, np.array(pose)),
                    "limbs": _limbs(problem, np.array(pose)),
                    "left": _left(measured, int(count)),
                }
                for count, pose in measured["poses"].items()
            }
    counts = sorted({int(count) for drawn in racers.values() for count in drawn})
    camera = problem.cameras[view]
    return {
        "name": definition.name,
        "kind": definition.kind,
        "about": definition.about,
        "camera": camera.name,
        "width": camera.width,
        "height": camera.height,
        "outline": _outline(maps.views[view].mask),
        "start": _lines(problem, view, problem.prior.start),
        "best": _lines(problem, view, best.pose),
        "shapes": [
            {"side": limb.side, "radius_start": limb.radius_start, "radius_end": limb.radius_end}
            for limb in problem.body.drawn
        ],
        "best_limbs": _limbs(problem, best.pose),
        "counts": counts,
        "racers": racers,
    }


def _left(measured: Mapping[str, Any], count: int) -> float | None:
    """The share of the way that is left after so many evaluations."""
    gaps = [gap for at, gap in zip(measured["reached"], measured["gaps"], strict=True) if at <= count]
    return float(f"{gaps[-1] / measured['way']:.4g}") if gaps and measured["way"] > 0.0 else None


def _lines(problem: Problem, view: int, pose: Array) -> list[list[float]]:
    pixels = project(problem.cameras[view], _ends(problem, pose))[0].reshape(-1, 4)
    return np.round(pixels[np.isfinite(pixels).all(axis=1)], 1).tolist()


def _limbs(problem: Problem, pose: Array) -> list[list[list[float]]]:
    return np.round(_ends(problem, pose), 1).tolist()


def _ends(problem: Problem, pose: Array) -> Array:
    return limb_ends(problem.body, problem.whole(pose[None]))[0]


def _outline(mask: Bytes) -> list[list[list[int]]]:
    closed, _ = cv2.findContours((mask > 0).astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    simple = [cv2.approxPolyDP(one, COARSE, True)[:, 0] for one in closed]
    return [one.tolist() for one in simple if len(one) > 2]
