"""Change tools of any origin: mutate one, or cross two."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import Component, Tool
from core.geometry import Array, Box, Pose
from core.values.shapes import resized
from plugins.vlms.offline.boxes import Boxes, separations

_COLOR = (0.56, 0.35, 0.68, 1.0)  # of added components
_THINNEST_M = 0.001
_OVERLAP_M = 0.0005  # of components that were moved until they touch

Change = Callable[[Tool, float, np.random.Generator], tuple[Tool, str]]


def mutate(tool: Tool, scale: float, rng: np.random.Generator) -> tuple[Tool, str]:
    """Make one change: to a component's size, position or orientation; or add, remove or replace one."""
    if not tool.components:
        return _added(tool, scale, rng)
    changes: dict[Change, float] = {
        _resized: 4.0,
        _shifted: 2.0,
        _turned: 2.0,
        _added: 1.5,
        _removed: 1.0 * (len(tool.components) > 2),
        _replaced: 1.0 * (len(tool.components) > 1),
    }
    weights = np.array(list(changes.values()))
    change = list(changes)[int(rng.choice(len(weights), p=weights / weights.sum()))]
    mutant, text = change(tool, scale, rng)
    return joined(mutant), text


def _with(tool: Tool, number: int, component: Component) -> Tool:
    return replace(tool, components=(*tool.components[:number], component, *tool.components[number + 1 :]))


def _resized(tool: Tool, scale: float, rng: np.random.Generator) -> tuple[Tool, str]:
    """Lengthen or shorten one side; children of the component move with its faces."""
    number, axis = int(rng.integers(len(tool.components))), int(rng.integers(3))
    factor = float(np.exp(rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.6) * max(scale, 0.2)))
    old = tool.components[number]
    own = old.shape.bounds[1]
    sides = own.tolist()
    sides[axis] = float(np.clip(sides[axis] * factor, _THINNEST_M, 1.5))
    stretch = np.ones(3)
    stretch[axis] = sides[axis] / own[axis]
    components = [
        replace(c, pose=Pose(c.pose.position * stretch, c.pose.quaternion)) if c.parent == old.name else c
        for c in tool.components
    ]
    # The end that meets the parent stays where it is.
    shift = old.pose.rotation.as_matrix()[:, axis] * (sides[axis] - own[axis]) / 2
    toward = np.sign(float(old.pose.position @ old.pose.rotation.as_matrix()[:, axis])) or 1.0
    pose = Pose(old.pose.position + toward * shift, old.pose.quaternion)
    components[number] = replace(old, shape=Box((sides[0], sides[1], sides[2])), pose=pose)
    verb = "lengthened" if factor > 1 else "shortened"
    return replace(tool, components=tuple(components)), f"{old.name} {verb} in {'xyz'[axis]} to {sides[axis]:.3f} m"


def _shifted(tool: Tool, scale: float, rng: np.random.Generator) -> tuple[Tool, str]:
    number = int(rng.integers(len(tool.components)))
    old = tool.components[number]
    way = rng.normal(0.0, 0.03 * max(scale, 0.2), 3)
    moved = replace(old, pose=Pose(old.pose.position + way, old.pose.quaternion))
    return _with(tool, number, moved), f"{old.name} moved by {np.linalg.norm(way) * 1000:.0f} mm"


def _turned(tool: Tool, scale: float, rng: np.random.Generator) -> tuple[Tool, str]:
    """Turn a component and its descendants about one of its axes."""
    number, axis = int(rng.integers(len(tool.components))), int(rng.integers(3))
    angle = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.08, 0.5) * max(scale, 0.3))
    old = tool.components[number]
    turn = Pose.from_rotation(np.zeros(3), Rotation.from_rotvec(angle * np.eye(3)[axis]))
    text = f"{old.name} turned by {np.degrees(angle):.0f} degrees about its {'xyz'[axis]}"
    return _with(tool, number, replace(old, pose=old.pose @ turn)), text


