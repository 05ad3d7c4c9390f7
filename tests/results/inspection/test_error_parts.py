"""Whose fault an error is: planted faults of search, likelihood and body are each blamed rightly."""

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from drawn_people import ring_of_cameras
from planted_runs import BODY, FRAME, FRAMES, drawn_session, person_poses
from tracked_runs import finish

import studio
from studio.body.catalogue import load_body
from studio.body.dimensions import with_dimensions
from studio.foundations.errors import NotFoundError, RunError, SessionError
from studio.operations.inspecting import worst_frame
from studio.results.evaluation.report import in_words
from studio.results.inspection import long_search
from studio.results.inspection.error_parts import ErrorParts, split_of
from studio.results.inspection.long_search import FILE_NAME, climb, frames_to_split, kept_searches
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.tables import Selection
from studio.results.inspection.views import look_over
from studio.results.inspection.why import rows
from studio.runs.new_run import prepare_run
from studio.sessions.session import Session

EVALUATIONS, FEW = 20_000, 1000
LONGER = 1.25
"""Of the bones of a person who is tracked with the usual ones."""
PLANTED = ("search", "likelihood", "body")


def planted(folder: Path, fault: str) -> InspectedRun:
    """A run over six frames of a walk, nothing refined, with a planted fault: σ0 that is too narrow for the motion, a
    likelihood whose weights let limbs hide in the silhouette, or arms and legs that are shorter than the person's.
    """
    body, stride = load_body(BODY), 6 if fault == "search" else 2
    if fault == "body":
        bones = {
            name: LONGER * mm
            for name, mm in body.dimensions.items()
            if name.endswith(("thigh_length", "shin_length", "arm_length"))
        }
        body = with_dimensions(body, bones)
    session = drawn_session(folder, person_poses("walk", 20, 6, stride), ring_of_cameras(4), body=body)
    knobs: dict[str, object] = {"refine_frames": False, "particles": 200, "layers": 10, "start_repeats": 1}
    knobs |= {
        "search": {"diffusion_scale": 0.1},
        "likelihood": {"edge_weight": 0.0, "silhouette_weight": 0.0},
    }.get(fault, {})
    run = prepare_run(session, seed=7, knobs=knobs, fit_shape=False, allow_inconsistent=True)
    finish(session, run)
    return InspectedRun(session, run)


@pytest.mark.slow
@pytest.mark.parametrize("fault", PLANTED)
def test_a_planted_fault_is_blamed(tmp_path: Path, fault: str) -> None:
    run = planted(tmp_path / "drawn", fault)
    frame = worst_frame(run)
    split = studio.split_error(run.run, frame=frame, evaluations=EVALUATIONS, progress=False)
    [parts] = split.frames
    assert parts.chief == fault, parts
    assert parts.error_mm is not None
    assert getattr(parts, f"{fault}_mm") > 0.6 * parts.error_mm, parts
    assert split.words.startswith(f"Mostly the {fault}: ")
    first = rows(run.frame(frame), Selection()).findings[0]
    assert first.words.startswith(f"Mostly the {fault}: of the "), first.words


@pytest.fixture
def own(run: InspectedRun, tmp_path: Path) -> InspectedRun:
    """A copy of the small run, which may change."""
    folder = tmp_path / "drawn"
    shutil.copytree(run.session.path, folder)
    session = Session(folder)
    return InspectedRun(session, session.run(run.run.name))


def split(run: InspectedRun, *frames: int, **more: bool) -> tuple[ErrorParts, ...]:
    for frame in frames:
        studio.split_error(run.run, frame=frame, evaluations=FEW, progress=False, **more)
    return split_of(run).frames


