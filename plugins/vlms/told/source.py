"""Write what a prompt shows of a task: parts of its source, and where the bodies of a layout are at the start."""

from __future__ import annotations

import ast
import inspect
import re
import sys
import textwrap
from collections import Counter
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import groupby
from typing import Any

import numpy as np

from core.geometry import Array, Box, Capsule, Cylinder, Mesh, Pose, Shape, Sphere
from core.interfaces import Task
from core.robot.solids import Solid, signed_distance, solid_geometry
from core.scene import Body, Soft
from core.support.text import short_number, short_numbers, table
from plugins.vlms.told.bodies import bounds, slip, weight

BODY = (
    "name",
    "pose",
    "mass",
    "visuals",
    "collisions",
    "friction",
    "rolling_friction",
    "restitution",
)  # members that are shown

_SECTION = re.compile(r"\n\n +(Args|Raises):.*?(?=\n? *\"\"\"\n)", re.DOTALL)


@lru_cache
def class_source(part: type, *members: str) -> str:
    """Take a class's head, its docstring without sections, and these fields."""
    text = _SECTION.sub("", inspect.getsource(part), count=1)
    lines, (node,) = text.splitlines(), ast.parse(text).body
    assert isinstance(node, ast.ClassDef)
    kept = lines[: node.body[0].end_lineno]
    for child in node.body[1:]:
        if (
            isinstance(child, ast.AnnAssign)
            and isinstance(child.target, ast.Name)
            and child.target.id in members
        ):
            kept += lines[child.lineno - 1 : child.end_lineno]
    return "\n".join(kept)


def task_source(task: Task) -> str:
    """Return the task's file without what the prompt says elsewhere, or what its reward does not read.

    Left out are its short description, its variations (what a design is judged by has their ranges) and goals that the
    reward does not name.
    """
    text = task.source()
    if task.language != "python":
        return re.sub(
            r"^(in_words|variations):.*?(?=^[^\s#]|\Z)",
            "",
            text,
            flags=re.MULTILINE | re.DOTALL,
        )
    lines = text.splitlines(keepends=True)
    members = [
        m
        for part in ast.parse(text).body
        if isinstance(part, ast.ClassDef)
        for m in part.body
    ]
    rewards = [
        ast.unparse(m)
        for m in members
        if isinstance(m, ast.FunctionDef) and m.name == "reward"
    ]
    unread = () if not rewards or "goals" in rewards[0] else ("goals", "every")
    left_out = {"in_words", "variations", *unread}
    for member in reversed(members):
        targets = member.targets if isinstance(member, ast.Assign) else []
        if any(
            isinstance(target, ast.Name) and target.id in left_out for target in targets
        ):
            del lines[member.lineno - 1 : member.end_lineno]
    return "".join(lines)


def helpers(task: Task) -> str:
    """Take the heads and docstrings of the functions that a task's file imports from its own package.

    A function without a docstring is taken whole.
    """
    module = sys.modules[type(task).__module__]
    package = module.__name__.partition(".")[0]
    functions = [
        inspect.unwrap(value) for value in vars(module).values() if callable(value)
    ]
    taken = [
        _head(function)
        for function in functions
        if inspect.isfunction(function)
        and function.__module__ != module.__name__
        and function.__module__.partition(".")[0] == package != "core"
        and function.__name__.isidentifier()  # no lambda
    ]
    return "\n\n".join(taken)


def _head(function: Callable[..., Any]) -> str:
    text = textwrap.dedent(inspect.getsource(function))
    (node,) = ast.parse(text).body
    assert isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    documented = ast.get_docstring(node) is not None
    return "\n".join(
        text.splitlines()[: node.body[0].end_lineno if documented else None]
    )


_ALIKE = 3  # bodies alike, one after the other, from which on they share a row
_HOLLOW = (
    3  # parts of a hollow body, and sides on which they bound its middle, at least
)
_STEP_M = 0.0005
_PLURAL = {"box": "boxes"}
_HEAD = ("body", "position", "shape", "x", "y", "z", "mass", "friction")


def layout_table(task: Task, seed: int, *, worded: bool = False) -> str:
    """Write a row for each body of a layout: position, turn, shape, extent in the world, mass and friction.

    Lengths are rounded to a millimetre. Bodies that differ in pose alone share a row. Of a hollow body, the row has the
    free space along the axes through its middle. ``worded``: mass and friction are words.
    """
    rows = []
    for _, alike in groupby(task.scene(seed).bodies, _description):
        bodies = list(alike)
        rows += (
            [_row(bodies, worded)]
            if len(bodies) >= _ALIKE
            else [_row([body], worded) for body in bodies]
        )
    return table(_HEAD, rows)


