"""Robots as bodies: a URDF or MJCF file, read by MuJoCo (the extra `robots`) in a process of its own.

Links and bodies become joints of the tree, their hinges and slides parameters with the file's limits (and a URDF's
velocities), their geometry truncated elliptical cones, their origins and an MJCF's sites markers. A file's metres are
mm here. A tree without a free joint stands at the world's origin as in the file.

The cones. Cylinders are exact. A capsule is a cylinder of its radius and volume, a sphere or ellipsoid one of its
length and volume, a box one of its length and cross-section's area. A mesh is a cone of the volume's length along its
longest principal axis, of the areas of its convex hull's slices, their flatness the slices' own. A link without
geometry is drawn to each link that hangs on it, with a radius of `THIN` of that way. Radii of meshes and of links
without geometry are dimensions, which a run fits; all other sizes are the file's.

What is shown only (no contact) is taken where a link has such geometry, else what collides. Meshes that are not found
or not of a kind that MuJoCo reads (STL, OBJ, MSH) count as no geometry. A joint that mimics another one by the factor
1 or -1 is driven by its parameter; by any other factor it moves by itself. Refused: chains that are closed.
"""

import hashlib
import importlib
import importlib.util
import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from studio.body.definition import (
    WORLD,
    BodyDefinition,
    DimensionEntry,
    JointEntry,
    LimbEntry,
    MarkerEntry,
    MeshEntry,
    ParameterEntry,
    StepEntry,
)
from studio.body.meshes import coarser, cone_mesh, mesh_entry
from studio.body.model import BodyModel
from studio.body.reader import assemble, check_definition
from studio.foundations.arrays import Array, Indices
from studio.foundations.errors import BodyError
from studio.foundations.foreign_files import foreign_file, read_file
from studio.foundations.isolated import isolated
from studio.foundations.words import sentence

ROBOT_SUFFIXES = (".urdf", ".xml", ".mjcf")
THIN = 0.12
"""Radius of a link without geometry, as a share of its length."""
USUAL_STEP = {"angle": 180.0, "length": 500.0}
"""Largest movement per second where the file gives no velocity, degrees and mm."""
MESHES = (".stl", ".obj", ".msh")
LARGEST_BYTES = 32 << 20
LONGEST_MM = 1e5
SHORTEST_MM = 0.05
SLICES = 24
CUBES = 48
"""Cubes along a mesh's longest side, of which each keeps one point."""
ROUND_MM, ROUND_DEGREES = 7, 9
"""Decimals that are kept."""
FREE, BALL, SLIDE, HINGE = range(4)
PLANE, HEIGHTS, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH = range(8)
SAME_VOLUME = math.sqrt(2.0 / 3.0)
"""Radius of a cylinder of a ball's length and volume, as a share of the ball's."""
SAME_AREA = 2.0 / math.sqrt(math.pi)
ABSENT = "Reading robots needs MuJoCo, which is not installed."
INSTALL = "Install the studio with its extra: pip install 'capture-studio[robots]'."


def is_robot(path: Path | str) -> bool:
    """Whether a file's name ends like a URDF's or an MJCF's."""
    return Path(path).suffix.lower() in ROBOT_SUFFIXES


def read_robot(path: Path) -> BodyModel:
    """The body of a URDF or MJCF file, named like the file.

    Raises BodyError for a file that is none, one that no body can follow, and where MuJoCo is not installed.
    """
    what = "a robot's file"
    with foreign_file(path, BodyError, what, "Give a URDF or an MJCF file."):
        if path.stat().st_size > LARGEST_BYTES:
            raise BodyError(
                f"Robot file {path.name} has more than {LARGEST_BYTES >> 20} MB.",
                "Give the description, not the meshes.",
            )
        digest = hashlib.sha256(read_file(path)).digest()
        if importlib.util.find_spec("mujoco") is None:
            raise BodyError(ABSENT, INSTALL)
        definition = _definition(path.resolve(), digest)
        check_definition(definition, path.name)
        dimensions = {key: entry.value for key, entry in definition.dimensions.items()}
        return assemble(definition, path.stem, dimensions)


@lru_cache(maxsize=16)
def _definition(path: Path, _digest: bytes) -> BodyDefinition:
    return isolated(BodyError, robot_definition, path)


