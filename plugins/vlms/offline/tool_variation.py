"""Vary tools of any origin at random: mutate one, or cross two.

A mutation changes the size, the place or the turn of one component, or adds, removes or replaces one. A crossover goes
part of the way from one tool's measures to another's where their components have the same names, or puts a component of
one on the other. Then every component is moved until it touches its parent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from core.design import Component, Tool
from core.geometry import Box, Pose
from plugins.vlms.offline.boxes import Boxes, separations
from plugins.vlms.offline.chance import Range, draw

_ADDED_COLOR = (0.56, 0.35, 0.68, 1.0)  # of components that were not in a parent
_THINNEST_M = 0.001
_LONGEST_M = 1.5
_KINDS = {
    "size": 4.0,  # most often: what a tool consists of is seldom what is wrong with it
    "shift": 2.0,
    "turn": 2.0,
    "add": 1.5,
}
"""How often a tool is changed in each way, in relation to the others; removing and replacing count 1."""

# Changes of the scale 1, and of the smallest scale: a change that is too small is none.
_SHIFT_M = 0.03  # a standard deviation
_LEAST_SHIFT = 0.2
_TURN_RAD = Range(0.08, 0.5)
_LEAST_TURN = 0.3
_GROWTH = Range(0.1, 0.6)  # the logarithm of a factor
_LEAST_GROWTH = 0.2
_REPLACED = 0.5  # the standard deviation of the logarithms of factors of sides
_LONGEST_REPLACED_M = 0.6
_ADDED = Range(0.3, 1.0)  # of its parent's sides
_ADDED_THICK_M = Range(0.01, 0.08)  # off the parent's face
_ADDED_SIDES_M = (0.004, 0.3)  # the least and the largest
_BLEND = Range(0.2, 0.8)  # of the way to the other tool: neither is left as it is
_OVERLAP_M = 0.0005  # of components that were moved until they touch
_BLENDS = 0.7  # how often tools of equal structure are blended when they are crossed
_MOST_MOVES = 4  # of a component, until it touches its parent


def mutate(
    tool: Tool,
    scale: float,
    rng: Generator,
) -> tuple[Tool, str]:
    """Make one change at random, by a scale of 0 to 1; return the tool, and what was changed, in words.

    Args:
        tool: of any origin.
        scale: of changes of size and pose.
        rng: random numbers.
    Returns:
        The tool is a new one, whose components touch their parents.
    """
    components = [*tool.components]
    count = len(components)
    kinds = {
        **_KINDS,
        "remove": float(count > 2),
        "replace": float(count > 1),
    }

    match draw(kinds, rng):
        case "size":
            change = _resize(components, scale, rng)

        case "add":
            change = _add(components, rng)

        case "shift":
            change = _shift(components, scale, rng)

        case "turn":
            change = _turn(components, scale, rng)

        case "remove":
            leaf = components.pop(_draw_leaf(components, rng))
            change = f"{leaf.name} removed"

        case _:
            change = _replace(components, rng)

    return _reattach(tool, components), change


def _shift(
    components: list[Component],
    scale: float,
    rng: Generator,
) -> str:
    """Move a component, and with it its descendants; say so.

    Args:
        components: of which one is changed.
        scale: of the way, 0..1.
        rng: random numbers.
    """
    number = rng.integers(len(components))
    component = components[number]
    pose = component.pose

    way = rng.normal(0.0, _SHIFT_M * max(scale, _LEAST_SHIFT), 3)
    moved = Pose(pose.position + way, pose.quaternion)
    components[number] = replace(component, pose=moved)

    return f"{component.name} moved by {np.linalg.norm(way) * 1000:.0f} mm"


def _turn(
    components: list[Component],
    scale: float,
    rng: Generator,
) -> str:
    """Turn a component, and with it its descendants; say so.

    Args:
        components: of which one is changed.
        scale: of the angle, 0..1.
        rng: random numbers.
    """
    number = rng.integers(len(components))
    component = components[number]
    axis = rng.integers(3)

    sign = rng.choice([-1.0, 1.0])
    angle = sign * _TURN_RAD.draw(rng) * max(scale, _LEAST_TURN)
    rotation = Rotation.from_rotvec(angle * np.eye(3)[axis])
    turn = Pose.from_rotation(np.zeros(3), rotation)
    components[number] = replace(component, pose=component.pose @ turn)

    return (
        f"{component.name} turned by {np.degrees(angle):.0f} degrees about its "
        f"{'xyz'[axis]}"
    )


def _replace(components: list[Component], rng: Generator) -> str:
    """Put a box in the place of a component without children; say so.

    Args:
        components: of which one is changed.
        rng: random numbers.
    Returns:
        What was changed, in words.
    """
    number = _draw_leaf(components, rng)
    component = components[number]
    sides = component.shape.bounds[1] * np.exp(rng.normal(0.0, _REPLACED, 3))
    x, y, z = np.clip(sides, _THINNEST_M, _LONGEST_REPLACED_M).tolist()

    name = _free_name("part", components)
    box = Box((x, y, z))

    parent = component.parent
    new = Component(name, parent, component.pose, box, color=_ADDED_COLOR)
    components[number] = new

    return f"{component.name} replaced by a box of {x:.3f} x {y:.3f} x {z:.3f} m"


def _resize(
    components: list[Component],
    scale: float,
    rng: Generator,
) -> str:
    """Lengthen or shorten one side; children of the component move with its faces. Say so.

    Args:
        components: of which one becomes a box.
        scale: of the change.
        rng: random numbers.
    """
    number = rng.integers(len(components))
    axis = rng.integers(3)

    # Growing and shrinking by the same factor are as likely.
    sign = rng.choice([-1.0, 1.0])
    factor = np.exp(sign * _GROWTH.draw(rng) * max(scale, _LEAST_GROWTH))

    component = components[number]
    before = component.shape.bounds[1]
    sides = before.tolist()
    sides[axis] = np.clip(sides[axis] * factor, _THINNEST_M, _LONGEST_M)

    # Its children keep their places on its faces.
    stretch = np.ones(3)
    stretch[axis] = sides[axis] / before[axis]

    for i, other in enumerate(components):
        if other.parent == component.name:
            pose = Pose(other.pose.position * stretch, other.pose.quaternion)
            components[i] = replace(other, pose=pose)

    # The end that meets the parent stays where it is.
    pose = component.pose
    way = pose.rotation_matrix[:, axis]
    toward = np.sign(pose.position @ way) or 1.0
    shift = toward * (way * (sides[axis] - before[axis]) / 2)
    moved = Pose(pose.position + shift, pose.quaternion)

    x, y, z = sides
    components[number] = replace(component, shape=Box((x, y, z)), pose=moved)

    verb = "lengthened" if factor > 1 else "shortened"

    return f"{component.name} {verb} in {'xyz'[axis]} to {sides[axis]:.3f} m"


def _add(components: list[Component], rng: Generator) -> str:
    """Add a plate on a face of a component of the second half; say so.

    Args:
        components: to which one is added.
        rng: random numbers.
    """
    count = len(components)
    parent = components[rng.integers(count // 2, count)]
    axis = rng.integers(3)

    side = rng.choice([-1.0, 1.0])
    size = parent.shape.bounds[1]
    sides = size * rng.uniform(*_ADDED, 3)
    sides[axis] = _ADDED_THICK_M.draw(rng)
    sides = np.clip(sides, *_ADDED_SIDES_M)

    place = np.zeros(3)
    place[axis] = side * ((size[axis] + sides[axis]) / 2 - _OVERLAP_M)
    along = (axis + rng.integers(1, 3)) % 3

    edge = rng.choice([-1.0, 0.0, 1.0])
    place[along] = edge * (size[along] - sides[along]) / 2
    x, y, z = sides

    name = _free_name("fin", components)
    fin = Component(name, parent.name, Pose(place), Box((x, y, z)), color=_ADDED_COLOR)
    components.append(fin)

    return f"{name} added on {parent.name}"


def _draw_leaf(components: Sequence[Component], rng: Generator) -> int:
    """Draw the number of a component without children.

    Args:
        components: of one tool, with names of each other as parents.
        rng: random numbers.
    Returns:
        Its place in the list.
    """
    parents = {component.parent for component in components}
    leaves = [
        number
        for number, component in enumerate(components)
        if component.name not in parents
    ]

    return int(rng.choice(leaves))


def _free_name(name: str, components: Sequence[Component]) -> str:
    """Return ``name``, with a number if one of the components has it.

    Args:
        name: of a new component.
        components: of the tool that gets it.
    """
    taken = {component.name for component in components}
    free = name
    number = 2

    while free in taken:
        free = f"{name}_{number}"
        number += 1

    return free


def cross(
    first: Tool,
    second: Tool,
    rng: Generator,
) -> tuple[Tool, str]:
    """Blend two tools of equal structure, or put a component of the second on the first; say what was changed.

    Where no component of the first tool is on the mount of the second's, the first is mutated.

    Args:
        first: which is changed.
        second: which gives.
        rng: random numbers.
    Returns:
        As of `mutate`.
    """
    if _structure(first) == _structure(second) and rng.random() < _BLENDS:
        return _blend(first, second, _BLEND.draw(rng))

    donor = second.components[_draw_leaf(second.components, rng)]
    mount, pose = second.placed()[donor.name]

    placed = first.placed()
    bearers = [c for c in first.components if placed[c.name][0] == mount]
    if not bearers:
        return mutate(first, 0.5, rng)

    graft = Boxes.from_poses([(pose, donor.shape.bounds[1])] * len(bearers))
    boxes = [(placed[c.name][1], c.shape.bounds[1]) for c in bearers]
    gaps, _ = separations(graft, Boxes.from_poses(boxes))
    parent = bearers[int(np.argmin(gaps))].name
    new = replace(
        donor,
        name=_free_name(donor.name, first.components),
        parent=parent,
        pose=placed[parent][1].inverse() @ pose,
        color=_ADDED_COLOR,
    )

    changed = _reattach(first, [*first.components, new])

    return changed, f"{donor.name} of the second put on {parent}"


def _structure(tool: Tool) -> list[tuple[str, str]]:
    """Return the names of components and of their parents, which two tools of equal structure share.

    Args:
        tool: of any origin.
    """
    return [(component.name, component.parent) for component in tool.components]


def _blend(
    first: Tool,
    second: Tool,
    share: float,
) -> tuple[Tool, str]:
    """Go a share of the way from the first tool's measures to the second's.

    Args:
        first: which gives names and kinds of shapes.
        second: of equal structure.
        share: 0..1.
    Returns:
        The tool, and what was changed.
    """
    rest = 1 - share

    components = []
    for start, end in zip(first.components, second.components, strict=True):
        sides = rest * start.shape.bounds[1] + share * end.shape.bounds[1]
        position = rest * start.pose.position + share * end.pose.position

        rotation = start.pose.rotation
        turn = (rotation.inv() * end.pose.rotation).as_rotvec()
        blended = rotation * Rotation.from_rotvec(share * turn)
        pose = Pose.from_rotation(position, blended)
        components.append(replace(start, shape=start.shape.resized(sides), pose=pose))

    text = f"all measures {share:.0%} of the way to the second's"

    return _reattach(first, components), text


def _reattach(tool: Tool, components: Sequence[Component]) -> Tool:
    """Give a tool components, each moved with its descendants until it touches its parent.

    Args:
        tool: which gives everything else.
        components: parents before their children.
    """
    sizes = {component.name: component.shape.bounds[1] for component in components}

    attached = []
    for component in components:
        moved = component
        if component.parent in sizes:
            parent = Boxes.from_poses([(Pose(), sizes[component.parent])])
            moved = _move_to_touch(component, parent)

        attached.append(moved)

    return replace(tool, components=tuple(attached))


def _move_to_touch(component: Component, parent: Boxes) -> Component:
    """Move a component straight toward its parent, a single box in its own frame, until both touch.

    Args:
        component: which is moved a few times: edges may still be apart after the first.
        parent: one box, at the origin of the frame in which the component's pose is given.
    """
    size = component.shape.bounds[1]
    pose = component.pose

    for _ in range(_MOST_MOVES):
        gaps, axes = separations(parent, Boxes.from_poses([(pose, size)]))
        if gaps[0] <= 0.0:
            break

        position = pose.position - (gaps[0] + _OVERLAP_M) * axes[0]
        pose = Pose(position, pose.quaternion)

    return replace(component, pose=pose)
