"""Build the scene that a checked file describes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from core.errors import UsageError, UserError, choices
from core.geometry import Array, Pose
from core.goals import Reach, Turned, check_names, reaches
from core.scene import Body, Scene, Soft, floor, table
from core.values.joints import Placement
from plugins.tasks.file.bodies import build_body, read_pose
from plugins.tasks.file.files import Files
from plugins.tasks.file.goals import Flattened, Spread
from plugins.tasks.file.spec import SceneSpec, rgba
from plugins.tasks.file.tree import Tree, Where


def build_scene(tree: Tree, spec: SceneSpec, files: Files) -> Scene:
    """Build the scene.

    Raises:
        UserError: a file can't be used; two bodies or marks have one name (says where the second is); or bodies, joints
            or goals don't fit together.
    """
    around = []
    if spec.floor:
        around.append(floor(spec.floor_height))
    if spec.table:
        around.append(table())
    marks = [
        Body.mark(mark.name, mark.position, mark.radius, rgba(mark.color))
        for mark in spec.marks
    ]
    bodies = list[Body]()
    joints = list(spec.joints)

    for number, given in enumerate(spec.bodies):
        with _located(tree, ("bodies", number)):
            body = build_body(given, files)
            frame = _frame(given.at, (*marks, *bodies))
            bodies.append(replace(body, pose=frame @ body.pose))

    for number, other in enumerate(spec.imports):
        with _located(tree, ("imports", number)):
            found = files.bodies(other.file, other.prefix, fixed=other.fixed)
            pose = _frame(other.at, (*marks, *bodies)) @ read_pose(other)

        bodies += [replace(body, pose=pose @ body.pose) for body in found.bodies]
        joints += found.joints

    _check_unique(tree, spec, [body.name for body in around])

    try:
        scene = Scene((*around, *marks, *bodies), tuple(joints))
    except ValueError as error:
        raise tree.error(_find_joint(spec, str(error)), str(error)) from error

    if not scene.free:
        problem = "nothing can move, so nothing can be earned; give a body a mass"
        raise tree.error(("bodies",), problem)

    _check_goals(tree, spec, scene)

    return scene


def _check_unique(tree: Tree, spec: SceneSpec, taken: list[str]) -> None:
    """Refuse a mark or body that has the name of another, or of what is ``taken``.

    Raises:
        UserError: says which.
    """
    marks = [mark.name for mark in spec.marks]
    bodies = [body.name for body in spec.bodies]
    for kind, names in (("marks", marks), ("bodies", bodies)):
        for number, name in enumerate(names):
            if name in taken:
                problem = f"{name!r} is there already; choose another name"
                raise tree.error((kind, number, "name"), problem)
            taken.append(name)


def _find_joint(spec: SceneSpec, message: str) -> Where:
    """Return where the joint is that a message names; the whole file where it names none."""
    for number, joint in enumerate(spec.joints):
        if f"joint {joint.name!r}:" in message:
            return ("joints", number)
    return ()


def with_starts(scene: Scene, starts: Mapping[str, float]) -> Scene:
    """Return a scene whose joints, by name, start elsewhere; bodies that hang from them go along.

    Raises:
        ValueError: a joint can't start there.
    """
    poses = {body.name: body.pose for body in scene.bodies}

    for placed in scene.ordered_joints:
        joint = placed.joint
        value: Array = np.array(starts.get(joint.name, joint.start))
        speed: Array = np.zeros(())
        if joint.kind == "ball":
            value = np.array([1.0, 0.0, 0.0, 0.0])
            speed = np.zeros(3)

        parent = Pose()
        if joint.parent is not None:
            parent = poses[joint.parent]
        moved = placed.carry(value, speed, Placement.at_rest(parent))
        poses[joint.body] = Pose(moved.position, moved.quaternion)

    joints = []
    for joint in scene.joints:
        start = starts.get(joint.name, joint.start)
        joints.append(replace(joint, start=start))

    bodies = [replace(body, pose=poses[body.name]) for body in scene.bodies]
    return Scene(tuple(bodies), tuple(joints))


@contextmanager
def _located(tree: Tree, where: Where) -> Iterator[None]:
    """Say where in the file it is that can't be."""
    try:
        yield
    except (UserError, ValueError) as error:
        raise tree.error(where, str(error)) from error


def _frame(name: str | None, above: Sequence[Body]) -> Pose:
    """Return the pose of the body or mark that another one is placed at.

    Raises:
        UsageError: there is none of that name.
    """
    if name is None:
        return Pose()
    frames = {body.name: body.pose for body in above}
    if name not in frames:
        raise choices("body or mark", name, frames, "what the file has before it")
    return frames[name]


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
                    problem = choices("goal", str(reach.after), map(str, names))
                    raise tree.error(("goals", number, "after"), str(problem))
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
            nodes = 0
            if isinstance(body, Soft):
                nodes = len(body.form.nodes)
            if soft and not 0 <= (node or 0) < nodes:
                what = "node (from 0), max_height_m and min_area_m2 are for soft bodies"
                raise UsageError(f"{what}; {name!r} has {nodes} nodes")

            if nodes and isinstance(part, Turned):
                raise UsageError(f"the soft body {name!r} has no axis; its nodes move")