def robot_definition(path: Path) -> BodyDefinition:
    """The body file's entries of a robot's file. To be called through `isolated`: MuJoCo is native code."""
    mujoco = _mujoco()
    mujoco.set_mju_user_warning(_ignore)
    notes: list[str] = []
    try:
        root = ElementTree.fromstring(read_file(path))
        if root.tag not in ("robot", "mujoco"):
            raise BodyError(
                f"Robot file {path.name} holds <{root.tag}>.",
                "Give a URDF (<robot>) or an MJCF (<mujoco>) file.",
            )
        if root.tag == "robot":
            _prepare_urdf(root, path, notes)
            free, name = _floating(root, path)
            spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
            if free:
                spec.body(free).add_freejoint(name=name)
        else:
            spec = mujoco.MjSpec.from_file(str(path))
        _prepare_spec(spec, path, notes)
        compiled = spec.compile()
    except (ElementTree.ParseError, ValueError, RuntimeError) as problem:
        words = " ".join(str(problem).split())[:300]
        raise BodyError(f"Robot file {path.name} cannot be read: {words}.", "Correct the file.") from None
    return _Robot(compiled, path, _speeds(root), notes).definition()


def _ignore(_warning: str) -> None:
    """Takes MuJoCo's warnings, which it would else append to a file in the working directory."""


def _mujoco() -> Any:  # noqa: ANN401 - a module without types
    return importlib.import_module("mujoco")


def _prepare_urdf(root: ElementTree.Element, path: Path, notes: list[str]) -> None:
    """Take out what MuJoCo would refuse and no body needs, and let it keep everything else."""
    for own in root.findall("mujoco"):
        root.remove(own)
    settings = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(settings, "compiler", discardvisual="false", fusestatic="false", strippath="false")
    for link in root.findall("link"):
        for part in list(link):
            if part.tag == "inertial":
                link.remove(part)
            mesh = part.find("geometry/mesh")
            if mesh is None:
                continue
            file = _mesh_file(mesh.get("filename", ""), path)
            if file is None:
                link.remove(part)
                notes.append(f"mesh '{mesh.get('filename', '')}' of '{link.get('name')}' was left out")
            else:
                mesh.set("filename", str(file))


def _floating(root: ElementTree.Element, path: Path) -> tuple[str, str]:
    """The link and the name of a URDF's floating joint, which is taken out with the link that it floats in; ("", "")
    without one. Raises BodyError for one that is not the root's.
    """
    joints = root.findall("joint")

    def end(joint: ElementTree.Element, tag: str) -> str:
        element = joint.find(tag)
        return element.get("link", "") if element is not None else ""

    for joint in joints:
        if joint.get("type") != "floating":
            continue
        world = end(joint, "parent")
        if any(
            end(other, "child") == world or end(other, "parent") == world
            for other in joints
            if other is not joint
        ):
            raise BodyError(
                f"Robot file {path.name} has a floating joint '{joint.get('name')}' inside the robot.",
                "Only the root can float: take it out, or give one of the two parts.",
            )
        root.remove(joint)
        for link in root.findall("link"):
            if link.get("name") == world:
                root.remove(link)
        return end(joint, "child"), joint.get("name", "")
    return "", ""


def _mesh_file(name: str, path: Path) -> Path | None:
    """Where a URDF's mesh lies, of those that MuJoCo reads: beside the file, or below a folder above it."""
    inside = re.sub(r"^[a-z]+://", "", name)
    if Path(inside).suffix.lower() not in MESHES:
        return None
    tails = [Path(inside)]
    if name.startswith("package://"):
        tails.append(Path(*Path(inside).parts[1:]))
    places = [folder / tail for folder in list(path.parents)[:4] for tail in tails]
    return next((place for place in places if place.is_file()), None)


def _prepare_spec(spec: Any, path: Path, notes: list[str]) -> None:  # noqa: ANN401 - of an extra
    """Masses and inertias do not matter here; meshes that are missing are left out."""
    convex = _mujoco().mjtMeshInertia.mjMESH_INERTIA_CONVEX
    compiler = spec.compiler
    compiler.fusestatic, compiler.discardvisual = False, False
    compiler.boundmass, compiler.boundinertia, compiler.balanceinertia = 1e-3, 1e-6, True
    folder = path.parent / spec.meshdir
    absent: set[str] = set()
    for mesh in list(spec.meshes):
        mesh.inertia = convex
        if mesh.file and not ((folder / mesh.file).is_file() and Path(mesh.file).suffix.lower() in MESHES):
            absent.add(mesh.name or Path(mesh.file).stem)
            notes.append(f"mesh '{mesh.file}' was left out")
            spec.delete(mesh)
    if absent:
        for geom in list(spec.geoms):
            if geom.meshname in absent:
                spec.delete(geom)