def _added(tool: Tool, scale: float, rng: np.random.Generator) -> tuple[Tool, str]:
    """Add a plate on a face of a component."""
    parent = tool.components[int(rng.integers(len(tool.components) // 2, len(tool.components)))]
    axis, side = int(rng.integers(3)), float(rng.choice([-1.0, 1.0]))
    size = parent.shape.bounds[1]
    sides = size * rng.uniform(0.3, 1.0, 3)
    sides[axis] = rng.uniform(0.01, 0.08)
    sides = np.clip(sides, 0.004, 0.3)
    place = np.zeros(3)
    place[axis] = side * ((size[axis] + sides[axis]) / 2 - 0.0005)
    along = (axis + int(rng.integers(1, 3))) % 3
    place[along] = rng.choice([-1.0, 0.0, 1.0]) * (size[along] - sides[along]) / 2
    name = free_name("fin", {c.name for c in tool.components})
    fin = Component(name, parent.name, Pose(place), Box((sides[0], sides[1], sides[2])), color=_COLOR)
    return replace(tool, components=(*tool.components, fin)), f"{name} added on {parent.name}"


def _leaves(tool: Tool) -> list[int]:
    parents = {c.parent for c in tool.components}
    return [i for i, c in enumerate(tool.components) if c.name not in parents]


def _removed(tool: Tool, scale: float, rng: np.random.Generator) -> tuple[Tool, str]:
    removed = tool.components[int(rng.choice(_leaves(tool)))]
    return replace(tool, components=tuple(c for c in tool.components if c is not removed)), f"{removed.name} removed"


def _replaced(tool: Tool, scale: float, rng: np.random.Generator) -> tuple[Tool, str]:
    """Replace a leaf by a box of other proportions in the same place."""
    number = int(rng.choice(_leaves(tool)))
    old = tool.components[number]
    sides = np.clip(old.shape.bounds[1] * np.exp(rng.normal(0.0, 0.5, 3)), _THINNEST_M, 0.6)
    name = free_name("part", {c.name for c in tool.components})
    new = Component(name, old.parent, old.pose, Box((sides[0], sides[1], sides[2])), color=_COLOR)
    text = f"{old.name} replaced by a box of {sides[0]:.3f} x {sides[1]:.3f} x {sides[2]:.3f} m"
    return _with(tool, number, new), text


def slimmed(tool: Tool) -> tuple[Tool, str]:
    """Make the last component's thinnest side a little thinner, which hardly ever breaks a rule."""
    last = tool.components[-1]
    sides = last.shape.bounds[1].tolist()
    axis = int(np.argmin(sides))
    sides[axis] = max(0.0006, sides[axis] * 0.97)
    slim = _with(tool, len(tool.components) - 1, replace(last, shape=resized(last.shape, sides)))
    return joined(slim), f"{last.name} made thinner, {sides[axis] * 1000:.1f} mm"


def cross(first: Tool, second: Tool, rng: np.random.Generator) -> tuple[Tool, str]:
    """Cross two tools: interpolate between tools of equal structure, or put a part of the second on the first."""
    alike = [(c.name, c.parent) for c in first.components] == [(c.name, c.parent) for c in second.components]
    if alike and rng.random() < 0.7:
        return _blended(first, second, float(rng.uniform(0.2, 0.8)))
    donor = second.components[int(rng.choice(_leaves(second)))]
    placed = second.placed()
    mount, pose = placed[donor.name]
    mine = first.placed()
    names = [c.name for c in first.components if mine[c.name][0] == mount]
    if not names:
        return mutate(first, 0.5, rng)
    graft = Boxes.of([(pose, donor.shape.bounds[1])] * len(names))
    sizes = {c.name: c.shape.bounds[1] for c in first.components}
    gaps, _ = separations(graft, Boxes.of((mine[name][1], sizes[name]) for name in names))
    parent = names[int(np.argmin(gaps))]
    name = free_name(donor.name, {c.name for c in first.components})
    new = replace(donor, name=name, parent=parent, pose=mine[parent][1].inverse() @ pose, color=_COLOR)
    return joined(replace(first, components=(*first.components, new))), f"{donor.name} of the second put on {parent}"


def _blended(first: Tool, second: Tool, share: float) -> tuple[Tool, str]:
    components = []
    for a, b in zip(first.components, second.components, strict=True):
        sides = (1 - share) * a.shape.bounds[1] + share * b.shape.bounds[1]
        middle = (1 - share) * a.pose.position + share * b.pose.position
        turn = (a.pose.rotation.inv() * b.pose.rotation).as_rotvec()
        pose = Pose.from_rotation(middle, a.pose.rotation * Rotation.from_rotvec(share * turn))
        components.append(replace(a, shape=resized(a.shape, sides), pose=pose))
    return joined(replace(first, components=tuple(components))), f"all measures {share:.0%} of the way to the second's"


def joined(tool: Tool) -> Tool:
    """The tool with every component, and its descendants, moved until it touches its parent."""
    components: list[Component] = []
    sizes: dict[str, Array] = {}
    for component in tool.components:
        if component.parent in sizes:
            size = component.shape.bounds[1]
            for _ in range(4):
                parent = Boxes.of([(Pose(), sizes[component.parent])])
                gap, axis = separations(parent, Boxes.of([(component.pose, size)]))
                if gap[0] <= 0.0:
                    break
                position = component.pose.position - (gap[0] + _OVERLAP_M) * axis[0]
                component = replace(component, pose=Pose(position, component.pose.quaternion))
        sizes[component.name] = component.shape.bounds[1]
        components.append(component)
    return replace(tool, components=tuple(components))


def free_name(name: str, taken: set[str]) -> str:
    """``name``, with a number if it is taken."""
    return next(free for free in (name, *(f"{name}_{i}" for i in range(2, 200))) if free not in taken)