def test_the_parts_add_up_to_the_error_that_evaluate_measures(own: InspectedRun) -> None:
    evaluation = studio.evaluate(own.run, track="raw", progress=False)
    for parts in split(own, 1, FRAME):
        assert None not in (parts.refinement_mm, parts.search_mm, parts.likelihood_mm, parts.body_mm)
        whole = parts.refinement_mm + parts.search_mm + parts.likelihood_mm + parts.body_mm  # type: ignore[operator]
        measured = evaluation.per_frame_mm[evaluation.frames.index(parts.frame)]
        assert whole == pytest.approx(measured)
        assert parts.error_mm == pytest.approx(measured)
        assert parts.known_nats >= max(0.0, parts.truth_nats or 0.0)
        assert parts.body_mm == pytest.approx(0.0, abs=0.1)
    measured_again = studio.evaluate(own.run, track="raw", progress=False)
    split_again = split_of(own)
    assert evaluation.parts_mm == {}
    assert measured_again.parts_mm == split_again.parts_mm
    assert measured_again.parts_mm["likelihood"] == split_again.mean["likelihood_mm"]
    assert f"likelihood {measured_again.parts_mm['likelihood']:.1f}, body 0.0 mm" in in_words(measured_again)
    assert studio.evaluate(own.run, truth=own.session.truth_path, progress=False).parts_mm == {}


def test_what_a_refinement_adds_is_a_part_of_its_own(tmp_path: Path) -> None:
    session = drawn_session(tmp_path / "drawn", person_poses("walk", 30, 2, 2), ring_of_cameras(4))
    knobs = {"particles": 40, "layers": 4, "start_repeats": 1}
    made = prepare_run(session, knobs=knobs, seed=4, fit_shape=False, allow_inconsistent=True, name="small")
    finish(session, made)
    run = InspectedRun(session, made)
    [parts] = split(run, 1)
    raw = studio.evaluate(made, track="raw", progress=False)
    assert parts.error_mm == pytest.approx(raw.per_frame_mm[1])
    assert parts.refinement_mm != 0.0
    whole = parts.refinement_mm + parts.search_mm + parts.likelihood_mm + parts.body_mm  # type: ignore[operator]
    assert whole == pytest.approx(parts.error_mm)


def test_why_says_it_first_once_a_frame_was_searched_for_long(own: InspectedRun) -> None:
    before = rows(own.frame(FRAME), Selection())
    assert not before.findings[0].kind.startswith("part of")
    assert not look_over(own, "why", Selection()).table("parts").rows
    [parts] = split(own, FRAME)
    after = rows(own.frame(FRAME), Selection())
    assert after.findings[0].kind == f"part of {parts.chief}"
    assert after.findings[0].words.startswith(f"Mostly the {parts.chief}: of the ")
    assert [one.words for one in after.findings[1:]] == [one.words for one in before.findings]
    assert rows(own.frame(1), Selection()).findings[0].kind != after.findings[0].kind
    [row] = look_over(own, "why", Selection()).table("parts").records()
    assert (row["frame"], row["error"], row["likelihood"]) == (FRAME, parts.error_mm, parts.likelihood_mm)


def test_without_a_truth_the_search_s_part_is_known(own: InspectedRun) -> None:
    shutil.rmtree(own.session.path / "truth")
    done = studio.split_error(own.run, frame=FRAME, evaluations=EVALUATIONS, progress=False)
    [parts] = done.frames
    assert (parts.error_mm, parts.search_mm, parts.likelihood_mm, parts.body_mm) == (None,) * 4
    assert (parts.truth_nats, done.mean) == (None, {})
    # Forty particles in four layers miss the peak, which a climb does not.
    assert parts.chief == "search"
    assert parts.known_nats > parts.threshold_nats
    assert parts.away_mm > 0.0
    assert done.words.startswith("In 1 of 1 frame a pose is known that outweighs what the search found, ")
    words = rows(own.frame(FRAME), Selection()).findings[0].words
    assert words.startswith("The search's part: a pose is known that weighs ")


