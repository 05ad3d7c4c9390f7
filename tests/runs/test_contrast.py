"""Subject and background alike in colour: said before anything is tracked, with limbs, cameras and where."""

import dataclasses
from contextlib import closing
from pathlib import Path

import cv2
import numpy as np
import pytest
from alike_person import SIZE, make_alike_session, standing_pose

from studio.evidence.backgrounds import Backgrounds
from studio.evidence.pipeline import EvidenceMaker
from studio.runs.drawing.overlay_drawing import projected_silhouette
from studio.runs.new_run import prepare_run
from studio.runs.setup.background_setup import set_up_background
from studio.runs.setup.contrast import Contrast, KnownPoses, ViewContrast, draw_contrast, measure_contrast
from studio.runs.setup.mask_quality import mask_quality, measure_masks
from studio.runs.setup.session_settings import session_settings
from studio.search.likelihood.overlay import limb_contours
from studio.sessions.background_files import SessionEvidence, write_evidence
from studio.sessions.session import Session

CAMERAS = ("cam1", "cam2", "cam3", "cam4")
EACH_ALONE = {"mask_shadow_floor": False}
"""No camera says what another one takes for shadow."""


def make_poorly_seen_session(folder: Path) -> Session:
    """Forearms are a darker floor, and no camera helps another."""
    session = make_alike_session(folder, forearms_alike=True)
    write_evidence(session, SessionEvidence(knobs=EACH_ALONE))
    return session


@pytest.fixture(scope="module")
def alike(tmp_path_factory: pytest.TempPathFactory) -> Session:
    return make_poorly_seen_session(tmp_path_factory.mktemp("alike") / "alike")


