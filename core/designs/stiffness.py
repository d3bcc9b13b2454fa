"""Estimate how far a tool bends, from its components taken as beams, one after the other from the mount to a tip.

A force F across a beam moves its tip by F times the integral of r^2 / (E I), r being the distance from the tip (beam
theory of Euler and Bernoulli), and stresses the outside of a section of thickness t with F r t / 2 I. Torsion is left
out, and so is that parallel chains of components bear a load together. What is printed with walls and infill has the
second moment of area I of its walls, and of its inside times the infill.
Covered by `tests/core/designs/test_rules.py` and, with loads, by `tests/plugins/results/workshop/test_strength.py`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from core.design import Tool
from core.geometry import Array, Compound, Pose, Shape
from core.values.materials import Material

_CORNERS = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, 8).T
_POINT_M = 1e-6  # what is shorter is no beam, and has no section
_Beam = tuple[Array, Array, float, float]  # its ends, its length over E I, and half its thickness over I


class Load(NamedTuple):
    """A ``force`` (3,), newtons, at a ``point`` (3,) of a component, in the frame of its mount; ``what`` names it."""

    what: str
    component: str
    point: Array
    force: Array


class Stressed(NamedTuple):
    """What loads do to a component: the largest stress, pascals, and of what adds most to it: ``what`` it is, its
    ``newtons``, its lever ``lever_m``, and ``bend_m``, by how much it would move its own place, across and alone.
    """

    stress_pa: float
    what: str
    newtons: float
    lever_m: float
    bend_m: float


def corners(shape: Shape | Compound, pose: Pose) -> Array:
    """Compute the corners (8, 3) of a shape's bounding box."""
    middle, size = shape.bounds
    return pose.apply(_CORNERS * size + middle)


def bending(tool: Tool, joints: Mapping[str, Array], material: Material) -> dict[str, tuple[float, float]]:
    """Estimate for each component what a newton at its far end does: by how much that moves, and the largest stress.

    The stress, in pascals, is that of the component or of what carries it.
    ``joints`` holds for each component the point (3,) where it touches its parent, in its mount's frame.
    """
    chains, placed = _chains(tool, joints, material), tool.placed()
    found = {}
    for component in tool.components:
        ends = corners(component.shape, placed[component.name][1])
        tip = ends[np.argmax(np.linalg.norm(ends - joints[component.name], axis=1))]
        bend, stresses, _ = _bent(tool, joints, material, chains, component.name, tip)
        found[component.name] = bend, float(stresses.max())
    return found


def stresses(tool: Tool, joints: Mapping[str, Array], material: Material, loads: Sequence[Load]) -> dict[str, Stressed]:
    """Estimate what loads that act at once do to each component that carries one.

    The moments of all loads beyond a section add up as vectors, so that loads that oppose each other do so here.
    Sections are looked at where a component is held, and where a load acts on it or comes from what it carries.
    """
    chains, placed = _chains(tool, joints, material), tool.placed()
    shapes = {component.name: component.shape for component in tool.components}
    carried: dict[str, list[tuple[Load, _Beam]]] = {}
    for load in loads:
        name = load.component
        own = _beam(joints[name], load.point, shapes[name], placed[name][1], material)
        for carrier, beam in [*chains[name], (name, own)]:
            carried.setdefault(carrier, []).append((load, beam))
    found = {}
    for carrier, of in carried.items():
        stress, at, beyond = _weakest(of)
        groups: dict[str, list[Load]] = {}
        for load in beyond:
            groups.setdefault(load.what, []).append(load)
        what = max(groups, key=lambda name: np.linalg.norm(_moment(groups[name], at)), default="")
        if what:
            newtons = float(np.linalg.norm(sum(load.force for load in groups[what])))
            hardest = max(groups[what], key=lambda load: np.linalg.norm(load.force))
            bend = _bent(tool, joints, material, chains, hardest.component, hardest.point)[0]
            lever = float(np.linalg.norm(hardest.point - at))
            found[carrier] = Stressed(stress, what, newtons, lever, newtons * bend)
    return found


