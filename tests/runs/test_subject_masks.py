"""Several subjects in view: found in the hull, cut from the masks, given sessions, tracked at once."""

import itertools
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from rendered_people import overlap
from two_people import TwoPeople, two_people

from studio.footage.capture.footage import Footage
from studio.foundations.arrays import Bytes
from studio.foundations.errors import FootageError, RunError, SessionError, WorkCancelledError
from studio.operations.masks import background
from studio.operations.subjects import subjects, together
from studio.runs.problem_source import ProblemSource
from studio.runs.setup.background_setup import set_up_background
from studio.runs.setup.mask_quality import mask_quality
from studio.runs.setup.session_settings import session_settings
from studio.runs.setup.subject_masks import WholeMasks, cut_frames, seen_subjects
from studio.runs.setup.workflow import MADE_WORDS, background_step
from studio.runs.together import track_together
from studio.search.settings import default_settings
from studio.sessions.background_files import HOMES
from studio.sessions.session import Session

FRAMES = 18
"""They pass each other, half a metre apart, in the middle."""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> TwoPeople:
    return two_people(tmp_path_factory.mktemp("two") / "two", FRAMES)


@pytest.fixture
def people(tmp_path: Path) -> TwoPeople:
    return two_people(tmp_path / "two", FRAMES)


def overlaps(session: Session, people: TwoPeople, who: int) -> dict[tuple[str, int], float]:
    """Of the masks in use with those of one of the two alone."""
    footage = Session(session.path).footage()
    found: dict[tuple[str, int], float] = {}
    for key, true in people.masks[who].items():
        mask = footage.mask(*key)
        assert mask is not None
        found[key] = overlap(mask, true)
    footage.close()
    return found


def assert_cut_well(session: Session, people: TwoPeople, who: int) -> None:
    """All of one of the two is in the masks in use, and where they say anything, hardly anything else; in line, the
    hull's pieces do not part them, and the masks say so.
    """
    footage = Session(session.path).footage()
    known = right = 0
    for key, true in people.masks[who].items():
        mask, hidden = footage.mask(*key), footage.hidden(*key)
        assert mask is not None
        assert hidden is not None
        assert np.count_nonzero((mask > 0) & (true > 0)) > 0.94 * np.count_nonzero(true), key
        said = (mask > 0) & (hidden == 0)
        known, right = known + np.count_nonzero(said), right + np.count_nonzero(said & (true > 0))
    footage.close()
    assert right > 0.97 * known
    assert known > 0.4 * sum(np.count_nonzero(true) for true in people.masks[who].values())


def hidden_by_the_other(session: Session, people: TwoPeople, who: int) -> tuple[int, int]:
    """Pixels of all views and frames of which the evidence says nothing of a session's subject, and those of them in
    which the other one is.
    """
    found = inside = 0
    settings = default_settings("annealed", "edge-region-silhouette")
    with closing(ProblemSource(Session(session.path), session.body())) as source:
        for frame in range(FRAMES):
            for view in source.evidence(frame, settings).views:
                assert view.unknown is not None
                other = people.masks[1 - who][view.camera, frame] > 0
                found += int(np.count_nonzero(view.unknown))
                inside += int(np.count_nonzero((view.unknown > 0) & other))
    return found, inside


def test_who_is_in_view_is_reported_by_the_hull(made: TwoPeople) -> None:
    for frame in (0, FRAMES - 1):
        seen = seen_subjects(made.session, frame)
        assert len(seen) == 2, seen
        for place in made.places(frame):
            apart = [np.hypot(one.at[0] - place[0], one.at[1] - place[1]) for one in seen]
            assert min(apart) < 0.15
    assert all(1.5 < one.height < 2.0 for one in seen_subjects(made.session))


def test_a_camera_without_a_picture_says_nothing_of_who_is_in_view(
    made: TwoPeople, monkeypatch: pytest.MonkeyPatch
) -> None:
    gone = made.session.manifest.footage.cameras[0].name
    mask_of, asked = WholeMasks.of, set[str]()

    def heard(whole: WholeMasks, camera: str, frame: int) -> Bytes:
        asked.add(camera)
        return mask_of(whole, camera, frame)

    monkeypatch.setattr(WholeMasks, "of", heard)
    monkeypatch.setattr(Footage, "absent", lambda *_: frozenset({gone}))
    assert len(seen_subjects(made.session)) == 2
    assert asked
    assert gone not in asked
    # Nor is anybody lost in a frame that it lacks.
    monkeypatch.setattr(Footage, "absent", lambda _, frame: frozenset({gone} if frame else ()))
    _, second = itertools.islice(cut_frames(made.session, made.places()), 2)
    assert second.lost == ()
    assert not second.parts[0][gone].any()
    assert all(part.any() for parts in second.parts for name, part in parts.items() if name != gone)


@pytest.mark.slow
def test_masks_of_two_are_not_called_usable(made: TwoPeople) -> None:
    found = mask_quality(made.session, session_settings(made.session).evidence)
    assert found.subjects == 2
    assert not found.usable
    assert "2 subjects" in found.in_words()


