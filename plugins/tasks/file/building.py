"""Build the scene that a checked file describes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from core.errors import UsageError, UserError, choices
from core.geometry import Pose
from core.goals import find_names
from core.scene import (
    FIXTURE,
    Body,
    Bond,
    Color,
    Joint,
    Region,
    Scene,
    Soft,
    table,
)
from plugins.tasks.file.body_building import (
    build_body,
    build_ground,
    build_mark,
    place_copies,
    read_pose,
)
from plugins.tasks.file.named_files import Files
from plugins.tasks.file.refusals import SceneReason
from plugins.tasks.file.spec import (
    MAX_COPIES,
    MarkSpec,
    RepeatSpec,
    SceneSpec,
    rgba,
)
from plugins.tasks.file.tree import Tree, Where, as_coded


def build_scene(tree: Tree, spec: SceneSpec, files: Files) -> Scene:
    """Build the scene.

    Raises:
        UserError: a file can't be used; two bodies or marks have one name (says where the second is); or bodies, joints
            or goals don't fit together.
    """
    around = list(build_ground(spec))
    if spec.table:
        around.append(table())

    marks = [build_mark(mark) for mark in spec.marks if mark.at is None]
    bodies = list[Body]()
    joints = list(spec.joints)

    for number, given in enumerate(spec.bodies):
        with _located(tree, ("bodies", number)):
            body = build_body(given, files)
            frame = _frame(given.at, (*marks, *bodies))
            placed = replace(body, pose=frame @ body.pose)
            bodies += _repeat(placed, given.repeat)

    for number, other in enumerate(spec.imports):
        with _located(tree, ("imports", number)):
            found = files.bodies(
                other.file,
                other.prefix,
                fixed=other.fixed,
                without=other.without,
                density=other.density,
            )
            pose = _frame(other.at, (*marks, *bodies)) @ read_pose(other)

        bodies += [replace(body, pose=pose @ body.pose) for body in found.bodies]
        joints += found.joints

    for number, mark in enumerate(spec.marks):
        if mark.at is not None:
            with _located(tree, ("marks", number)):
                marks.append(_place_mark(mark, marks, bodies))

    if any(goal.needs_fixture for entry in spec.goals for goal in entry):
        marks.append(_stand_in(tree, spec))

    taken = [body.name for body in around]
    _check_unique(tree, spec, taken)
    if len(bodies) > MAX_COPIES:
        problem = UserError.because(
            SceneReason.SCENE_COUNT, count=len(bodies), most=MAX_COPIES
        )
        raise tree.error(("bodies",), problem)

    with _located(tree, ("colors",)):
        bodies = list(_paint(bodies, spec.colors))

    bodies = [_draw_carried(body, spec.marks, marks) for body in bodies]

    try:
        scene = Scene(
            (*around, *marks, *bodies), tuple(joints), spec.gravity, spec.bonds
        )
    except ValueError as error:
        where = _find_link(spec, getattr(error, "part", None))
        raise tree.error(where, as_coded(error)) from error

    if not scene.free:
        hint = ""
        if spec.imports:
            hint = ", or let what an import has without a joint move: fixed: false"

        problem = UserError.because(SceneReason.NOTHING_MOVES, hint=hint)
        raise tree.error(("bodies",), problem)

    return scene


def build_region(spec: SceneSpec) -> Region | None:
    """Return where a designed fixture may stand; None: there can be none."""
    if spec.fixture is None:
        return None

    middle = np.array(spec.fixture.position)
    half = np.array(spec.fixture.box) / 2
    low, high = np.round([middle - half, middle + half], 6).tolist()
    return Region(tuple(low), tuple(high))


def _stand_in(tree: Tree, spec: SceneSpec) -> Body:
    """Build the mark whose place a design's fixture takes: where it may stand.

    Raises:
        UserError: it may not stand anywhere.
    """
    region = spec.fixture
    if region is None:
        raise tree.error(("goals",), UserError.because(SceneReason.NO_FIXTURE))

    place = {"position": region.position, "box": region.box}
    mark = MarkSpec.model_validate({"name": FIXTURE, **place})
    return build_mark(mark)


def _repeat(body: Body, repeat: RepeatSpec | None) -> list[Body]:
    """Return copies of a body, with numbers from 0 in their names; itself where it is not repeated."""
    if repeat is None:
        return [body]

    return [
        replace(body, name=f"{body.name}_{number}", pose=body.pose @ pose)
        for number, pose in enumerate(place_copies(repeat, body))
    ]


def _place_mark(spec: MarkSpec, marks: Sequence[Body], bodies: Sequence[Body]) -> Body:
    """Build a mark that is placed at something: with what can move it goes along, and that draws it.

    Raises:
        UsageError: there is nothing of that name, or it is soft.
    """
    mark = build_mark(spec)
    frame = _frame(spec.at, (*marks, *bodies))
    mark = replace(mark, pose=frame @ mark.pose)

    named = {body.name: body for body in (*marks, *bodies)}
    bearer = named[str(spec.at)]
    if isinstance(bearer, Soft):
        raise UsageError(
            f"{bearer.name!r} is soft, and has no frame that a mark could move with; leave at out, and write where the "
            "mark is in the world"
        )

    carrier = bearer.carrier
    if not bearer.fixed:
        carrier = bearer.name
    if carrier is None:
        return mark

    return replace(mark, visuals=(), carrier=carrier)


def _draw_carried(body: Body, specs: Sequence[MarkSpec], marks: Sequence[Body]) -> Body:
    """Let a body draw the marks that it takes along."""
    carried = {mark.name: mark for mark in marks if mark.carrier == body.name}
    visuals = list(body.visuals)
    for spec in specs:
        if spec.name in carried:
            place = body.pose.inverse() @ carried[spec.name].pose
            for geom in build_mark(spec).visuals:
                visuals.append(replace(geom, pose=place @ geom.pose))

    return replace(body, visuals=tuple(visuals)) if carried else body


def _paint(bodies: Sequence[Body], colors: Mapping[str, str]) -> Iterator[Body]:
    """Yield bodies in the colours that patterns of names give them.

    Raises:
        UsageError: a pattern fits none, or there is no such body.
    """
    names = [body.name for body in bodies]
    given = dict[str, Color]()
    for pattern, color in colors.items():
        found = find_names((pattern,), names)
        if found == (pattern,) and pattern not in names:
            raise choices("body", pattern, names)
        given |= dict.fromkeys(found, rgba(color))

    for body in bodies:
        if body.name not in given:
            yield body
            continue

        paint = given[body.name]
        visuals = [replace(geom, color=paint) for geom in body.visuals]
        yield replace(body, visuals=tuple(visuals))


def _check_unique(tree: Tree, spec: SceneSpec, taken: list[str]) -> None:
    """Refuse a mark or body that has the name of another, or of what is ``taken``.

    Raises:
        UserError: says which.
    """
    marks = [mark.name for mark in spec.marks]
    bodies = [body.name for body in spec.bodies]
    for kind, names in (("marks", marks), ("bodies", bodies)):
        for number, name in enumerate(names):
            where = (kind, number, "name")
            if name == FIXTURE:
                reason = SceneReason.SCENE_FIXTURE_NAME
                raise tree.error(where, UserError.because(reason, name=name))
            if name in taken:
                reason = SceneReason.SCENE_NAME
                raise tree.error(where, UserError.because(reason, name=name))

            taken.append(name)


def _find_link(spec: SceneSpec, part: object) -> Where:
    """Return where a joint or bond of a scene is written; the whole file for anything else."""
    if isinstance(part, Joint):
        names = [joint.name for joint in spec.joints]
        if part.name in names:
            return ("joints", names.index(part.name))
    elif isinstance(part, Bond):
        return ("bonds", spec.bonds.index(part))

    return ()


@contextmanager
def _located(tree: Tree, where: Where) -> Iterator[None]:
    """Say where in the file it is that can't be."""
    try:
        yield
    except (UserError, ValueError) as error:
        raise tree.error(where, as_coded(error)) from error


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
