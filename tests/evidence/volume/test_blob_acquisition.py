"""Blobs learnt from hulls whose colours and poses are known."""

import itertools

import numpy as np
import pytest
from posed_hulls import empty_hull, hull_of, learn_blobs, limb_colours, near, plain

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_frames
from studio.body.model import BodyModel, kinematic_tables
from studio.evidence.volume.blob_acquisition import (
    BINS,
    SEEN,
    SUMS,
    Profiles,
    blobs_of,
    colour_change,
    parts_of,
)
from studio.evidence.volume.blob_fitting import Voxels, nearest_blobs
from studio.evidence.volume.blob_model import cone_blobs, cone_moments
from studio.evidence.volume.hull import Hull

Array = np.ndarray


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return load_body("human25")


def limb_number(body: BodyModel, name: str) -> int:
    return next(index for index, limb in enumerate(body.drawn) if limb.name == name)


def slices_of(colours: Array, spread: float = 5.0, length: float = 400.0) -> Array:
    """(BINS, SUMS) of a limb with the given colour in each slice."""
    rng = np.random.default_rng(0)
    made = np.zeros((BINS, SUMS))
    for index, colour in enumerate(colours):
        z = length * (index + rng.random(200)) / BINS
        place = np.column_stack([rng.normal(0, 20, (200, 2)), z])
        seen = colour + rng.normal(0, spread, (200, 3))
        rows = np.column_stack([np.ones(200), place, place**2, place[:, 2:] * seen, seen, seen**2])
        made[index] = rows.sum(axis=0)
    return made


