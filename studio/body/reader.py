"""Body files: reading, with errors that name the file, the entry and the remedy."""

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import NoReturn

import msgspec
import numpy as np

from studio.body.definition import WORLD, BodyDefinition, JointEntry, ParameterEntry, StepEntry, split_sign
from studio.body.meshes import mesh_of
from studio.body.model import MOVE, TURN, BodyModel, Joint, Limb, LinkMesh, Marker, Parameter, Step
from studio.body.stretching import MOST_STRETCH, far_name, stretch_name, with_slides
from studio.foundations.errors import BodyError
from studio.foundations.foreign_files import foreign_file, read_foreign_text
from studio.foundations.typed_decoding import decode_toml, is_list

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_ .]*")

# Number of angles and lengths that a joint of each type is driven by.
FREEDOMS = {
    "fixed": (0, 0),
    "hinge": (1, 0),
    "slide": (0, 1),
    "two-axis": (2, 0),
    "ball": (3, 0),
    "free": (3, 3),
}


def check_definition(definition: BodyDefinition, file: str) -> None:
    """Raise BodyError, naming the file, the entry and the remedy, unless `assemble` can build the body."""
    check = _Check(definition, file)
    check.names()
    check.dimensions()
    check.parameters()
    check.joints()
    check.limbs()
    check.markers()
    check.meshes()
    check.stretching()


