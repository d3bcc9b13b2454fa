"""Vary tools of any origin at random: mutate one, or cross two.

A mutation changes the size, the place or the turn of one component, or adds, removes or replaces one. A crossover goes
part of the way from one tool's measures to another's where their components have the same names, or puts a component of
one on the other. Then every component is moved until it touches its parent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from core.design import Component, Tool
from core.geometry import Box, Pose, resized
from plugins.vlms.offline.boxes import Boxes, separations
from plugins.vlms.offline.chance import draw

_ADDED_COLOR = (0.56, 0.35, 0.68, 1.0)  # of components that were not in a parent
_THINNEST_M = 0.001
_LONGEST_M = 1.5
_OVERLAP_M = 0.0005  # of components that were moved until they touch
_BLENDS = 0.7  # how often tools of equal structure are blended when they are crossed
_MOST_MOVES = 4  # of a component, until it touches its parent


class ToolChange(NamedTuple):
    """A changed tool, and what was changed, in words.

    Attributes:
        tool: after the change.
        text: in the words of a tool's description.
    """

    tool: Tool
    text: str


def mutate(tool: Tool, scale: float, rng: Generator) -> ToolChange:
    """Make one change at random, by a scale of 0 to 1.

    Args:
        tool: of any origin.
        scale: of changes of size and pose.
        rng: random numbers.
    """
    count = len(tool.components)
    kinds = {
        "size": 4.0,
        "shift": 2.0,
        "turn": 2.0,
        "add": 1.5,
        "remove": float(count > 2),
        "replace": float(count > 1),
    }
    match draw(kinds, rng):
        case "size":
            return _resize(tool, scale, rng)
        case "add":
            return _add(tool, rng)
        case "shift":
            return _shift(tool, int(rng.integers(count)), scale, rng)
        case "turn":
            return _turn(tool, int(rng.integers(count)), scale, rng)
        case "remove":
            number = int(rng.choice(_find_leaves(tool)))
            name = tool.components[number].name
            return _with_components(tool, number, [], f"{name} removed")
        case _:
            return _replace(tool, int(rng.choice(_find_leaves(tool))), rng)


def _with_components(
    tool: Tool,
    number: int,
    new: Sequence[Component],
    text: str,
) -> ToolChange:
    """Put components in the place of the one with this number.

    Args:
        tool: of any origin.
        number: of a component; that after the last adds at the end.
        new: in its place.
        text: what was changed.
    """
    components = [*tool.components]
    components[number : number + 1] = new
    return _change(tool, components, text)


def _change(tool: Tool, components: Sequence[Component], text: str) -> ToolChange:
    """Give a tool these components, and move each until it touches its parent."""
    return ToolChange(_reattach(replace(tool, components=tuple(components))), text)


def _shift(
    tool: Tool,
    number: int,
    scale: float,
    rng: Generator,
) -> ToolChange:
    """Move a component, and with it its descendants.

    Args:
        tool: of any origin.
        number: of the component.
        scale: of the way, 0..1.
        rng: random numbers.
    """
    component = tool.components[number]
    pose = component.pose
    way = rng.normal(0.0, 0.03 * max(scale, 0.2), 3)
    moved = replace(component, pose=Pose(pose.position + way, pose.quaternion))
    text = f"{component.name} moved by {np.linalg.norm(way) * 1000:.0f} mm"

    return _with_components(tool, number, [moved], text)


def _turn(
    tool: Tool,
    number: int,
    scale: float,
    rng: Generator,
) -> ToolChange:
    """Turn a component, and with it its descendants.

    Args:
        tool: of any origin.
        number: of the component.
        scale: of the angle, 0..1.
        rng: random numbers.
    """
    component = tool.components[number]
    axis = int(rng.integers(3))
    sign = rng.choice([-1.0, 1.0])
    angle = float(sign * rng.uniform(0.08, 0.5) * max(scale, 0.3))
    rotation = Rotation.from_rotvec(angle * np.eye(3)[axis])
    turn = Pose.from_rotation(np.zeros(3), rotation)
    turned = replace(component, pose=component.pose @ turn)
    text = f"{component.name} turned by {np.degrees(angle):.0f} degrees about its {'xyz'[axis]}"

    return _with_components(tool, number, [turned], text)


def _replace(tool: Tool, number: int, rng: Generator) -> ToolChange:
    """Put a box in the place of a component.

    Args:
        tool: of any origin.
        number: of a component without children.
        rng: random numbers.
    """
    component = tool.components[number]
    sides = component.shape.bounds[1] * np.exp(rng.normal(0.0, 0.5, 3))
    x, y, z = np.clip(sides, _THINNEST_M, 0.6).tolist()
    name = _free_name("part", tool)
    box = Box((x, y, z))
    new = Component(name, component.parent, component.pose, box, color=_ADDED_COLOR)
    text = f"{component.name} replaced by a box of {x:.3f} x {y:.3f} x {z:.3f} m"

    return _with_components(tool, number, [new], text)


def _resize(tool: Tool, scale: float, rng: Generator) -> ToolChange:
    """Lengthen or shorten one side; children of the component move with its faces.

    Args:
        tool: of any origin, whose component becomes a box.
        scale: of the change.
        rng: random numbers.
    """
    number = int(rng.integers(len(tool.components)))
    axis = int(rng.integers(3))
    sign = rng.choice([-1.0, 1.0])
    factor = float(np.exp(sign * rng.uniform(0.1, 0.6) * max(scale, 0.2)))
    component = tool.components[number]
    before = component.shape.bounds[1]
    sides = before.tolist()
    sides[axis] = float(np.clip(sides[axis] * factor, _THINNEST_M, _LONGEST_M))

    stretch = np.ones(3)
    stretch[axis] = sides[axis] / before[axis]
    components = []

    for other in tool.components:
        stretched = other
        if other.parent == component.name:
            position = other.pose.position * stretch
            stretched = replace(other, pose=Pose(position, other.pose.quaternion))

        components.append(stretched)

    # The end that meets the parent stays where it is.
    pose = component.pose
    way = pose.rotation.as_matrix()[:, axis]
    toward = np.sign(float(pose.position @ way)) or 1.0
    shift = toward * (way * (sides[axis] - before[axis]) / 2)
    moved = Pose(pose.position + shift, pose.quaternion)
    x, y, z = sides
    components[number] = replace(component, shape=Box((x, y, z)), pose=moved)

    verb = "lengthened" if factor > 1 else "shortened"
    text = f"{component.name} {verb} in {'xyz'[axis]} to {sides[axis]:.3f} m"
    return _change(tool, components, text)


def _add(tool: Tool, rng: Generator) -> ToolChange:
    """Add a plate on a face of a component of the second half.

    Args:
        tool: of any origin.
        rng: random numbers.
    """
    count = len(tool.components)
    parent = tool.components[int(rng.integers(count // 2, count))]
    axis = int(rng.integers(3))
    side = float(rng.choice([-1.0, 1.0]))
    size = parent.shape.bounds[1]
    sides = size * rng.uniform(0.3, 1.0, 3)
    sides[axis] = rng.uniform(0.01, 0.08)
    sides = np.clip(sides, 0.004, 0.3)

    place = np.zeros(3)
    place[axis] = side * ((size[axis] + sides[axis]) / 2 - _OVERLAP_M)
    along = (axis + int(rng.integers(1, 3))) % 3
    edge = rng.choice([-1.0, 0.0, 1.0])
    place[along] = edge * (size[along] - sides[along]) / 2
    x, y, z = sides
    name = _free_name("fin", tool)
    fin = Component(name, parent.name, Pose(place), Box((x, y, z)), color=_ADDED_COLOR)

    return _add_component(tool, fin, f"{name} added on {parent.name}")


def _add_component(tool: Tool, component: Component, text: str) -> ToolChange:
    """Add a component at the end.

    Args:
        tool: of any origin.
        component: with a name and a parent in that tool.
        text: what was changed.
    """
    return _with_components(tool, len(tool.components), [component], text)


def _find_leaves(tool: Tool) -> list[int]:
    """Find the numbers of the components without children."""
    parents = {component.parent for component in tool.components}
    leaves = []
    for number, component in enumerate(tool.components):
        if component.name not in parents:
            leaves.append(number)
    return leaves


def _free_name(name: str, tool: Tool) -> str:
    """Return ``name``, with a number if a component has it.

    Args:
        name: of a new component.
        tool: which gets it.
    """
    taken = {component.name for component in tool.components}
    free = name
    number = 2

    while free in taken:
        free = f"{name}_{number}"
        number += 1

    return free


def cross(first: Tool, second: Tool, rng: Generator) -> ToolChange:
    """Blend two tools of equal structure, or put a component of the second on the first.

    Where no component of the first tool is on the mount of the second's, the first is mutated.

    Args:
        first: which is changed.
        second: which gives.
        rng: random numbers.
    """
    if _structure(first) == _structure(second) and rng.random() < _BLENDS:
        return _blend(first, second, float(rng.uniform(0.2, 0.8)))

    donor = second.components[int(rng.choice(_find_leaves(second)))]
    mount, pose = second.placed()[donor.name]
    placed = first.placed()
    bearers = []

    for component in first.components:
        if placed[component.name][0] == mount:
            bearers.append(component)

    if not bearers:
        return mutate(first, 0.5, rng)

    size = donor.shape.bounds[1]
    graft = Boxes.from_poses([(pose, size)] * len(bearers))
    poses = [placed[bearer.name][1] for bearer in bearers]
    sizes = [bearer.shape.bounds[1] for bearer in bearers]
    gaps, _ = separations(graft, Boxes.from_poses(zip(poses, sizes, strict=True)))
    nearest = int(np.argmin(gaps))
    parent = bearers[nearest].name
    new = replace(
        donor,
        name=_free_name(donor.name, first),
        parent=parent,
        pose=poses[nearest].inverse() @ pose,
        color=_ADDED_COLOR,
    )

    return _add_component(first, new, f"{donor.name} of the second put on {parent}")


def _structure(tool: Tool) -> list[tuple[str, str]]:
    """Return the names of components and of their parents, which two tools of equal structure share."""
    return [(component.name, component.parent) for component in tool.components]


def _blend(first: Tool, second: Tool, share: float) -> ToolChange:
    """Go a share of the way from the first tool's measures to the second's.

    Args:
        first: which gives names and kinds of shapes.
        second: of equal structure.
        share: 0..1.
    """
    components = []
    for start, end in zip(first.components, second.components, strict=True):
        components.append(_blend_components(start, end, share))

    text = f"all measures {share:.0%} of the way to the second's"
    return _change(first, components, text)


def _blend_components(start: Component, end: Component, share: float) -> Component:
    """Blend the sizes and poses of two components, by a share of the second, 0..1.

    Args:
        start: which gives its name and its kind of shape.
        end: of the same name.
        share: 0..1, of the way from the first to the second.
    """
    rest = 1 - share
    sides = rest * start.shape.bounds[1] + share * end.shape.bounds[1]
    position = rest * start.pose.position + share * end.pose.position
    rotation = start.pose.rotation
    turn = (rotation.inv() * end.pose.rotation).as_rotvec()
    blended = rotation * Rotation.from_rotvec(share * turn)
    pose = Pose.from_rotation(position, blended)

    return replace(start, shape=resized(start.shape, sides), pose=pose)


def _reattach(tool: Tool) -> Tool:
    """Move each component, and with it its descendants, until it touches its parent."""
    sizes = {component.name: component.shape.bounds[1] for component in tool.components}
    components = []
    for component in tool.components:
        moved = component
        if component.parent in sizes:
            parent = Boxes.from_poses([(Pose(), sizes[component.parent])])
            moved = _move_to_touch(component, parent)
        components.append(moved)

    return replace(tool, components=tuple(components))


def _move_to_touch(component: Component, parent: Boxes) -> Component:
    """Move a component toward its parent, a single box in its own frame, until both touch.

    Args:
        component: which is moved straight toward its parent, a few times.
        parent: a box in its own frame.
    """
    size = component.shape.bounds[1]

    for _ in range(_MOST_MOVES):
        pose = component.pose
        gaps, axes = separations(parent, Boxes.from_poses([(pose, size)]))
        if gaps[0] <= 0.0:
            break

        position = pose.position - (gaps[0] + _OVERLAP_M) * axes[0]
        component = replace(component, pose=Pose(position, pose.quaternion))

    return component