def _row(bodies: Sequence[Body], worded: bool) -> tuple[str, ...]:
    first = bodies[0]
    alone = len(bodies) == 1
    name = (
        first.name
        if alone
        else f"{len(bodies)} alike: {first.name} ... {bodies[-1].name}"
    )
    place = "; ".join(_placed(body.pose) for body in bodies)
    lows, highs = zip(*(bounds(body, body.pose) for body in bodies), strict=True)
    ends = zip(np.min(lows, axis=0), np.max(highs, axis=0), strict=True)
    extents = (
        f"{short_number(low, 3)} to {short_number(high, 3)}" for low, high in ends
    )
    mass = "fixed"
    if first.mass:
        mass = weight(first) if worded else f"{first.mass:.3g} kg"
    friction = slip(first) if worded else _friction(first)
    return name, place, _shape(first, alone=alone), *extents, mass, friction


def _description(body: Body) -> tuple[object, ...]:
    """The properties that bodies of one row share."""
    parts = tuple(
        (describe_shape(part.shape), part.pose)
        for part in body.collisions or body.visuals
    )
    made = body.elastic if isinstance(body, Soft) else bool(body.collisions)
    return (
        made,
        parts,
        body.mass,
        body.friction,
        body.rolling_friction,
        body.restitution,
    )


def _placed(pose: Pose) -> str:
    roll, pitch, yaw = pose.rpy.round(3) + 0.0
    turn = (
        f" rpy {short_numbers((roll, pitch, yaw), 3)}"
        if roll or pitch
        else f" yaw {short_number(yaw, 3)}"
    )
    return short_numbers(pose.position, 3) + (turn if roll or pitch or yaw else "")


def _shape(body: Body, *, alone: bool) -> str:
    """Describe a body's collision shapes, or a soft body; ``alone``: it has its row to itself."""
    if isinstance(body, Soft):
        size = short_numbers(np.ptp(body.form.nodes, axis=0), 3)
        return f"soft {body.form.kind}, {size}, {body.form.thickness:g} thick; {body.in_words()}"
    if not body.collisions:
        return "a mark: nothing touches it"
    parts = body.collisions
    if len(parts) == 1 and not isinstance(parts[0].shape, Mesh):
        return describe_shape(parts[0].shape)
    counts = Counter(
        type(part.shape).__name__.lower().replace("mesh", "convex part")
        for part in parts
    )
    text = " + ".join(
        f"{n} {kind}" if n == 1 else f"{n} {_PLURAL.get(kind, f'{kind}s')}"
        for kind, n in counts.items()
    )
    low, high = bounds(body, Pose())
    if not _upright(body) or not alone:
        text += f", {short_numbers(high - low, 3)} along its own axes"
    return text + _inside(body, low, high)


def _upright(body: Body) -> bool:
    return float(np.abs(body.pose.rpy).max()) <= 0.001


def _inside(body: Body, low: Array, high: Array) -> str:
    """Describe the free space through the middle of a hollow body."""
    middle = (low + high) / 2
    solids = [
        Solid("", solid_geometry(part.shape), part.pose) for part in body.collisions
    ]
    if len(solids) < _HOLLOW or _distance(solids, middle) <= 0:
        return ""
    shift = body.pose.position if _upright(body) else np.zeros(3)
    words = []
    for axis, name in enumerate("xyz"):
        ends = []
        for sign in (-1, 1):
            end = middle.copy()
            while (
                low[axis] < end[axis] < high[axis]
                and (gap := _distance(solids, end)) > _STEP_M
            ):
                end[axis] += sign * gap
            closed = low[axis] < end[axis] < high[axis]
            ends.append(short_number((end + shift)[axis], 3) if closed else "open")
        words.append(f"{name} {ends[0]} to {ends[1]}")
    text = ", ".join(words)
    if text.count("open") > 6 - _HOLLOW:
        return ""
    return f"; hollow, free through its middle{'' if _upright(body) else ' in its own frame'}: {text}"


def _distance(solids: Sequence[Solid], point: Array) -> float:
    dot = Solid("", solid_geometry(Sphere(1e-6)), Pose(point))
    return min(signed_distance(dot, solid) for solid in solids)


def describe_shape(shape: Shape) -> str:
    """Name a shape with its sizes in metres."""
    match shape:
        case Box(size):
            return f"box {short_numbers(size, 3)}"
        case Sphere(radius):
            return f"sphere, radius {short_number(radius, 3)}"
        case Cylinder(radius, length):
            return f"cylinder, radius {short_number(radius, 3)}, length {short_number(length, 3)}"
        case Capsule(radius, length):
            return f"capsule, radius {short_number(radius, 3)}, length {short_number(length, 3)} without its ends"
        case Mesh(vertices):
            return f"convex part of {len(vertices)} corners, {short_numbers(np.ptp(vertices, axis=0), 3)}"


def _friction(body: Body) -> str:
    if not (body.collisions or body.mass):
        return "-"
    rolling = f", rolling {body.rolling_friction:g}" if body.rolling_friction else ""
    bounce = f", restitution {body.restitution:g}" if body.restitution else ""
    return f"{body.friction:g}{rolling}{bounce}"
