"""A black mouse that walks and rears in a glass cylinder, three cameras, from the videos to errors in mm (issue 29).

Two frames are labelled by hand. They are no blind test: the labels showed what the hind legs of body `mouse` lack, and
pictures of these frames were among those by which the masks and the start were judged. Sheets of all
views are kept to be looked at (STUDIO_ARTEFACTS, default artefacts/mouse-cylinder).
"""

import csv
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from kept_overlays import keep_overlays

import studio
from studio.body.forward_kinematics import marker_points
from studio.foundations.arrays import Array
from studio.runs.refining import jitter
from studio.runs.setup.initialising import InitialPose
from studio.runs.setup.mask_quality import MaskQuality
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

pytestmark = [pytest.mark.slow, pytest.mark.real_data, pytest.mark.timeout(1500)]

REARED, WALKING = 6, 323
MASKS, START_MM, OVERLAP = 0.88, 20.0, 0.74
START_MEAN_MM, TRACKED_MM = {REARED: 10.0, WALKING: 17.0}, {REARED: 12.0, WALKING: 12.0}
"""Means of what has a name below. The goals of issue 29 are 6 mm for the trunk's and head's points and 10 for limbs.
Reached from nothing: 6 to 8 and 12 to 15 mm (five seeds), tracked 9.2 and 8.3. The body's pose that is nearest to the
labels is 4.2 and 4.1 mm off; refined from there on the masks, which lack feet that stand in the shadow, 5.2 and 7.8:
that much is the body and the masks, the rest the search. A reared body that is turned by 70 degrees about itself, ears
21 and 27 mm off, does not keep these bounds.
"""
AHEAD = 0.0
"""Least cosine between where the body points in a frame and in the next: 0.46 and 0.83 are reached; half a turn makes
it negative.
"""
NAMES = {
    "EarL": "Ear_L", "EarR": "Ear_R", "Snout": "Nose", "SpineF": "Neck", "SpineM": "Trunk", "TailBase": "TTI",
    "HindpawL": "Hindpaw_left", "HindpawR": "Hindpaw_right", "HindlimbL": "Ankle_left", "HindlimbR": "Ankle_right",
}  # fmt: skip


TAIL = {"TailMid": "Tail_1", "TailEnd": "TailTip"}
TAIL_MM, TAIL_LOST = 18.0, 0.05
"""Of the points of the tail, and of the frames in which it is called lost. Reached: 4.5, 2.7 and 5.3 mm, 0.003; before
lines in the pictures were asked (`thin_limbs`), 51, 77 and 6 mm, 0.72."""


@dataclass(frozen=True)
class Workflow:
    """What the steps gave."""

    session: Session
    masks: MaskQuality
    starts: dict[int, InitialPose]
    run: StoredRun


@pytest.fixture(scope="module")
def footage(real_data: Path) -> Path:
    folder = real_data / "mouse-cylinder" / "three-a"
    if not folder.is_dir():
        pytest.skip("the footage of the mouse in the cylinder is not here")
    return folder


@pytest.fixture(scope="module")
def labels(footage: Path) -> dict[int, dict[str, Array]]:
    """By frame and name, mm."""
    return points_of(footage, NAMES)


def points_of(footage: Path, names: dict[str, str]) -> dict[int, dict[str, Array]]:
    points: dict[int, dict[str, Array]] = {}
    with (footage / "truth" / "points.csv").open() as file:
        for row in csv.DictReader(file):
            if row["point"] in names:
                place = np.array([float(row[f"{axis}_mm"]) for axis in "xyz"])
                points.setdefault(int(row["frame"]), {})[names[row["point"]]] = place
    return points


@pytest.fixture(scope="module")
def workflow(footage: Path, tmp_path_factory: pytest.TempPathFactory) -> Workflow:
    take = tmp_path_factory.mktemp("cylinder") / "take"
    for name in ("videos", "calibration"):
        shutil.copytree(footage / name, take / name)
    (take / "subject.toml").write_text('body = "mouse31"\n')
    session = studio.import_footage(take, take.parent / "session")
    plates = {path.stem: str(path) for path in (footage / "background").glob("*.png")}
    studio.background(session, "animal", plates=plates)
    session = Session(session.path)
    masks = studio.mask_quality(session)
    starts = {frame: studio.initialise(session, frame=frame) for frame in (REARED, WALKING)}
    run = studio.track(session, name="first", start_pose=starts[REARED]).run
    keep_overlays("mouse-cylinder", session, run, 30)
    return Workflow(session, masks, starts, run)


