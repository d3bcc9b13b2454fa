"""Estimate how far a tool bends, from its components taken as beams, one after the other from the mount to a tip.

A force F across a beam moves its tip by F times the integral of r^2 / (E I), r being the distance from the tip (beam
theory of Euler and Bernoulli). Torsion is left out, and so is that parallel chains of components bear a load together.
Covered by `tests/core/designs/test_rules.py`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from core.design import Tool
from core.geometry import Array, Compound, Pose, Shape

STEEL_PA = 200e9  # Young's modulus; hardly a material that tools are made of is stiffer

_CORNERS = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, 8).T
_Beam = tuple[Array, Array, float]  # its ends, and its length over E I


def corners(shape: Shape | Compound, pose: Pose) -> Array:
    """Compute the corners (8, 3) of a shape's bounding box."""
    middle, size = shape.bounds
    return pose.apply(_CORNERS * size + middle)


def compliance(tool: Tool, joints: Mapping[str, Array]) -> dict[str, float]:
    """Estimate for each component by how much its far end moves if the tool is of steel, metres per newton.

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
            chains[name] = [*chains[parent], _beam(joints[parent], joint, shapes[parent], poses[parent])]
        ends = corners(component.shape, poses[name])
        tip = ends[np.argmax(np.linalg.norm(ends - joint, axis=1))]
        starts, stops, soft = zip(*chains[name], _beam(joint, tip, component.shape, poses[name]), strict=True)
        a, b = np.array(starts) - tip, np.array(stops) - tip
        found[name] = float(np.array(soft) @ (a * a + a * b + b * b).sum(axis=1)) / 3
    return found


def _beam(start: Array, stop: Array, shape: Shape | Compound, pose: Pose) -> _Beam:
    """The part of a component between two points, which bends about the weaker axis of the section across it.

    The section is that of the bounding box. What fills a share s of its volume has s^2 of its stiffness, which is 5 %
    too much for a rod.
    """
    along = int(np.argmax(np.abs((stop - start) @ pose.rotation.as_matrix())))
    size = shape.bounds[1]
    thin, wide = sorted(np.delete(size, along))
    filled = shape.volume / float(np.prod(size))
    return start, stop, float(np.linalg.norm(stop - start)) / (STEEL_PA * wide * thin**3 / 12 * filled**2)
