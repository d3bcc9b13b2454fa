"""Vary the numbers of a tool: the sizes of its components, and how each lies on its parent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import Component, Tool
from core.geometry import Array, Pose, Shape
from core.interfaces import Numbers, ToolRepresentation
from core.robot.solids import closest, solids_of
from core.values.contents import content_of

GROWTH = 0.1
"""A small growth of a side, as a logarithm."""

MOST_GROWTH = 1.0
"""The largest growth of a side, as a logarithm."""

SLIDE_M = 0.01
"""A small slide along the parent's surface, or into it."""

MOST_SLIDE_M = 0.2
"""The largest slide."""

TURN_RAD = 0.05
"""A small turn."""

MOST_TURN_RAD = 0.5
"""The largest turn."""


def tool_numbers(design: Tool) -> Numbers:
    """List the changes of a tool that `vary_tool` makes, all 0 as it is: nine for each component.

    A tool with joints has none.
    """
    if design.bearers:
        return Numbers()

    steps = np.repeat((GROWTH, SLIDE_M, TURN_RAD), 3)
    most = np.repeat((MOST_GROWTH, MOST_SLIDE_M, MOST_TURN_RAD), 3)
    numbers = Numbers()

    for _ in design.components:  # a table each, since they change one by one
        numbers += Numbers.near(np.zeros(9), steps, most)

    return numbers


def vary_tool(design: Tool, values: Array) -> Tool:
    """Return the tool with changes ``values`` (N,), see `tool_numbers`.

    A component grows about the point where it touches its parent, slides on the parent with that point, and turns
    about it; so the two go on touching. On the mount it does not slide. Compounds don't grow. Densities stay.

    Args:
        design: the tool as it is.
        values: (9 C,) of each of C components in turn: the logarithms of its sides' growth, its slide in the parent's
            frame, metres, and its turn in its own frame, a rotation vector.
    """
    changed: dict[str, Component] = {}
    old = {component.name: component for component in design.components}
    changes = values.reshape(-1, 3, 3)

    for component, (growth, slide, turn) in zip(
        design.components, changes, strict=True
    ):
        shape = component.shape
        if growth.any() and shape.is_convex:
            shape = shape.resized(shape.bounds[1] * np.exp(growth))

        touch = goal = np.zeros(3)
        if component.parent in changed:
            touch = _touching(component, old[component.parent])
            goal = _slid(touch, slide, old[component.parent], changed[component.parent])

        inside = component.pose.inverse().apply(touch)
        inside = _scaled(inside, component.shape, shape)
        rotation = component.pose.rotation * Rotation.from_rotvec(turn)
        pose = Pose.from_rotation(goal - rotation.apply(inside), rotation)
        mass = component.mass * shape.volume / component.shape.volume
        changed[component.name] = replace(component, pose=pose, shape=shape, mass=mass)

    return replace(design, components=tuple(changed.values()))


def tool_change(design: Tool, other: Tool) -> Array | None:
    """Return the changes (N,) by which `vary_tool` makes ``design`` like ``other``, as far as it can.

    None: the tools have joints, or other components, parents or kinds of shapes.

    Args:
        design: the tool as it is.
        other: what it is to be like.
    """
    if design.bearers or _structure(design) != _structure(other):
        return None

    values = []
    old = {c.name: c for c in design.components}
    new = {c.name: c for c in other.components}

    for component, after in zip(design.components, other.components, strict=True):
        slide = np.zeros(3)
        if component.parent in old:
            touch = _touching(component, old[component.parent])
            inside = component.pose.inverse().apply(touch)
            inside = _scaled(inside, component.shape, after.shape)
            goal = after.pose.apply(inside)
            slide = goal - _slid(touch, slide, old[component.parent], new[after.parent])

        growth = np.log(after.shape.bounds[1] / component.shape.bounds[1])
        turn = component.pose.rotation.inv() * after.pose.rotation
        values += [growth, slide, turn.as_rotvec()]

    return np.concatenate(values)


def _structure(tool: Tool) -> object:
    """What `vary_tool` leaves as it is, but for names."""
    number = {component.name: n for n, component in enumerate(tool.components)}

    structure: list[tuple[object, object]] = []
    for component in tool.components:
        shape: object = type(component.shape)
        if not component.shape.is_convex:
            shape = content_of(component.shape)

        structure.append((number.get(component.parent, component.parent), shape))

    return tool.gripper, structure


def _slid(
    point: Array,
    slide: Array,
    before: Component,
    after: Component,
) -> Array:
    """Find where a point of a parent is, after the parent has grown and the point has slid.

    Args:
        point: (3,) on the parent as it was, in the parent's frame, metres.
        slide: (3,) its slide, as far as the parent's bounds reach.
        before: the parent as it was.
        after: the parent as it is.
    """
    middle, sides = before.shape.bounds
    new_middle, new_sides = after.shape.bounds
    half = new_sides / 2
    share = np.clip((point - middle) / sides * 2, -1.0, 1.0)

    return new_middle + np.clip(share * half + slide, -half, half)


def _scaled(
    point: Array,
    before: Shape,
    after: Shape,
) -> Array:
    """Find where a ``point`` (3,) of a shape is after the shape has grown, in the shape's frame."""
    middle, sides = before.bounds
    new_middle, new_sides = after.bounds

    return new_middle + (point - middle) * new_sides / sides


def _touching(component: Component, parent: Component) -> Array:
    """The point (3,) in the parent's frame where the two are closest."""
    solids = solids_of(component.name, component.shape, component.pose)
    _, point, _ = closest(solids, solids_of(parent.name, parent.shape, Pose()))

    return point


class VariedTools(ToolRepresentation):
    """A representation that can write tools of any sizes and poses."""

    parameters = staticmethod(tool_numbers)
    with_parameters = staticmethod(vary_tool)
    toward = staticmethod(tool_change)
