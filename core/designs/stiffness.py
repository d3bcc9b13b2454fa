"""Estimate how far a tool bends, from its components taken as beams, one after the other from the mount to a tip.

A force F across a beam moves its tip by F times the integral of r^2 / (E I), r being the distance from the tip (beam
theory of Euler and Bernoulli), and stresses the outside of a section of thickness t with F r t / 2 I. Torsion is left
out, and so is that parallel chains of components bear a load together. What is printed with walls and infill has the
second moment of area I of its walls, and of its inside times the infill.
Covered by `tests/core/designs/test_rules.py`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from core.design import Tool
from core.geometry import Array, Compound, Pose, Shape
from core.materials import Material

_CORNERS = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, 8).T
_POINT_M = 1e-6  # what is shorter is no beam, and has no section
_Beam = tuple[Array, Array, float, float]  # its ends, its length over E I, and half its thickness over I


def corners(shape: Shape | Compound, pose: Pose) -> Array:
    """Compute the corners (8, 3) of a shape's bounding box."""
    middle, size = shape.bounds
    return pose.apply(_CORNERS * size + middle)


def bending(tool: Tool, joints: Mapping[str, Array], material: Material) -> dict[str, tuple[float, float]]:
    """Estimate for each component what a newton at its far end does: by how much that moves, and the largest stress.

    The stress, in pascals, is that of the component or of what carries it.
    ``joints`` holds for each component the point (3,) where it touches its parent, in its mount's frame.
    """
    poses = {name: pose for name, (_, pose) in tool.placed().items()}
    shapes = {component.name: component.shape for component in tool.components}
    chains: dict[str, list[_Beam]] = {mount: [] for mount in tool.mounts}  # up to where the parent is attached
    found = {}
    for component in tool.components:
        name, parent, joint = component.name, component.parent, joints[component.name]
        chains[name] = chains[parent]
        if parent in shapes:
            chains[name] = [*chains[parent], _beam(joints[parent], joint, shapes[parent], poses[parent], material)]
        ends = corners(component.shape, poses[name])
        tip = ends[np.argmax(np.linalg.norm(ends - joint, axis=1))]
        own = _beam(joint, tip, component.shape, poses[name], material)
        starts, stops, soft, weak = map(np.array, zip(*chains[name], own, strict=True))
        a, b = starts - tip, stops - tip
        far = np.linalg.norm([a, b], axis=2).max(axis=0)
        found[name] = float(soft @ (a * a + a * b + b * b).sum(axis=1)) / 3, float((weak * far).max())
    return found


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