class _Check:
    def __init__(self, definition: BodyDefinition, file: str) -> None:
        self.definition = definition
        self.file = file
        self.kinds = {entry.name: entry.kind for entry in definition.parameters}

    def fail(self, entry: str, cause: str, remedy: str) -> NoReturn:
        raise BodyError(f"Body file {self.file}: {entry} {cause}.", remedy)

    def names(self) -> None:
        body = self.definition
        if not (body.parameters and body.joints and body.limbs):
            self.fail("the body", "has no parameters, joints or limbs", "Give at least one entry of each.")
        groups = {
            "parameter": [entry.name for entry in body.parameters],
            "joint": [entry.name for entry in body.joints],
            "limb": [entry.name for entry in body.limbs],
            "marker": [entry.name for entry in body.markers],
            "dimension": list(body.dimensions),
        }
        for kind, names in groups.items():
            for name, count in Counter(names).items():
                if count > 1:
                    self.fail(
                        f"{kind} '{name}'", f"is declared {count} times", f"Give every {kind} its own name."
                    )
                if not NAME.fullmatch(name):
                    self.fail(
                        f"{kind} '{name}'", "is no name", "Start with a letter; use letters, digits and _."
                    )
        for name in sorted(set(groups["parameter"]) & set(groups["dimension"])):
            self.fail(f"'{name}'", "is both a parameter and a dimension", "Rename one of them.")
        if WORLD in groups["joint"]:
            self.fail(f"joint '{WORLD}'", "has the name of the fixed frame", "Give the joint another name.")

    def dimensions(self) -> None:
        for name, entry in self.definition.dimensions.items():
            if (entry.mm is None) == (entry.ratio is None):
                self.fail(
                    f"dimension '{name}'", "needs exactly one of mm and ratio", "Write e.g. { mm = 420 }."
                )
            if not (math.isfinite(entry.value) and (entry.value >= 0.0 or entry.is_offset)):
                self.fail(
                    f"dimension '{name}'", f"is {entry.value:g}", "Give a finite number that is not negative."
                )
            if entry.spread is not None and not (math.isfinite(entry.spread) and entry.spread > 0.0):
                self.fail(f"dimension '{name}'", f"has spread {entry.spread:g}", "Give a number above 0.")
            if entry.of_height is None:
                continue
            if entry.ratio is not None:
                self.fail(f"dimension '{name}'", "is a ratio with of_height", "Leave of_height out.")
            if not (math.isfinite(entry.of_height) and 0.0 <= entry.of_height <= 1.0):
                cause = f"has of_height {entry.of_height:g}"
                self.fail(f"dimension '{name}'", cause, "Give the share of the height, from 0 to 1.")
        for name in self.definition.shape_order:
            if name not in self.definition.dimensions:
                self.fail("shape_order", f"names the unknown dimension '{name}'", self.known_dimensions())

    def parameters(self) -> None:
        limbs: list[str] = []
        for entry in self.definition.parameters:
            where = f"parameter '{entry.name}'"
            neutral = self.rest(where, entry.neutral)
            values = {"lower": entry.lower, "upper": entry.upper, "neutral": neutral}
            for key, value in values.items():
                if math.isnan(value):
                    self.fail(
                        where, f"has {key} nan", "Give a number; leave a limit out where there is none."
                    )
            if entry.lower >= entry.upper:
                cause = f"has lower {entry.lower:g} not below upper {entry.upper:g}"
                self.fail(where, cause, "Swap or correct the limits.")
            if not (math.isfinite(neutral) and entry.lower <= neutral <= entry.upper):
                cause = f"has neutral {neutral:g} outside its limits {entry.lower:g} to {entry.upper:g}"
                self.fail(where, cause, "Give a rest value between the limits.")
            if not entry.spread > 0.0:
                self.fail(
                    where, f"has spread {entry.spread:g}", "Give the usual deviation from rest, above 0."
                )
            if not (math.isfinite(entry.max_step) and entry.max_step > 0.0):
                self.fail(
                    where,
                    f"has max_step {entry.max_step:g}",
                    "Give the largest movement per second, above 0.",
                )
            if entry.limb in limbs and limbs[-1] != entry.limb:
                cause = f"is apart from the other parameters of limb '{entry.limb}'"
                self.fail(where, cause, "Keep the parameters of one limb next to each other.")
            limbs.append(entry.limb)

    def rest(self, where: str, neutral: float | tuple[float | str, ...]) -> float:
        if not isinstance(neutral, tuple):
            return neutral
        return sum(self.length(where, "neutral", part) for part in neutral)

    def joints(self) -> None:
        names = [entry.name for entry in self.definition.joints]
        used: set[str] = set()
        for index, entry in enumerate(self.definition.joints):
            where = f"joint '{entry.name}'"
            if entry.parent != WORLD and entry.parent not in names:
                known = ", ".join([WORLD, *names[:index]])
                self.fail(where, f"has the unknown parent '{entry.parent}'", f"Name one of: {known}.")
            if entry.parent != WORLD and names.index(entry.parent) >= index:
                cause = f"comes before its parent '{entry.parent}'"
                self.fail(where, cause, f"Move joint '{entry.parent}' above it.")
            driven = [self.step(where, position, step) for position, step in enumerate(entry.sequence, 1)]
            parameters = [name for name in driven if name]
            self.freedoms(where, entry, parameters)
            used.update(parameters)
        for name in self.kinds:
            if name not in used:
                self.fail(
                    f"parameter '{name}'", "moves no joint", "Use it in a joint's sequence or remove it."
                )

    def freedoms(self, where: str, entry: JointEntry, parameters: list[str]) -> None:
        distinct = Counter(self.kinds[name] for name in set(parameters))
        angles, lengths = FREEDOMS[entry.type]
        if (distinct["angle"], distinct["length"]) != (angles, lengths) or len(set(parameters)) < len(
            parameters
        ):
            cause = (
                f"is '{entry.type}' ({angles} angles, {lengths} lengths, each once) but its sequence uses "
                f"{distinct['angle']} angles and {distinct['length']} lengths in {len(parameters)} steps"
            )
            self.fail(where, cause, "Correct the type or the sequence.")

    def step(self, where: str, position: int, step: StepEntry) -> str:
        """The parameter that drives the step, "" for a fixed one."""
        where = f"{where}, step {position},"
        if (step.move is None) == (step.turn is None):
            self.fail(where, "needs exactly one of move and turn", 'Write e.g. { turn = "x", by = 90 }.')
        if not isinstance(step.by, str):
            if not math.isfinite(step.by):
                self.fail(where, f"goes by {step.by}", "Give a finite number.")
            return ""
        _, name = split_sign(step.by)
        wanted = "length" if step.move else "angle"
        if name in self.kinds:
            if self.kinds[name] != wanted:
                cause = f"needs a parameter of kind '{wanted}', and '{name}' is of kind '{self.kinds[name]}'"
                self.fail(where, cause, "Move by lengths, turn by angles.")
            return name
        if step.move is None or name not in self.definition.dimensions:
            kind = "parameter" if step.turn else "parameter or dimension"
            known = [key for key, value in self.kinds.items() if value == wanted]
            known += list(self.definition.dimensions) if step.move else []
            self.fail(where, f"names the unknown {kind} '{name}'", _one_of(known))
        self.length(where, "by", step.by)
        return ""

    def limbs(self) -> None:
        for entry in self.definition.limbs:
            where = f"limb '{entry.name}'"
            self.joint(where, entry.joint)
            self.length(where, "length", entry.length)
            for key, value in (("radius_start", entry.radius_start), ("radius_end", entry.radius_end)):
                if self.length(where, key, value) < 0.0:
                    self.fail(where, f"has a negative {key}", "Give a radius of 0 mm or more.")
            for key, value in (("scale_x", entry.scale_x), ("scale_y", entry.scale_y)):
                if isinstance(value, str) and value in self.definition.dimensions:
                    factor = self.definition.dimensions[value].ratio
                    if factor is None:
                        self.fail(where, f"has {key} '{value}', a length", "Name a dimension given as ratio.")
                else:
                    factor = self.length(where, key, value)
                if factor <= 0.0:
                    self.fail(where, f"has {key} {factor:g}", "Give a scale above 0.")

    def markers(self) -> None:
        for entry in self.definition.markers:
            where = f"marker '{entry.name}'"
            self.joint(where, entry.joint)
            for value in entry.at:
                self.length(where, "at", value)

    def meshes(self) -> None:
        for number, entry in enumerate(self.definition.meshes, 1):
            self.joint(f"mesh {number}", entry.joint)
            try:
                mesh_of(entry)
            except ValueError as problem:
                self.fail(
                    f"mesh {number}", f"cannot be read: {problem}", "Make the file of the robot's again."
                )

    def stretching(self) -> None:
        """Limbs of changing length, when all else is known to be right."""
        body = self.definition
        for entry in body.limbs:
            if entry.stretch is None:
                if entry.stretch_step is not None:
                    self.fail(f"limb '{entry.name}'", "has stretch_step alone", "Give stretch as well.")
                continue
            where = f"limb '{entry.name}', stretch,"
            self.bounds(where, *entry.stretch)
            step = entry.stretch_step
            if step is not None and not (math.isfinite(step) and step > 0.0):
                cause = f"has stretch_step {step:g}"
                self.fail(f"limb '{entry.name}'", cause, "Give the largest change, mm per second, above 0.")
            name = split_sign(entry.length)[1] if isinstance(entry.length, str) else ""
            alike = [one.name for one in body.limbs if one is not entry and one.length in (name, f"-{name}")]
            if not name or alike:
                cause = f"shares its length with '{alike[0]}'" if alike else "has a length that is a number"
                remedy = (
                    "Name a dimension of this limb alone as its length, and move what hangs on it by that."
                )
                self.fail(where, cause, remedy)
            if body.dimensions[name].value == 0.0:
                self.fail(where, "is of a limb without length", f"Give dimension '{name}' a length above 0.")
        self.free_names()

    def bounds(self, where: str, least: float, greatest: float) -> None:
        said = f"goes from {least:g} to {greatest:g}"
        if not (0.0 < least <= 1.0 <= greatest < math.inf and least < greatest):
            remedy = "Give shares of the limb's length, the least up to 1, the greatest from 1, such as [0.8, 1.25]."
            self.fail(where, said, remedy)
        if greatest > MOST_STRETCH * least:
            remedy = (
                f"Give at most {MOST_STRETCH:g} times the least length, or make two limbs of it in a row."
            )
            self.fail(where, said, remedy)

    def free_names(self) -> None:
        """Fail where a name that stretching adds is taken."""
        body = self.definition
        whole = with_slides(body, {name: entry.value for name, entry in body.dimensions.items()})
        for kind in ("parameters", "joints", "limbs"):
            names = Counter(entry.name for entry in getattr(whole, kind))
            for name, count in names.items():
                if count > 1 or (kind == "parameters" and name in body.dimensions):
                    cause = f"is taken, and a limb that stretches makes a {kind[:-1]} of this name"
                    self.fail(f"'{name}'", cause, "Rename what has the name, or the limb.")

    def joint(self, where: str, name: str) -> None:
        names = [entry.name for entry in self.definition.joints]
        if name not in names:
            self.fail(where, f"is fixed to the unknown joint '{name}'", _one_of(names))

    def length(self, where: str, key: str, value: float | str) -> float:
        """The value of a number or [-]dimension."""
        if not isinstance(value, str):
            if not math.isfinite(value):
                self.fail(where, f"has {key} {value}", "Give a finite number.")
            return value
        sign, name = split_sign(value)
        if name not in self.definition.dimensions:
            self.fail(where, f"has {key} '{value}', an unknown dimension", self.known_dimensions())
        entry = self.definition.dimensions[name]
        if entry.ratio is not None:
            self.fail(where, f"has {key} '{value}', a ratio", "Name a dimension given in mm.")
        return sign * entry.value

    def known_dimensions(self) -> str:
        return _one_of(self.definition.dimensions)