def _speeds(root: ElementTree.Element) -> dict[str, float]:
    """The velocity limits of a URDF's joints, rad/s or m/s."""
    speeds: dict[str, float] = {}
    for joint in root.findall("joint"):
        limit = joint.find("limit")
        try:
            speed = float(limit.get("velocity", "0")) if limit is not None else 0.0
        except ValueError:
            continue
        if math.isfinite(speed) and speed > 0.0:
            speeds[joint.get("name", "")] = speed
    return speeds


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """A cone in its link's frame: start (3,) mm, turn (3, 3) with z along it, sizes (mm). guessed : its radii are."""

    start: Array
    turn: Array
    length: float
    radii: tuple[float, float]
    scales: tuple[float, float] = (1.0, 1.0)
    guessed: bool = False
    mesh: tuple[Array, Indices] | None = None
    """Points in the link's frame, mm, and triangles; None where the cone is all there is."""


@dataclass(slots=True)
class _Drive:
    """What moves a joint: a parameter with its sign, or nothing, and a fixed share before it (degrees or mm)."""

    parameter: str
    before: float


@dataclass(slots=True)
class _Robot:
    """A compiled model on its way to a definition."""

    model: Any
    path: Path
    speeds: dict[str, float]
    notes: list[str]
    names: dict[str, set[str]] = field(default_factory=dict[str, set[str]])
    parameters: list[ParameterEntry] = field(default_factory=list[ParameterEntry])
    joints: list[JointEntry] = field(default_factory=list[JointEntry])
    limbs: list[LimbEntry] = field(default_factory=list[LimbEntry])
    markers: list[MarkerEntry] = field(default_factory=list[MarkerEntry])
    dimensions: dict[str, DimensionEntry] = field(default_factory=dict[str, DimensionEntry])
    link: dict[int, str] = field(default_factory=dict[int, str])
    drives: dict[int, str] = field(default_factory=dict[int, str])
    thin: list[str] = field(default_factory=list[str])
    surfaces: list[tuple[str, _Part]] = field(default_factory=list[tuple[str, _Part]])

    def definition(self) -> BodyDefinition:
        self._refuse_loops()
        kept = self._robot_bodies()
        if not kept:
            raise BodyError(
                f"Robot file {self.path.name} has no joint that moves.", "Give a file of a robot that moves."
            )
        rest = self.model.key_qpos[0] if self.model.nkey else self.model.qpos0
        groups = self._groups(kept)
        for body in kept:
            self._add_joints(body, groups[body], rest)
        for body in kept:
            self._add_parts(body, kept)
            self._add_markers(body)
        self._check_size()
        if self.thin:
            self.notes.append(
                f"links without geometry ({', '.join(self.thin)}) have a radius of {THIN:g} of their length"
            )
        notes = "; ".join(self.notes)
        title = _words(self.model.names[: self.model.names.find(b"\0")].decode("utf-8", "replace"))
        return BodyDefinition(
            title=f"{title or self.path.stem}, {len(self.parameters)} parameters",
            source=f"Made of {self.path.name}, metres as mm.{f' {sentence(notes)}.' if notes else ''}",
            parameters=tuple(self.parameters),
            joints=tuple(self.joints),
            limbs=tuple(self.limbs),
            markers=tuple(self.markers),
            dimensions=self.dimensions,
            meshes=tuple(self._meshes()),
        )

    # Which bodies.

    def _refuse_loops(self) -> None:
        model = self.model
        for number in range(model.neq):
            if model.eq_type[number] in (0, 1) and model.eq_active0[number]:
                raise BodyError(
                    f"Robot file {self.path.name} closes a chain by its equality constraint "
                    f"'{model.equality(number).name or number + 1}'.",
                    "A body is an open tree: take the constraint out, or describe one side of the loop only.",
                )

    def _robot_bodies(self) -> list[int]:
        """The bodies of the robot, parents first: surroundings and single things that lie about are left out."""
        model = self.model
        moving = {body: int(model.body_jntnum[body]) for body in range(1, model.nbody)}
        roots = {body: int(model.body_rootid[body]) for body in moving}
        counts = {
            root: sum(moving[body] for body in moving if roots[body] == root) for root in roots.values()
        }
        loose = {
            root
            for root, count in counts.items()
            if count == 1 and moving[root] and self._kinds(root) == [FREE]
        }
        robots = {root for root, count in counts.items() if count}
        robots = (robots - loose) or set(sorted(robots)[:1])
        left = [self._name(root) for root in counts if root not in robots]
        if left:
            self.notes.append(f"left out: {', '.join(left)}")
        return [body for body in moving if roots[body] in robots]

    def _kinds(self, body: int) -> list[int]:
        first = self.model.body_jntadr[body]
        return [int(self.model.jnt_type[first + number]) for number in range(self.model.body_jntnum[body])]

    def _groups(self, kept: list[int]) -> dict[int, str]:
        """The limb of each body's parameters: chains between branchings, named by their first link."""
        moving = [body for body in kept if self.model.body_jntnum[body]]
        above = {body: self._moving_above(body) for body in moving}
        groups: dict[int, str] = {}
        for body in kept:
            parent = above.get(body, 0)
            alone = parent in groups and sum(other == parent for other in above.values()) == 1
            groups[body] = groups[parent] if alone else _words(self._name(body))
        return groups

    def _moving_above(self, body: int) -> int:
        parent = int(self.model.body_parentid[body])
        while parent and not self.model.body_jntnum[parent]:
            parent = int(self.model.body_parentid[parent])
        return parent

    # Joints and parameters.

    def _add_joints(self, body: int, group: str, rest: Array) -> None:
        """One joint for every joint of the body, the last one called like the link; a fixed one without any."""
        model, name = self.model, self._unique("joint", self._name(body))
        self.link[body] = name
        parent = self.link.get(int(model.body_parentid[body]), WORLD)
        kinds, first = self._kinds(body), int(model.body_jntadr[body])
        steps = _fixed_steps(1e3 * model.body_pos[body], _rotation(model.body_quat[body]))
        if FREE in kinds:
            steps = []
        if not kinds:
            self.joints.append(JointEntry(name, parent, "fixed", tuple(steps)))
            return
        for number, kind in enumerate(kinds):
            joint = first + number
            last = number == len(kinds) - 1
            own = name if last else self._unique("joint", f"{name} {self._joint_name(joint)}")
            type_name, more = self._joint(joint, kind, group, rest)
            self.joints.append(JointEntry(own, parent, type_name, (*steps, *more)))
            parent, steps = own, []

    def _joint(self, joint: int, kind: int, group: str, rest: Array) -> tuple[Any, list[StepEntry]]:
        model, name = self.model, self._joint_name(joint)
        at = int(model.jnt_qposadr[joint])
        if kind in (FREE, BALL):
            return self._ball_or_free(joint, kind, group, rest[at : at + (7 if kind == FREE else 4)])
        word: Literal["angle", "length"] = "length" if kind == SLIDE else "angle"
        unit = 1e3 if kind == SLIDE else math.degrees(1.0)
        axis = np.asarray(model.jnt_axis[joint], dtype=float)
        drive = self._mimicked(joint, word, unit)
        if drive is None:
            lower, upper = self._limits(joint, unit)
            if lower >= upper:
                drive = _Drive("", unit * (float(rest[at]) - float(model.qpos0[at])))
                self.notes.append(f"joint '{name}' has no room between its limits and is fixed")
            else:
                speed = self.speeds.get(name, 0.0) * unit or USUAL_STEP[word]
                neutral = min(max(unit * float(rest[at]), lower), upper)
                own = self._driver(joint)
                self._add_parameter(own, word, group, (lower, upper), neutral, speed)
                drive = _Drive(own, -unit * float(model.qpos0[at]))
        steps = _driven(axis, word, drive)
        anchor = 1e3 * np.asarray(model.jnt_pos[joint], dtype=float)
        if word == "angle":
            steps = [*_moves(anchor), *steps, *_moves(-anchor)]
        return ("fixed" if not drive.parameter else "slide" if word == "length" else "hinge"), steps

    def _mimicked(self, joint: int, word: str, unit: float) -> _Drive | None:
        """How a joint follows another one (q - q0 = a + b (p - p0)); None for one that moves by itself."""
        model = self.model
        for number in range(model.neq):
            if model.eq_type[number] != 2 or not model.eq_active0[number] or model.eq_obj1id[number] != joint:
                continue
            shares, other = model.eq_data[number][:5], int(model.eq_obj2id[number])
            if other < 0:
                return _Drive("", unit * float(shares[0]))
            same = model.jnt_type[joint] == model.jnt_type[other]
            if same and self._leads(other, unit) and abs(shares[1]) == 1.0 and not np.any(shares[2:]):
                sign = float(shares[1])
                start = float(model.qpos0[model.jnt_qposadr[other]])
                before = unit * (float(shares[0]) - sign * start)
                return _Drive(("-" if sign < 0 else "") + self._driver(other), before)
            self.notes.append(
                f"joint '{self._joint_name(joint)}' follows '{self._joint_name(other)}' in the file and moves by "
                "itself here"
            )
        return None

    def _limits(self, joint: int, unit: float) -> tuple[float, float]:
        if not self.model.jnt_limited[joint]:
            return -math.inf, math.inf
        lower, upper = (_rounded(unit * float(value), ROUND_DEGREES) for value in self.model.jnt_range[joint])
        return lower, upper

    def _leads(self, joint: int, unit: float) -> bool:
        """Whether a hinge or slide has a parameter of its own."""
        model = self.model
        follows = (model.eq_type == 2) & (model.eq_obj1id == joint) & (model.eq_active0 != 0)
        lower, upper = self._limits(joint, unit)
        return not follows.any() and lower < upper

    def _driver(self, joint: int) -> str:
        """The name of the parameter of a hinge or slide."""
        if joint not in self.drives:
            self.drives[joint] = self._unique("parameter", self._joint_name(joint))
        return self.drives[joint]

    def _ball_or_free(self, joint: int, kind: int, group: str, rest: Array) -> tuple[Any, list[StepEntry]]:
        """A ball as turns about z, then y, then x; a free joint with moves before them."""
        name, steps = self._joint_name(joint), list[StepEntry]()
        unlimited = (-math.inf, math.inf)
        if kind == FREE:
            for axis, value in zip("xyz", 1e3 * rest[:3], strict=True):
                own = self._unique("parameter", f"{name}_{axis}")
                self._add_parameter(own, "length", group, unlimited, float(value), USUAL_STEP["length"])
                steps.append(StepEntry(own, move=_axis(axis)))
        limits = unlimited
        if kind == BALL and self.model.jnt_limited[joint]:
            reach = math.degrees(float(self.model.jnt_range[joint][1]))
            limits = (-reach, reach)
        angles = _turns(_rotation(rest[-4:]))
        words = ("yaw", "pitch", "roll") if kind == FREE else ("turn_z", "turn_y", "turn_x")
        for axis, word, angle in zip("zyx", words, angles, strict=True):
            value = min(max(angle, limits[0]), limits[1])
            own = self._unique("parameter", f"{name}_{word}")
            self._add_parameter(own, "angle", group, limits, value, USUAL_STEP["angle"])
            steps.append(StepEntry(own, turn=_axis(axis)))
        if kind == BALL:
            anchor = 1e3 * np.asarray(self.model.jnt_pos[joint], dtype=float)
            steps = [*_moves(anchor), *steps, *_moves(-anchor)]
        return ("free" if kind == FREE else "ball"), steps

    def _add_parameter(
        self,
        name: str,
        kind: Literal["angle", "length"],
        group: str,
        limits: tuple[float, float],
        neutral: float,
        speed: float,
    ) -> None:
        self.parameters.append(
            ParameterEntry(
                name=name,
                kind=kind,
                max_step=_rounded(speed, 3),
                limb=group,
                lower=limits[0],
                upper=limits[1],
                neutral=_rounded(neutral, ROUND_DEGREES),
            )
        )

    # Limbs and markers.

    def _add_parts(self, body: int, kept: list[int]) -> None:
        parts, name = list(self._parts(body)), self.link[body]
        if not parts:
            parts = list(self._thin_parts(body, kept))
            self.thin += [name] if parts else []
        side = "left" if "left" in name.lower() else "right" if "right" in name.lower() else "middle"
        self.surfaces += [(name, part) for part in parts]
        for number, part in enumerate(parts, 1):
            own = self._unique("limb", name if len(parts) == 1 else f"{name} {number}")
            joint = self._unique("joint", f"{own} part")
            self.joints.append(JointEntry(joint, name, "fixed", tuple(_fixed_steps(part.start, part.turn))))
            sizes: list[float | str] = [_rounded(value, ROUND_MM) for value in part.radii]
            if part.guessed:
                for place, ending in enumerate(("radius_start", "radius_end")):
                    dimension = self._unique("dimension", f"{own.replace(' ', '_')}_{ending}")
                    self.dimensions[dimension] = DimensionEntry(mm=round(float(sizes[place]), 3))
                    sizes[place] = dimension
            self.limbs.append(
                LimbEntry(
                    own,
                    joint,
                    _rounded(part.length, ROUND_MM),
                    sizes[0],
                    sizes[1],
                    _rounded(part.scales[0], 6),
                    _rounded(part.scales[1], 6),
                    side,
                )
            )

    def _parts(self, body: int) -> Iterator[_Part]:
        model = self.model
        first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
        geoms = range(first, first + count)
        shown = [geom for geom in geoms if not (model.geom_contype[geom] or model.geom_conaffinity[geom])]
        for geom in shown or geoms:
            part = self._part(geom)
            if part is None:
                self.notes.append(f"a part of '{self._name(body)}' that no cone can be was left out")
            elif part.length > SHORTEST_MM and max(part.radii) > SHORTEST_MM:
                yield part

    def _part(self, geom: int) -> _Part | None:
        model, kind = self.model, int(self.model.geom_type[geom])
        turn = _rotation(model.geom_quat[geom])
        centre, size = 1e3 * np.asarray(model.geom_pos[geom]), 1e3 * np.asarray(model.geom_size[geom])
        if kind == MESH:
            return self._mesh_part(geom, centre, turn)
        if kind == CYLINDER:
            half, radius, scales = float(size[1]), float(size[0]), (1.0, 1.0)
        elif kind == CAPSULE:
            half, radius, scales = float(size[1] + 2.0 * size[0] / 3.0), float(size[0]), (1.0, 1.0)
        elif kind in (SPHERE, ELLIPSOID, BOX):
            sides = np.repeat(size[0], 3) if kind == SPHERE else size
            if sides.min() <= 0.0:
                return None
            long = int(np.argmax(sides))
            turn = turn @ _to_z(long)
            across = np.roll(sides, -long - 1)[:2] * (SAME_AREA if kind == BOX else SAME_VOLUME)
            half, radius = float(sides[long]), float(np.sqrt(across[0] * across[1]))
            scales = (float(across[0] / radius), float(across[1] / radius))
        else:
            return None
        return _Part(centre - half * turn[:, 2], turn, 2.0 * half, (radius, radius), scales)

    def _mesh_part(self, geom: int, centre: Array, turn: Array) -> _Part | None:
        model, mesh = self.model, int(self.model.geom_dataid[geom])
        first = int(model.mesh_vertadr[mesh])
        points = 1e3 * np.asarray(model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])], dtype=float)
        part = fitted_cone(points)
        if part is None:
            return None
        faces, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
        triangles = np.asarray(model.mesh_face[faces : faces + count], dtype=np.int64)
        return _Part(
            centre + turn @ part.start,
            turn @ part.turn,
            part.length,
            part.radii,
            part.scales,
            guessed=True,
            mesh=coarser(centre + points @ turn.T, triangles, float(np.ptp(points, axis=0).max()) / CUBES),
        )

    def _meshes(self) -> Iterator[MeshEntry]:
        """The surfaces of all links, cones as well, where any is a mesh."""
        if any(part.mesh is not None for _, part in self.surfaces):
            for joint, part in self.surfaces:
                points, triangles = part.mesh or cone_mesh(part.length, part.radii, part.scales)
                if part.mesh is None:
                    points = part.start + points @ part.turn.T
                yield mesh_entry(joint, points, triangles)

    def _thin_parts(self, body: int, kept: list[int]) -> Iterator[_Part]:
        for other in kept:
            if int(self.model.body_parentid[other]) != body:
                continue
            way = 1e3 * np.asarray(self.model.body_pos[other], dtype=float)
            length = float(np.linalg.norm(way))
            if length > SHORTEST_MM:
                azimuth, polar = _pointing(way / length)
                turn = _about(2, azimuth) @ _about(1, polar)
                yield _Part(np.zeros(3), turn, length, (THIN * length, THIN * length), guessed=True)

    def _add_markers(self, body: int) -> None:
        model, joint = self.model, self.link[body]
        self.markers.append(MarkerEntry(self._unique("marker", self._name(body)), joint, (0.0, 0.0, 0.0)))
        for site in range(model.nsite):
            if int(model.site_bodyid[site]) == body and model.site(site).name:
                x, y, z = (_rounded(1e3 * float(value), ROUND_MM) for value in model.site_pos[site])
                name = self._unique("marker", model.site(site).name)
                self.markers.append(MarkerEntry(name, joint, (x, y, z)))

    def _check_size(self) -> None:
        lengths = [
            abs(float(step.by)) for joint in self.joints for step in joint.sequence if _is_fixed_move(step)
        ]
        longest = max([*lengths, *(abs(float(limb.length)) for limb in self.limbs)], default=0.0)
        if longest > LONGEST_MM:
            raise BodyError(
                f"Robot file {self.path.name} has a length of {longest / 1e3:.0f} m.",
                "URDF and MJCF are in metres; give a mesh in mm its scale of 0.001.",
            )

    # Names.

    def _name(self, body: int) -> str:
        return str(self.model.body(body).name) or f"body {body}"

    def _joint_name(self, joint: int) -> str:
        own = str(self.model.joint(joint).name)
        return own or f"{self._name(int(self.model.jnt_bodyid[joint]))} joint {joint + 1}"

    def _unique(self, kind: str, name: str) -> str:
        """The name as a body file may have it, unlike those of its kind; parameters and dimensions are one kind."""
        used = self.names.setdefault("parameter" if kind == "dimension" else kind, {WORLD})
        wanted = _words(name) if kind in ("joint", "limb", "marker") else _words(name).replace(" ", "_")
        wanted = wanted or kind
        free, number = wanted, 2
        while free in used:
            free, number = f"{wanted}_{number}", number + 1
        used.add(free)
        return free


