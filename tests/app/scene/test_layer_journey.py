"""From whose places a layer's particles come, and what is drawn about the layer that is looked at."""

import dataclasses

import numpy as np
import pytest
from swaying_session import LAYERS, PARTICLES, cloud_record

from studio.app.scene.guarded_server import GuardedServer
from studio.app.scene.layer_journey import Journeys, glow, journey, lines_back, parent_rows, travelled
from studio.app.scene.particle_view import CloudStyle, ParticleView
from studio.app.scene.search_view import SearchLook, SearchView
from studio.app.scene.viewpoint import framed, on_screen
from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel, extremities
from studio.runs.drawing.colour_tokens import colour_tokens
from studio.search.trackers.tracker import NO_PARENT, LayerRecord

DARK = colour_tokens(True)
LENS = 0.85, 2.0


@pytest.fixture(scope="module")
def records(human: BodyModel) -> list[LayerRecord]:
    """A frame's layers, each drawn from the two heaviest and, every third, crossed with the one in row 2."""
    first = np.arange(PARTICLES) % 2
    second = np.where(np.arange(PARTICLES) % 3 == 0, 2, NO_PARENT)
    parents = np.stack([first, second])
    made = [cloud_record(human, 2, layer) for layer in range(LAYERS)]
    nothing = np.zeros((2, 0), dtype=np.int64)
    return [dataclasses.replace(one, parents=parents if one.layer < LAYERS - 1 else nothing) for one in made]


def test_particles_set_out_from_the_parent_that_is_nearer_and_the_childless_stay_behind() -> None:
    before = np.zeros((4, 2, 2, 3))
    before[1, :, 1] = 1.0
    before[2, 0, 1], before[2, 1, 1] = 5.0, 0.9
    after = np.zeros((3, 2, 2, 3))
    after[1, 0, 1], after[1, 1, 1] = 4.0, 1.0
    found = journey(before, after, np.array([[0, 1, NO_PARENT], [NO_PARENT, 2, NO_PARENT]]))
    np.testing.assert_array_equal(found.start[0], before[0])
    np.testing.assert_array_equal(found.start[1, 0], before[2, 0], "of this limb the second parent is nearer")
    np.testing.assert_array_equal(found.start[1, 1], before[1, 1])
    np.testing.assert_array_equal(found.start[2], after[2], "nobody knows where it came from")
    np.testing.assert_array_equal(found.dead, before[[3]])
    np.testing.assert_allclose(found.at(0.5), (found.start + found.end) / 2.0)
    assert [travelled(0.0), travelled(1.0)] == [0.0, 1.0]
    assert (np.diff([travelled(share) for share in np.linspace(0.0, 0.7, 20)]) > 0.0).all()


def test_parents_are_rows_of_what_was_kept(records: list[LayerRecord]) -> None:
    whole = parent_rows(records[0], records[1])
    np.testing.assert_array_equal(whole, records[0].parents)
    # Of both layers only some particles were kept: rows are numbers within those.
    kept = np.array([0, 2, 5])
    thin = [
        dataclasses.replace(one, poses=one.poses[kept], log_weights=one.log_weights[kept], rows=kept)
        for one in records[:2]
    ]
    np.testing.assert_array_equal(
        parent_rows(thin[0], thin[1]), [[0, 0, NO_PARENT], [1, NO_PARENT, NO_PARENT]], "number 1 was not kept"
    )
    assert (parent_rows(records[0], records[2]) == NO_PARENT).all(), "not the layer after"
    assert (parent_rows(records[3], records[3]) == NO_PARENT).all()


def test_lines_lead_back_by_first_parents(records: list[LayerRecord]) -> None:
    lines = lines_back(records)
    assert len(lines) == LAYERS
    np.testing.assert_array_equal(lines[-1], np.arange(PARTICLES))
    np.testing.assert_array_equal(lines[-2], np.arange(PARTICLES) % 2)
    np.testing.assert_array_equal(lines[0], np.arange(PARTICLES) % 2 % 2)
    # Another search began in between: the line ends there.
    cut = [
        *records[:1],
        dataclasses.replace(records[1], parents=np.zeros((2, 0), dtype=np.int64)),
        *records[2:],
    ]
    assert (lines_back(cut)[0] == NO_PARENT).all()
    assert lines_back([]) == []


def test_what_weighs_most_glows_most(records: list[LayerRecord]) -> None:
    shares = glow(dataclasses.replace(records[0], beta=0.5))
    weights = records[0].log_weights
    assert shares.max() == 1.0
    assert shares.argmax() == weights.argmax()
    np.testing.assert_allclose(shares, np.exp(0.5 * (weights - weights.max())))
    assert glow(dataclasses.replace(records[0], beta=float("nan"))).min() == pytest.approx(0.0)
    nothing = dataclasses.replace(records[0], log_weights=np.full(PARTICLES, -np.inf))
    assert (glow(nothing) == 0.0).all()


