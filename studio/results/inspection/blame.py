"""Which camera and which term of the likelihood prefers a pose to another, limb by limb, and where each pulls.

Where a log-weight is a sum over cameras and terms (`BaseFrameLikelihood.shares`), so is its difference between two
poses. A limb's part of it is what is lost when that limb alone is put as in the reference pose; limbs that hide one
another share theirs, so parts need not add up to the whole.
"""

from dataclasses import dataclass

import numpy as np

from studio.body.scale import scale_of
from studio.evidence.distance_maps import silhouettes_by_camera
from studio.foundations.arrays import Array
from studio.results.inspection.likelihoods import (
    NATS_SCALE,
    FrameEvaluation,
    evaluation_of,
    limbs_swapped,
    nats_scale,
)
from studio.results.inspection.reading import InspectedFrame
from studio.results.inspection.reference import true_pose
from studio.results.inspection.tables import Row, Selection, View, ViewResult, table
from studio.runs.tracks import RAW, best_track, pose_in_track
from studio.search.likelihood.edge_region import EdgeRegionSettings
from studio.search.likelihood.overlay import sample_points
from studio.search.likelihood.problem import Shares
from studio.search.trackers.agreement import Agreement, limb_names

VIEW = View(
    "blame",
    "Blame",
    "Which camera and term pulls where?",
    ("limb", "camera", "track"),
    (
        table(
            "matrix",
            "Log-likelihood by camera, term and limb",
            "camera",
            "term",
            "limb",
            ("value", "At the pose", "nats"),
            ("reference", "At the reference pose", "nats"),
            ("difference", "Pose less reference", "nats"),
        ),
        table(
            "left_out",
            "Change when one camera or term counts less",
            "camera",
            "term",
            ("factor", "Counts"),
            ("log_weight", "At the pose", "nats"),
            ("reference", "At the reference pose", "nats"),
            ("preference", "Preference of the pose", "nats"),
            ("change", "Change of preference", "nats"),
        ),
        table(
            "pulls",
            "Where each camera and term pulls each parameter",
            "parameter",
            "limb",
            "unit",
            "camera",
            "term",
            ("pull", "Log-likelihood a deviation", "nats"),
        ),
        table(
            "areas",
            "Areas of silhouette and body",
            "camera",
            "limb",
            ("outside", "Body outside the silhouette (B)", "mm²"),
            ("bare", "Silhouette without body (R)", "mm²"),
            ("area", "Area of the limb", "mm²"),
        ),
        table(
            "samples",
            "Samples of one camera",
            "camera",
            "limb",
            "term",
            ("x", "x", "px"),
            ("y", "y", "px"),
            ("cost", "Cost, 0 to 1"),
        ),
        NATS_SCALE,
    ),
    evaluates=True,
)


STEP = 0.25
"""Deviations to either side at which a pull is measured."""
FACTORS = (0.0, 0.5)
WHOLE_BODY = "whole body"


@dataclass(frozen=True, slots=True, eq=False)
class ReferencePose:
    """The pose that a frame's pose is compared with. kind : "truth", "refined" (after the search), a track's name, or
    "best particle" where there is no other.
    """

    kind: str
    pose: Array


def explained_pose(frame: InspectedFrame, track: str = "") -> Array:
    """(D,) the pose that is asked about: a track's, else what the search found."""
    return frame.searched() if track in ("", RAW) else frame.estimate(track)


def reference_pose(frame: InspectedFrame, track: str = "") -> ReferencePose:
    """The pose to compare with: the truth, else of a refinement or a later track, else the best particle."""
    truth = true_pose(frame.of, frame.number)
    if truth is not None:
        return ReferencePose("truth", truth.pose)
    run = frame.of.run
    best = best_track(run).name
    if best not in (RAW, track):
        return ReferencePose(best, pose_in_track(run, best, frame.number))
    result = frame.result
    if result is not None and result.estimate.searched is not None:
        return ReferencePose("refined", result.estimate.pose)
    return ReferencePose("best particle", frame.layers[-1].best)


def pulls_at(frame: InspectedFrame, evaluation: FrameEvaluation, pose: Array) -> tuple[Shares, Array]:
    """What cameras and terms add at the pose, and (D, V, T) the slope of each, nats a deviation σ0 of the parameter."""
    sigma = np.array(frame.of.run.record.sigma)
    steps = np.diag(STEP * sigma)
    shares = evaluation.shares(np.concatenate([pose[None], pose + steps, pose - steps]))
    ahead, behind = shares.values[1 : len(pose) + 1], shares.values[len(pose) + 1 :]
    return shares, (ahead - behind) / (2.0 * STEP)