def fitted_cone(points: Array) -> _Part | None:
    """The truncated elliptical cone of a mesh: points (V, 3), mm, in its principal frame.

    None where they lie in a plane. The radii are a line through the square roots of the slices' areas, their
    flatness the ratio of the slices' spreads.
    """
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return None
    long = int(np.argmax(np.ptp(points, axis=0)))
    turn = _to_z(long)
    corners: Array = points[np.asarray(hull.vertices)] @ turn
    low, high = corners.min(axis=0), corners.max(axis=0)
    share = (np.arange(SLICES) + 0.5) / SLICES
    grid = np.stack(np.meshgrid(share, share, share, indexing="ij"), axis=-1)
    places = low + grid * (high - low)
    normals, offsets = hull.equations[:, :3] @ turn, hull.equations[:, 3]
    inside = np.ones(places.shape[:3], dtype=bool)
    for normal, offset in zip(normals, offsets, strict=True):
        inside &= places @ normal + offset <= 0.0
    counts = inside.sum(axis=(0, 1)).astype(float)
    if np.count_nonzero(counts) < 2:
        return None
    cell = float(high[0] - low[0]) * float(high[1] - low[1]) / SLICES**2
    within: Array = places[inside]
    middle: Array = np.mean(within, axis=0)
    spread: Array = np.std(within[:, :2], axis=0)
    if spread.min() == 0.0:
        return None
    # A line through the slices' radii, each counted by its area.
    radii = np.sqrt(counts * cell / np.pi)
    weights = counts / counts.sum()
    offset, height = share - float(weights @ share), float(weights @ radii)
    slope = float((weights * offset) @ radii) / float((weights * offset) @ offset)
    ends = height + slope * (np.array([0.0, 1.0]) - float(weights @ share))
    ends = np.maximum(ends, 0.05 * float(ends.max()))
    flat = math.sqrt(float(spread[0] / spread[1]))
    start = turn @ np.array([float(middle[0]), float(middle[1]), float(low[2])])
    length = float(high[2] - low[2])
    return _Part(start, turn, length, (float(ends[0]), float(ends[1])), (flat, 1.0 / flat), guessed=True)