@pytest.fixture(scope="module")
def apart(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """Forearms are of cloth."""
    return make_alike_session(tmp_path_factory.mktemp("apart") / "apart", forearms_alike=False)


def contrast_of(session: Session, *, posed: bool) -> Contrast:
    known = KnownPoses(session.body(), {0: standing_pose()}, "told") if posed else None
    found = measure_contrast(session, session_settings(session).evidence, known)
    assert found is not None
    return found


def test_limbs_of_a_known_pose_are_named_with_their_cameras(alike: Session) -> None:
    found = contrast_of(alike, posed=True)
    assert set(found.alike) == {"left forearm", "right forearm"}
    assert found.words == "forearms and background are alike in cam1 to cam4"
    assert "source person" in found.remedy
    assert "source best" in found.remedy


def test_cameras_that_see_the_floor_empty_bring_the_forearms_back(tmp_path: Path) -> None:
    session = make_alike_session(tmp_path / "together", forearms_alike=True)
    assert not contrast_of(session, posed=True).alike
    body, settings = session.body(), session_settings(session).evidence
    forearms = [at for at, limb in enumerate(body.drawn) if "forearm" in limb.name]
    shares: dict[bool, list[float]] = {}
    for together in (True, False):
        knobs = dataclasses.replace(settings, mask_shadow_floor=together)
        with closing(session.footage()) as footage:
            maker = EvidenceMaker(session.cameras(), footage, Backgrounds(footage), knobs, "none")
            seen = maker.evidence(0)
            for view in seen.views:
                np.testing.assert_array_equal(maker.mask(view.camera, 0), view.mask)
            for name, _, view in maker.views(CAMERAS[1:], [0], lambda done, total: None):
                wanted = next(one for one in seen.views if one.camera == name)
                np.testing.assert_array_equal(view.mask, wanted.mask)
        contours = limb_contours(body, session.cameras(), standing_pose())
        shares[together] = [
            float(
                (
                    view.mask[projected_silhouette([own[at] for at in forearms], *view.mask.shape) > 0] > 0
                ).mean()
            )
            for view, own in zip(seen.views, contours, strict=True)
        ]
    assert max(shares[False]) < 0.3
    assert min(shares[True]) > 0.7


def test_a_subject_of_another_colour_is_not_named_whatever_its_shadow(apart: Session) -> None:
    for posed in (True, False):
        found = contrast_of(apart, posed=posed)
        assert not found.low, found
        assert (found.words, found.remedy) == ("", "")


def test_without_a_pose_the_hull_says_where_the_subject_is(alike: Session) -> None:
    found = contrast_of(alike, posed=False)
    assert found.alike == {"subject": CAMERAS}


def test_the_outlines_lie_on_what_is_alike(alike: Session, tmp_path: Path) -> None:
    found = contrast_of(alike, posed=True)
    for view in found.views:
        picture = cv2.imread(str(alike.path / "pictures" / view.camera / "0000.png"))
        inside = np.zeros((SIZE[1], SIZE[0]), np.uint8)
        cv2.fillPoly(inside, [np.array(outline, np.int32) for outline in view.outlines], (255,))
        # Redder than blue: wood, not cloth.
        assert (picture[inside > 0].astype(int) @ [-1, 0, 1] > 0).mean() > 0.95
    drawn = draw_contrast(alike, found, tmp_path / "where")
    assert [path.name for path in drawn] == [f"{name}-frame-0.png" for name in CAMERAS]


def test_agreement_alone_is_not_usable(alike: Session, apart: Session) -> None:
    settings = session_settings(alike).evidence
    poor, good = (mask_quality(session, settings) for session in (alike, apart))
    assert poor.agreeing
    assert not poor.usable
    assert "but subject and background are alike in cam1 to cam4" in poor.in_words()
    assert good.usable
    unmeasured = dataclasses.replace(good, contrast=None)
    assert unmeasured.usable, "borders of the pictures confirm it"
    views = tuple(dataclasses.replace(view, border=0.1) for view in good.views)
    assert not dataclasses.replace(unmeasured, views=views).usable


def test_masks_that_came_with_the_footage_have_no_contrast(alike: Session) -> None:
    settings = dataclasses.replace(session_settings(alike).evidence, background_model="threshold")
    assert measure_contrast(alike, settings) is None


def test_every_source_is_tried_where_the_views_agree_about_too_little(tmp_path: Path) -> None:
    session = make_alike_session(tmp_path / "tried", forearms_alike=True)
    shadows = {
        "mask_shadow_test": True,
        "mask_shadow_darkest": 0.4,
        "mask_shadow_colour": 0.025,
        **EACH_ALONE,
    }
    made = set_up_background(session, "plate", knobs=shadows)
    assert made.choice is not None
    assert any("every source was tried besides plate" in note for note in made.notes)
    kept = set_up_background(Session(session.path), "plate", tune=False)
    assert kept.choice is None


def test_the_first_run_notes_it(tmp_path: Path) -> None:
    session = make_poorly_seen_session(tmp_path / "noted")
    run = prepare_run(session, start_pose=standing_pose(), fit_shape=False)
    assert [note for note in run.record.notes if note.startswith("Forearms and background are alike")]
    second = prepare_run(session, start_pose=standing_pose(), fit_shape=False)
    assert not [note for note in second.record.notes if "alike" in note]


def test_it_is_remembered_for_the_guided_set_up(alike: Session) -> None:
    write_evidence(alike, SessionEvidence(knobs=EACH_ALONE))
    assert not measure_masks(alike).usable


def test_one_camera_of_four_is_made_up_for() -> None:
    views = tuple(
        ViewContrast(name, 0.2, {"shin": share}, 0, ())
        for name, share in zip(CAMERAS, (0.6, 0.1, 0.1, 0.0), strict=True)
    )
    assert not Contrast(views, "told", 0.025).low
    more = (dataclasses.replace(views[1], limbs={"shin": 0.3}), *views[2:])
    assert (
        Contrast((views[0], *more), "told", 0.025).words == "shin and background are alike in cam1 and cam2"
    )
