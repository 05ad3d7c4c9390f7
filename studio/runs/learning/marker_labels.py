"""A person's joint markers among a file's labelled points.

Labels differ between programs: case, spaces, hyphens, a subject's name before a colon and a word that all begin with
(`Bip01 L Thigh`, `Character1_LeftUpLeg`) do not count; joints have many names; and Vicon's Plug-in Gait puts markers on
the skin, from which joints are estimated.
"""

import re
from collections.abc import Sequence

import numpy as np

from studio.body.person import MARKERS
from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError

SYNONYMS: dict[str, tuple[str, ...]] = {
    "Hip": ("hip", "midhip", "hips", "pelvis", "root"),
    "Neck": ("neck", "lowerneck", "neck1", "c7"),
    "Head": ("headtop", "headend", "headnub", "vertex", "topofhead", "head"),
    "Hip side": ("hip", "upleg", "thigh", "upperleg", "femur", "hipjoint", "hjc"),
    "Knee": ("knee", "leg", "lowleg", "lowerleg", "shin", "calf", "tibia", "kjc"),
    "Ankle": ("ankle", "foot", "ajc"),
    "Shoulder": ("arm", "upperarm", "uparm", "humerus", "shoulder", "sjc"),
    "Elbow": ("elbow", "forearm", "lowarm", "lowerarm", "radius", "ejc"),
    "Wrist": ("wrist", "hand", "wjc"),
}
SIDE_WORDS = {"R": ("right", "r"), "L": ("left", "l")}
OPTIONAL = ("Hip", "Neck", "Head")

# Plug-in Gait. The hip joints lie this share of the distance of both anterior spines behind, beside and below their
# middle (Bell, Pedersen & Brand 1990: 0.19, 0.36, 0.30).
SPINES, BEHIND, BESIDE, BELOW = ("lasi", "rasi", "lpsi", "rpsi"), 0.19, 0.36, 0.30
SKIN: dict[str, tuple[tuple[str, ...], ...]] = {
    "Neck": (("c7", "clav"),),
    "Head": (("lfhd", "rfhd", "lbhd", "rbhd"), ("lfhd", "rfhd")),
    **{
        f"{side}{joint}": choices
        for side in "RL"
        for joint, choices in (
            ("Knee", ((f"{side.lower()}kne",),)),
            ("Ankle", ((f"{side.lower()}ank",),)),
            ("Shoulder", ((f"{side.lower()}sho",),)),
            ("Elbow", ((f"{side.lower()}elb",),)),
            ("Wrist", ((f"{side.lower()}wra", f"{side.lower()}wrb"), (f"{side.lower()}wra",))),
        )
    },
}


def person_markers(labels: Sequence[str], points: Array, source: str) -> tuple[tuple[str, ...], Array]:
    """Names and positions (F, M, 3) of a person's markers among labelled points (F, P, 3), NaN where missing.

    The twelve of arms and legs must be there; those of trunk and head may be missing. source : for messages. Raises
    StudioError naming the markers that are missing and the labels that the file has.
    """
    shared = shared_beginning(labels)
    at = {_plain(label[shared:] or label): place for place, label in reversed(list(enumerate(labels)))}
    joints = {name: points[:, at[label]] for name in MARKERS if (label := _label_of(name, at)) is not None}
    skin = _from_skin(at, points)
    markers = joints if _missing(joints) <= _missing(skin) else {**joints, **skin}
    missing = [name for name in MARKERS if name not in markers and name not in OPTIONAL]
    if missing:
        listed = ", ".join(labels[:60]) + (", ..." if len(labels) > 60 else "")
        raise StudioError(
            f"'{source}' has no points for {', '.join(missing)}; its points are: {listed or 'none'}.",
            f"Label the points {', '.join(MARKERS)} (or RightKnee, R_Knee, ...), or as Vicon's Plug-in Gait does.",
        )
    if "Hip" not in markers:
        markers["Hip"] = 0.5 * (markers["RHip"] + markers["LHip"])
    names = tuple(name for name in MARKERS if name in markers)
    return names, np.stack([markers[name] for name in names], axis=1)


def shared_beginning(labels: Sequence[str]) -> int:
    """Characters of a whole word that all labels begin with, 0 without one."""
    first, last = (min(labels), max(labels)) if len(labels) > 1 else ("", "")
    alike = (at for at, (one, other) in enumerate(zip(first, last, strict=False)) if one != other)
    shared = next(alike, min(len(first), len(last)))
    while shared and not all(_parts(label, shared) for label in labels):
        shared -= 1
    return shared


def _parts(label: str, at: int) -> bool:
    """Whether a word of a label ends at a character."""
    return at == len(label) or not label[at - 1].isalnum() or not label[at].isalnum()


def _plain(label: str) -> str:
    return re.sub(r"[^a-z0-9]", "", label.rsplit(":", 1)[-1].lower())


def _missing(markers: dict[str, Array]) -> int:
    return sum(name not in markers and name not in OPTIONAL for name in MARKERS)


def _label_of(name: str, at: dict[str, int]) -> str | None:
    """The label of a marker, the best of its names; None where there is none."""
    if name in OPTIONAL:
        return next((word for word in SYNONYMS[name] if word in at), None)
    side, joint = name[0], name[1:]
    for word in SYNONYMS["Hip side" if joint == "Hip" else joint]:
        for prefix in SIDE_WORDS[side]:
            for label in (prefix + word, word + prefix):
                if label in at:
                    return label
    return None


def _from_skin(at: dict[str, int], points: Array) -> dict[str, Array]:
    """The joints estimated from Plug-in Gait's markers."""
    markers: dict[str, Array] = {}
    for name, choices in SKIN.items():
        whole = [choice for choice in choices if all(label in at for label in choice)]
        if whole:
            markers[name] = np.mean([points[:, at[label]] for label in whole[0]], axis=0)
    if all(label in at for label in SPINES):
        markers |= _hips(*(points[:, at[label]] for label in SPINES))
    return markers


def _hips(left: Array, right: Array, left_back: Array, right_back: Array) -> dict[str, Array]:
    """Hip joints from the four spines of the pelvis, (F, 3) each."""
    front, back = 0.5 * (left + right), 0.5 * (left_back + right_back)
    across = left - right
    width = np.linalg.norm(across, axis=1, keepdims=True)
    across = across / width
    ahead = front - back
    ahead = ahead - across * (ahead * across).sum(axis=1, keepdims=True)
    ahead = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
    down = -np.cross(ahead, across)
    middle = front + width * (BELOW * down - BEHIND * ahead)
    return {"LHip": middle + BESIDE * width * across, "RHip": middle - BESIDE * width * across}