# Rotations as steps.


def _rotation(quaternion: Any) -> Array:  # noqa: ANN401 - an array of an extra
    w, x, y, z = np.asarray(quaternion, dtype=float) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _turns(rotation: Array) -> tuple[float, float, float]:
    """Degrees about z, then y, then x, each about the axes turned so far."""
    level = math.hypot(rotation[0, 0], rotation[1, 0])
    pitch = math.atan2(-rotation[2, 0], level)
    if level > 1e-9:
        yaw, roll = math.atan2(rotation[1, 0], rotation[0, 0]), math.atan2(rotation[2, 1], rotation[2, 2])
    else:
        yaw, roll = math.atan2(-rotation[0, 1], rotation[1, 1]), 0.0
    return math.degrees(yaw), math.degrees(pitch), math.degrees(roll)


def _fixed_steps(position: Array, rotation: Array) -> list[StepEntry]:
    """The steps of a fixed motion, mm."""
    return [*_moves(position), *_fixed_turns(zip("zyx", _turns(rotation), strict=True))]


def _moves(position: Array) -> list[StepEntry]:
    moves = [(axis, _rounded(float(value), ROUND_MM)) for axis, value in zip("xyz", position, strict=True)]
    return [StepEntry(value, move=_axis(axis)) for axis, value in moves if value]


