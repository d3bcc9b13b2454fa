"""Build the scene that a checked file describes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import trimesh

from core.errors import UsageError, UserError, choices
from core.geometry import Box, Mesh, Pose, Shape
from core.goals import Reach, Turned, check_names, reaches
from core.scene import Body, Filling, Geom, Scene, Soft, floor, table
from core.values.joints import Placement
from plugins.tasks.file.files import Files
from plugins.tasks.file.goals import Flattened, Spread
from plugins.tasks.file.imports.bodies import HEAVIEST, LIGHTEST
from plugins.tasks.file.spec import BodySpec, ImportSpec, SceneSpec, ShapeSpec, rgba
from plugins.tasks.file.tree import Tree, Where

GREY = "#b3b3b3"


def build_scene(tree: Tree, spec: SceneSpec, files: Files) -> Scene:
    """Build the scene.

    Raises:
        UserError: a file can't be used; two bodies or marks have one name (says where the second is); or bodies, joints
            or goals don't fit together.
    """
    around = [floor(spec.floor_height)] * spec.floor + [table()] * spec.table
    marks = [
        Body.mark(mark.name, mark.position, mark.radius, rgba(mark.color))
        for mark in spec.marks
    ]
    bodies = list[Body]()
    joints = list(spec.joints)
    for number, of in enumerate(spec.bodies):
        with _located(tree, ("bodies", number)):
            body = _body(of, files)
            limits = f"{LIGHTEST:g} to {HEAVIEST:g}; change its density"
            if not of.fixed and not LIGHTEST <= body.mass <= HEAVIEST:
                raise ValueError(
                    f"its mass would be {body.mass:.3g} kg, beyond {limits}"
                )
            bodies.append(
                replace(body, pose=_frame(of.at, (*marks, *bodies)) @ body.pose)
            )
    for number, other in enumerate(spec.imports):
        with _located(tree, ("imports", number)):
            found = files.bodies(other.file, other.prefix, fixed=other.fixed)
            pose = _frame(other.at, (*marks, *bodies)) @ _pose(other)
        bodies += [replace(body, pose=pose @ body.pose) for body in found.bodies]
        joints += found.joints
    taken = [body.name for body in around]
    for kind, names in (
        ("marks", [mark.name for mark in spec.marks]),
        ("bodies", [body.name for body in spec.bodies]),
    ):
        for number, name in enumerate(names):
            if name in taken:
                raise tree.error(
                    (kind, number, "name"),
                    f"{name!r} is there already; choose another name",
                )
            taken.append(name)
    try:
        scene = Scene((*around, *marks, *bodies), tuple(joints))
    except ValueError as error:
        known = (
            ("joints", n)
            for n, joint in enumerate(spec.joints)
            if f"joint {joint.name!r}:" in str(error)
        )
        raise tree.error(next(known, ()), str(error)) from error
    if not scene.free:
        raise tree.error(
            ("bodies",),
            "nothing can move, so nothing can be earned; give a body a mass",
        )
    _check_goals(tree, spec, scene)
    return scene


def with_starts(scene: Scene, starts: Mapping[str, float]) -> Scene:
    """Return a scene whose joints, by name, start elsewhere; bodies that hang from them go along.

    Raises:
        ValueError: a joint can't start there.
    """
    poses = {body.name: body.pose for body in scene.bodies}
    for placed in scene.ordered_joints:
        joint = placed.joint
        ball = placed.joint.kind == "ball"
        value = np.array(
            [1.0, 0.0, 0.0, 0.0] if ball else starts.get(joint.name, joint.start)
        )
        parent = Placement.at_rest(
            poses[joint.parent] if joint.parent is not None else Pose()
        )
        moved = placed.carry(value, np.zeros(3 if ball else ()), parent)
        poses[joint.body] = Pose(moved.position, moved.quaternion)
    return Scene(
        tuple(replace(body, pose=poses[body.name]) for body in scene.bodies),
        tuple(
            replace(joint, start=starts.get(joint.name, joint.start))
            for joint in scene.joints
        ),
    )


@contextmanager
def _located(tree: Tree, where: Where) -> Iterator[None]:
    """Say where in the file it is that can't be."""
    try:
        yield
    except (UserError, ValueError) as error:
        raise tree.error(where, str(error)) from error


