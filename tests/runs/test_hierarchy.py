"""The tree of every body of the catalogue, as partitions see it."""

import numpy as np
import pytest

from studio.body.catalogue import list_bodies, load_body
from studio.body.model import BodyModel
from studio.results.drawing_footage.recipe_file import RECIPES
from studio.runs.hierarchy import hierarchy_of
from studio.runs.search_space import default_sigma, search_space
from studio.search.trackers import partitions
from studio.search.trackers.swarm_settings import PARTITIONS, SwarmSettings


def named(name: str, chosen: np.ndarray) -> set[str]:
    """The parameters of a body that a mask chooses."""
    return {entry.name for entry, one in zip(load_body(name).parameters, chosen, strict=True) if one}


def test_the_lee_walk_body_has_the_papers_stages() -> None:
    tree = hierarchy_of(load_body("human31"))
    assert np.array_equal(np.flatnonzero(tree.depth == 0), range(6)), "x1 … x6"
    assert np.array_equal(np.flatnonzero(tree.position), [3, 4, 5]), "x4 … x6"
    assert named("human31", tree.depth == 2) == {
        "left_knee_ry",
        "right_knee_ry",
        "left_elbow_ry",
        "right_elbow_ry",
    }


def test_the_lee_walk_body_has_twelve_subspaces() -> None:
    # John, Trucco & Ivekovic 2010: position, orientation, torso, head, and two for each arm and leg.
    tree = hierarchy_of(load_body("human31"))
    found = [named("human31", tree.subspace == number) for number in range(tree.subspace.max() + 1)]
    assert len(found) == 12
    assert found[0] == {"pelvis_x", "pelvis_y", "pelvis_z"}
    assert found[1] == {"pelvis_rx", "pelvis_ry", "pelvis_rz"}
    assert found[2] == {"thorax_ry", "thorax_rz"}
    assert {"head_rx", "head_ry", "head_rz"} in found
    assert {"left_hip_rx", "left_hip_ry", "left_hip_rz"} in found
    shoulder = {"left_clavicle_rx", "left_clavicle_ry"} | {f"left_shoulder_r{axis}" for axis in "xyz"}
    assert shoulder in found
    assert found.index(shoulder) < found.index({"left_elbow_ry"})


@pytest.mark.parametrize(
    ("name", "subspaces"), [("human29", 12), ("human34", 12), ("human25", 11), ("dog", 14)]
)
def test_other_bodies_are_cut_at_knees_and_elbows(name: str, subspaces: int) -> None:
    tree = hierarchy_of(load_body(name))
    assert tree.subspace.max() + 1 == subspaces
    far = named(name, tree.depth == 2)
    hinges = {"left_elbow", "right_elbow"} | (
        {"left_stifle", "left_hock"} if name == "dog" else {"left_knee", "left_ankle"}
    )
    assert hinges <= far
    assert not any("hip" in entry or "shoulder" in entry or "clavicle" in entry for entry in far)


@pytest.mark.parametrize(
    ("name", "kinds"), [("human31", (8, 12)), ("human25", (8, 10)), ("dog", (8, 8)), ("planar_arm4", ())]
)
def test_kinds_of_limbs(name: str, kinds: tuple[int, ...]) -> None:
    pair = hierarchy_of(load_body(name)).pair
    assert sorted(int((pair == number).sum()) for number in range(pair.max() + 1)) == sorted(kinds)


def test_what_moves_a_tree_on_a_fixed_base_is_its_root() -> None:
    """A robot's first axis stands on a base that is bolted down."""
    body = load_body(str(RECIPES / "robot_arm.urdf"))
    assert hierarchy_of(body).depth.tolist() == [0, 1, 1, 2, 2, 2]


@pytest.mark.parametrize("name", list_bodies())
def test_every_body_can_be_partitioned(name: str) -> None:
    body = load_body(name)
    tree = search_space(body, default_sigma(body, 60.0)).hierarchy
    count = len(body.parameters)
    assert (tree.depth == 0).any()
    for array in (tree.depth, tree.position, tree.subspace, tree.pair):
        assert array.shape == (count,)
    # A parameter never comes before one that it hangs on.
    assert np.all(np.diff(np.sort(np.unique(tree.subspace))) == 1)
    for joint in body.joints:
        own = _parameters(body, joint.name)
        above = joint.parent
        while above >= 0:
            for lower in own:
                for upper in _parameters(body, body.joints[above].name):
                    assert tree.subspace[upper] <= tree.subspace[lower]
                    assert tree.depth[upper] <= tree.depth[lower]
            above = body.joints[above].parent
    for partition in PARTITIONS:
        settings = SwarmSettings(partition=partition)
        stages = partitions.stages_of(tree, settings)
        assert sum(stage.particles * stage.iterations for stage in stages) == 1000
        assert np.all(np.max([stage.freedom for stage in stages], axis=0) > 0.0), "everything moves once"


def _parameters(body: BodyModel, joint: str) -> set[int]:
    found = next(entry for entry in body.joints if entry.name == joint)
    return {step.parameter for step in found.steps if step.parameter >= 0}