def _fixed_turns(turns: Any) -> list[StepEntry]:  # noqa: ANN401 - pairs of an axis and degrees
    turned = [(axis, _rounded(float(angle), ROUND_DEGREES)) for axis, angle in turns]
    return [StepEntry(angle, turn=_axis(axis)) for axis, angle in turned if angle]


def _driven(axis: Array, word: str, drive: _Drive) -> list[StepEntry]:
    """The steps of a hinge or slide about or along any axis: its axis is turned onto one of the frame's, and back."""
    axis = axis / np.linalg.norm(axis)
    own = int(np.argmax(np.abs(axis)))
    before, after = list[StepEntry](), list[StepEntry]()
    sign = 1.0
    if abs(axis[own]) > 1.0 - 1e-12:
        sign = math.copysign(1.0, axis[own])
    else:
        azimuth, polar = _pointing(axis)
        own = 2
        before = _fixed_turns((("z", math.degrees(azimuth)), ("y", math.degrees(polar))))
        after = _fixed_turns((("y", -math.degrees(polar)), ("z", -math.degrees(azimuth))))
    letter = _axis("xyz"[own])
    fixed = _rounded(sign * drive.before, ROUND_DEGREES)
    name = drive.parameter
    if name and sign < 0.0:
        name = name.removeprefix("-") if name.startswith("-") else f"-{name}"
    steps = [fixed] if fixed else []
    amounts: list[float | str] = [*steps, *([name] if name else [])]
    if word == "length":
        return [*before, *(StepEntry(amount, move=letter) for amount in amounts), *after]
    return [*before, *(StepEntry(amount, turn=letter) for amount in amounts), *after]


