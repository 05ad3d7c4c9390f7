import itertools
from pathlib import Path

import numpy as np
import pytest

from studio.body.catalogue import load_body
from studio.body.dimensions import with_dimensions
from studio.body.forward_kinematics import marker_points
from studio.body.model import BodyModel
from studio.body.subject import (
    DEFAULT_BODY,
    Subject,
    enlarged,
    fit_subject,
    height_spread,
    in_lengths,
    read_subject,
    subject_from_shape,
    write_subject,
)
from studio.foundations.errors import BodyError

HEIGHT = 1780.0
LIMBS = (
    ("RHip", "RKnee"), ("RKnee", "RAnkle"), ("LHip", "LKnee"), ("LKnee", "LAnkle"), ("RShoulder", "RElbow"),
    ("RElbow", "RWrist"), ("LShoulder", "LElbow"), ("LElbow", "LWrist"),
)  # fmt: skip


@pytest.fixture(scope="module")
def human31() -> BodyModel:
    return load_body("human31")


def _distance(body: BodyModel, pair: str, seed: int | None = None) -> float:
    """Between two markers, in the rest pose or in a random one."""
    pose = body.neutral
    if seed is not None:
        pose = pose + np.random.default_rng(seed).uniform(-1.0, 1.0, len(pose))
    points = dict(zip([marker.name for marker in body.markers], marker_points(body, pose)[0], strict=True))
    one, two = pair.split("_")
    return float(np.linalg.norm(points[one] - points[two]))


@pytest.mark.parametrize("name", ["human31", "human29", "human34", "human35", "human25"])
def test_lengths_are_met_in_every_pose(name: str) -> None:
    rng = np.random.default_rng(2)
    lengths = {f"{one}_{two}": float(rng.uniform(220, 480)) for one, two in LIMBS}
    lengths |= {"Hip_Neck": 530.0, "Neck_Head": 250.0, "Neck_RShoulder": 190.0, "RHip_LHip": 210.0}
    body, notes = fit_subject(load_body(name), Subject(name, HEIGHT, lengths))
    bends = {"Hip_Neck"} if name in ("human34", "human35") else set()
    for pair, length in lengths.items():
        seed = None if pair in bends else 5
        assert _distance(body, pair, seed) == pytest.approx(length, abs=1e-3), pair
    assert {note.split("'")[1] for note in notes} == bends


def test_missing_dimensions_follow_from_the_height(human31: BodyModel) -> None:
    body, notes = fit_subject(human31, Subject(height_mm=HEIGHT, lengths_mm={"RHip_RKnee": 420.0}))
    assert notes == ()
    shares = {"left_foot_length": 0.152, "right_hand_length": 0.108, "left_forearm_length": 0.146,
              "right_shin_length": 0.246, "left_thigh_length": 0.245}  # fmt: skip
    for name, share in shares.items():
        assert body.dimensions[name] == pytest.approx(share * HEIGHT)
    assert body.dimensions["right_thigh_length"] == pytest.approx(420.0)
    assert len(body.drawn) == 14
    assert [limb.name for limb in body.drawn[10:]] == ["left foot", "right foot", "left hand", "right hand"]
    assert marker_points(body, body.neutral)[0][:, 2].max() == pytest.approx(HEIGHT, abs=2.0)


def test_hips_and_shoulders_share_one_length_evenly(human31: BodyModel) -> None:
    lengths = {"LHip_RHip": 200.0, "LShoulder_RShoulder": 380.0}
    for height in (HEIGHT, None):
        body, notes = fit_subject(human31, Subject(height_mm=height, lengths_mm=lengths))
        assert body.dimensions["left_hip_offset"] == pytest.approx(100.0)
        assert body.dimensions["right_hip_offset"] == pytest.approx(100.0)
        assert body.dimensions["left_clavicle_length"] == pytest.approx(
            body.dimensions["right_clavicle_length"]
        )
        assert _distance(body, "LShoulder_RShoulder") == pytest.approx(380.0, abs=1e-3)
        assert any("measured standing" in note for note in notes)


