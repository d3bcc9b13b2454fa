"""Make bodies and joints of an MJCF file, MuJoCo's format; no engine is needed, and none reads the file."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from core.errors import UserError, choices
from core.geometry import Array, Box, Capsule, Cylinder, Mesh, Pose, Shape, Sphere, mass_properties
from core.imports.bodies import Imported, Weight, heavy_body, still_body
from core.imports.solids import KINDS, Solid, load_solid, read_inside
from core.robot.urdf import MAX_BYTES, NAME, numbers, read_xml
from core.scene import Body, Color, Geom, Joint
from core.text import shorten

MAX_DEPTH = 64
MAX_BODIES = 500
_JOINTS = {"hinge": "hinge", "slide": "slider", "ball": "ball"}
_READ = ("compiler", "default", "asset", "worldbody")
_UNREAD = ("plane", "hfield", "sdf")
_DRAWN_GROUPS = (0, 1, 2)
Attributes = Mapping[str, str]


@dataclass
class _Part:
    """A body that moves, or what is fixed to the world at one body: its shapes and weights in its own frame."""

    name: str
    pose: Pose
    joint: Attributes | None
    parent: _Part | None
    visuals: list[Geom] = field(default_factory=list)
    collisions: list[Geom] = field(default_factory=list)
    weights: list[Weight] = field(default_factory=list)
    frictions: set[float] = field(default_factory=set)


def read_mjcf(file: str | Path, *, pose: Pose | None = None, prefix: str = "", folder: Path | None = None) -> Imported:
    """Make bodies and joints of an MJCF file, as they stand at the start (``qpos0``).

    A body without joints becomes part of the one that it hangs from, or fixed if that is the world. As in MuJoCo a mesh
    collides as its convex hull, a body that hangs from a fixed one collides with it, and shapes with a ``contype`` and
    a ``conaffinity`` of 0 are only drawn.

    Args:
        file: the MJCF file; meshes are OBJ or STL.
        pose: of its world in the scene's.
        prefix: put before all names.
        folder: where all files must lie; None: where the MJCF file is.

    Raises:
        UserError: says what can't be used, where, and how to mend it.
    """
    file = Path(file).expanduser().absolute()
    folder = folder or file.parent
    root = read_xml(read_inside(file, folder, "MJCF", MAX_BYTES / 1e6), file)
    try:
        return _Reading(root, file, folder).read(pose or Pose(), prefix)
    except (UserError, ValueError) as error:
        raise UserError(f"{file}: {error}") from error


class _Reading:
    def __init__(self, root: Element, file: Path, folder: Path) -> None:
        if root.tag != "mujoco":
            raise UserError(f"it is no MJCF: its root is <{shorten(root.tag)[1:-1]}> instead of <mujoco>")
        if root.find(".//include") is not None:
            raise UserError("<include> is not read; write the model as one file, with MuJoCo's MjSpec.to_xml")
        self._file, self._folder, self._root = file, folder, root
        self._compiler: dict[str, str] = {}
        for element in root.findall("compiler"):
            self._compiler |= element.attrib
        if self._compiler.get("coordinate", "local") != "local":
            raise UserError('compiler: coordinate must be "local", as in MuJoCo since 2.3.4')
        self._angle = 1.0 if self._compiler.get("angle", "degree") == "radian" else math.pi / 180
        self._left: Counter[str] = Counter()
        self._notes: list[str] = []
        self._defaults: dict[str, dict[str, dict[str, str]]] = {"main": {}}
        for element in root.findall("default"):
            self._read_defaults(element, "main", 0)
        self._assets = {
            (asset.tag, asset.get("name") or Path(asset.get("file", "")).stem): self._merged(asset, "main")
            for asset in root.findall("asset/*")
            if asset.tag in ("mesh", "material")
        }
        self._parts: list[_Part] = []
        self._bodies = 0

    def read(self, pose: Pose, prefix: str) -> Imported:
        self._left.update(f"<{e.tag}>" for e in self._root if e.tag not in _READ)
        for key in ("settotalmass", "inertiafromgeom", "inertiagrouprange", "boundmass", "boundinertia"):
            self._left.update([f"compiler {key}"] * (key in self._compiler))
        for element in self._root.findall("worldbody"):
            self._walk(element, _Part("world", Pose(), None, None), Pose(), "main", 0)
        bodies, joints = [], []
        for part in self._parts:
            moves = part.joint is not None
            if moves or part.visuals or part.collisions:
                bodies.append(self._body(part, prefix + part.name, pose @ part.pose))
            if part.joint is not None and part.joint["type"] != "free":
                joints.append(self._joint(part, part.joint, prefix))
        left = [f"left out: {count} {what[:60]}" for what, count in sorted(self._left.items())]
        return Imported(tuple(bodies), tuple(joints), (*left, *self._notes))

    def _read_defaults(self, element: Element, above: str, depth: int) -> None:
        if depth > MAX_DEPTH:
            raise UserError(f"defaults are nested more than {MAX_DEPTH} deep")
        name = element.get("class") or above
        own = self._defaults[name] = {tag: dict(given) for tag, given in self._defaults[above].items()}
        if depth == 0:
            self._defaults["main"] = own
        for child in element:
            if child.tag != "default":
                own[child.tag] = own.get(child.tag, {}) | child.attrib
        for child in element.findall("default"):
            self._read_defaults(child, name, depth + 1)

    def _merged(self, element: Element, childclass: str) -> dict[str, str]:
        name = element.get("class") or childclass
        if name not in self._defaults:
            raise choices("class", name, self._defaults, f"<{element.tag}>")
        return self._defaults[name].get(element.tag, {}) | element.attrib

    # --- the tree -----------------------------------------------------------------------------------------------

    def _walk(self, element: Element, part: _Part, at: Pose, childclass: str, depth: int) -> None:
        """Read what a body (or a frame) holds; it is at ``at`` in the part's frame."""
        if depth > MAX_DEPTH:
            raise UserError(f"bodies are nested more than {MAX_DEPTH} deep")
        if element.tag == "worldbody":
            self._parts.append(part)
        childclass = element.get("childclass") or childclass
        inertial = element.find("inertial")
        if inertial is not None:
            part.weights.append(self._inertial(inertial, at, f"body {part.name!r}: inertial"))
        weighed = inertial is None or element.tag == "frame"
        for child in element:
            match child.tag:
                case "geom":
                    self._geom(self._merged(child, childclass), part, at, weighed)
                case "frame":
                    if child.find("joint") is not None or child.find("inertial") is not None:
                        raise UserError("a <frame> with a <joint> or <inertial> is not read; put these in the body")
                    self._walk(child, part, at @ self._pose(child.attrib, "frame"), childclass, depth + 1)
                case "body":
                    self._child(child, part, at, childclass, depth)
                case "inertial" | "joint" | "freejoint":
                    pass
                case _:
                    self._left[f"<{child.tag}>"] += 1

    def _child(self, element: Element, part: _Part, at: Pose, childclass: str, depth: int) -> None:
        self._bodies += 1
        if self._bodies > MAX_BODIES:
            raise UserError(f"there are more than {MAX_BODIES} bodies; leave some out")
        name = element.get("name") or f"body{self._bodies}"
        where = f"body {name[:64]!r}"
        if not NAME.fullmatch(name) or name == "world":
            raise UserError(
                f"{where}: its name is not 1 to 64 letters, digits, '_', '.' or '-', or is world; rename it"
            )
        inner = element.get("childclass") or childclass
        joints = [self._merged(joint, inner) for joint in element.findall("joint")]
        joints = [{"type": "hinge"} | joint for joint in joints]
        joints += [{"type": "free"} for _ in element.findall("freejoint")]
        at = at @ self._pose(element.attrib, where)
        if len(joints) > 1:
            raise UserError(f"{where} has {len(joints)} joints; one is read: put a body with mass and shape in between")
        if not joints and part.joint is not None:
            self._walk(element, part, at, childclass, depth + 1)
            return
        joint = joints[0] if joints else None
        if joint is not None and joint["type"] not in (*_JOINTS, "free"):
            raise choices("type", joint["type"][:64], (*_JOINTS, "free"), f"{where}: joint")
        made = _Part(name, part.pose @ at, joint, part)
        self._parts.append(made)
        self._walk(element, made, Pose(), childclass, depth + 1)

    def _body(self, part: _Part, name: str, pose: Pose) -> Body:
        if len(part.frictions) > 1:
            self._notes.append(f"body {name!r}: its shapes have several frictions; all get the largest")
        friction = max(part.frictions, default=1.0)
        if part.joint is None:
            return still_body(name, pose, part.visuals, part.collisions, friction)
        return heavy_body(name, pose, part.weights, part.visuals, part.collisions, friction, self._notes)

    def _joint(self, part: _Part, given: Attributes, prefix: str) -> Joint:
        name = given.get("name") or f"{part.name}_joint"
        where, kind = f"joint {name[:64]!r}", _JOINTS[given["type"]]
        unit = self._angle if kind == "hinge" else 1.0
        low, high = (unit * value for value in numbers(given, "range", 2, where, (0.0, 0.0)))
        limited = given.get("limited", "auto")
        if limited == "auto" and self._compiler.get("autolimits", "true") == "true":
            limited = "true" if "range" in given else "false"
        if limited == "true" and kind == "ball":
            self._notes.append(f"{where} is a ball, so that its range is left out")
        for key in ("armature", "actuatorfrcrange", "springdamper", "margin"):
            self._left.update([f"{key} of a joint"] * (key in given))
        spring, hinge = [numbers(given, key, 1, where, (0.0,))[0] for key in ("springref", "ref")], kind != "ball"
        ends = (low, high) if limited == "true" and hinge else (-math.inf, math.inf)
        if kind == "hinge" and ends[1] - ends[0] >= 2 * math.pi:
            ends = (-math.inf, math.inf)
        above = part.parent
        return Joint(
            prefix + name,
            kind,  # type: ignore[arg-type]  # one of three
            prefix + part.name,
            prefix + above.name if above and above.joint is not None else None,
            axis=numbers(given, "axis", 3, where, (0.0, 0.0, 1.0)),
            origin=numbers(given, "pos", 3, where, (0.0, 0.0, 0.0)),
            lower=ends[0],
            upper=ends[1],
            start=unit * spring[1] if hinge else 0.0,
            damping=numbers(given, "damping", 1, where, (0.0,))[0],
            friction=numbers(given, "frictionloss", 1, where, (0.0,))[0],
            stiffness=numbers(given, "stiffness", 1, where, (0.0,))[0],
            rest=unit * spring[0] if hinge else 0.0,
        )

    # --- elements -----------------------------------------------------------------------------------------------

    def _inertial(self, element: Element, at: Pose, where: str) -> Weight:
        pose = at @ self._pose(element.attrib, where)
        turn = pose.rotation.as_matrix()
        if "fullinertia" in element.attrib:
            xx, yy, zz, xy, xz, yz = numbers(element, "fullinertia", 6, where)
            tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        else:
            tensor = np.diag(numbers(element, "diaginertia", 3, where, (0.0, 0.0, 0.0)))
        return numbers(element, "mass", 1, where)[0], pose.position, turn @ tensor @ turn.T

    def _geom(self, given: Attributes, part: _Part, at: Pose, weighed: bool) -> None:
        where = f"body {part.name!r}: geom {given.get('name', '')[:64]!r}"
        kind = given.get("type", "mesh" if "mesh" in given else "sphere")
        if kind in _UNREAD or ("mesh" in given and kind != "mesh"):
            self._left[f"geom of type {kind}" + " around a mesh" * ("mesh" in given)] += 1
            return
        collides = any(numbers(given, key, 1, where, (1.0,))[0] for key in ("contype", "conaffinity"))
        drawn = numbers(given, "group", 1, where, (0.0,))[0] in _DRAWN_GROUPS
        look = self._assets.get(("material", given.get("material", "")), {})
        red, green, blue, opacity = np.clip(numbers({**look, **given}, "rgba", 4, where, (0.5, 0.5, 0.5, 1.0)), 0, 1)
        color: Color = (float(red), float(green), float(blue), float(opacity))
        local = self._pose(given, where)
        solid = None
        if kind == "mesh":
            solid = self._mesh(given.get("mesh", ""), where, needed=collides)
            if solid is None:
                return
            shape: Shape = solid.parts[0]
        else:
            shape, local = self._primitive(kind, given, local, where)
        place = at @ local
        if drawn and opacity:
            meshes = [(shape, color)] if solid is None else [(mesh, own or color) for mesh, own in solid.drawn]
            part.visuals += [Geom(mesh, place, own) for mesh, own in meshes]
        if collides:
            part.collisions.append(Geom(shape, place, color))
            part.frictions.add(_some(given, "friction", 1, where, (1.0,))[0])
        if weighed and part.joint is not None:
            volume = shape.volume if solid is None else solid.filled
            mass = numbers(given, "mass", 1, where, (numbers(given, "density", 1, where, (1000.0,))[0] * volume,))[0]
            center, tensor = mass_properties(shape, mass)
            turn = place.rotation.as_matrix()
            part.weights.append((mass, place.apply(center), turn @ tensor @ turn.T))

    def _primitive(self, kind: str, given: Attributes, pose: Pose, where: str) -> tuple[Shape, Pose]:
        counts = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3}
        if kind not in counts:
            raise choices("type", kind[:64], (*counts, "mesh", *_UNREAD), where)
        if "fromto" in given and kind != "sphere":
            ends = np.array(numbers(given, "fromto", 6, where)).reshape(2, 3)
            along = ends[0] - ends[1]
            pose = Pose.from_rotation(ends.mean(axis=0), _upward(along, where))
            first = _some(given, "size", 1, where)[0]
            size = [*[first] * (counts[kind] - 1), float(np.linalg.norm(along)) / 2]
        else:
            size = list(_some(given, "size", counts[kind], where))
        try:
            match kind:
                case "sphere":
                    return Sphere(size[0]), pose
                case "capsule":
                    return Capsule(size[0], 2 * size[1]), pose
                case "cylinder":
                    return Cylinder(size[0], 2 * size[1]), pose
                case "box":
                    return Box((2 * size[0], 2 * size[1], 2 * size[2])), pose
            ball = Sphere(1.0).to_trimesh()
            return Mesh(ball.vertices * size, ball.faces), pose
        except ValueError as error:
            raise UserError(f"{where}: {error}") from error

    def _mesh(self, name: str, where: str, *, needed: bool) -> Solid | None:
        """Read a mesh; None: it is only drawn, and of a kind that is not read."""
        asset = self._assets.get(("mesh", name))
        if asset is None:
            raise choices("mesh", name[:64], (known for tag, known in self._assets if tag == "mesh"), where)
        if not asset.get("file"):
            raise UserError(f"mesh {name!r} names no file; give it file=")
        for key in ("refpos", "refquat", "vertex", "builtin"):
            if key in asset:
                raise UserError(f"mesh {name!r}: {key} is not read; bake it into the mesh's file")
        file = self._file.parent / self._compiler.get("meshdir", self._compiler.get("assetdir", "")) / asset["file"]
        if file.suffix.lower() not in KINDS and not needed:
            self._left[f"drawn mesh {file.suffix[:8]}"] += 1
            return None
        return load_solid(file, self._folder, numbers(asset, "scale", 3, f"mesh {name!r}", (1.0,) * 3), max_parts=1)

    def _pose(self, given: Attributes, where: str) -> Pose:
        position = numbers(given, "pos", 3, where, (0.0, 0.0, 0.0))
        if "quat" in given:
            return Pose(np.array(position), np.array(numbers(given, "quat", 4, where)))
        return Pose.from_rotation(position, self._rotation(given, where))

    def _rotation(self, given: Attributes, where: str) -> Rotation:
        if "axisangle" in given:
            x, y, z, angle = numbers(given, "axisangle", 4, where)
            length = np.linalg.norm([x, y, z])
            if length < 1e-9:
                raise UserError(f"{where}: axisangle needs an axis with a length")
            return Rotation.from_rotvec(np.array([x, y, z]) / length * angle * self._angle)
        if "euler" in given:
            order = self._compiler.get("eulerseq", "xyz")
            if len(order) != 3 or not {*order.lower()} <= {*"xyz"}:
                raise UserError(f"compiler: eulerseq is {shorten(order)}; give three of x, y, z, X, Y, Z")
            return _turned(order, np.array(numbers(given, "euler", 3, where)) * self._angle)
        if "xyaxes" in given:
            first, second = np.array(numbers(given, "xyaxes", 6, where)).reshape(2, 3)
            third = np.cross(first, second)
            if np.linalg.norm(third) < 1e-9:
                raise UserError(f"{where}: xyaxes needs two directions that differ")
            axes = np.stack([first, np.cross(third, first), third])
            return Rotation.from_matrix((axes / np.linalg.norm(axes, axis=1)[:, None]).T)
        if "zaxis" in given:
            return _upward(np.array(numbers(given, "zaxis", 3, where)), where)
        return Rotation.identity()


def _turned(order: str, angles: Array) -> Rotation:
    """Rotate about three axes: small letters turn with the frame, capitals are fixed."""
    total = Rotation.identity()
    for axis, angle in zip(order, angles, strict=True):
        step = Rotation.from_euler(axis.lower(), angle)
        total = total * step if axis.islower() else step * total
    return total


def _upward(along: Array, where: str) -> Rotation:
    """The smallest rotation that turns z to a direction."""
    length = np.linalg.norm(along)
    if length < 1e-9:
        raise UserError(f"{where}: its two ends, or its axis, have no length between them")
    along = along / length
    if along[2] < -1 + 1e-12:
        return Rotation.from_rotvec([math.pi, 0.0, 0.0])
    return Rotation.from_quat([-along[1], along[0], 0.0, 1 + along[2]])


def _some(
    given: Attributes, name: str, count: int, where: str, default: tuple[float, ...] | None = None
) -> tuple[float, ...]:
    """Read the first numbers of an attribute, of which there may be more."""
    words = given.get(name, "").split()
    return numbers({name: " ".join(words[:count])} if words else {}, name, count, where, default)