def stepped(*levels: float) -> Array:
    """(BINS, 3) equal stretches of grey."""
    return np.repeat(np.array(levels), BINS // len(levels))[:, None] * np.ones(3)


def test_limbs_of_one_colour_keep_one_blob_and_it_is_the_limbs(body: BodyModel) -> None:
    poses = np.stack([near(body, body.neutral, seed, frames=4) for seed in range(5)])
    model = learn_blobs(body, [hull_of(body, pose, seed=n) for n, pose in enumerate(poses)], poses)
    cones, colours = cone_blobs(body), limb_colours(body)
    shins = [limb_number(body, "left shin"), limb_number(body, "right forearm"), limb_number(body, "head")]
    for limb in shins:
        (blob,) = np.flatnonzero(model.limb == limb)
        np.testing.assert_allclose(model.colour[blob], colours[limb], atol=4.0)
        assert model.offset[blob] == pytest.approx(cones.offset[limb], abs=20.0)
        # The grid's own size is in the eigenvalues, and joints are shared with neighbours.
        np.testing.assert_allclose(
            np.sqrt(model.eigenvalues[blob]), np.sqrt(cones.eigenvalues[limb]), atol=8.0
        )
    assert model.weight.sum() == pytest.approx(1.0)


def test_a_limb_of_two_colours_is_split_where_they_meet(body: BodyModel) -> None:
    thigh = limb_number(body, "left thigh")
    even = plain(body)

    def shorts(limb: int, along: Array) -> Array:
        colours = even(limb, along)
        if limb == thigh:
            colours = np.where(along[:, None] < 0.4, [40.0, 60.0, 80.0], [150.0, 160.0, 190.0])
        return colours

    poses = np.stack([near(body, body.neutral, seed, frames=4) for seed in range(4)])
    hulls = [hull_of(body, pose, colour=shorts, seed=n) for n, pose in enumerate(poses)]
    model = learn_blobs(body, hulls, poses)
    own = np.flatnonzero(model.limb == thigh)
    assert len(own) == 2
    length = abs(body.drawn[thigh].length)
    ends = [blob for blob in own if abs(model.offset[blob]) > 0.4 * length]
    tops = [blob for blob in own if abs(model.offset[blob]) <= 0.4 * length]
    np.testing.assert_allclose(model.colour[tops[0]], [40, 60, 80], atol=15)
    np.testing.assert_allclose(model.colour[ends[0]], [150, 160, 190], atol=15)
    share = model.weight[tops[0]] / model.weight[own].sum()
    assert share == pytest.approx(0.45, abs=0.1)
    assert len(np.flatnonzero(model.limb == limb_number(body, "right thigh"))) == 1


def test_the_criterion_in_closed_form() -> None:
    """A step of Δ in the middle of an even limb: cov(z, c) = Δ L / 8 a channel, over L / √12."""
    grey = colour_change(slices_of(stepped(80.0, 120.0)).sum(axis=0))
    assert grey == pytest.approx(np.sqrt(3) * 40.0 * np.sqrt(12) / 8, rel=0.03)
    assert colour_change(slices_of(stepped(80.0)).sum(axis=0)) < 1.0
    longer = colour_change(slices_of(stepped(80.0, 120.0), length=90.0).sum(axis=0))
    assert longer == pytest.approx(grey, rel=0.05)


def test_splits_go_where_colours_change_and_stop_at_the_threshold() -> None:
    assert parts_of(slices_of(stepped(80.0)), 12.0) == [(0, BINS)]
    assert parts_of(slices_of(stepped(80.0, 140.0)), 12.0) == [(0, 12), (12, BINS)]
    assert parts_of(slices_of(stepped(40.0, 100.0, 160.0)), 12.0) == [(0, 8), (8, 16), (16, BINS)]
    assert parts_of(slices_of(stepped(40.0, 100.0, 160.0)), 12.0, most_parts=2) in (
        [(0, 8), (8, BINS)],
        [(0, 16), (16, BINS)],
    )
    assert parts_of(slices_of(stepped(80.0, 90.0)), 12.0) == [(0, BINS)]
    # As the paper's criterion has it, stripes that return to where they began are no change along the bone.
    assert parts_of(slices_of(stepped(80.0, 140.0, 80.0)), 12.0) == [(0, BINS)]


def test_halves_of_different_splits_merge() -> None:
    """A steady climb within a step: cut first at the step, then in its parts, of which two are alike again."""
    slices = slices_of(stepped(40.0, 40.0, 90.0, 90.0, 90.0, 190.0))
    parts = parts_of(slices, 12.0)
    assert parts == [(0, 8), (8, 20), (20, BINS)]
    for first, second in itertools.pairwise(parts):
        union = slices[first[0] : second[1]].sum(axis=0)
        assert colour_change(union) >= 6.0


def test_frames_add_up_and_a_limb_never_seen_keeps_its_cone(body: BodyModel) -> None:
    pose = body.neutral
    hull = hull_of(body, pose)
    profiles = Profiles.none(body).with_frame(body, cone_blobs(body), hull, pose)
    assert profiles.sums[..., 0].sum() == pytest.approx(hull.volume())
    twice = profiles.with_frame(body, cone_blobs(body), hull, pose)
    assert twice.frames == 2
    np.testing.assert_allclose(twice.sums, 2.0 * profiles.sums)
    once, again = blobs_of(body, profiles, 12.0), blobs_of(body, twice, 12.0)
    np.testing.assert_allclose(again.eigenvalues, once.eigenvalues)
    hidden = limb_number(body, "right foot")
    sums = profiles.sums.copy()
    sums[hidden] = 0.0
    model = blobs_of(body, Profiles(sums, 1), 12.0)
    (blob,) = np.flatnonzero(model.limb == hidden)
    cones = cone_blobs(body)
    assert np.isnan(model.colour[blob]).all()
    assert model.offset[blob] == cones.offset[hidden]
    assert 0.0 < model.weight[blob] < cones.weight[hidden]


def test_a_blob_weighs_what_is_seen_of_it(body: BodyModel) -> None:
    seen = Profiles.none(body).with_frame(body, cone_blobs(body), hull_of(body, body.neutral), body.neutral)
    volumes = seen.sums[:, :, 0].sum(axis=1)
    everywhere = np.where((volumes > 0.0)[:, None, None], seen.sums, seen.sums.max(axis=0))
    model = blobs_of(body, Profiles(everywhere, 1), 1e9)
    volumes = everywhere[:, :, 0].sum(axis=1)
    np.testing.assert_allclose(model.weight, volumes[model.limb] / volumes.sum(), rtol=1e-12)


def test_nothing_learnt_is_the_cones(body: BodyModel) -> None:
    model, cones = blobs_of(body, Profiles.none(body), 12.0), cone_blobs(body)
    for name in ("limb", "offset", "eigenvalues", "colour", "weight"):
        np.testing.assert_array_equal(getattr(model, name), getattr(cones, name))
    learnt = learn_blobs(body, [empty_hull()], body.neutral[None])
    np.testing.assert_array_equal(learnt.offset, cones.offset)


def test_what_is_seen_of_a_limb_has_to_be_a_share_of_it_in_every_frame(body: BodyModel) -> None:
    shin = limb_number(body, "left shin")
    enough = SEEN * cone_moments(body).volume[shin]
    slices = slices_of(stepped(80.0))
    for share, learnt in ((0.9, False), (1.1, True)):
        sums = np.zeros((len(body.drawn), BINS, SUMS))
        sums[shin] = slices * (share * 6.0 * enough / slices[:, 0].sum())
        model = blobs_of(body, Profiles(sums, 6), 12.0)
        assert np.isfinite(model.colour[model.limb == shin]).all() == learnt


def test_a_slice_holds_what_the_voxels_of_its_stretch_of_the_limb_sum_to(body: BodyModel) -> None:
    pose = near(body, body.neutral, 7, frames=4)
    fine = hull_of(body, pose, spacing=35.0)
    edges = np.random.default_rng(1).choice([20.0, 40.0], len(fine.edges))
    hull = Hull(fine.centres, edges, fine.colours, fine.view_colours, 7, fine.box)
    model = cone_blobs(body)
    profiles = Profiles.none(body).with_frame(body, model, hull, pose)
    voxels = Voxels.of(hull)
    coloured = model.in_colour(voxels.colour, voxels.colour_variance)
    limbs = model.limb[nearest_blobs(voxels, coloured.mixture(body, pose).at(0))]
    frames, lengths = limb_frames(body, pose)[0], kinematic_tables(body).limb_shape[:, 0]
    expected, slices = np.zeros((len(body.drawn), 24, 16)), set()
    for limb, centre, edge, colour in zip(
        limbs, hull.centres, hull.edges, hull.colours.astype(float), strict=True
    ):
        x, y, z = place = frames[limb, :, :3].T @ (centre - frames[limb, :, 3])
        along = z / lengths[limb]
        # Twenty-four slices from a tenth before the limb to a tenth behind it.
        number = min(max(int(np.floor((along + 0.1) * 20.0)), 0), 23)
        slices.add(number)
        row = [1.0, x, y, z, *(place**2 + edge**2 / 12.0), *(z * colour), *colour, *colour**2]
        expected[limb, number] += edge**3 * np.array(row)
    np.testing.assert_allclose(profiles.sums, expected, rtol=1e-6, atol=1e-3)
    assert profiles.frames == 1
    assert {0, 1, 12, 22} <= slices


def plain_criterion(slices: Array) -> float:
    sums = slices.sum(axis=0)
    place, colour = sums[3] / sums[0], sums[10:13] / sums[0]
    spread = max(sums[6] / sums[0] - place**2, 25.0)
    return float(np.linalg.norm(sums[7:10] / sums[0] - place * colour) / np.sqrt(spread))


def plain_parts(slices: Array, split: float, most: int) -> list[tuple[int, int]]:
    """Cut by cut, each where the two parts' colours vary least, then union by union."""
    parts, volume = [(0, len(slices))], slices[:, 0].sum()
    while len(parts) < most:
        cuts = []
        for first, last in parts:
            change = plain_criterion(slices[first:last]) if slices[first:last, 0].sum() else 0.0
            within = []
            for cut in range(first + 1, last):
                sides = slices[first:cut].sum(axis=0), slices[cut:last].sum(axis=0)
                if min(side[0] for side in sides) >= max(0.15 * volume, 1e-300):
                    varied = sum((side[13:16] - side[10:13] ** 2 / side[0]).sum() for side in sides)
                    within.append((varied, cut))
            if change > split and within:
                cuts.append((change, first, last, min(within)[1]))
        if not cuts:
            break
        _, first, last, cut = max(cuts)
        at = parts.index((first, last))
        parts[at : at + 1] = [(first, cut), (cut, last)]
    while len(parts) > 1:
        unions = [plain_criterion(slices[a:b]) for (a, _), (_, b) in itertools.pairwise(parts)]
        if min(unions) >= 0.5 * split:
            break
        at = int(np.argmin(unions))
        parts[at : at + 2] = [(parts[at][0], parts[at + 1][1])]
    return parts


def test_parts_of_any_limb_are_those_of_cuts_and_unions_one_by_one() -> None:
    rng, counts = np.random.default_rng(3), []
    for number in range(40):
        levels = rng.choice([40.0, 70.0, 120.0, 190.0], (rng.choice([2, 3, 4, 6, 8]), 3))
        slices = slices_of(np.repeat(levels, BINS // len(levels), axis=0), length=rng.choice([20.0, 400.0]))
        slices *= rng.uniform(0.3, 1.5, (BINS, 1))
        if number % 3 == 0:
            slices[: rng.integers(1, 6)] = 0.0
        split, most = rng.uniform(4.0, 30.0), int(rng.integers(2, 6))
        parts = parts_of(slices, split, most)
        assert parts == plain_parts(slices, split, most)
        assert most != 4 or parts_of(slices, split) == parts
        counts.append(len(parts))
    assert {1, 2, 3, 4} <= set(counts)


def test_a_blob_is_described_by_the_moments_of_its_slices(body: BodyModel) -> None:
    shin, frames = limb_number(body, "left shin"), 3
    slices = slices_of(stepped(80.0, 150.0), spread=9.0)
    sums = np.zeros((len(body.drawn), BINS, SUMS))
    sums[shin] = slices * (5.0 * frames * cone_moments(body).volume[shin] / slices[:, 0].sum())
    model = blobs_of(body, Profiles(sums, frames), 12.0)
    own = np.flatnonzero(model.limb == shin)
    assert len(own) == 2
    volumes = np.where(np.arange(len(body.drawn)) == shin, 0.0, 0.05 * frames * cone_moments(body).volume)
    whole = volumes.sum() + sums[shin, :, 0].sum()
    for blob, part in zip(own, (sums[shin, :12].sum(axis=0), sums[shin, 12:].sum(axis=0)), strict=True):
        means = part[1:4] / part[0]
        assert model.offset[blob] == pytest.approx(means[2])
        np.testing.assert_allclose(model.eigenvalues[blob], np.maximum(part[4:7] / part[0] - means**2, 25.0))
        colour = part[10:13] / part[0]
        np.testing.assert_allclose(model.colour[blob], colour)
        np.testing.assert_allclose(
            model.colour_variance[blob], np.maximum(part[13:16] / part[0] - colour**2, 36.0)
        )
        assert model.weight[blob] == pytest.approx(part[0] / whole)
    unseen = np.flatnonzero(model.limb != shin)
    np.testing.assert_allclose(model.weight[unseen], np.delete(volumes, shin) / whole)
    np.testing.assert_array_equal(
        model.eigenvalues[unseen], np.delete(cone_blobs(body).eigenvalues, shin, axis=0)
    )