def test_contradictions_are_met_in_the_least_squares(human31: BodyModel) -> None:
    lengths = {"Hip_RHip": 90.0, "Hip_LHip": 90.0, "RHip_LHip": 210.0}
    body, _ = fit_subject(human31, Subject(height_mm=HEIGHT, lengths_mm=lengths))
    design = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    expected = np.linalg.lstsq(design, np.array([90.0, 90.0, 210.0]))[0]
    found = [body.dimensions["right_hip_offset"], body.dimensions["left_hip_offset"]]
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_a_length_that_no_pose_changes_outweighs_one_measured_standing(human31: BodyModel) -> None:
    lengths = {"RHip_RKnee": 430.0, "RKnee_RAnkle": 420.0, "RHip_RAnkle": 900.0}
    body, _ = fit_subject(human31, Subject(height_mm=HEIGHT, lengths_mm=lengths))
    assert body.dimensions["right_thigh_length"] == pytest.approx(430.0, abs=0.1)
    assert body.dimensions["right_shin_length"] == pytest.approx(420.0, abs=0.1)


@pytest.mark.parametrize(
    "pair", ["RKnee_LWrist", "RKnee_LKnee", "RWrist_LWrist", "RBigToe_RHeel", "RHip", "RHip_RHip"]
)
def test_pairs_that_no_dimension_sets_are_ignored_with_a_note(human31: BodyModel, pair: str) -> None:
    body, notes = fit_subject(human31, Subject(height_mm=HEIGHT, lengths_mm={pair: 300.0}))
    plain, _ = fit_subject(human31, Subject(height_mm=HEIGHT))
    assert body.dimensions == plain.dimensions
    assert len(notes) == 1
    assert f"'{pair}' was ignored" in notes[0]


def test_without_height_it_follows_from_the_lengths(human31: BodyModel) -> None:
    lengths = {"RHip_RKnee": 0.245 * 1600, "RKnee_RAnkle": 0.246 * 1600, "Neck_Head": 0.16 * 1600}
    body, notes = fit_subject(human31, Subject(lengths_mm=lengths))
    assert body.dimensions["left_foot_length"] == pytest.approx(0.152 * 1600)
    assert "1600 mm follows" in notes[0]


def test_an_empty_subject_leaves_the_body_unchanged(human31: BodyModel) -> None:
    body, notes = fit_subject(human31, Subject())
    assert body.dimensions == human31.dimensions
    assert notes == ()


def test_dimensions_are_used_unchanged(human31: BodyModel) -> None:
    given = {"left_foot_length": 0.0, "right_thigh_length": 400.0}
    subject = Subject(
        "human31", HEIGHT, {"RHip_RKnee": 500.0}, dimensions_mm=given, ratios={"head_scale_y": 0.9}
    )
    body, notes = fit_subject(human31, subject)
    assert body.dimensions["right_thigh_length"] == 400.0
    assert body.dimensions["left_foot_length"] == 0.0
    assert body.dimensions["head_scale_y"] == 0.9
    assert len(body.drawn) == 13
    assert "'RHip_RKnee' was ignored" in notes[0]


def test_dimensions_of_one_body_size_another(human31: BodyModel) -> None:
    rng = np.random.default_rng(8)
    own = {
        name: value * rng.uniform(0.9, 1.1)
        for name, value in human31.dimensions.items()
        if name.endswith("_length")
    }
    sized = with_dimensions(human31, own)
    body, _ = fit_subject(load_body("human29"), Subject("human31", None, {}, own))
    for one, two in LIMBS:
        assert _distance(body, f"{one}_{two}", seed=1) == pytest.approx(
            _distance(sized, f"{one}_{two}"), abs=1e-4
        )
    assert _distance(body, "Hip_Neck") == pytest.approx(sized.dimensions["torso_length"], rel=0.02)


def test_a_dog_is_sized_by_its_own_markers() -> None:
    dog = load_body("dog")
    body, _ = fit_subject(dog, Subject("dog", None, {"Poll_Nose": dog.dimensions["head_length"] * 0.5}))
    for one, two in itertools.combinations([marker.name for marker in dog.markers], 2):
        # Proportions are written with four digits.
        assert _distance(body, f"{one}_{two}") == pytest.approx(
            0.5 * _distance(dog, f"{one}_{two}"), rel=2e-3, abs=0.1
        )


@pytest.mark.parametrize(("subject", "words"), [
    (Subject(height_mm=float("nan")), "height_mm is nan"),
    (Subject(height_mm=-1.0), "height_mm is -1"),
    (Subject(height_mm=299.0), "height_mm is 299"),
    (Subject(height_mm=3001.0), "height_mm is 3001"),
    (Subject(lengths_mm={"RHip_RKnee": 10_001.0}), "'RHip_RKnee' is 10001"),
    (Subject(dimensions_mm={"left_foot_length": -1.0}), "'left_foot_length' is -1"),
    (Subject(lengths_mm={"RHip_RKnee": float("nan")}), "'RHip_RKnee' is nan"),
    (Subject(lengths_mm={"RHip_RKnee": 0.0}), "'RHip_RKnee' is 0"),
    (Subject(dimensions_mm={"tail_length": 3.0}), "no dimension 'tail_length'"),
    (Subject(ratios={"head_scale_y": 0.0}), "'head_scale_y' is 0"),
])  # fmt: skip
def test_wrong_values_are_refused(human31: BodyModel, subject: Subject, words: str) -> None:
    with pytest.raises(BodyError, match=words) as caught:
        fit_subject(human31, subject)
    assert caught.value.hint