def errors(
    session: Session, run: StoredRun | None, pose: Array, points: dict[str, Array]
) -> dict[str, float]:
    """By marker, mm."""
    body = run.body() if run else session.body()
    where = dict(
        zip([marker.name for marker in body.markers], marker_points(body, pose[None])[0], strict=True)
    )
    return {name: float(np.linalg.norm(where[name] - point)) for name, point in points.items()}


def test_the_masks_agree_without_shadow_and_reflection(workflow: Workflow) -> None:
    for view in workflow.masks.views:
        print(view.camera, round(view.agreement, 3))
    assert all(view.agreement >= MASKS for view in workflow.masks.views)


@pytest.mark.parametrize("frame", [REARED, WALKING])
def test_it_starts_right_from_nothing(
    workflow: Workflow, labels: dict[int, dict[str, Array]], frame: int
) -> None:
    start = workflow.starts[frame]
    off = errors(workflow.session, None, start.pose, labels[frame])
    print(frame, round(start.confidence, 3), {name: round(value, 1) for name, value in off.items()})
    assert max(off[name] for name in ("Nose", "Neck", "Trunk", "TTI")) < START_MM
    assert float(np.mean(list(off.values()))) < START_MEAN_MM[frame]
    assert start.confidence > 0.5


def test_it_is_tracked_to_the_end(workflow: Workflow, labels: dict[int, dict[str, Array]]) -> None:
    track = studio.read_track(workflow.run, "best")
    frames = track.frames.tolist()
    assert frames == list(range(REARED, 330))
    for frame in (REARED, WALKING):
        off = errors(workflow.session, workflow.run, track.poses[frames.index(frame)], labels[frame])
        print(frame, {name: round(value, 1) for name, value in off.items()})
        assert float(np.mean(list(off.values()))) < TRACKED_MM[frame]
    assert float(np.nanmean(track.confidence)) > OVERLAP


def test_the_tail_is_followed_where_masks_lack_it(workflow: Workflow, footage: Path) -> None:
    track = studio.read_track(workflow.run, "best")
    frames = track.frames.tolist()
    for frame, points in points_of(footage, TAIL).items():
        off = errors(workflow.session, workflow.run, track.poses[frames.index(frame)], points)
        print(frame, {name: round(value, 1) for name, value in off.items()})
        assert max(off.values()) < TAIL_MM
    with workflow.run.results() as results:
        lost = ["tail" in results.result(frame).limbs_lost for frame in frames]
    print("called lost", np.mean(lost))
    assert np.mean(lost) < TAIL_LOST


def test_it_is_never_turned_round(workflow: Workflow) -> None:
    track, body = studio.read_track(workflow.run, "best"), workflow.run.body()
    names = [marker.name for marker in body.markers]
    points = marker_points(body, track.poses)
    along = points[:, names.index("Nose")] - points[:, names.index("TTI")]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    turns = np.einsum("ni,ni->n", along[1:], along[:-1])
    print(round(float(turns.min()), 2), "in frame", int(track.frames[1 + turns.argmin()]))
    assert float(turns.min()) > AHEAD


def test_refining_the_clip_keeps_the_tail_and_jitters_less(
    workflow: Workflow, labels: dict[int, dict[str, Array]], footage: Path
) -> None:
    before = studio.read_track(workflow.run, "sides")
    studio.refine(workflow.run)
    track = studio.read_track(workflow.run, "refined")
    frames = track.frames.tolist()
    for frame, points in points_of(footage, TAIL).items():
        pose = track.poses[frames.index(frame)]
        off = errors(workflow.session, workflow.run, pose, {**labels[frame], **points})
        print(frame, {name: round(value, 1) for name, value in off.items()})
        assert float(np.mean([off[name] for name in labels[frame]])) < TRACKED_MM[frame]
        assert max(off[name] for name in points) < TAIL_MM
    assert jitter(workflow.run, track) < jitter(workflow.run, before)
