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
from core.scene import Body, Geom, Soft
from core.support.text import short_number, short_numbers, table
from plugins.vlms.told.bodies import slip, weight

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
        if isinstance(child, ast.AnnAssign) and isinstance(child.target, ast.Name) and child.target.id in members:
            kept += lines[child.lineno - 1 : child.end_lineno]
    return "\n".join(kept)


def task_source(task: Task) -> str:
    """Return the task's file without what the prompt says elsewhere, or what its reward does not read.

    Left out are its short description, its variations (what a design is judged by has their ranges) and goals that the
    reward does not name.
    """
    text = task.source()
    if task.language != "python":
        return re.sub(r"^(in_words|variations):.*?(?=^[^\s#]|\Z)", "", text, flags=re.MULTILINE | re.DOTALL)
    lines = text.splitlines(keepends=True)
    members = [m for part in ast.parse(text).body if isinstance(part, ast.ClassDef) for m in part.body]
    rewards = [ast.unparse(m) for m in members if isinstance(m, ast.FunctionDef) and m.name == "reward"]
    unread = () if not rewards or "goals" in rewards[0] else ("goals", "every")
    left_out = {"in_words", "variations", *unread}
    for member in reversed(members):
        targets = member.targets if isinstance(member, ast.Assign) else []
        if any(isinstance(target, ast.Name) and target.id in left_out for target in targets):
            del lines[member.lineno - 1 : member.end_lineno]
    return "".join(lines)


def helpers(task: Task) -> str:
    """Take the heads and docstrings of the functions that a task's file imports from its own package.

    A function without a docstring is taken whole.
    """
    module = sys.modules[type(task).__module__]
    package = module.__name__.partition(".")[0]
    functions = [inspect.unwrap(value) for value in vars(module).values() if callable(value)]
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
    return "\n".join(text.splitlines()[: node.body[0].end_lineno if documented else None])


_ALIKE = 3  # bodies alike, one after the other, from which on they share a row
_HOLLOW = 3  # parts of a hollow body, and sides on which they bound its middle, at least
_STEP_M = 0.0005
_HEAD = ("body", "position", "shape", "x", "y", "z", "mass", "friction")


def layout_table(task: Task, seed: int, *, worded: bool = False) -> str:
    """Write a row for each body of a layout: position, turn, shape, extent in the world, mass and friction.

    Lengths are rounded to a millimetre. Bodies that differ in pose alone share a row. Of a hollow body, the row has the
    free space along the axes through its middle. ``worded``: mass and friction are words.
    """
    rows = []
    for _, alike in groupby(task.scene(seed).bodies, _description):
        bodies = list(alike)
        rows += [_row(bodies, worded)] if len(bodies) >= _ALIKE else [_row([body], worded) for body in bodies]
    return table(_HEAD, rows)


def _row(bodies: Sequence[Body], worded: bool) -> tuple[str, ...]:
    first = bodies[0]
    if len(bodies) == 1:
        name, place = first.name, _placed(first.pose)
    else:
        name = f"{len(bodies)} alike: {first.name} ... {bodies[-1].name}"
        place = "; ".join(_placed(body.pose) for body in bodies)
    bounds = [_bounds(_parts(body), body.pose) for body in bodies]
    low, high = np.min([low for low, _ in bounds], axis=0), np.max([high for _, high in bounds], axis=0)
    extents = (f"{short_number(a, 3)} to {short_number(b, 3)}" for a, b in zip(low, high, strict=True))
    mass = "fixed" if not first.mass else weight(first) if worded else f"{first.mass:.3g} kg"
    friction = slip(first) if worded else _friction(first)
    return name, place, _shape(first, alone=len(bodies) == 1), *extents, mass, friction


def _description(body: Body) -> tuple[object, ...]:
    """The properties that bodies of one row share."""
    parts = tuple((describe_shape(part.shape), part.pose) for part in _parts(body))
    made = body.elastic if isinstance(body, Soft) else bool(body.collisions)
    return made, parts, body.mass, body.friction, body.rolling_friction, body.restitution