@pytest.fixture
def drawn(server: GuardedServer, human: BodyModel) -> tuple[ParticleView, SearchView]:
    cloud = ParticleView(server, human)
    return cloud, SearchView(server, human, cloud)


def look(human: BodyModel, **changes: object) -> SearchLook:
    whole = SearchLook(extremities(human), LAYERS, 0.02, True, True, None, ())
    return dataclasses.replace(whole, **changes)  # pyright: ignore[reportArgumentType]


def style(human: BodyModel, layer: int | None) -> CloudStyle:
    return CloudStyle(extremities(human), "layer", layer, LAYERS, 0.02, glows=layer is not None)


def test_a_layers_particles_travel_and_nothing_but_places_is_sent(
    server: GuardedServer,
    human: BodyModel,
    records: list[LayerRecord],
    drawn: tuple[ParticleView, SearchView],
) -> None:
    cloud, search = drawn
    cloud.show(records, style(human, 2), DARK)
    search.show(records, 2, look(human), DARK, 0.0)
    limbs = list(extremities(human))
    ends = Journeys(human)
    way = ends.to(records[2], records[1])
    handle = cloud.handles[2]
    np.testing.assert_allclose(handle.points, way.start[:, limbs, 1].reshape(-1, 3), atol=1e-6)
    assert search.dead.visible
    buffer = server._websock_server._broadcast_buffer
    before = buffer.message_counter
    for phase in (0.02, 0.1, 0.2):
        search.travel(phase)
    sent = [buffer.message_from_id.get(number) for number in range(before, buffer.message_counter)]
    assert {key for one in sent if one is not None for key in getattr(one, "updates", {"other": 0})} == {
        "points"
    }
    search.travel(1.0)
    own = limb_ends(human, records[2].poses)[:, limbs, 1].reshape(-1, 3) / 1000.0
    np.testing.assert_allclose(handle.points, own, atol=1e-6)
    assert not search.dead.visible
    assert search.shells.visible
    assert len(search.shells.points) == 2 * min(PARTICLES, 60) * len(limbs)
    assert search.skeletons.handle.points.shape[1:] == (2, 3)
    # One that was left on its way stands at its own place where all layers are shown.
    search.travel(0.1)
    cloud.show(records, style(human, None), DARK)
    search.show(records, None, look(human), DARK)
    np.testing.assert_allclose(handle.points, own, atol=1e-6)
    assert not any(one.visible for one in (search.shells, search.dead, search.skeletons.handle))


def test_a_particle_has_a_line_back_to_the_first_layer_and_a_limb_the_ways_of_all(
    human: BodyModel, records: list[LayerRecord], drawn: tuple[ParticleView, SearchView]
) -> None:
    cloud, search = drawn
    cloud.show(records, style(human, 3), DARK)
    search.show(records, 3, look(human, particle=5), DARK)
    limbs = extremities(human)
    line = search.lineage.handle
    assert line.visible
    assert line.points.shape == (3 * len(limbs), 2, 3)
    tip = limb_ends(human, records[3].poses[5])[0, limbs[0], 1] / 1000.0
    np.testing.assert_allclose(line.points[2 * len(limbs), 1], tip, atol=1e-6)
    assert not search.ways.handle.visible
    search.show(records, 3, look(human, limb=(limbs[0],)), DARK)
    assert search.ways.handle.points.shape == (3 * PARTICLES, 2, 3)
    assert not line.visible


def test_the_particle_under_the_pointer_is_named_with_its_line(
    human: BodyModel, records: list[LayerRecord], drawn: tuple[ParticleView, SearchView]
) -> None:
    cloud, search = drawn
    cloud.show(records, style(human, 3), DARK)
    search.show(records, 3, look(human), DARK)
    limbs = extremities(human)
    places = Journeys(human).places(records[3])[:, list(limbs), 1]
    eye = framed(places.reshape(-1, 3), np.array([1.0, 0.3, 0.2]), *LENS)
    across, down, _ = on_screen(places[4, :1], eye, *LENS)[0]
    found = search.pointed((float(across), float(down)), eye, LENS, 0.05)
    assert (found.layer, found.particle, found.particles) == (3, 4, PARTICLES)
    assert found.line == (0, 0, 0, 4)
    assert found.log_weight == records[3].log_weights[4]
    assert 0.0 < found.weight <= 1.0
    assert search.pointed((0.02, 0.02), eye, LENS, 0.05) is None