def _pointing(axis: Array) -> tuple[float, float]:
    """Radians about z and then about y that turn z onto a unit axis."""
    return math.atan2(axis[1], axis[0]), math.atan2(math.hypot(axis[0], axis[1]), axis[2])


def _about(axis: int, angle: float) -> Array:
    turn = np.eye(3)
    one, two = (axis + 1) % 3, (axis + 2) % 3
    turn[one, one] = turn[two, two] = math.cos(angle)
    turn[two, one] = math.sin(angle)
    turn[one, two] = -turn[two, one]
    return turn


def _to_z(axis: int) -> Array:
    """(3, 3) whose columns are the axes after this one, and this one last: a frame with z along it."""
    return np.roll(np.eye(3), -axis - 1, axis=1)


def _is_fixed_move(step: StepEntry) -> bool:
    return step.move is not None and not isinstance(step.by, str)


def _axis(letter: str) -> Any:  # noqa: ANN401 - one of three letters, to a Literal
    return letter


def _rounded(value: float, decimals: int) -> float:
    return round(value, decimals) + 0.0


def _words(name: str) -> str:
    """A name as a body file may have it: letters, digits, _ and spaces, a letter first; "" of nothing."""
    plain = re.sub(r"[^A-Za-z0-9_ .]+", "_", name).strip("_ .")
    return plain if not plain or plain[0].isalpha() else f"link {plain}"