@pytest.mark.parametrize(
    "subject",
    [
        Subject(height_mm=300.0),
        Subject(height_mm=3000.0),
        Subject("human31", dimensions_mm={"left_foot_length": 10_000.0}),
    ],
)
def test_the_least_and_the_largest_sizes_are_taken(human31: BodyModel, subject: Subject) -> None:
    body, _ = fit_subject(human31, subject)
    if subject.height_mm:
        assert body.dimensions["left_thigh_length"] == pytest.approx(0.245 * subject.height_mm)
    else:
        assert body.dimensions["left_foot_length"] == 10_000.0


def test_all_measures_grow_alike_and_ratios_stay() -> None:
    subject = Subject(
        "human31", 1700.0, {"RHip_RKnee": 400.0}, {"left_foot_length": 250.0}, {"head_scale_y": 0.9}
    )
    larger = enlarged(subject, 0.05)
    assert (larger.body, larger.ratios) == ("human31", {"head_scale_y": 0.9})
    assert larger.height_mm == pytest.approx(1785.0)
    assert [dict(one) for one in (larger.lengths_mm, larger.dimensions_mm)] == [
        {"RHip_RKnee": pytest.approx(420.0)},
        {"left_foot_length": pytest.approx(262.5)},
    ]
    assert enlarged(Subject(), 0.05) == Subject()


def test_a_shapes_numbers_go_to_dimensions_and_ratios_by_their_order(human31: BodyModel) -> None:
    order = human31.definition.shape_order
    numbers = np.arange(1.0, len(order) + 1.0)
    subject = subject_from_shape(human31, numbers[None])
    ratios = {name for name in order if human31.definition.dimensions[name].ratio is not None}
    assert {**subject.dimensions_mm, **subject.ratios} == dict(zip(order, numbers.tolist(), strict=True))
    assert set(subject.ratios) == ratios
    assert (subject.body, subject.height_mm, dict(subject.lengths_mm)) == ("human31", None, {})
    with pytest.raises(BodyError, match=r"The shape: .* is -1"):
        subject_from_shape(human31, -np.ones(len(order)))


def test_without_a_height_sides_that_nothing_says_are_levelled(human31: BodyModel) -> None:
    """One length is shared by both in the ratio of the mean sides; what is given directly stays."""
    own = {"left_clavicle_length": 150.0}
    body, _ = fit_subject(human31, Subject("human31", None, {"LHip_RHip": 220.0}, own))
    assert body.dimensions["left_hip_offset"] == pytest.approx(body.dimensions["right_hip_offset"])
    assert body.dimensions["left_clavicle_length"] == 150.0
    unmeasured = {"torso_length", "left_thigh_radius_start", "right_clavicle_length"} & set(body.dimensions)
    shares = human31.definition.dimensions
    for name in unmeasured:
        if shares[name].of_height is None:
            assert body.dimensions[name] == human31.dimensions[name], name


def test_a_fit_changes_what_is_undetermined_alike(human31: BodyModel) -> None:
    """A distance over two bones of the prior's lengths x and y: both by the same factor."""
    lengths = {"Hip_RHip": 100.0, "RHip_LHip": 230.0}
    body, _ = fit_subject(human31, Subject(height_mm=HEIGHT, lengths_mm=lengths))
    assert body.dimensions["right_hip_offset"] == pytest.approx(100.0, abs=1e-6)
    assert body.dimensions["left_hip_offset"] == pytest.approx(130.0, abs=1e-6)
    far, _ = fit_subject(human31, Subject(height_mm=HEIGHT, lengths_mm={"RHip_RKnee": 4000.0}))
    assert far.dimensions["right_thigh_length"] == pytest.approx(4000.0, abs=1e-6)
    near, _ = fit_subject(human31, Subject(height_mm=HEIGHT, lengths_mm={"RHip_RKnee": 1.0}))
    assert near.dimensions["right_thigh_length"] == pytest.approx(1.0, abs=1e-6)