def test_masks_of_every_source_have_words() -> None:
    assert set(MADE_WORDS) == set(HOMES)


@pytest.mark.parametrize("who", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_the_others_are_cut_from_the_masks(people: TwoPeople, who: int) -> None:
    set_up_background(people.session, "masks", subject_at=people.places()[who])
    session = Session(people.session.path)
    assert_cut_well(session, people, who)
    assert mask_quality(session, session_settings(session).evidence).subjects == 1
    # Whom to follow can be asked again: the masks of all are kept.
    set_up_background(session, "subject", subject_at=people.places()[1 - who])
    assert_cut_well(session, people, 1 - who)
    assert "one subject" in background_step(Session(session.path)).words


def test_nobody_at_a_place_is_an_error_that_says_where_they_stand_and_changes_nothing(
    people: TwoPeople,
) -> None:
    manifest = people.session.manifest
    with pytest.raises(FootageError, match=r"Nobody stands at 3,2\.5") as error:
        set_up_background(people.session, "subject", subject_at=(3.0, 2.5))
    x, y = seen_subjects(people.session)[0].at
    assert f"{x:.2f},{y:.2f}" in error.value.hint
    assert Session(people.session.path).manifest == manifest
    assert not (people.session.path / "subject_masks").exists()


@pytest.mark.parametrize(
    ("place", "words"), [(None, "Nobody was chosen"), ((float("nan"), 0.0), "two finite numbers")]
)
def test_a_subject_needs_a_place(people: TwoPeople, place: tuple[float, float] | None, words: str) -> None:
    with pytest.raises(FootageError, match=words):
        set_up_background(people.session, "subject", subject_at=place)


def test_a_cut_that_is_cancelled_leaves_the_masks_as_they_were(people: TwoPeople) -> None:
    def stop(step: str, done: int, total: int) -> None:
        if done == 3:
            raise WorkCancelledError("stopped", "")

    with pytest.raises(WorkCancelledError):
        set_up_background(people.session, "subject", subject_at=people.places()[0], progress=stop)
    assert Session(people.session.path).manifest == people.session.manifest
    assert not (people.session.path / "subject_masks").exists()


@pytest.mark.slow
def test_each_gets_a_session_with_what_is_known_of_him(people: TwoPeople) -> None:
    places = people.places()
    made = subjects(people.session, at=[places[1], places[0]]).sessions
    assert [one.name for one in made] == ["two-1", "two-2"]
    for session, who in zip(made, (1, 0), strict=True):
        measures = session.subject()
        assert measures.height_mm == (1780.0, 1650.0)[who]
        start = session.start_pose()
        assert start is not None
        assert np.allclose(start, people.poses[who][0], atol=1e-6)
        assert_cut_well(session, people, who)
    # The footage is there once.
    picture = "pictures/cam1/000.png"
    assert (made[0].path / picture).samefile(people.session.path / picture)


@pytest.mark.slow
def test_bodies_tracked_at_once_keep_apart_and_each_has_his_masks(people: TwoPeople) -> None:
    one, other = subjects(people.session, at=people.places()).sessions
    rough = [
        np.mean(list(overlaps(session, people, who).values())) for who, session in enumerate((one, other))
    ]
    found = together(one, [str(other.path)])
    for who, session in enumerate((one, other)):
        names = ["pelvis_x", "pelvis_y"]
        columns = [index for index, entry in enumerate(people.bodies[who].parameters) if entry.name in names]
        off = np.linalg.norm((found.poses[who] - people.poses[who])[:, columns], axis=1)
        assert off.max() < 60.0
        shares = overlaps(session, people, who)
        assert np.mean(list(shares.values())) >= max(0.94, rough[who])
        assert session_settings(Session(session.path)).evidence.background_model == "auto"
        # Who is in front hides the other: there masks say nothing of him.
        hidden, by_the_other = hidden_by_the_other(session, people, who)
        assert by_the_other > max(500, 0.9 * hidden)
    again = track_together([Session(one.path), Session(other.path)])
    assert all((a == b).all() for a, b in zip(found.poses, again.poses, strict=True))


def test_what_does_not_belong_together_is_refused(people: TwoPeople, tmp_path: Path) -> None:
    other = two_people(tmp_path / "longer", 2).session
    with pytest.raises(RunError, match="not of the same footage"):
        track_together([people.session, other])
    with pytest.raises(RunError, match="named twice"):
        track_together([people.session, people.session])
    with pytest.raises(RunError, match="tracked alone"):
        track_together([people.session])
    with pytest.raises(SessionError, match="1 names were given for 2 places"):
        subjects(people.session, at=people.places(), into=["mine"])


@pytest.mark.slow
def test_the_verb_takes_a_place(people: TwoPeople) -> None:
    made = background(people.session, "subject", subject_at=people.places()[0])
    assert made.source == "subject"
    assert min(view.agreement for view in made.quality.views) > 0.8
