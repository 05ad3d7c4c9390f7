"""A body's file changed and written again: sizes, limits, markers, one side mirrored onto the other.

Every change is of the definition (`definition.py`) and is checked like a file that is read, so that what comes out can
be saved as a body of one's own. Nothing here reads or writes files.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import msgspec
import numpy as np

from studio.body.definition import BodyDefinition, LimbEntry, MarkerEntry, ParameterEntry, split_sign
from studio.body.forward_kinematics import joint_frames
from studio.body.mirroring import Mirror, name_twins
from studio.body.model import BodyModel
from studio.body.reader import parse_body
from studio.body.stretching import stretch_name
from studio.body.subject import LONGEST_MM
from studio.body.writing import body_text, sized_definition, unit_of
from studio.foundations.errors import BodyError

SIZES = ("length", "radius_start", "radius_end", "scale_x", "scale_y")
LIMITS = ("lower", "upper", "neutral", "max_step")
SIDES = ("left", "right")
MOST_SCALE = 20.0
SAME_MM = 1e-6
"""Sizes and places within which a mirrored entry is left as it is written."""
QUARTER = 90.0
"""Degrees."""
SHARE_DIGITS = 9
MARKER = re.compile(r"([^=]+)=([^,=]+),([^,]+),([^,]+),([^,]+)")


@dataclass(frozen=True, slots=True, eq=False)
class BodyEdit:
    """A changed body. notes : on what else followed from a change, for a person."""

    body: BodyModel
    notes: tuple[str, ...] = ()


def edited(
    body: BodyModel,
    *,
    sizes: Mapping[str, float] | None = None,
    limits: Mapping[str, float] | None = None,
    markers: Sequence[str] = (),
    without_markers: Sequence[str] = (),
    mirror: str = "",
    title: str = "",
) -> BodyEdit:
    """The body with changes: sizes, limits and markers first, then the side `mirror` ("left" or "right") is copied to
    the other.

    sizes : mm (scales and ratios without unit) of a dimension, or of a limb by "LIMB.length", ".radius_start",
    ".radius_end", ".scale_x" or ".scale_y". limits : degrees or mm by "PARAMETER.lower", ".upper", ".neutral" or
    ".max_step"; ±inf takes a limit away. markers : "NAME=JOINT,X,Y,Z", mm in the joint's frame; one that is there is
    moved. Raises BodyError with the part that is wrong and the remedy.
    """
    definition, notes = sized_definition(body), list[str]()
    for name, value in (sizes or {}).items():
        definition = _with_size(definition, name, value, notes)
    definition = _with_limits(definition, limits or {}, notes)
    definition = _without_markers(definition, without_markers)
    for text in markers:
        definition = _with_marker(definition, text)
    if title:
        definition = msgspec.structs.replace(definition, title=title)
    definition_now = _check(definition, body.name)
    if mirror:
        definition_now = _mirrored(definition_now, mirror, notes)
    return BodyEdit(definition_now, tuple(notes))


def _check(definition: BodyDefinition, name: str) -> BodyModel:
    """The body of a definition, read from its text: what is saved is what was checked."""
    bare = BodyModel(name, definition.title, (), (), (), (), _values(definition), definition)
    return parse_body(body_text(bare), name, f"{name}.toml")


def _values(definition: BodyDefinition) -> dict[str, float]:
    return {name: entry.value for name, entry in definition.dimensions.items()}


def _fail(part: str, cause: str, remedy: str) -> NoReturn:
    raise BodyError(f"{part} {cause}.", remedy)


# Sizes.


def _with_size(definition: BodyDefinition, name: str, value: float, notes: list[str]) -> BodyDefinition:
    """The definition with a dimension, or a size of a limb, of another value."""
    if name in definition.dimensions:
        return _with_dimension(definition, name, value)
    limb_name, dot, key = name.rpartition(".")
    limb = next((one for one in definition.limbs if one.name == limb_name), None)
    if not dot or limb is None:
        known = ", ".join([*definition.dimensions, *(f"{one.name}.radius_start" for one in definition.limbs)])
        _fail(f"'{name}'", "is no dimension and no size of a limb", f"Known: {known}.")
    if key not in SIZES:
        _fail(f"'{name}'", f"names no size of limb '{limb_name}'", f"A limb has {', '.join(SIZES)}.")
    written = getattr(limb, key)
    if isinstance(written, str):
        return _with_dimension(definition, split_sign(written)[1], value)
    _check_size(f"Limb '{limb_name}', {key},", value, key.startswith("scale"))
    if key == "length":
        notes.append(f"The length of '{limb_name}' is a number of its own: what hangs on it stays in place.")
        value = math.copysign(value, written)
    limbs = tuple(
        msgspec.structs.replace(one, **{key: value}) if one.name == limb_name else one
        for one in definition.limbs
    )
    return msgspec.structs.replace(definition, limbs=limbs)


def _with_dimension(definition: BodyDefinition, name: str, value: float) -> BodyDefinition:
    entry = definition.dimensions[name]
    is_ratio = entry.ratio is not None
    _check_size(f"Dimension '{name}'", abs(value) if entry.is_offset else value, is_ratio)
    changed = msgspec.structs.replace(entry, **{unit_of(entry): value})
    return msgspec.structs.replace(definition, dimensions={**definition.dimensions, name: changed})


def _check_size(part: str, value: float, is_scale: bool) -> None:
    most, unit = (MOST_SCALE, "") if is_scale else (LONGEST_MM, " mm")
    allowed = value > 0.0 if is_scale else value >= 0.0
    if not (math.isfinite(value) and allowed and value <= most):
        least = "above 0" if is_scale else "from 0"
        _fail(part, f"cannot be {value:g}", f"Give a number {least} to {most:g}{unit}.")


# Limits.


def _with_limits(definition: BodyDefinition, limits: Mapping[str, float], notes: list[str]) -> BodyDefinition:
    stretching = {stretch_name(limb): limb for limb in definition.limbs if limb.stretch is not None}
    known = {entry.name for entry in definition.parameters} | set(stretching)
    changes: dict[str, dict[str, float]] = {}
    for name, value in limits.items():
        parameter, dot, key = name.rpartition(".")
        if not dot or parameter not in known:
            _fail(
                f"'{name}'", "names no parameter", f"Write one of {', '.join(sorted(known))}, and '.lower'."
            )
        if key not in LIMITS:
            _fail(f"'{name}'", f"names nothing of parameter '{parameter}'", f"It has {', '.join(LIMITS)}.")
        changes.setdefault(parameter, {})[key] = value
    parameters = tuple(
        _limit(entry, changes[entry.name], notes) if entry.name in changes else entry
        for entry in definition.parameters
    )
    sized = _values(definition)
    limbs = tuple(
        _stretch(limb, changes[name], sized)
        if (name := stretch_name(limb)) in changes and name in stretching
        else limb
        for limb in definition.limbs
    )
    return msgspec.structs.replace(definition, parameters=parameters, limbs=limbs)


def _stretch(limb: LimbEntry, changes: Mapping[str, float], sizes: Mapping[str, float]) -> LimbEntry:
    """The limb with other bounds of its length, given as mm beyond it."""
    if "neutral" in changes:
        _fail(f"'{stretch_name(limb)}'", "is 0 at rest", f"Change the length of limb '{limb.name}' instead.")
    length = sizes[split_sign(str(limb.length))[1]]
    least, greatest = limb.stretch or (1.0, 1.0)
    if "lower" in changes:
        least = round(1.0 + changes["lower"] / length, SHARE_DIGITS)
    if "upper" in changes:
        greatest = round(1.0 + changes["upper"] / length, SHARE_DIGITS)
    step = changes.get("max_step", limb.stretch_step)
    return msgspec.structs.replace(limb, stretch=(least, greatest), stretch_step=step)


def _limit(entry: ParameterEntry, changes: Mapping[str, float], notes: list[str]) -> ParameterEntry:
    changed = msgspec.structs.replace(entry, **changes)
    rest = changed.neutral
    if isinstance(rest, tuple) or "neutral" in changes or changed.lower >= changed.upper:
        return changed
    inside = min(max(rest, changed.lower), changed.upper)
    if inside != rest:
        notes.append(f"The rest value of '{entry.name}' is {inside:g} now, for {rest:g} is outside.")
    return msgspec.structs.replace(changed, neutral=inside)


# Markers.


def _with_marker(definition: BodyDefinition, text: str) -> BodyDefinition:
    match = MARKER.fullmatch(text.strip())
    try:
        at = tuple(float(match[part]) for part in (3, 4, 5)) if match else ()
    except ValueError:
        at = ()
    if match is None or len(at) != 3:
        _fail(f"Marker '{text[:80]}'", "cannot be understood", "Write NAME=JOINT,X,Y,Z with three mm.")
    if not all(abs(value) <= LONGEST_MM for value in at):
        _fail(f"Marker '{match[1]}'", "is too far off", f"Give mm up to {LONGEST_MM:g}.")
    marker = MarkerEntry(match[1].strip(), match[2].strip(), at)
    kept = tuple(marker if one.name == marker.name else one for one in definition.markers)
    return msgspec.structs.replace(definition, markers=kept if marker in kept else (*kept, marker))


def _without_markers(definition: BodyDefinition, names: Sequence[str]) -> BodyDefinition:
    known = [one.name for one in definition.markers]
    for name in names:
        if name not in known:
            _fail(f"'{name}'", "is no marker", f"Known: {', '.join(known) or 'none'}.")
    kept = tuple(one for one in definition.markers if one.name not in names)
    return msgspec.structs.replace(definition, markers=kept)


# One side onto the other.


def _mirrored(body: BodyModel, side: str, notes: list[str]) -> BodyModel:
    """The body whose other side has the sizes, limits and markers of `side`."""
    if side not in SIDES:
        _fail(f"Side '{side}'", "is none", "Choose left or right.")
    mirror = Mirror(body)
    definition = sized_definition(body)
    names = list(definition.dimensions)
    dimensions = dict(definition.dimensions)
    for name, twin in zip(names, name_twins(names).tolist(), strict=True):
        if side in name and names[twin] != name:
            dimensions[names[twin]] = _with_value(dimensions[names[twin]], dimensions[name].value)
    definition = msgspec.structs.replace(definition, dimensions=dimensions)
    definition = _mirrored_limbs(definition, side)
    parameters = {entry.name: entry for entry in definition.parameters}
    twins: list[int] = mirror.twins.tolist()
    for at, twin in enumerate(twins):
        own, other, sign = body.parameters[at].name, body.parameters[twin].name, float(mirror.signs[at])
        # Bounds of limbs' lengths are the limbs'.
        if own in parameters and other in parameters and side in parameters[own].limb and twin != at:
            parameters[other] = _mirrored_limits(parameters[own], parameters[other], sign)
    definition = msgspec.structs.replace(definition, parameters=tuple(parameters.values()))
    whole = _check(definition, body.name)
    # Its sides are even now: so is the plane between them.
    changed = _mirrored_markers(whole, Mirror(whole), side, notes)
    return _check(changed, body.name)


def _with_value(entry: Any, value: float) -> Any:  # noqa: ANN401 - a DimensionEntry
    return msgspec.structs.replace(entry, **{unit_of(entry): value})


def _mirrored_limbs(definition: BodyDefinition, side: str) -> BodyDefinition:
    limbs = list(definition.limbs)
    values = _values(definition)

    def size(limb: LimbEntry, key: str) -> float:
        written = getattr(limb, key)
        if not isinstance(written, str):
            return float(written)
        sign, name = split_sign(written)
        return sign * values[name]

    twins: list[int] = name_twins([limb.name for limb in limbs]).tolist()
    for at, twin in enumerate(twins):
        if limbs[at].side != side or twin == at:
            continue
        for key in SIZES:
            wanted, present = abs(size(limbs[at], key)), size(limbs[twin], key)
            if abs(abs(present) - wanted) > SAME_MM:
                # The twin's own way of writing it cannot follow: it gets the number.
                number = math.copysign(wanted, present)
                limbs[twin] = msgspec.structs.replace(limbs[twin], **{key: number})
        own = limbs[at]
        limbs[twin] = msgspec.structs.replace(limbs[twin], stretch=own.stretch, stretch_step=own.stretch_step)
    return msgspec.structs.replace(definition, limbs=tuple(limbs))


def _mirrored_limits(own: ParameterEntry, twin: ParameterEntry, sign: float) -> ParameterEntry:
    """The twin with the limits and rest value of a parameter. Where a body counts the two from other directions (a
    quarter turn or more apart at rest) that stays so.
    """
    apart = 0.0
    neutral = twin.neutral
    if not isinstance(own.neutral, tuple) and not isinstance(neutral, tuple):
        if own.kind == "angle":
            apart = QUARTER * round((neutral - sign * own.neutral) / QUARTER)
        neutral = sign * own.neutral + apart
    ends = sorted((sign * own.lower + apart, sign * own.upper + apart))
    return msgspec.structs.replace(twin, lower=ends[0], upper=ends[1], neutral=neutral, max_step=own.max_step)


def _mirrored_markers(body: BodyModel, mirror: Mirror, side: str, notes: list[str]) -> BodyDefinition:
    """The definition whose markers of the other side lie about their joints as those of `side` do, mirrored."""
    definition = sized_definition(body)
    turns = joint_frames(body, body.neutral[None])[0][:, :, :3]
    names = [joint.name for joint in body.joints]
    joint_twins = name_twins(names).tolist()
    markers = {one.name: one for one in definition.markers}
    by_name = {one.name: one for one in body.markers}
    for marker in body.markers:
        other = other_side(marker.name, side)
        known = by_name.get(other)
        if not other or (known is None and joint_twins[marker.joint] == marker.joint):
            continue
        if known is not None and np.allclose(np.abs(known.offset), np.abs(marker.offset), atol=SAME_MM):
            continue
        offset = turns[marker.joint] @ marker.offset
        image = offset - 2.0 * (offset @ mirror.across) * mirror.across
        joint = known.joint if known is not None else joint_twins[marker.joint]
        x, y, z = (round(float(value), 3) + 0.0 for value in turns[joint].T @ image)
        markers[other] = MarkerEntry(other, names[joint], (x, y, z))
        if known is None:
            notes.append(f"Marker '{other}' was added, the mirror image of '{marker.name}'.")
    return msgspec.structs.replace(definition, markers=tuple(markers.values()))


def other_side(name: str, side: str) -> str:
    """A marker's name on the other side: "Ear_L" is "Ear_R", "LKnee" is "RKnee"; "" for one that is not of `side`."""
    from_word, to_word = (side, "right" if side == "left" else "left")
    for ours, theirs in ((from_word, to_word), (from_word.title(), to_word.title())):
        if ours in name:
            return name.replace(ours, theirs, 1)
    letter, other = from_word[0].upper(), to_word[0].upper()
    for pattern in (rf"^{letter}(?=[A-Z])", rf"(?<=[_. ]){letter}$", rf"^{letter}(?=[_. ])"):
        if re.search(pattern, name):
            return re.sub(pattern, other, name, count=1)
    return ""


# The text.