def _parts(body: Body) -> tuple[Geom, ...]:
    return body.collisions or body.visuals


def _placed(pose: Pose) -> str:
    roll, pitch, yaw = pose.rpy.round(3) + 0.0
    turn = (
        f" rpy {short_numbers((roll, pitch, yaw), 3)}"
        if roll or pitch
        else f" yaw {short_number(yaw, 3)}"
        if yaw
        else ""
    )
    return short_numbers(pose.position, 3) + turn


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
    counts = Counter(type(part.shape).__name__.lower().replace("mesh", "convex part") for part in parts)
    plural = {"box": "boxes"}
    words = [f"{n} {plural.get(kind, f'{kind}s')}" if n > 1 else f"1 {kind}" for kind, n in counts.items()]
    low, high = _bounds(parts, Pose())
    size = (
        f", {short_numbers(high - low, 3)} along its own axes"
        if np.abs(body.pose.rpy).max() > 0.001 or not alone
        else ""
    )
    return " + ".join(words) + size + _inside(body, low, high)


def _inside(body: Body, low: Array, high: Array) -> str:
    """Describe the free space through the middle of a hollow body."""
    middle = (low + high) / 2
    solids = [Solid("", solid_geometry(part.shape), part.pose) for part in body.collisions]
    if len(solids) < _HOLLOW or _distance(solids, middle) <= 0:
        return ""
    upright = np.abs(body.pose.rpy).max() <= 0.001
    shift = body.pose.position if upright else np.zeros(3)
    words, met = [], 0
    for axis, name in enumerate("xyz"):
        ends = []
        for sign, limit in ((-1, low), (1, high)):
            way = sign * np.eye(3)[axis]
            free = _free(solids, middle, way, abs(float(limit[axis] - middle[axis])))
            met += free is not None
            ends.append("open" if free is None else short_number((middle + free * way + shift)[axis], 3))
        words.append(f"{name} {ends[0]} to {ends[1]}")
    frame = "" if upright else " in its own frame"
    return f"; hollow, free through its middle{frame}: {', '.join(words)}" if met >= _HOLLOW else ""


def _free(solids: Sequence[Solid], start: Array, way: Array, most: float) -> float | None:
    """The distance from ``start`` along ``way`` to the first solid; None: there is none within ``most`` metres."""
    gone = 0.0
    while gone < most:
        gap = _distance(solids, start + gone * way)
        if gap < _STEP_M:
            return gone + max(gap, 0.0)
        gone += gap
    return None


def _distance(solids: Sequence[Solid], point: Array) -> float:
    dot = Solid("", solid_geometry(Sphere(1e-6)), Pose(point))
    return min(signed_distance(dot, solid) for solid in solids)


def _bounds(parts: Sequence[Geom], pose: Pose) -> tuple[Array, Array]:
    """The lowest and the highest corner of the box around shapes, along the axes of the frame that has ``pose``."""
    lows, highs = [], []
    for part in parts:
        frame = pose @ part.pose
        if isinstance(part.shape, Sphere):  # its own box would turn with it
            points = frame.position + part.shape.radius * np.array([[-1.0], [1.0]])
        elif isinstance(part.shape, Cylinder):
            axis = frame.rotation.as_matrix()[:, 2]
            half = part.shape.length / 2 * np.abs(axis) + part.shape.radius * np.sqrt(np.maximum(1 - axis**2, 0.0))
            points = np.array([frame.position - half, frame.position + half])
        else:
            points = frame.apply(
                part.shape.vertices if isinstance(part.shape, Mesh) else part.shape.to_trimesh().vertices
            )
        lows.append(points.min(axis=0))
        highs.append(points.max(axis=0))
    return np.min(lows, axis=0), np.max(highs, axis=0)


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