def test_a_standing_length_weighs_three_hundredths_of_one_that_no_pose_changes(human31: BodyModel) -> None:
    """Two bones of 430 and 420 mm, 900 mm along a leg that stands straight: the least squares of all three."""
    lengths = {"RHip_RKnee": 430.0, "RKnee_RAnkle": 420.0, "RHip_RAnkle": 900.0}
    body, _ = fit_subject(human31, Subject(height_mm=HEIGHT, lengths_mm=lengths))
    design = np.array([[1.0, 0.0], [0.0, 1.0], [0.03, 0.03]])
    expected = np.linalg.lstsq(design, np.array([430.0, 420.0, 27.0]))[0]
    found = [body.dimensions["right_thigh_length"], body.dimensions["right_shin_length"]]
    np.testing.assert_allclose(found, expected, atol=2e-3)


def test_dimensions_of_another_body_become_all_distances_that_no_pose_changes(human31: BodyModel) -> None:
    subject = Subject("human31", HEIGHT, {"RHip_RKnee": 444.0}, {"left_thigh_length": 410.0})
    other = in_lengths(subject, human31)
    assert (other.body, other.height_mm, other.dimensions_mm, other.ratios) == ("human31", HEIGHT, {}, {})
    assert other.lengths_mm["RHip_RKnee"] == 444.0
    assert other.lengths_mm["LHip_LKnee"] == pytest.approx(410.0)
    assert other.lengths_mm["Neck_Head"] == pytest.approx(
        _distance(fit_subject(human31, subject)[0], "Neck_Head")
    )


def test_a_subject_file_comes_back_as_written(tmp_path: Path) -> None:
    path = tmp_path / "subject.toml"
    for subject in (
        Subject(),
        Subject("dog", 600.0, {"Poll_Nose": 200.0}, {"tail_length": 10.0}, {"chest_scale": 1.0}),
    ):
        write_subject(subject, path)
        assert read_subject(path) == subject


def test_an_empty_subject_file_is_of_the_usual_body_or_its_sessions(tmp_path: Path) -> None:
    path = tmp_path / "subject.toml"
    path.write_text("")
    assert read_subject(path) == Subject(body=DEFAULT_BODY)
    assert read_subject(path, "human25") == Subject(body="human25")
    path.write_text('body = "human29"\n')
    assert read_subject(path, "human25").body == "human29"


@pytest.mark.parametrize(("text", "words"), [
    ("height_mm = 'tall'", "Expected 'float"),
    ("hight_mm = 1780", "unknown field 'hight_mm'"),
    ("height_mm = nan", "height_mm is nan"),
    ("[lengths_mm]\nRHip_RKnee = -4", "'RHip_RKnee' is -4"),
    ("height_mm = ", "subject.toml"),
])  # fmt: skip
def test_a_wrong_subject_file_is_named(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "subject.toml"
    path.write_text(text)
    with pytest.raises(BodyError) as caught:
        read_subject(path)
    assert "subject.toml" in caught.value.message
    assert words in caught.value.message
    assert caught.value.hint


def test_a_subject_cannot_be_changed() -> None:
    with pytest.raises(AttributeError):
        Subject().body = "dog"


def test_a_missing_subject_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(BodyError, match="cannot be read"):
        read_subject(tmp_path / "subject.toml")


def test_a_shape_of_another_length_or_body_is_refused(human31: BodyModel) -> None:
    with pytest.raises(BodyError, match="shape of 57 numbers"):
        subject_from_shape(human31, np.ones(57))
    with pytest.raises(BodyError, match="'planar_arm4'"):
        subject_from_shape(load_body("planar_arm4"), np.ones(58))


@pytest.mark.parametrize(
    ("body", "subject", "spread"),
    [
        ("human35", Subject(height_mm=1700.0), 15.0),
        ("human35", Subject(), 90.0),
        ("human35", None, 90.0),
        ("human35", Subject(height_mm=1700.0, lengths_mm={"RHip_RKnee": 400.0}), None),
        ("human35", Subject(dimensions_mm={"left_thigh_length": 400.0}), None),
        ("mouse31", None, None),
    ],
)
def test_a_height_may_be_off_where_no_length_was_measured(
    body: str, subject: Subject | None, spread: float | None
) -> None:
    assert height_spread(load_body(body), subject) == (spread and pytest.approx(spread, rel=0.02))


def test_lengths_of_a_users_own_body_are_no_guess() -> None:
    own = with_dimensions(load_body("human35"), {"left_thigh_length": 410.0})
    assert height_spread(own, None) is None
    assert height_spread(own, Subject(height_mm=1700.0)) == 15.0