def _one_of(names: Iterable[str]) -> str:
    listed = ", ".join(names)
    return f"Name one of: {listed}." if listed else "Declare it first."


AXES = "xyz"


def assemble(definition: BodyDefinition, name: str, dimensions: Mapping[str, float]) -> BodyModel:
    """The body with these dimensions (mm, ratios).

    definition : already checked (`check_definition`), so every name in it exists.
    """
    written, definition = definition, with_slides(definition, dimensions)
    parameter_index = {entry.name: index for index, entry in enumerate(definition.parameters)}
    joint_index = {entry.name: index for index, entry in enumerate(definition.joints)}

    def amount(value: float | str) -> float:
        if not isinstance(value, str):
            return float(value)
        sign, dimension = split_sign(value)
        return sign * dimensions[dimension]

    def rest(value: float | tuple[float | str, ...]) -> float:
        return sum(amount(part) for part in value) if isinstance(value, tuple) else value

    def step(entry: StepEntry) -> Step:
        kind, axis = (MOVE, entry.move) if entry.move else (TURN, entry.turn)
        axis_index = AXES.index(axis or "x")
        if isinstance(entry.by, str):
            sign, reference = split_sign(entry.by)
            if reference in parameter_index:
                return Step(kind, axis_index, parameter_index[reference], sign)
            return Step(kind, axis_index, -1, amount(entry.by))
        return Step(kind, axis_index, -1, entry.by if kind == MOVE else math.radians(entry.by))

    slides = {
        far_name(limb): parameter_index[stretch_name(limb)]
        for limb in written.limbs
        if limb.stretch is not None
    }
    return BodyModel(
        name=name,
        title=definition.title,
        parameters=tuple(parameter(entry, rest(entry.neutral)) for entry in definition.parameters),
        joints=tuple(
            Joint(
                entry.name,
                -1 if entry.parent == WORLD else joint_index[entry.parent],
                tuple(step(part) for part in entry.sequence),
            )
            for entry in definition.joints
        ),
        limbs=tuple(
            Limb(
                entry.name,
                joint_index[entry.joint],
                amount(entry.length),
                amount(entry.radius_start),
                amount(entry.radius_end),
                amount(entry.scale_x),
                amount(entry.scale_y),
                entry.side,
                entry.part,
                slides.get(entry.name, -1),
            )
            for entry in definition.limbs
        ),
        markers=tuple(
            Marker(entry.name, joint_index[entry.joint], np.array([amount(value) for value in entry.at]))
            for entry in definition.markers
        ),
        dimensions=dict(dimensions),
        definition=written,
        meshes=tuple(LinkMesh(joint_index[entry.joint], *mesh_of(entry)) for entry in definition.meshes),
    )


