"""Make bodies and joints of a URDF or MJCF file."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal
from xml.etree.ElementTree import Element

import numpy as np

from core.errors import UserError
from core.geometry import Color, Mesh, Pose
from core.imports.documents import MAX_BYTES, read_root
from core.imports.meshes import hull_corners
from core.imports.urdf import read_urdf
from core.scene import Body, Geom, Joint
from core.support.cli import expand
from core.values.descriptions import (
    Description,
    RobotJoint,
    RobotLink,
    RobotShape,
)
from plugins.tasks.file.imports.imported import Imported, find_left_out, joined_body
from plugins.tasks.file.imports.solids import (
    load_solid,
    note_coarse,
    read_inside,
)

_FRICTION = 0.5  # of shapes that say none
_READ = ("link", "joint", "material")
_WITHOUT_MESH = "leave it out: without: [{name}] in the import"
_GREY: Color = (0.7, 0.7, 0.7, 1.0)


def read_bodies(
    file: str | Path,
    *,
    fixed: bool = True,
    prefix: str = "",
    folder: Path | None = None,
    without: Sequence[str] = (),
    density: float | None = None,
) -> Imported:
    """Make bodies and joints of a URDF or MJCF file: a body of all links that are rigidly joined, named like the first.

    A joint of a URDF starts at 0, or at the end of its range that is next to it; one of MJCF at its ``qpos0``. Meshes
    are in the file's own axes; of a URDF they are cut into convex parts as `read_mesh` does. As in
    MuJoCo, a mesh of MJCF collides as its convex hull, each body that is fixed in the world stays one, and what hangs
    from it collides with it.

    Args:
        file: the URDF or MJCF file, as its content says.
        fixed: whether the root of a URDF is fixed to the world, or what has no joint in MJCF. The root of a URDF need
            not be there then.
        prefix: put before all names.
        folder: where all files must lie; None: where the file is.
        without: names of links, or patterns, that are left out with all that hangs from them; and names of a URDF's
            meshes, as the file has them.
        density: kg/m^3 of what moves without a mass in the file; None: that is refused.

    Raises:
        UserError: says what can't be used, where, and how to mend it.
    """
    file = expand(file).absolute()
    folder = folder or file.parent
    root = read_root(read_inside(file, folder, "URDF or MJCF", MAX_BYTES / 1e6), file)
    try:
        if root.tag == "mujoco":
            # It imports MuJoCo.
            from plugins.tasks.file.imports.mjcf import read_model

            tree, notes = read_model(root, file, folder, prefix, without)
            if not fixed:
                tree = _set_free(tree)

            return _Making(tree, folder, prefix, notes, density).make_in_world()

        tags = Counter(str(element.tag) for element in root)
        notes = [
            f"left out: {count} <{tag[:40]}>"
            for tag, count in tags.items()
            if tag not in _READ
        ]
        links = [link.get("name", "") for link in root.findall("link")]
        meshes = _leave_out_meshes(root, without)
        notes += [f"left out: mesh {mesh}" for mesh in meshes]
        bodies = [name for name in without if name not in meshes]
        left = find_left_out(bodies, prefix, links)
        tree, missing = read_urdf(root, file, left, without_mesh=_WITHOUT_MESH)
        return _Making(tree, folder, prefix, notes + missing, density).make(fixed)
    # RuntimeError: Qhull's, of what is flat.
    except (UserError, ValueError, RuntimeError) as error:
        raise UserError(f"{file}: {error}") from error


def _leave_out_meshes(root: Element, names: Sequence[str]) -> list[str]:
    """Take the shapes of meshes out of a URDF, and return which meshes of those that are named there were."""
    found = dict[str, None]()
    for link in root.iter("link"):
        for shape in (*link.findall("collision"), *link.findall("visual")):
            mesh = shape.find("geometry/mesh")
            name = "" if mesh is None else mesh.get("filename", "")
            if name in names:
                found[name] = None
                link.remove(shape)

    return list(found)


def _set_free(tree: Description) -> Description:
    """Let what stands in the world of an MJCF file without a joint move freely.

    Objects of robosuite and its kin are such: a body without shapes around one that has some. The inner one moves.
    """
    joints = dict(tree.joints)
    for top in _list_fixed(tree, tree.root):
        moving = top
        link = tree.links[moving]
        inner = _list_fixed(tree, moving)
        while not (link.collisions or link.visuals) and len(inner) == 1:
            moving = inner[0]
            link = tree.links[moving]
            inner = _list_fixed(tree, moving)

        joints[moving] = replace(joints[moving], kind="floating")

    return replace(tree, joints=joints)


def _list_fixed(tree: Description, bearer: str) -> list[str]:
    """List the links that are fixed to one."""
    return [
        child
        for child, joint in tree.joints.items()
        if joint.parent == bearer and joint.kind == "fixed"
    ]


class _Making:
    """Makes bodies and joints of a description, and notes what is left out."""

    def __init__(
        self,
        tree: Description,
        folder: Path,
        prefix: str,
        notes: list[str],
        density: float | None,
    ) -> None:
        links = {name: prefix + name for name in tree.links}
        tree = tree.renamed(links, {name: prefix + name for name in tree.named})
        self._tree = tree
        self._folder = folder
        self._notes = notes
        self._density = density
        self._moving = [
            child for child, joint in tree.joints.items() if self._moves(joint)
        ]
        self._parts = tree.rigid_parts(self._moving)

    def make_in_world(self) -> Imported:
        """Make a body of each link that is fixed to the root, which is the world and bears no joint."""
        root = self._tree.root
        standing = {name for name, (head, _) in self._parts.items() if head == root}
        self._parts = self._tree.rigid_parts([*standing, *self._moving])
        return self._make(standing, {*self._moving})

    def make(self, fixed: bool) -> Imported:
        """Make one body of all that is rigidly joined to the root, ``fixed`` or not."""
        root = self._tree.root
        standing = {root} if fixed else set()
        return self._make(standing, {root, *self._moving})

    def _make(self, standing: set[str], bearers: set[str]) -> Imported:
        """Make the bodies, the root first, and the joints between them.

        Args:
            standing: the links whose bodies are fixed.
            bearers: those that joints move against, where they have a body; the others are the world.
        """
        tree = self._tree
        heads = {head: list[tuple[RobotLink, Pose]]() for head in tree.links}
        for name, (head, place) in self._parts.items():
            heads[head].append((tree.links[name], place))

        places = {tree.root: Pose()}
        bodies = dict[str, Body]()
        joints = list[Joint]()
        for head in sorted(
            filter(heads.get, heads), key=lambda link: len(tree.above(link))
        ):
            if head != tree.root:
                joint = tree.joints[head]
                parent, place = self._parts[joint.parent]
                frame = places[parent] @ place @ joint.origin.pose
                places[head] = frame
                if head in self._moving:
                    places[head] = frame @ joint.moved(_find_start(joint))
                    bearer = parent if parent in bearers & bodies.keys() else None
                    if joint.kind != "floating":
                        joints.append(self._joint(joint, bearer))
            body = self._body(head, places[head], heads[head], head in standing)
            if body is not None:
                bodies[head] = body

        return Imported(tuple(bodies.values()), tuple(joints), tuple(self._notes))

    def _moves(self, joint: RobotJoint) -> bool:
        """Tell whether a joint moves, and note what it does not do."""
        where = f"joint {joint.name!r}"
        if joint.kind == "planar":
            self._notes.append(f"{where} is planar, which can't be; it is fixed")
        if joint.mimic:
            self._notes.append(
                f"{where} mimics another one, which is left out; it moves by itself"
            )
        if joint.kind == "ball" and joint.limits.upper != math.inf:
            self._notes.append(f"{where} is a ball, of which the range is left out")

        if joint.kind in ("revolute", "prismatic"):
            lower, upper = joint.range
            if lower > upper:
                raise UserError(
                    f"{where} has limits {lower:g} to {upper:g}; exchange them"
                )

            if lower == upper:
                self._notes.append(f"{where} has no range, so that it is fixed")
                return False

            if _turns_freely(joint):
                self._notes.append(
                    f"{where} may turn a whole turn, so that it has no limits"
                )

        return joint.kind not in ("fixed", "planar")

    def _joint(self, joint: RobotJoint, bearer: str | None) -> Joint:
        """Make a joint that moves against a body, or None: the world."""
        kind: Literal["hinge", "slider", "ball"] = "hinge"
        lower, upper = joint.range
        if joint.kind == "prismatic":
            kind = "slider"
        elif joint.kind == "ball":
            kind = "ball"

        if joint.kind in ("ball", "continuous") or _turns_freely(joint):
            lower = -math.inf
            upper = math.inf

        stiffness, rest = joint.spring or (0.0, 0.0)
        return Joint(
            joint.name,
            kind,
            joint.child,
            bearer,
            axis=joint.direction,
            origin=tuple(0.0 - away for away in self._tree.links[joint.child].frame),
            lower=lower,
            upper=upper,
            start=_find_start(joint),
            damping=joint.damping,
            friction=joint.friction,
            stiffness=stiffness,
            rest=rest,
        )

    def _body(
        self,
        head: str,
        pose: Pose,
        links: Sequence[tuple[RobotLink, Pose]],
        fixed: bool,
    ) -> Body | None:
        """Make a body of links that are rigidly joined, each with its pose; None: nothing is there."""
        frame = Pose(np.array(self._tree.links[head].frame))
        inside = [(link, frame.inverse() @ place) for link, place in links]
        visuals = list[Geom]()
        for link, place in inside:
            for shape in link.visuals:
                visuals += self._geoms(shape, place, drawn=True)

        collisions = list[Geom]()
        frictions = set[float]()
        for link, place in inside:
            for shape in link.collisions:
                collisions += self._geoms(shape, place, drawn=False)
                frictions.add(_FRICTION if shape.friction is None else shape.friction)

        if len(frictions) > 1:
            self._notes.append(
                f"body {head!r}: its shapes have several frictions; all get the largest"
            )

        mass = None
        if not fixed:
            mass = sum(link.inertial.mass for link, _ in links)
            if mass == 0 and self._density is not None:
                volume = sum(geom.shape.volume for geom in collisions)
                mass = self._density * volume
        elif not (visuals or collisions):
            return None

        friction = max(frictions, default=_FRICTION)
        return joined_body(head, pose @ frame, mass, visuals, collisions, friction)

    def _geoms(self, shape: RobotShape, place: Pose, *, drawn: bool) -> list[Geom]:
        """Make what is drawn of a shape, or what collides."""
        pose = place @ shape.origin.pose
        color = shape.color or _GREY
        solid = shape.shape
        if isinstance(solid, Mesh) and not drawn:
            return [Geom(Mesh.hull_of(hull_corners(solid.vertices)), pose, color)]
        if not isinstance(solid, Path):
            return [Geom(solid, pose, color)]

        try:
            found = load_solid(solid, self._folder, shape.scale, drawn_only=drawn)
        except UserError as error:
            if not drawn:
                raise

            self._notes.append(f"not drawn: {error}")
            return []

        if drawn:
            return [Geom(mesh, pose, known or color) for mesh, known in found.drawn]

        if found.coarse:
            self._notes.append(note_coarse(solid))

        return [Geom(part, pose, color) for part in found.parts]


def _turns_freely(joint: RobotJoint) -> bool:
    """Check if a joint's limits let it turn a whole turn."""
    lower, upper = joint.range
    return joint.kind == "revolute" and upper - lower >= 2 * math.pi


def _find_start(joint: RobotJoint) -> float:
    """Return the position at which a joint starts, rad or m: within its range."""
    if joint.kind not in ("revolute", "prismatic"):
        return joint.start

    lower, upper = joint.range
    return min(max(joint.start, lower), upper)