def compliance(tool: Tool, joints: Mapping[str, Array], material: Material, component: str, point: Array) -> float:
    """Estimate by how many metres a newton across a beam moves a point of a component, in its mount's frame."""
    return _bent(tool, joints, material, _chains(tool, joints, material), component, point)[0]


def _weakest(carried: Sequence[tuple[Load, _Beam]]) -> tuple[float, Array, list[Load]]:
    """Find the section of a component that bears most: its stress, its place (3,), and the loads beyond it."""
    loads = [load for load, _ in carried]
    starts, stops, _, weak = map(np.array, zip(*(beam for _, beam in carried), strict=True))
    forces, points = (np.array([load[k] for load in loads]) for k in (3, 2))
    ways = stops - starts
    along = ways @ ways.T  # (N, N): how far each gets along the way of another, times its length
    lengths = np.maximum(np.sqrt(np.diagonal(along)), _POINT_M)
    turning = np.cross(points, forces)
    best: tuple[float, Array, Array] = (-1.0, starts[0], np.zeros(len(loads), dtype=bool))
    for sections, beyond in (
        (starts, along / lengths[:, None] > _POINT_M),
        (stops, along / lengths[:, None] >= lengths[:, None] - _POINT_M),
    ):
        moments = beyond @ turning - np.cross(sections, beyond @ forces)
        found = weak * np.linalg.norm(moments, axis=1)
        k = int(found.argmax())
        if found[k] > best[0]:
            best = float(found[k]), sections[k], beyond[k]
    return best[0], best[1], [load for load, counts in zip(loads, best[2], strict=True) if counts]


def _moment(loads: Sequence[Load], at: Array) -> Array:
    moments: Array = np.sum([np.cross(load.point - at, load.force) for load in loads], axis=0)
    return moments


_Chains = Mapping[str, list[tuple[str, _Beam]]]


def _chains(tool: Tool, joints: Mapping[str, Array], material: Material) -> _Chains:
    """What carries each component, from the mount on: each carrier's name, and its beam up to the next joint."""
    shapes, placed = {component.name: component.shape for component in tool.components}, tool.placed()
    chains: dict[str, list[tuple[str, _Beam]]] = {mount: [] for mount in tool.mounts}
    for component in tool.components:
        name, parent = component.name, component.parent
        chains[name] = chains[parent]
        if parent in shapes:
            beam = _beam(joints[parent], joints[name], shapes[parent], placed[parent][1], material)
            chains[name] = [*chains[parent], (parent, beam)]
    return chains


def _bent(
    tool: Tool, joints: Mapping[str, Array], material: Material, chains: _Chains, name: str, point: Array
) -> tuple[float, Array, Array]:
    """What a newton does at a point of a component: by how much that moves; stress and lever of each beam (N,)."""
    (shape,) = (component.shape for component in tool.components if component.name == name)
    own = _beam(joints[name], point, shape, tool.placed()[name][1], material)
    starts, stops, soft, weak = map(np.array, zip(*(beam for _, beam in chains[name]), own, strict=True))
    a, b = starts - point, stops - point
    far = np.linalg.norm([a, b], axis=2).max(axis=0)
    return float(soft @ (a * a + a * b + b * b).sum(axis=1)) / 3, weak * far, far


def _beam(start: Array, stop: Array, shape: Shape | Compound, pose: Pose, material: Material) -> _Beam:
    """The part of a component between two points, which bends about the weaker axis of the section across it.

    The section is that of the bounding box. What fills a share s of its volume has s^2 of its stiffness, which is 5 %
    too much for a rod.
    """
    along = int(np.argmax(np.abs((stop - start) @ pose.rotation.as_matrix())))
    size = shape.bounds[1]
    thin, wide = sorted(np.delete(size, along))
    filled = shape.volume / float(np.prod(size))
    inner_thin, inner_wide = (max(0.0, side - material.wall_mm / 500) for side in (thin, wide))
    share = filled**2 * (1 - (1 - material.infill) * inner_wide * inner_thin**3 / (wide * thin**3))
    length = float(np.linalg.norm(stop - start))
    weak = 6 / (wide * thin**2 * share) if length > _POINT_M else 0.0
    return start, stop, length / (material.young_pa * wide * thin**3 / 12 * share), weak