def _body(spec: BodySpec, files: Files) -> Body:
    own = rgba(spec.color or GREY)
    if spec.elastic is not None:
        form = spec.rope or spec.cloth or Filling(_hull(spec, files), spec.counts)
        return Soft.make(
            spec.name, form, spec.elastic, _pose(spec), color=own, pinned=spec.pinned
        )
    if spec.file is not None:
        (read,) = files.mesh(spec.file, spec.scale).bodies
        visuals = read.visuals
        collisions = read.collisions
        volume = read.mass
        if spec.color is not None:
            visuals = tuple(replace(geom, color=own) for geom in visuals)
    elif spec.parts is not None:
        parts = spec.parts
        visuals = collisions = tuple(
            Geom(_shape(p), _pose(p), rgba(p.color) if p.color else own) for p in parts
        )
        volume = sum(geom.shape.volume for geom in visuals)
    else:
        visuals = collisions = (Geom(_shape(spec), color=own),)
        volume = visuals[0].shape.volume
    mass = (spec.mass or 0.0) if spec.density is None else spec.density * volume
    names = ("friction", "rolling_friction", "restitution", "velocity", "spin")
    given = {name: getattr(spec, name) for name in names}
    return Body(spec.name, _pose(spec), mass, visuals, collisions, **given)


def _hull(spec: BodySpec, files: Files) -> Shape:
    """Return a shape whose convex hull is that of a body's one shape, or of its file."""
    if spec.file is None:
        return _shape(spec)
    parts = [
        part.shape.to_trimesh()
        for part in files.mesh(spec.file, spec.scale).bodies[0].collisions
    ]
    return Mesh.from_trimesh(trimesh.util.concatenate(parts).convex_hull)


def _shape(spec: ShapeSpec) -> Shape:
    shape = spec.sphere or spec.cylinder or spec.capsule
    if shape is not None:
        return shape
    assert spec.box is not None  # the spec has one of them
    return Box(spec.box)


def _pose(spec: ShapeSpec | ImportSpec) -> Pose:
    roll, pitch, yaw = np.radians(spec.rpy_deg)
    return Pose.xyz_rpy(spec.position, (roll, pitch, yaw))


def _frame(at: str | None, above: Sequence[Body]) -> Pose:
    """Return the pose of the body or mark that another one is placed at.

    Raises:
        UsageError: there is none of that name.
    """
    if at is None:
        return Pose()
    frames = {body.name: body.pose for body in above}
    if at not in frames:
        raise choices("body or mark", at, frames, "what the file has before it")
    return frames[at]


def _check_goals(tree: Tree, spec: SceneSpec, scene: Scene) -> None:
    """Refuse goals that name what is not there.

    Raises:
        UserError: says which name.
    """
    names = set[str | int]()  # of goals that another may come after
    for number, entry in enumerate(spec.goals):
        for reach in reaches(entry):
            names |= {number, reach.name or number}
    for number, entry in enumerate(spec.goals):
        try:
            for goal in entry:
                check_names(goal, scene)
            for reach in reaches(entry):
                if reach.after is not None and reach.after not in names:
                    raise choices("goal", str(reach.after), map(str, names))
                _check_softness(reach, scene)
        except UsageError as error:
            raise tree.error(("goals", number), str(error)) from None


def _check_softness(goal: Reach, scene: Scene) -> None:
    """Refuse what can't be asked of soft bodies, and what can be asked of them alone.

    Raises:
        UsageError: says which.
    """
    for part in goal.parts:
        node = getattr(part, "node", None)
        soft = node is not None or isinstance(part, Flattened | Spread)
        for name in goal.bodies:
            body = scene[name]
            nodes = len(body.form.nodes) if isinstance(body, Soft) else 0
            if soft and not 0 <= (node or 0) < nodes:
                what = "node (from 0), max_height_m and min_area_m2 are for soft bodies"
                raise UsageError(f"{what}; {name!r} has {nodes} nodes")
            if nodes and isinstance(part, Turned):
                raise UsageError(f"the soft body {name!r} has no axis; its nodes move")