def test_frames_that_were_searched_are_not_searched_again(
    own: InspectedRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    searched: list[tuple[int, int]] = []

    def counting(run: InspectedRun, number: int, evaluations: int, step: object) -> object:
        searched.append((number, evaluations))
        return real(run, number, evaluations, step)  # type: ignore[arg-type]

    real = long_search.search_long
    monkeypatch.setattr(long_search, "search_long", counting)
    first = split(own, FRAME)
    assert split(own, FRAME) == first
    assert searched == [(FRAME, FEW)]
    split(own, FRAME, again=True)
    studio.split_error(own.run, frame=FRAME, evaluations=2 * FEW, progress=False)
    assert searched[1:] == [(FRAME, FEW), (FRAME, 2 * FEW)]


def test_a_truth_that_came_later_is_climbed_from(own: InspectedRun) -> None:
    truth = own.session.path / "truth"
    away = truth.rename(truth.with_name("away"))
    split(own, FRAME)
    away.rename(truth)
    assert kept_searches(own.run)[FRAME].truth is None
    split(own, FRAME)
    assert kept_searches(own.run)[FRAME].truth is not None


def test_what_is_done_when_it_is_cancelled_is_kept(own: InspectedRun) -> None:
    told: list[tuple[int, int]] = []

    def stop(step: str, done: int, total: int) -> None:
        told.append((done, total))
        if done > 120:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        studio.split_error(own.run, count=3, evaluations=FEW, progress=stop)
    assert [one.frame for one in split_of(own).frames] == [0]
    assert told[0] == (0, 300)
    assert [done for done, _ in told] == sorted(done for done, _ in told)


def test_a_search_of_a_frame_that_was_tracked_again_counts_no_more(own: InspectedRun) -> None:
    split(own, FRAME)
    kept = own.run.folder / FILE_NAME
    kept.write_text(kept.read_text().replace('"frame": 3', '"frame": 2'))
    assert split_of(own).frames == ()
    assert split_of(own).words.startswith("No frame has been searched for long")


def test_a_search_before_other_masks_counts_no_more(own: InspectedRun) -> None:
    split(own, FRAME)
    areas = own.session.path / "exclusions"
    areas.mkdir()
    area = np.zeros((48, 64), np.uint8)
    area[:4] = 255
    cv2.imwrite(str(areas / "cam1.png"), area)
    assert split_of(own).frames == ()
    (areas / "cam1.png").unlink()
    assert [one.frame for one in split_of(own).frames] == [FRAME]


def test_a_kept_pose_of_another_body_counts_not(own: InspectedRun) -> None:
    split(own, FRAME)
    kept = own.run.folder / FILE_NAME
    record = json.loads(kept.read_text())
    record["searches"][0]["pose"].pop()
    kept.write_text(json.dumps(record))
    assert split_of(own).frames == ()
    kept.write_text("{")
    with pytest.raises(SessionError, match="cannot be read"):
        split_of(own)


def test_frames_are_evenly_spread(own: InspectedRun) -> None:
    assert frames_to_split(own, 1) == [2]
    assert frames_to_split(own, 2) == [1, 3]
    assert frames_to_split(own, 99) == list(range(FRAMES))


def test_what_cannot_be_split_is_refused(own: InspectedRun) -> None:
    with pytest.raises(NotFoundError):
        studio.split_error(own.run, frame=99, progress=False)
    empty = prepare_run(own.session, seed=1, fit_shape=False, allow_inconsistent=True, name="empty")
    with pytest.raises(RunError, match="no finished frame"):
        studio.split_error(empty, progress=False)


def test_a_climb_reaches_a_peak_that_is_narrow_and_askew() -> None:
    rng = np.random.default_rng(0)
    turn = np.linalg.qr(rng.standard_normal((10, 10)))[0]
    narrow = turn * np.logspace(0.0, 3.0, 10) @ turn.T
    peak = np.full(10, 0.5)

    def weigh(poses: np.ndarray) -> np.ndarray:
        off = poses - peak
        return -np.einsum("ni,ij,nj->n", off, narrow, off)

    limits = np.full(10, -1.0), np.full(10, 1.0)
    pose, weight = climb(weigh, np.zeros(10), np.full(10, 0.1), limits, 150, rng)
    assert weight > -1e-6
    assert pose == pytest.approx(peak, abs=1e-3)
    pose, _ = climb(weigh, np.zeros(10), np.full(10, 0.1), (limits[0], np.full(10, 0.2)), 150, rng)
    assert pose.max() <= 0.2
