"""Estimate how far a tool bends, from its components taken as beams, one after the other from the mount to a tip.

A force F across a beam moves its tip by F times the integral of r^2 / (E I), r being the distance from the tip (beam
theory of Euler and Bernoulli), and stresses the outside of a section of thickness t with F r t / 2 I. Torsion is left
out, and so is that parallel chains of components bear a load together. What is printed with walls and infill has the
second moment of area I of its walls, and of its inside times the infill.
Covered by `tests/core/designs/test_rules.py` and, with loads, by `tests/core/export/test_strength.py`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from core.design import Tool
from core.geometry import Array, Compound, Pose, Shape
from core.materials import Material

_CORNERS = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, 8).T
_POINT_M = 1e-6  # what is shorter is no beam, and has no section
_Beam = tuple[Array, Array, float, float]  # its ends, its length over E I, and half its thickness over I


class Load(NamedTuple):
    """A force of ``newtons``, which acts across whatever carries it, at any of the ``places``.

    ``what`` names it; ``places`` holds by component points (P, 3) in the frame of the component's mount.
    """

    what: str
    newtons: float
    places: Mapping[str, Array]


class Stressed(NamedTuple):
    """What loads do to a component: the largest stress, pascals, and of the load that adds most to it ``what`` it is,
    its ``newtons``, its lever ``lever_m``, and ``bend_m``, by how much it moves its own place.
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

    Each acts at the place and in the direction that is worst for the component, and stresses add up.
    """
    chains = _chains(tool, joints, material)
    most: dict[str, Stressed] = {}
    totals: dict[str, float] = {}
    for load in loads:
        worst: dict[str, Stressed] = {}
        for name, points in load.places.items():
            carriers = [carrier for carrier, _ in chains[name]] + [name]
            for point in points:
                bend, by, far = _bent(tool, joints, material, chains, name, point)
                for carrier, stress, lever in zip(carriers, load.newtons * by, far, strict=True):
                    if carrier not in worst or stress > worst[carrier].stress_pa:
                        made = Stressed(float(stress), load.what, load.newtons, float(lever), load.newtons * bend)
                        worst[carrier] = made
        for carrier, one in worst.items():
            totals[carrier] = totals.get(carrier, 0.0) + one.stress_pa
            most[carrier] = max(most.get(carrier, one), one, key=lambda of: of.stress_pa)
    return {name: one._replace(stress_pa=totals[name]) for name, one in most.items()}


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