def parameter(entry: ParameterEntry, neutral: float) -> Parameter:
    """A pose entry in radians or mm. neutral : degrees or mm."""
    unit = math.radians(1.0) if entry.kind == "angle" else 1.0
    return Parameter(
        name=entry.name,
        label=entry.label or entry.name.replace("_", " "),
        kind=entry.kind,
        lower=entry.lower * unit,
        upper=entry.upper * unit,
        max_step=entry.max_step * unit,
        neutral=neutral * unit,
        limb=entry.limb,
        spread=entry.spread * unit,
    )


def read_body(path: Path) -> BodyModel:
    """The body of a TOML file (format: `definition.py`), named like the file, with the file's own dimensions.

    Raises BodyError when the file cannot be read, is no TOML, or does not describe a body.
    """
    with foreign_file(path, BodyError, "a body file", "Check that it is a text file, or correct it."):
        return parse_body(read_foreign_text(path), path.stem, path.name)


@lru_cache(maxsize=64)
def parse_body(text: str, name: str, file: str) -> BodyModel:
    """The body of a TOML text, the same object for the same text; `file` is what errors call it."""
    try:
        definition = decode_toml(text, BodyDefinition)
    except msgspec.ValidationError as problem:
        cause = f"Body file {file}: {_with_names(text, str(problem))}."
        raise BodyError(
            cause, "The format is described in the guide and in studio/body/definition.py."
        ) from None
    except msgspec.DecodeError as problem:
        raise BodyError(
            f"Body file {file} is not valid TOML: {problem}.", "Correct the line it names."
        ) from None
    check_definition(definition, file)
    dimensions = {key: entry.value for key, entry in definition.dimensions.items()}
    return assemble(definition, name, dimensions)


def _with_names(text: str, problem: str) -> str:
    """msgspec's message with "$.joints[3].parent" written as "joint 'left_shin', parent"."""
    place = re.search(r"\$\.(\w+)\[(\d+)\]\.?(\S*)$", problem.replace("`", ""))
    if place is None:
        return problem.replace("`", "'")
    group, index, rest = place.group(1), int(place.group(2)), place.group(3)
    entries = msgspec.toml.decode(text).get(group)
    name = entries[index].get("name", f"number {index + 1}") if is_list(entries) else index
    cause = problem.replace("`", "'").split(" - at ")[0]
    return f"{group.removesuffix('s')} '{name}'{', ' + rest if rest else ''}: {cause}"