def rows(frame: InspectedFrame, selection: Selection) -> ViewResult:
    run, evaluation = frame.of, evaluation_of(frame)
    pose, reference = explained_pose(frame, selection.track), reference_pose(frame, selection.track)
    limbs, swapped = limbs_swapped(run, pose, reference.pose)
    shares = evaluation.shares(np.concatenate([pose[None], reference.pose[None], swapped]))
    pose_terms, reference_terms, by_limb = shares.values[0], shares.values[1], shares.values[2:]
    matrix: list[Row] = []
    for view, camera in enumerate(shares.cameras):
        for number, term in enumerate(shares.terms):
            own = float(pose_terms[view, number])
            others = [(WHOLE_BODY, float(reference_terms[view, number]))]
            others += [
                (limb, float(values[view, number])) for limb, values in zip(limbs, by_limb, strict=True)
            ]
            matrix += [
                (camera, term, limb, own, other, own - other)
                for limb, other in others
                if selection.limb in ("", limb) or limb == WHOLE_BODY
            ]
    _, pulls = pulls_at(frame, evaluation, pose)
    return ViewResult(
        {
            "matrix": matrix,
            "left_out": _left_out(shares, pose_terms, reference_terms),
            "pulls": [
                (*label, camera, term, float(pulls[at, view, number]))
                for at, label in enumerate(run.labels)
                if selection.limb in ("", label[1])
                for view, camera in enumerate(shares.cameras)
                for number, term in enumerate(shares.terms)
            ],
            "areas": _areas(frame, evaluation, pose),
            "samples": _samples(frame, evaluation, pose, selection.camera) if selection.camera else [],
            "scale": [nats_scale(run)],
        },
        (f"The pose is compared with: {reference.kind}.",),
    )


def _left_out(shares: Shares, pose_terms: Array, reference_terms: Array) -> list[Row]:
    """Preference of the pose over the reference when a camera or a term counts less; "" stands for all of them."""
    whole = float((pose_terms - reference_terms).sum())
    table: list[Row] = [("", "", 1.0, float(pose_terms.sum()), float(reference_terms.sum()), whole, 0.0)]
    for name_at, names in ((0, shares.cameras), (1, shares.terms)):
        for at, name in enumerate(names):
            own, other = (np.take(part, at, axis=name_at).sum() for part in (pose_terms, reference_terms))
            for factor in FACTORS:
                less = 1.0 - factor
                table.append(
                    (
                        name if name_at == 0 else "",
                        name if name_at == 1 else "",
                        factor,
                        float(pose_terms.sum() - less * own),
                        float(reference_terms.sum() - less * other),
                        whole - less * float(own - other),
                        -less * float(own - other),
                    )
                )
    return table


def _areas(frame: InspectedFrame, evaluation: FrameEvaluation, pose: Array) -> list[Row]:
    """Areas (mm² at the body) in which pose and silhouettes disagree by more than clothes explain."""
    silhouettes = silhouettes_by_camera(evaluation.evidence)
    cameras = tuple(camera for camera in frame.of.run.cameras() if camera.name in silhouettes)
    agreement = Agreement(frame.of.body, cameras).of(pose, [silhouettes[camera.name] for camera in cameras])
    groups, own = np.array(agreement.limbs), scale_of(frame.of.body) ** 2
    return [
        (
            camera.name,
            limb,
            own * float(agreement.outside[view, groups == limb].sum()),
            own * float(agreement.bare[view, groups == limb].sum()),
            own * float(agreement.area[view, groups == limb].sum()),
        )
        for view, camera in enumerate(cameras)
        for limb in dict.fromkeys(agreement.limbs)
    ]


def _samples(frame: InspectedFrame, evaluation: FrameEvaluation, pose: Array, name: str) -> list[Row]:
    """The samples that the likelihood reads in a camera's picture, with what each costs: (1 - p)²."""
    settings = frame.settings.weighting
    views = {view.camera: view for view in evaluation.evidence.views}
    cameras = tuple(camera for camera in frame.of.run.cameras() if camera.name == name)
    if not isinstance(settings, EdgeRegionSettings) or name not in views or not cameras:
        return []
    corners = Agreement(frame.of.body, cameras).corners(pose)[0]
    view, table = views[name], list[Row]()
    for limb, outline in zip(limb_names(frame.of.body), corners, strict=True):
        if not np.isfinite(outline).all():
            continue
        for term, points, picture in zip(
            ("edge", "region"), sample_points(outline[None], settings), (view.edges, view.mask), strict=True
        ):
            table += [
                (name, limb, term, float(x), float(y), _cost(picture, x, y)) for x, y in points.tolist()
            ]
    return table


def _cost(picture: np.ndarray, x: float, y: float) -> float:
    """(1 - p)² of the nearest pixel; 1 outside the picture."""
    column, row = round(x), round(y)
    inside = 0 <= row < picture.shape[0] and 0 <= column < picture.shape[1]
    return float((1.0 - picture[row, column] / 255.0) ** 2) if inside else 1.0
